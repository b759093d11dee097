//! Statistics of the newest numbers of a measurement.

use serde::Serialize;

/// The newest numbers of a measurement; the oldest drop out.
#[derive(Clone, Debug)]
pub struct RollingWindow {
    numbers: Vec<f64>,
    next: usize,
    capacity: usize,
}

/// Statistics of a [`RollingWindow`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// Number of values.
    pub count: usize,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub std_dev: f64,
    /// Minimum.
    pub min: f64,
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Maximum.
    pub max: f64,
}

impl RollingWindow {
    /// A window of at least one number.
    pub fn new(capacity: usize) -> RollingWindow {
        RollingWindow { numbers: Vec::new(), next: 0, capacity: capacity.max(1) }
    }

    /// Adds a number.
    pub fn add(&mut self, number: f64) {
        if self.numbers.len() < self.capacity {
            self.numbers.push(number);
        } else {
            self.numbers[self.next] = number;
            self.next = (self.next + 1) % self.capacity;
        }
    }

    /// Statistics of the numbers in the window; `None` if it is empty.
    pub fn statistics(&self) -> Option<Statistics> {
        let mut sorted = self.numbers.clone();
        sorted.sort_by(f64::total_cmp);
        let count = sorted.len();
        let mean = sorted.iter().sum::<f64>() / count as f64;
        let variance = sorted.iter().map(|number| (number - mean).powi(2)).sum::<f64>() / count as f64;
        let quantile = |q: f64| {
            let rank = (q * count as f64).ceil().max(1.0) as usize;
            sorted.get(rank - 1).copied()
        };
        Some(Statistics {
            count,
            mean,
            std_dev: variance.sqrt(),
            min: *sorted.first()?,
            p50: quantile(0.5)?,
            p99: quantile(0.99)?,
            max: *sorted.last()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_holds_the_newest_numbers() {
        let mut window = RollingWindow::new(100);
        assert_eq!(window.statistics(), None);
        (0..300).for_each(|number| window.add(f64::from(number)));
        let statistics = window.statistics().unwrap();
        assert_eq!((statistics.count, statistics.min, statistics.max), (100, 200.0, 299.0));
        assert_eq!((statistics.p50, statistics.p99, statistics.mean), (249.0, 298.0, 249.5));
        assert!((statistics.std_dev - 28.866).abs() < 1e-3, "{}", statistics.std_dev);
    }
}
