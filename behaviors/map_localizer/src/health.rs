//! How far the pose can be trusted.

use yamabico_core::message::{PoseStatus, Reason};

use crate::belief::Belief;
use crate::fix::Fix;

/// So many lines are judged together.
const WINDOW_LINES: usize = 20;
/// Half the mean squared distance of honest covariances lies in here.
const HONEST: [f64; 2] = [0.4, 2.0];
/// Factor on the measurements' variance: no less, no more.
const SCALE: [f64; 2] = [0.25, 16.0];
/// Pictures in a row whose lines all lie beyond the gate, before the prior is believed less.
const CONTRADICTIONS: u32 = 3;
/// So often is it believed less before the robot looks around.
const INFLATIONS: u32 = 4;
/// The prior's covariance grows by this when it is believed less.
pub const INFLATION: f64 = 4.0;
/// Beyond these (m, rad) neighboring doors look alike.
const BLOWN_UP: (f64, f64) = (0.5, 10.0 * std::f64::consts::PI / 180.0);
/// Beyond this (m) the pose says nothing.
const LOST_M: f64 = 1.5;
/// Below this share of the upright edges that should be in view, the place along the way has no support.
const SUPPORT: f64 = 0.2;
/// With fewer upright edges in view nothing is said of the support.
const MIN_UPRIGHTS: usize = 3;
/// So far (m) the robot goes on without support.
const UNSUPPORTED_M: f64 = 1.5;

/// What is to be done about the belief.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advice {
    /// Nothing.
    GoOn,
    /// Believe the prior less: multiply its covariance by [`INFLATION`].
    Inflate,
    /// Stop and look around.
    LookAround,
}

/// The judge.
#[derive(Clone, Debug, PartialEq)]
pub struct Health {
    status: PoseStatus,
    reason: Reason,
    scale: f64,
    surprise: f64,
    lines: usize,
    is_contradicted: bool,
    contradictions: u32,
    inflations: u32,
    unsupported_m: f64,
}

impl Default for Health {
    fn default() -> Self {
        Self {
            status: PoseStatus::Unknown,
            reason: Reason::NoInput,
            scale: 1.0,
            surprise: 0.0,
            lines: 0,
            is_contradicted: false,
            contradictions: 0,
            inflations: 0,
            unsupported_m: 0.0,
        }
    }
}

impl Health {
    /// How far the pose can be trusted.
    #[must_use]
    pub fn status(&self) -> PoseStatus {
        self.status
    }

    /// Why.
    #[must_use]
    pub fn reason(&self) -> Reason {
        self.reason
    }

    /// Factor on the variance of measurements.
    #[must_use]
    pub fn noise_scale(&self) -> f64 {
        self.scale
    }

    /// Judges a picture that was matched, `driven_m` after the one before it.
    pub fn take(&mut self, fix: &Fix, driven_m: f64) -> Advice {
        self.judge_surprise(fix);
        let [expected, seen] = fix.uprights;
        let has_uprights = expected < MIN_UPRIGHTS || seen as f64 >= SUPPORT * expected as f64;
        let has_support = has_uprights && fix.verdict != Err(Reason::Ambiguous);
        self.unsupported_m = if has_support { 0.0 } else { self.unsupported_m + driven_m };
        match fix.verdict {
            Ok(()) => {
                self.contradictions = 0;
                self.inflations = 0;
                let is_sound = !self.is_contradicted && self.unsupported_m < 0.5 * UNSUPPORTED_M;
                (self.status, self.reason) = if is_sound {
                    (PoseStatus::Tracking, Reason::Nominal)
                } else {
                    (PoseStatus::Inconsistent, Reason::Inconsistent)
                };
            }
            Err(Reason::Gated) => {
                self.contradictions += 1;
                (self.status, self.reason) = (PoseStatus::Inconsistent, Reason::Gated);
                if self.contradictions >= CONTRADICTIONS {
                    self.contradictions = 0;
                    self.inflations += 1;
                    self.reason = Reason::OverConfident;
                    return if self.inflations > INFLATIONS { self.lose() } else { Advice::Inflate };
                }
            }
            Err(reason) => self.miss(reason),
        }
        if self.unsupported_m > UNSUPPORTED_M || is_blown_up(&fix.posterior) {
            return self.lose();
        }
        Advice::GoOn
    }

    /// Takes a picture that told nothing.
    pub fn miss(&mut self, reason: Reason) {
        if !matches!(self.status, PoseStatus::Unknown | PoseStatus::Lost) {
            self.status = PoseStatus::Coasting;
        }
        self.reason = reason;
    }

