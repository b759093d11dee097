//! Units derived from the ending of a key: `gap_m`, `fov_deg`, `speed_mps`.

/// Endings of keys and their units; the longest matching ending applies.
const UNITS: &[(&str, &str)] = &[
    ("_m", "m"),
    ("_mm", "mm"),
    ("_m2", "m²"),
    ("_s", "s"),
    ("_ms", "ms"),
    ("_us", "µs"),
    ("_ns", "ns"),
    ("_hz", "Hz"),
    ("_deg", "°"),
    ("_rad", "rad"),
    ("_px", "px"),
    ("_mps", "m/s"),
    ("_m_s", "m/s"),
    ("_mps2", "m/s²"),
    ("_mps3", "m/s³"),
    ("_degps", "°/s"),
    ("_deg_s", "°/s"),
    ("_deg_per_s", "°/s"),
    ("_radps", "rad/s"),
    ("_rad_s", "rad/s"),
    ("_radps2", "rad/s²"),
    ("_radps3", "rad/s³"),
    ("_percent", "%"),
    ("_per_m", "1/m"),
    ("_deg_per_m", "°/m"),
    ("deg_per_px", "°/px"),
    ("_kg", "kg"),
    ("_n", "N"),
    ("_nm", "N m"),
];

/// Returns the unit given by the ending of `key`, or `None` if it has no unit.
pub fn unit_of(key: &str) -> Option<&'static str> {
    let fits = UNITS.iter().filter(|(ending, _)| key.ends_with(ending));
    fits.max_by_key(|(ending, _)| ending.len()).map(|(_, unit)| *unit)
}

/// Returns a hint if `value` was probably written in another unit than that of `key`; `fits` accepts valid values.
pub fn meant(key: &str, value: f64, fits: impl Fn(f64) -> bool) -> Option<String> {
    let unit = unit_of(key)?;
    let guesses: &[(&str, f64)] = match unit {
        "m" => &[("millimeters", 1e-3), ("centimeters", 1e-2)],
        "m/s" => &[("millimeters per second", 1e-3), ("kilometers per hour", 1.0 / 3.6)],
        "s" => &[("milliseconds", 1e-3)],
        "ms" => &[("seconds", 1e3), ("microseconds", 1e-3)],
        "Hz" => &[("a period in seconds", f64::NAN)],
        "rad" => &[("degrees", std::f64::consts::PI / 180.0)],
        "rad/s" => &[("degrees per second", std::f64::consts::PI / 180.0)],
        "°" => &[("radians", 180.0 / std::f64::consts::PI)],
        "°/s" => &[("radians per second", 180.0 / std::f64::consts::PI)],
        _ => return None,
    };
    let (name, meant) = guesses.iter().find_map(|(name, factor)| {
        let meant = if factor.is_nan() { 1.0 / value } else { value * factor };
        (meant.is_finite() && meant != 0.0 && fits(meant)).then_some((name, meant))
    })?;
    Some(format!("the unit is {unit}; if the value is in {name}, write {key} = {}", number(meant)))
}

/// Formats a number with at most four decimals, and with an exponent only for very small and very large values.
pub fn number(value: f64) -> String {
    if value != 0.0 && (value.abs() < 1e-3 || value.abs() >= 1e9) {
        return format!("{value:e}");
    }
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_ending_applies() {
        assert_eq!(unit_of("max_angular_radps"), Some("rad/s"));
        assert_eq!(unit_of("gate_m"), Some("m"));
        assert_eq!(unit_of("turn_rad_s"), Some("rad/s"));
        assert_eq!(unit_of("hold_ms"), Some("ms"));
        assert_eq!(unit_of("name"), None);
    }

    #[test]
    fn degrees_are_recognized_where_radians_are_expected() {
        let help = meant("max_angular_radps", 90.0, |value| value < 20.0).unwrap();
        assert!(help.contains("degrees per second, write max_angular_radps = 1.5708"), "{help}");
        assert_eq!(meant("max_angular_radps", -90.0, |value| value > 0.0), None);
    }

    #[test]
    fn numbers_are_written_short() {
        assert_eq!(number(0.5), "0.5");
        assert_eq!(number(20.0), "20");
        assert_eq!(number(1e-6), "1e-6");
    }
}
