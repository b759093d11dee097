//! Brightness profile across the foot of a wall: floor, baseboard, wall.

/// Number of samples of a profile.
pub const FOOT_SAMPLES: u32 = 16;
/// RMS contrast of a profile, and RMS difference of two, above which they count, gray levels.
pub const FOOT_CONTRAST: f64 = 12.0;
/// Minimum correlation of two similar profiles.
const ALIKE: f64 = 0.8;

/// Gray levels across the foot of a wall, upward.
pub type FootProfile = [f64; FOOT_SAMPLES as usize];

/// Returns true if two profiles are similar up to gain and offset. A profile without contrast is similar to any.
#[must_use]
pub fn are_alike(a: &FootProfile, b: &FootProfile) -> bool {
    is_flat(a) || correlation(a, b) > ALIKE
}

/// Returns the correlation of two profiles, -1 to 1, up to a shift by one sample; 0 if either has no contrast.
#[must_use]
pub fn likeness(a: &[f64], b: &[f64]) -> f64 {
    let count = a.len().min(b.len());
    let displaced = [(0, 0), (1, 0), (0, 1)].into_iter().filter_map(|(of_a, of_b)| {
        let kept = count.checked_sub(of_a.max(of_b))?;
        Some(correlation(a.get(of_a..of_a + kept)?, b.get(of_b..of_b + kept)?))
    });
    displaced.fold(-1.0, f64::max)
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |profile: &[f64]| profile.iter().sum::<f64>() / profile.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let sum = |x: &[f64], mean_x: f64, y: &[f64], mean_y: f64| {
        x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>()
    };
    let both = (sum(a, mean_a, a, mean_a) * sum(b, mean_b, b, mean_b)).sqrt();
    if both > 0.0 { sum(a, mean_a, b, mean_b) / both } else { 0.0 }
}

/// Returns true if a profile has no contrast.
#[must_use]
pub fn is_flat(profile: &FootProfile) -> bool {
    let mean = profile.iter().sum::<f64>() / f64::from(FOOT_SAMPLES);
    let squares: f64 = profile.iter().map(|level| (level - mean).powi(2)).sum();
    squares < FOOT_CONTRAST.powi(2) * f64::from(FOOT_SAMPLES)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn foot(floor: f64, baseboard: f64, wall: f64, shift: usize) -> FootProfile {
        std::array::from_fn(|i| match i + shift {
            0..4 => floor,
            4..9 => baseboard,
            _ => wall,
        })
    }

    #[test]
    fn feet_are_alike_in_any_light_but_not_shifted() {
        let here = foot(120.0, 40.0, 190.0, 0);
        assert!(are_alike(&here, &foot(80.0, 30.0, 120.0, 0)));
        assert!(
            !are_alike(&here, &foot(190.0, 120.0, 40.0, 0))
                && !are_alike(&here, &foot(120.0, 40.0, 190.0, 6))
        );
        assert!(is_flat(&foot(100.0, 105.0, 100.0, 0)) && !is_flat(&here));
        assert!(are_alike(&foot(100.0, 105.0, 100.0, 0), &here), "no contrast is like any");
        assert!(likeness(&here, &foot(120.0, 40.0, 190.0, 1)) > 0.99, "one sample beside");
        assert!(likeness(&here, &foot(120.0, 40.0, 190.0, 3)) < 0.8);
        assert_eq!(likeness(&here, &foot(90.0, 90.0, 90.0, 0)), 0.0, "no contrast is like none");
    }
}
