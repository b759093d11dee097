//! Center and spread of repeated measurements, robust against a share of wrong ones.

/// Number of blocks that are left out in turn.
const BLOCKS: usize = 8;

/// Returns the median of finite values; `None` without any.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => None,
        count if count % 2 == 1 => Some(sorted[middle]),
        _ => Some(0.5 * (sorted[middle - 1] + sorted[middle])),
    }
}

/// Returns the standard deviation that the median of the absolute deviations stands for, if they are normal; `None` without values.
#[must_use]
pub fn robust_sigma(values: &[f64]) -> Option<f64> {
    let middle = median(values)?;
    let deviations: Vec<f64> = values.iter().map(|value| (value - middle).abs()).collect();
    median(&deviations).map(|deviation| 1.4826 * deviation)
}

/// Standard deviations of a result of `N` numbers, computed from `items`, by leaving out one block of consecutive items after the other:
/// consecutive pictures show the same edges, so that they are not independent. `None` if there are fewer than two items or a part gives
/// no result.
pub fn block_jackknife<T: Clone, const N: usize>(
    items: &[T],
    result: impl Fn(&[T]) -> Option<[f64; N]>,
) -> Option<[f64; N]> {
    let blocks = BLOCKS.min(items.len());
    if blocks < 2 {
        return None;
    }
    let edge = |block: usize| block * items.len() / blocks;
    let parts: Option<Vec<[f64; N]>> = (0..blocks)
        .map(|block| result(&[&items[..edge(block)], &items[edge(block + 1)..]].concat()))
        .collect();
    let parts = parts?;
    Some(std::array::from_fn(|i| {
        let mean = parts.iter().map(|part| part[i]).sum::<f64>() / blocks as f64;
        let sum = parts.iter().map(|part| (part[i] - mean).powi(2)).sum::<f64>();
        ((blocks as f64 - 1.0) / blocks as f64 * sum).sqrt()
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_values_do_not_count_and_correlated_ones_count_less() {
        assert_eq!(median(&[3.0, f64::NAN, 1.0, 1e9]), Some(3.0));
        assert!(median(&[]).is_none() && block_jackknife(&[1.0], |_| Some([0.0])).is_none());
        let values: Vec<f64> = (0..101).map(|i| f64::from(i % 11) - 5.0).collect();
        assert!((robust_sigma(&values).unwrap() - 4.4).abs() < 0.1);
        let mean = |values: &[f64]| Some([values.iter().sum::<f64>() / values.len() as f64]);
        let steps: Vec<f64> = (0..80).map(|i| f64::from(i / 10 % 2)).collect();
        let [sigma] = block_jackknife(&steps, mean).unwrap();
        assert!((sigma - 0.19).abs() < 0.01, "{sigma}: of 8 values, not of 80");
    }
}
