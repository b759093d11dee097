//! Consistency monitor of the pose estimate.

use yamabico_core::message::{PoseStatus, Reason};

use crate::belief::Belief;
use crate::fix::Fix;

/// Number of lines over which the normalized innovations are averaged.
const WINDOW_LINES: usize = 20;
/// Range of the mean NIS per degree of freedom in which covariances count as consistent.
const CONSISTENT_NIS: [f64; 2] = [0.4, 2.0];
/// Range of the factor on the variance of measurements.
const SCALE_RANGE: [f64; 2] = [0.25, 16.0];
/// Number of consecutive images without a fix, or with a weak one, after which the pose may be wrong.
const IMAGES_BEFORE_RECOVERY: u32 = 2;
/// Number of consecutive images with all lines outside the gate after which the prior's covariance is inflated.
const IMAGES_BEFORE_INFLATION: u32 = 3;
/// Maximum number of inflations before the robot looks around.
const MAX_INFLATIONS: u32 = 4;
/// Factor by which an inflation multiplies the prior's covariance.
pub const INFLATION: f64 = 4.0;
/// Standard deviations of position (m) and heading (rad) above which matches with neighboring doors become ambiguous
/// and the pose counts as lost.
const MAX_SIGMA: (f64, f64) = (0.5, 10.0 * std::f64::consts::PI / 180.0);
/// Minimum fraction of the expected vertical edges that must be matched to support the position along the corridor.
const MIN_SUPPORT: f64 = 0.2;
/// Minimum number of expected vertical edges for the support to be evaluated.
const MIN_UPRIGHTS: usize = 3;
/// Maximum distance driven without support, m.
const MAX_UNSUPPORTED_M: f64 = 1.5;

/// Action recommended by the consistency check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advice {
    /// Keep the belief.
    Continue,
    /// Multiply the prior's covariance by [`INFLATION`].
    Inflate,
    /// Stop and search for the pose.
    LookAround,
}

/// Consistency of the recent matches and the resulting status of the pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Health {
    status: PoseStatus,
    reason: Reason,
    scale: f64,
    nis: f64,
    lines: usize,
    is_contradicted: bool,
    gated_images: u32,
    inflations: u32,
    /// Consecutive images without a fix, or with a weak one, although edges were expected.
    failures: u32,
    unsupported_m: f64,
}

impl Default for Health {
    fn default() -> Self {
        Self {
            status: PoseStatus::Unknown,
            reason: Reason::NoInput,
            scale: 1.0,
            nis: 0.0,
            lines: 0,
            is_contradicted: false,
            gated_images: 0,
            inflations: 0,
            failures: 0,
            unsupported_m: 0.0,
        }
    }
}

impl Health {
    /// Returns the status of the pose.
    #[must_use]
    pub fn status(&self) -> PoseStatus {
        self.status
    }

    /// Returns the reason for the status.
    #[must_use]
    pub fn reason(&self) -> Reason {
        self.reason
    }

    /// Returns the factor on the variance of measurements.
    #[must_use]
    pub fn noise_scale(&self) -> f64 {
        self.scale
    }

