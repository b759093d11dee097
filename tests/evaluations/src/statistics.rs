//! Percentiles, means and deviations.

/// Returns the quantile `share`, 0 to 1, interpolated between the two nearest values; NaN without values.
pub fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let position = share * last as f64;
    let (low, high) = (sorted[position.floor() as usize], sorted[position.ceil() as usize]);
    low + (high - low) * position.fract()
}

/// Returns the smallest value that is not exceeded by `share`, 0 to 1, of the values; NaN without values.
pub fn nearest_rank(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied().unwrap_or(f64::NAN)
}

/// Returns the mean; NaN without values.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Returns the root mean square; NaN without values.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Returns the standard deviation of a sample; NaN with fewer than two values.
pub fn standard_deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let sum = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (sum / (values.len() as f64 - 1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_interpolate_and_ranks_do_not() {
        let values = [4.0, 1.0, 2.0, 3.0];
        assert_eq!((percentile(&values, 0.5), percentile(&values, 1.0)), (2.5, 4.0));
        assert_eq!((nearest_rank(&values, 0.5), nearest_rank(&values, 0.0)), (2.0, 1.0));
        assert!(percentile(&[], 0.5).is_nan() && nearest_rank(&[], 0.5).is_nan());
    }
}
