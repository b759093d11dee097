//! Stamps of measurements that a device counts by its own clock, and that arrive late and in batches.

use std::time::Duration;

use yamabico_core::time::Time;

/// Time over which the shortest delay is looked for, s. Clocks of 100 ppm drift apart by 2 ms in two of them.
const WINDOW_S: f64 = 10.0;
/// Jump of a device's clock that counts as its reset, s.
const RESET_S: f64 = 1.0;

/// Estimate of the capture times of a periodic device.
///
/// A USB adapter hands over its bytes every 16 ms, so that two measurements arrive at once and the third late. The device's
/// own clock is even: the measurement with the shortest delay among those of the last seconds tells the offset between the
/// two clocks, and the others are stamped by it. No stamp is later than its arrival.
#[derive(Clone, Debug, Default)]
pub struct Stamper {
    window: Option<Window>,
    last: Option<Time>,
}

/// Shortest offsets, arrival minus device time, of this and of the last window.
#[derive(Clone, Copy, Debug)]
struct Window {
    begin_s: f64,
    shortest_s: f64,
    before_s: f64,
}

impl Stamper {
    /// Returns the stamp of a measurement that the device took at `device_s` on its own clock, s, and that arrived at
    /// `arrival`. Stamps increase.
    pub fn stamp(&mut self, device_s: f64, arrival: Time) -> Time {
        let arrival_s = arrival.as_secs_f64();
        let offset_s = arrival_s - device_s;
        let fresh = Window { begin_s: arrival_s, shortest_s: offset_s, before_s: f64::INFINITY };
        let window = self.window.get_or_insert(fresh);
        if (offset_s - window.offset_s()).abs() > RESET_S {
            *window = fresh;
        } else if arrival_s - window.begin_s > WINDOW_S {
            *window = Window { before_s: window.shortest_s, ..fresh };
        } else {
            window.shortest_s = window.shortest_s.min(offset_s);
        }
        let delay_s = (offset_s - window.offset_s()).max(0.0);
        let stamp = arrival - Duration::from_secs_f64(delay_s);
        let stamp = self.last.map_or(stamp, |last| stamp.max(Time(last.0 + 1)));
        self.last = Some(stamp);
        stamp
    }
}

impl Window {
    fn offset_s(&self) -> f64 {
        self.shortest_s.min(self.before_s)
    }
}

/// Estimate of the capture times of a device that sends at a constant period without telling the time.
///
/// Measurements that arrive together were taken a period apart, also after a pause in which the line was not read.
#[derive(Clone, Debug)]
pub struct PeriodicStamper {
    period: Duration,
    last: Option<Time>,
}

/// Number of periods by which a measurement may be late; one that seems later follows others that were lost.
const MAX_LATE_PERIODS: u32 = 2;
/// Share of the lateness that is given up per measurement, so that a lost measurement and a slow clock are caught up with.
const CATCH_UP: f64 = 0.01;

impl PeriodicStamper {
    /// Returns the estimate for this period.
    #[must_use]
    pub fn new(period: Duration) -> PeriodicStamper {
        PeriodicStamper { period, last: None }
    }

    /// Returns the stamps of `count` measurements that arrived together at `arrival`. Stamps increase, and none is later than its
    /// arrival.
    pub fn stamps(&mut self, count: usize, arrival: Time) -> impl Iterator<Item = Time> + use<> {
        let (period, last) = (self.period, self.last);
        let predicted = last.map_or(arrival, |last| last + period * count as u32);
        let late = arrival.since(predicted);
        let newest =
            if late > period * MAX_LATE_PERIODS { arrival } else { predicted + late.mul_f64(CATCH_UP) };
        let newest = newest.min(arrival);
        let earliest = last.map_or(Time::ZERO, |last| Time(last.0 + 1));
        self.last = Some(newest.max(Time(earliest.0 + count as u64)));
        let back = move |i: usize| newest - period * (count - 1 - i) as u32;
        (0..count).map(move |i| back(i).max(Time(earliest.0 + i as u64)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// True times and stamps, s, of a device with a period of 15 ms behind an adapter that hands over every 16 ms, without the
    /// measurements that are `lost`; the line is not read from 3.0 to 3.2 s.
    fn batched(count: u32, lost: impl Fn(u32) -> bool) -> Vec<(f64, f64)> {
        let mut stamper = PeriodicStamper::new(Duration::from_millis(15));
        let arrival_s = |taken_s: f64| {
            let handed_s = (taken_s / 0.016).ceil() * 0.016;
            if (3.0..3.2).contains(&handed_s) { 3.2 } else { handed_s }
        };
        let taken: Vec<f64> = (0..count).filter(|i| !lost(*i)).map(|i| 1.0 + 0.015 * f64::from(i)).collect();
        let batches = taken.chunk_by(|a, b| arrival_s(*a) == arrival_s(*b));
        let stamped = batches.flat_map(|batch| {
            let arrival = Time::from_secs_f64(arrival_s(batch[0]));
            let stamps: Vec<Time> = stamper.stamps(batch.len(), arrival).collect();
            assert!(stamps.iter().all(|stamp| *stamp <= arrival));
            batch.iter().copied().zip(stamps.into_iter().map(Time::as_secs_f64)).collect::<Vec<_>>()
        });
        stamped.collect()
    }

    #[test]
    fn batches_are_spread_evenly() {
        let stamps = batched(600, |_| false);
        for pair in stamps[20..].windows(2) {
            let step_s = pair[1].1 - pair[0].1;
            assert!((step_s - 0.015).abs() < 0.002, "{step_s}");
        }
        assert!(stamps[200..].iter().all(|(taken_s, stamped_s)| (stamped_s - taken_s).abs() < 0.004));
    }

    #[test]
    fn lost_measurements_are_caught_up_with() {
        let stamps = batched(2000, |i| i % 100 == 40 || (1000..1040).contains(&i));
        assert!(stamps.windows(2).all(|pair| pair[1].1 > pair[0].1));
        let worst_s =
            stamps.iter().map(|(taken_s, stamped_s)| (stamped_s - taken_s).abs()).fold(0.0, f64::max);
        assert!(worst_s < 0.032, "{worst_s}");
        let (taken_s, stamped_s) = stamps[stamps.len() - 1];
        assert!((stamped_s - taken_s).abs() < 0.016, "{taken_s} {stamped_s}");
    }

    #[test]
    fn a_reset_clock_and_a_gap_do_not_go_back() {
        let mut stamper = Stamper::default();
        let at = Time::from_secs_f64;
        assert_eq!(stamper.stamp(500.0, at(10.0)), at(10.0));
        assert!(stamper.stamp(500.1, at(10.13)).seconds_after(at(10.1)).abs() < 1e-6);
        assert_eq!(stamper.stamp(0.0, at(12.0)), at(12.0), "reset");
        assert!(stamper.stamp(0.0, at(12.0)) > at(12.0) - Duration::from_millis(1));
    }

    #[test]
    fn a_drifting_clock_is_followed() {
        let mut stamper = Stamper::default();
        for i in 0..20_000_u64 {
            let taken_s = 50.0 + 0.015 * i as f64;
            let device_s = 0.015 * i as f64 * 1.0001;
            let stamp = stamper.stamp(device_s, Time::from_secs_f64(taken_s + 0.002));
            assert!((stamp.as_secs_f64() - taken_s).abs() < 0.005, "{i}: {stamp}");
        }
    }
}
