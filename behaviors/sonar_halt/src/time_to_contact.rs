//! Time to contact with something that comes nearer, from ranges or from its size in the image (Lee 1976).

/// Closing speed below which nothing comes nearer, m/s.
const MIN_CLOSING_MPS: f64 = 0.02;
/// Minimum number of echoes for a fit.
const MIN_ECHOES: usize = 3;

/// Straight line through ranges over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeFit {
    /// Range at the last echo, m.
    pub range_m: f64,
    /// Speed at which the range decreases, m/s; negative if it increases.
    pub closing_mps: f64,
    /// Maximum distance of an echo from the line, m.
    pub residual_m: f64,
    /// Number of echoes.
    pub echoes: usize,
}

impl RangeFit {
    /// Fits ranges (m) over their times (s). Ranges of `max_range_m` and more are not echoes and do not count. `None` for
    /// fewer than three echoes or for echoes at one time.
    #[must_use]
    pub fn new(readings: impl Iterator<Item = (f64, f64)> + Clone, max_range_m: f64) -> Option<Self> {
        let echoes = readings.filter(|&(_, range_m)| range_m < max_range_m);
        let last_s = echoes.clone().last()?.0;
        let from_last = echoes.map(|(time_s, range_m)| (time_s - last_s, range_m));
        let sums = from_last
            .clone()
            .fold((0.0, 0.0, 0.0), |(n, t, r), (time_s, range_m)| (n + 1.0, t + time_s, r + range_m));
        let (count, mean_s, mean_m) = (sums.0, sums.1 / sums.0, sums.2 / sums.0);
        let (spread, product) = from_last.clone().fold((0.0, 0.0), |(spread, product), (time_s, range_m)| {
            let time_s = time_s - mean_s;
            (spread + time_s * time_s, product + time_s * (range_m - mean_m))
        });
        let slope = product / spread;
        if count < MIN_ECHOES as f64 || !slope.is_finite() {
            return None;
        }
        let range_m = mean_m - slope * mean_s;
        let residuals = from_last.map(|(time_s, reading_m)| (reading_m - range_m - slope * time_s).abs());
        let residual_m = residuals.fold(0.0, f64::max);
        Some(Self { range_m, closing_mps: -slope, residual_m, echoes: count as usize })
    }

    /// Returns the time to contact (s), or `None` if nothing comes nearer.
    #[must_use]
    pub fn time_to_contact_s(&self) -> Option<f64> {
        (self.closing_mps > MIN_CLOSING_MPS).then(|| self.range_m / self.closing_mps)
    }
}

/// Returns the time to contact (s) with something whose size in the image (px) grew within `dt_s`, counted from the later
/// image, first order; `None` if it did not grow.
#[must_use]
pub fn time_to_contact_from_size_s(previous_px: f64, current_px: f64, dt_s: f64) -> Option<f64> {
    let growth_px = current_px - previous_px;
    (growth_px > 0.0).then(|| current_px * dt_s / growth_px)
}
