/// Returns the quantile of the chi-squared distribution with `freedom` > 0 degrees of freedom at a probability between
/// 0 and 1 (exclusive); NaN otherwise.
#[must_use]
pub fn quantile(probability: f64, freedom: u32) -> f64 {
    if !(probability > 0.0 && probability < 1.0) || freedom == 0 {
        return f64::NAN;
    }
    let (mut low, mut high) = (0.0, 2.0 * f64::from(freedom) + 100.0);
    while cumulative(high, freedom) < probability {
        high *= 2.0;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if cumulative(middle, freedom) < probability { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Returns the cumulative distribution at `x`: the regularized lower incomplete gamma function of half the arguments,
/// as a series of positive terms.
fn cumulative(x: f64, freedom: u32) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    let (a, half) = (0.5 * f64::from(freedom), 0.5 * x);
    let (mut term, mut sum, mut k) = (1.0, 1.0, a);
    while term > 1e-17 * sum {
        k += 1.0;
        term *= half / k;
        sum += term;
    }
    (a * half.ln() - half + sum.ln() - log_gamma_after(freedom)).exp().min(1.0)
}

/// Returns the logarithm of the gamma function of freedom/2 + 1.
fn log_gamma_after(freedom: u32) -> f64 {
    let (mut at, mut log) =
        if freedom.is_multiple_of(2) { (1.0, 0.0) } else { (0.5, 0.5 * std::f64::consts::PI.ln()) };
    while at < 0.5 * f64::from(freedom) + 0.75 {
        log += f64::ln(at);
        at += 1.0;
    }
    log
}

#[cfg(test)]
mod tests {
    use super::quantile;

    #[test]
    fn known_values() {
        for (freedom, value) in [
            (1, 6.634_896_601_021_214_5),
            (2, 9.210_340_371_976_18),
            (3, 11.344_866_730_144_373),
            (10, 23.209_251_158_954_356),
        ] {
            assert!((quantile(0.99, freedom) - value).abs() < 1e-9, "{freedom}");
        }
        assert!((quantile(0.999, 3) - 16.266_236_196_238_13).abs() < 1e-9);
        // Wilson-Hilferty approximation for many degrees of freedom.
        let ninth = 2.0 / (9.0 * 200.0);
        let normal = 200.0 * (1.0_f64 - ninth + 2.326_347_874 * f64::sqrt(ninth)).powi(3);
        assert!((quantile(0.99, 200) / normal - 1.0).abs() < 1e-3);
        assert!(quantile(1.0, 3).is_nan() && quantile(0.5, 0).is_nan());
    }
}
