//! The floor's look, learned while driving.

use super::features::Feature;
use super::modes::{Mode, Surfaces};

/// Time after which a mode that is not seen again has lost 63 % of its mass, s.
const MEMORY_S: f64 = 60.0;
/// Maximum time that counts as one step, s.
const MAX_STEP_S: f64 = 1.0;
/// Squared Mahalanobis distance up to which a sample belongs to a mode.
const SAME_MODE: f32 = 9.0;
/// Maximum mass of a mode: newer samples replace older ones.
const MAX_MASS: f32 = 400.0;
/// Mass from which on the look is trusted.
const TRUSTED_MASS: f32 = 100.0;

/// Up to four modes with a mass that decays. Allocates at its creation only.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnedLook {
    modes: Vec<Mode>,
}

impl Default for LearnedLook {
    fn default() -> Self {
        Self { modes: Vec::with_capacity(Surfaces::FLOOR.max_modes) }
    }
}

impl LearnedLook {
    /// Creates a look from saved modes; only the four with the most mass count.
    #[must_use]
    pub fn from_modes(modes: &[Mode]) -> Self {
        let mut sorted = modes.to_vec();
        sorted.sort_by(|a, b| b.mass.total_cmp(&a.mass));
        let mut look = Self::default();
        look.modes.extend(sorted.into_iter().take(Surfaces::FLOOR.max_modes));
        look
    }

    /// The modes; their masses are numbers of samples.
    #[must_use]
    pub fn modes(&self) -> &[Mode] {
        &self.modes
    }

    /// Returns true once enough floor has been seen, so that the foreground need not be presumed to be floor.
    #[must_use]
    pub fn is_trusted(&self) -> bool {
        self.modes.iter().map(|mode| mode.mass).sum::<f32>() >= TRUSTED_MASS
    }

    /// Decays the mass of all modes over `elapsed_s` (at most 1 s counts). Call it only while learning, so that a robot at rest
    /// forgets nothing.
    pub fn fade(&mut self, elapsed_s: f64) {
        let share = (-elapsed_s.clamp(0.0, MAX_STEP_S) / MEMORY_S).exp() as f32;
        self.modes.iter_mut().for_each(|mode| mode.mass *= share);
    }

    /// Learns the feature of a block that is floor. A feature that no mode describes becomes a new mode, in place of the one
    /// with the least mass.
    pub fn learn(&mut self, feature: &Feature, is_color: bool) {
        let distances = self.modes.iter_mut().map(|mode| (mode.distance_squared(feature, is_color), mode));
        match distances.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((distance, mode)) if distance < SAME_MODE => {
                mode.mass = (mode.mass + 1.0).min(MAX_MASS);
                let rate = 1.0 / mode.mass;
                for (i, value) in feature.iter().enumerate() {
                    let error = value - mode.mean[i];
                    mode.mean[i] += rate * error;
                    let variance = mode.deviation[i].powi(2);
                    let least = 2.0 * Surfaces::FLOOR.min_deviation[i].powi(2);
                    mode.deviation[i] = (variance + rate * (error * error - variance)).max(least).sqrt();
                }
            }
            _ => {
                if self.modes.len() >= Surfaces::FLOOR.max_modes {
                    let masses = self.modes.iter().map(|mode| mode.mass).enumerate();
                    if let Some((lightest, _)) = masses.min_by(|a, b| a.1.total_cmp(&b.1)) {
                        self.modes.swap_remove(lightest);
                    }
                }
                let deviation = Surfaces::FLOOR.min_deviation.map(|least| std::f32::consts::SQRT_2 * least);
                self.modes.push(Mode { mean: *feature, deviation, mass: 1.0 });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Feature = [0.5, 0.25, 4.0, -2.0];

    #[test]
    fn looks_are_learned_apart_and_fade() {
        let mut look = LearnedLook::default();
        assert!(!look.is_trusted());
        for i in 0..90 {
            look.learn(&[0.33, 0.33, 5.0 + 0.001 * (i % 7) as f32, -3.0], true);
            if i % 3 == 0 {
                look.learn(&RED, true);
            }
        }
        assert_eq!(look.modes().len(), 2);
        assert!(look.is_trusted() && (look.modes()[0].mass, look.modes()[1].mass) == (90.0, 30.0));
        for _ in 0..40 {
            look.fade(1.0);
        }
        assert!(!look.is_trusted() && look.modes()[0].mass < 50.0);
        look.fade(f64::MAX);
        assert!(look.modes()[0].mass > 40.0, "a gap counts as one second");
    }

    #[test]
    fn the_lightest_mode_gives_way() {
        let mut look = LearnedLook::default();
        for red in [0.2, 0.25, 0.3, 0.35, 0.4] {
            let count = if red == 0.25 { 1 } else { 5 };
            (0..count).for_each(|_| look.learn(&[red, 0.33, 5.0, -3.0], true));
        }
        let mut reds: Vec<f32> = look.modes().iter().map(|mode| mode.mean[0]).collect();
        reds.sort_by(f32::total_cmp);
        assert_eq!(reds, [0.2, 0.3, 0.35, 0.4]);
        assert_eq!(LearnedLook::from_modes(look.modes()).modes().len(), 4);
    }

    #[test]
    fn gradual_changes_are_followed() {
        let mut look = LearnedLook::default();
        for i in 0..600 {
            look.learn(&[0.33, 0.33, 4.0 + 0.002 * i as f32, -3.0], true);
        }
        let nearest = look.modes().iter().map(|mode| mode.distance_squared(&[0.33, 0.33, 5.2, -3.0], true));
        assert!(nearest.fold(f32::INFINITY, f32::min) < SAME_MODE);
    }
}
