//! Sway of a camera on its mast, which odometry does not measure.

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::camera::Mount;

/// Sway of a camera from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct SwayConfig {
    /// Standard deviation of the rotation about the vertical.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub pan_deg: f64,
    /// Standard deviation of the forward tilt and of the sideways tilt.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub tilt_deg: f64,
    /// Autocorrelation of the sway between consecutive frames.
    #[default(0.6)]
    #[schemars(range(min = 0.0, max = 0.999))]
    pub memory: f64,
}

/// Stationary first-order autoregressive process of pan, tilt and roll.
pub struct Sway {
    config: SwayConfig,
    rng: Pcg64,
    /// Pan, tilt and roll, in standard deviations; `None` before the first frame.
    state: Option<[f64; 3]>,
    next: u64,
}

impl Sway {
    /// Returns a sway drawn from `rng`.
    #[must_use]
    pub fn new(config: SwayConfig, rng: Pcg64) -> Self {
        Self { config, rng, state: None, next: 0 }
    }

    /// Returns the mount in frame number `sequence`. Numbers must increase; skipped frames advance the sway too.
    pub fn mount(&mut self, still: Mount, sequence: u64) -> Mount {
        while self.next <= sequence {
            self.next += 1;
            let fresh: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(&mut self.rng));
            let memory = self.config.memory;
            self.state = Some(match self.state {
                None => fresh,
                Some(last) => {
                    let share = (1.0 - memory * memory).sqrt();
                    std::array::from_fn(|i| memory * last[i] + share * fresh[i])
                }
            });
        }
        let [pan, tilt, roll] = self.state.unwrap_or_default();
        let (pan_rad, tilt_rad) = (self.config.pan_deg.to_radians(), self.config.tilt_deg.to_radians());
        Mount {
            pan: still.pan + pan_rad * pan,
            tilt: still.tilt + tilt_rad * tilt,
            roll: still.roll + tilt_rad * roll,
            ..still
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn it_has_the_configured_deviation_and_autocorrelation() {
        let config = SwayConfig { pan_deg: 1.0, tilt_deg: 0.3, memory: 0.6 };
        let mut sway = Sway::new(config, stream(1, "sway"));
        let mounts: Vec<Mount> = (0..20_000).map(|i| sway.mount(Mount::level(0.3), i)).collect();
        let deviation = |part: fn(&Mount) -> f64| {
            (mounts.iter().map(|m| part(m).to_degrees().powi(2)).sum::<f64>() / mounts.len() as f64).sqrt()
        };
        let (pan, tilt, roll) = (deviation(|m| m.pan), deviation(|m| m.tilt), deviation(|m| m.roll));
        assert!((pan - 1.0).abs() < 0.04 && (tilt - 0.3).abs() < 0.012 && (roll - 0.3).abs() < 0.012);
        let kept: f64 = mounts.windows(2).map(|m| m[0].pan * m[1].pan).sum();
        let all: f64 = mounts.iter().map(|m| m.pan * m.pan).sum();
        assert!((kept / all - 0.6).abs() < 0.03, "{}", kept / all);
        assert_eq!(mounts[0].z, 0.3);
    }

    #[test]
    fn skipped_frames_do_not_change_the_others() {
        let config = SwayConfig { pan_deg: 1.0, ..SwayConfig::default() };
        let [mut all, mut some] = [0, 1].map(|_| Sway::new(config, stream(7, "sway")));
        let every: Vec<Mount> = (0..10).map(|i| all.mount(Mount::level(0.3), i)).collect();
        for i in [0, 3, 9] {
            assert_eq!(some.mount(Mount::level(0.3), i), every[i as usize]);
        }
        let mut still = Sway::new(SwayConfig::default(), stream(7, "sway"));
        assert_eq!(still.mount(Mount::level(0.3), 4), Mount::level(0.3));
    }
}
