//! Quantiles of many durations in constant memory.

use std::time::Duration;

/// Buckets in each doubling of the duration: a quantile is exact to 1/32 of its value.
const PER_OCTAVE: usize = 32;
const OCTAVES: usize = 40;

/// Histogram of durations on a logarithmic scale, from nanoseconds to minutes. Adding a duration does not allocate.
#[derive(Clone, Debug)]
pub struct DurationHistogram {
    buckets: Vec<u64>,
    count: u64,
    total: Duration,
    max: Duration,
}

impl Default for DurationHistogram {
    fn default() -> Self {
        DurationHistogram {
            buckets: vec![0; PER_OCTAVE * OCTAVES],
            count: 0,
            total: Duration::ZERO,
            max: Duration::ZERO,
        }
    }
}

impl DurationHistogram {
    /// Adds one duration.
    pub fn add(&mut self, duration: Duration) {
        self.buckets[bucket(duration.as_nanos() as u64)] += 1;
        self.count += 1;
        self.total += duration;
        self.max = self.max.max(duration);
    }

    /// Number of buckets.
    pub fn max_buckets(&self) -> usize {
        self.buckets.len()
    }

    /// Returns index and count of each bucket that is not empty.
    pub fn buckets(&self) -> impl Iterator<Item = (usize, u64)> + '_ {
        self.buckets.iter().copied().enumerate().filter(|(_, count)| *count > 0)
    }

    /// Adds `count` durations to the bucket `index`, from another histogram. An index out of range changes nothing.
    pub fn add_bucket(&mut self, index: usize, count: u64) {
        if let Some(bucket) = self.buckets.get_mut(index) {
            *bucket += count;
            self.count += count;
            self.total += Duration::from_nanos(upper_edge(index).saturating_mul(count));
        }
    }

    /// Raises the maximum to at least `max`.
    pub fn raise_max(&mut self, max: Duration) {
        self.max = self.max.max(max);
    }

    /// Adds every duration of `other`.
    pub fn merge(&mut self, other: &DurationHistogram) {
        other.buckets().for_each(|(index, count)| self.add_bucket(index, count));
        self.raise_max(other.max);
    }

    /// Number of durations added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Sum of all durations; those from other histograms count with 1/32 of uncertainty.
    pub fn total(&self) -> Duration {
        self.total
    }

    /// Longest duration; zero before the first.
    pub fn max(&self) -> Duration {
        self.max
    }

    /// Returns the duration that the fraction `quantile` (0 to 1) of all does not exceed, to 1/32 of its value; zero
    /// before the first.
    pub fn quantile(&self, quantile: f64) -> Duration {
        let rank = (quantile.clamp(0.0, 1.0) * self.count as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        for (index, &count) in self.buckets.iter().enumerate() {
            seen += count;
            if seen >= rank {
                return Duration::from_nanos(upper_edge(index)).min(self.max);
            }
        }
        Duration::ZERO
    }
}

/// Returns the bucket of a duration: linear below `PER_OCTAVE` nanoseconds, then `PER_OCTAVE` buckets in each doubling.
fn bucket(nanos: u64) -> usize {
    if nanos < PER_OCTAVE as u64 {
        return nanos as usize;
    }
    let octave = nanos.ilog2() as usize - PER_OCTAVE.ilog2() as usize;
    let within = (nanos >> octave) as usize - PER_OCTAVE;
    ((octave + 1) * PER_OCTAVE + within).min(PER_OCTAVE * OCTAVES - 1)
}

fn upper_edge(index: usize) -> u64 {
    if index < PER_OCTAVE {
        return index as u64;
    }
    let (octave, within) = (index / PER_OCTAVE - 1, index % PER_OCTAVE);
    (((PER_OCTAVE + within + 1) as u64) << octave) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_exact_to_a_thirty_second() {
        let mut durations = DurationHistogram::default();
        for micros in 1..=1000 {
            durations.add(Duration::from_micros(micros));
        }
        for (quantile, exact) in [(0.5, 500.0), (0.99, 990.0), (1.0, 1000.0)] {
            let estimate = durations.quantile(quantile).as_secs_f64() * 1e6;
            assert!((estimate - exact).abs() <= exact / 32.0, "{quantile}: {estimate} us");
        }
        assert_eq!(durations.max(), Duration::from_millis(1));
        assert_eq!(DurationHistogram::default().quantile(0.5), Duration::ZERO);
    }

    #[test]
    fn every_duration_lies_below_its_bucket_edge() {
        for nanos in (0..200).chain([1 << 20, (1 << 20) + 12_345, u64::from(u32::MAX) * 100]) {
            let index = bucket(nanos);
            assert!(upper_edge(index) >= nanos && (index == 0 || upper_edge(index - 1) < nanos), "{nanos}");
        }
        DurationHistogram::default().add(Duration::MAX);
    }
}