    /// Returns true if several images in succession gave no fix, or a weak one, although edges were expected: the pose
    /// may be wrong.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.failures >= IMAGES_BEFORE_RECOVERY
    }

    /// Evaluates the match of an image. `driven_m` is the distance driven since the previous image.
    pub fn evaluate(&mut self, fix: &Fix, driven_m: f64) -> Advice {
        self.evaluate_nis(fix);
        self.failures = match fix.verdict {
            Ok(()) if !fix.is_weak() => 0,
            Err(Reason::NoModel) => self.failures,
            _ => self.failures + 1,
        };
        let [expected, seen] = fix.uprights;
        let has_uprights = expected < MIN_UPRIGHTS || seen as f64 >= MIN_SUPPORT * expected as f64;
        let has_support = has_uprights && fix.verdict != Err(Reason::Ambiguous);
        self.unsupported_m = if has_support { 0.0 } else { self.unsupported_m + driven_m };
        match fix.verdict {
            Ok(()) => {
                self.gated_images = 0;
                self.inflations = 0;
                let is_sound = !self.is_contradicted && self.unsupported_m < 0.5 * MAX_UNSUPPORTED_M;
                (self.status, self.reason) = if is_sound {
                    (PoseStatus::Tracking, Reason::Nominal)
                } else {
                    (PoseStatus::Inconsistent, Reason::Inconsistent)
                };
            }
            Err(Reason::Gated) => {
                self.gated_images += 1;
                (self.status, self.reason) = (PoseStatus::Inconsistent, Reason::Gated);
                if self.gated_images >= IMAGES_BEFORE_INFLATION {
                    self.gated_images = 0;
                    self.inflations += 1;
                    self.reason = Reason::Overconfident;
                    return if self.inflations > MAX_INFLATIONS { self.lose() } else { Advice::Inflate };
                }
            }
            Err(reason) => self.miss(reason),
        }
        if self.unsupported_m > MAX_UNSUPPORTED_M || is_too_uncertain(&fix.posterior) {
            return self.lose();
        }
        Advice::Continue
    }

    /// Records an image without a fix.
    pub fn miss(&mut self, reason: Reason) {
        if !matches!(self.status, PoseStatus::Unknown | PoseStatus::Lost) {
            self.status = PoseStatus::Coasting;
        }
        self.reason = reason;
    }

    /// Records data that contradicts the belief, such as a jump of the odometry.
    pub fn doubt(&mut self, reason: Reason) {
        if self.status != PoseStatus::Lost {
            self.status = PoseStatus::Inconsistent;
        }
        self.reason = reason;
    }

    /// Checks the uncertainty of the belief between images.
    pub fn check(&mut self, belief: &Belief) -> Advice {
        if self.status != PoseStatus::Lost && is_too_uncertain(belief) {
            self.lose()
        } else {
            Advice::Continue
        }
    }

    /// Restarts with status `Tracking` after the pose was found again.
    pub fn recover(&mut self) {
        *self = Self { status: PoseStatus::Tracking, reason: Reason::Nominal, ..Self::default() };
    }

    /// Restarts with status `Lost`.
    pub fn lose(&mut self) -> Advice {
        *self = Self { status: PoseStatus::Lost, reason: Reason::Lost, ..Self::default() };
        Advice::LookAround
    }

    fn evaluate_nis(&mut self, fix: &Fix) {
        self.nis += fix.nis;
        self.lines += fix.lines;
        if self.lines < WINDOW_LINES {
            return;
        }
        let mean = self.nis / self.lines as f64;
        self.is_contradicted = mean > CONSISTENT_NIS[1];
        if !(CONSISTENT_NIS[0]..=CONSISTENT_NIS[1]).contains(&mean) {
            self.scale = (self.scale * mean.clamp(0.7, 2.0)).clamp(SCALE_RANGE[0], SCALE_RANGE[1]);
        }
        self.nis = 0.0;
        self.lines = 0;
    }
}

fn is_too_uncertain(belief: &Belief) -> bool {
    belief.sigma_xy_m() > MAX_SIGMA.0 || belief.sigma_theta_rad() > MAX_SIGMA.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::geometry::Pose2;

    fn fix(verdict: Result<(), Reason>, lines: usize, nis: f64, uprights: [usize; 2]) -> Fix {
        let posterior = Belief::new(Pose2::IDENTITY, 0.02, 0.01);
        Fix { posterior, verdict, lines, expected: 10, uprights, nis }
    }

    #[test]
    fn lines_outside_the_gate_inflate_the_belief_and_then_start_a_search() {
        let mut health = Health::default();
        health.evaluate(&fix(Ok(()), 10, 10.0, [6, 5]), 0.04);
        assert_eq!(health.status(), PoseStatus::Tracking);
        let mut advice = Vec::new();
        for _ in 0..15 {
            advice.push(health.evaluate(&fix(Err(Reason::Gated), 0, 0.0, [6, 5]), 0.04));
        }
        assert_eq!(advice.iter().filter(|advice| **advice == Advice::Inflate).count(), 4);
        assert_eq!(advice.last(), Some(&Advice::LookAround));
        assert_eq!(health.status(), PoseStatus::Lost);
    }

    #[test]
    fn inconsistent_measurements_are_downweighted_and_reported() {
        let mut health = Health::default();
        for _ in 0..4 {
            health.evaluate(&fix(Ok(()), 10, 35.0, [6, 5]), 0.04);
        }
        assert_eq!(health.status(), PoseStatus::Inconsistent);
        assert!(health.noise_scale() >= 3.0);
        for _ in 0..20 {
            health.evaluate(&fix(Ok(()), 10, 2.0, [6, 5]), 0.04);
        }
        assert_eq!(health.status(), PoseStatus::Tracking);
        assert!(health.noise_scale() < 1.0);
    }

    #[test]
    fn floor_lines_alone_do_not_carry_far() {
        let mut health = Health::default();
        let mut driven = 0.0;
        while health.evaluate(&fix(Ok(()), 6, 6.0, [8, 0]), 0.04) == Advice::Continue {
            driven += 0.04;
            assert!(driven < 3.0);
        }
        assert!(driven > 1.0 && health.status() == PoseStatus::Lost);
    }

    #[test]
    fn an_uncertain_belief_is_lost() {
        let mut health = Health::default();
        assert_eq!(health.check(&Belief::new(Pose2::IDENTITY, 0.4, 0.1)), Advice::Continue);
        assert_eq!(health.check(&Belief::new(Pose2::IDENTITY, 0.6, 0.1)), Advice::LookAround);
        assert_eq!(health.check(&Belief::new(Pose2::IDENTITY, 0.6, 0.1)), Advice::Continue, "once");
        health.recover();
        assert_eq!(health.status(), PoseStatus::Tracking);
    }
}