    /// Takes something that contradicts the belief, such as odometry that jumps.
    pub fn doubt(&mut self, reason: Reason) {
        if self.status != PoseStatus::Lost {
            self.status = PoseStatus::Inconsistent;
        }
        self.reason = reason;
    }

    /// Looks at the belief where no picture comes; says whether it has grown beyond use.
    pub fn watch(&mut self, belief: &Belief) -> Advice {
        if self.status != PoseStatus::Lost && is_blown_up(belief) { self.lose() } else { Advice::GoOn }
    }

    /// The robot was found again.
    pub fn found(&mut self) {
        *self = Self { status: PoseStatus::Tracking, reason: Reason::Nominal, ..Self::default() };
    }

    fn lose(&mut self) -> Advice {
        *self = Self { status: PoseStatus::Lost, reason: Reason::Lost, ..Self::default() };
        Advice::LookAround
    }

    fn judge_surprise(&mut self, fix: &Fix) {
        self.surprise += fix.surprise;
        self.lines += fix.lines;
        if self.lines < WINDOW_LINES {
            return;
        }
        let mean = self.surprise / self.lines as f64;
        self.is_contradicted = mean > HONEST[1];
        if !(HONEST[0]..=HONEST[1]).contains(&mean) {
            self.scale = (self.scale * mean.clamp(0.7, 2.0)).clamp(SCALE[0], SCALE[1]);
        }
        self.surprise = 0.0;
        self.lines = 0;
    }
}

/// Whether gates would reach from one door to the next.
fn is_blown_up(belief: &Belief) -> bool {
    belief.sigma_xy_m() > BLOWN_UP.0 || belief.sigma_theta_rad() > BLOWN_UP.1
}

/// Whether the place is not known within `LOST_M`.
#[must_use]
pub fn is_lost(belief: &Belief) -> bool {
    belief.sigma_xy_m() > LOST_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::geometry::Pose2;

    fn fix(verdict: Result<(), Reason>, lines: usize, surprise: f64, uprights: [usize; 2]) -> Fix {
        let posterior = Belief::new(Pose2::IDENTITY, 0.02, 0.01);
        Fix { posterior, verdict, lines, expected: 10, uprights, surprise }
    }

    #[test]
    fn lines_beyond_the_gate_are_believed_in_the_end() {
        let mut health = Health::default();
        health.take(&fix(Ok(()), 10, 10.0, [6, 5]), 0.04);
        assert_eq!(health.status(), PoseStatus::Tracking);
        let mut advice = Vec::new();
        for _ in 0..15 {
            advice.push(health.take(&fix(Err(Reason::Gated), 0, 0.0, [6, 5]), 0.04));
        }
        assert_eq!(advice.iter().filter(|advice| **advice == Advice::Inflate).count(), 4);
        assert_eq!(advice.last(), Some(&Advice::LookAround));
        assert_eq!(health.status(), PoseStatus::Lost);
    }

    #[test]
    fn surprising_measurements_count_less_and_are_told() {
        let mut health = Health::default();
        for _ in 0..4 {
            health.take(&fix(Ok(()), 10, 35.0, [6, 5]), 0.04);
        }
        assert_eq!(health.status(), PoseStatus::Inconsistent);
        assert!(health.noise_scale() >= 3.0);
        for _ in 0..20 {
            health.take(&fix(Ok(()), 10, 2.0, [6, 5]), 0.04);
        }
        assert_eq!(health.status(), PoseStatus::Tracking);
        assert!(health.noise_scale() < 1.0);
    }

    #[test]
    fn floor_lines_alone_do_not_carry_far() {
        let mut health = Health::default();
        let mut driven = 0.0;
        while health.take(&fix(Ok(()), 6, 6.0, [8, 0]), 0.04) == Advice::GoOn {
            driven += 0.04;
            assert!(driven < 3.0);
        }
        assert!(driven > 1.0 && health.status() == PoseStatus::Lost);
    }

    #[test]
    fn a_grown_belief_is_lost() {
        let mut health = Health::default();
        assert_eq!(health.watch(&Belief::new(Pose2::IDENTITY, 0.4, 0.1)), Advice::GoOn);
        assert_eq!(health.watch(&Belief::new(Pose2::IDENTITY, 0.6, 0.1)), Advice::LookAround);
        assert_eq!(health.watch(&Belief::new(Pose2::IDENTITY, 0.6, 0.1)), Advice::GoOn, "once");
        health.found();
        assert_eq!(health.status(), PoseStatus::Tracking);
    }
}
