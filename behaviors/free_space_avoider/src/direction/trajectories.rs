//! Trajectories of a holonomic robot with limited acceleration, and their clearance.

use nalgebra::Vector2;

use super::choice::{ChoiceRules, Start, Velocity};
use super::free_distances::FreeDistances;
use super::limited_motion::LimitedMotion;

/// Trajectories that are checked for one direction: driving on, and stopping after the reaction time.
pub(super) struct Trajectories {
    from: Vector2<f64>,
    drive: LimitedMotion,
    drive_s: f64,
    stop: LimitedMotion,
    stop_from: Vector2<f64>,
}

impl Trajectories {
    /// Creates the trajectories from `start` to the velocity `to_mps`.
    pub(super) fn new(start: &Start, to_mps: Vector2<f64>, rules: &ChoiceRules) -> Self {
        let from_mps = match rules.velocity {
            Velocity::Considered => start.velocity_mps,
            Velocity::Ignored => to_mps,
        };
        let acceleration = rules.acceleration_mps2;
        let drive = LimitedMotion::new(from_mps, to_mps, acceleration);
        Self {
            from: start.position_m,
            drive,
            // After the ramp, straight on over the braking distance.
            drive_s: drive.ramp_s() + rules.speed_mps / (2.0 * acceleration),
            stop: LimitedMotion::new(drive.velocity_mps(rules.reaction_s), Vector2::zeros(), acceleration),
            stop_from: start.position_m + drive.position_m(rules.reaction_s),
        }
    }

    /// Returns true if both keep the clearance of `rules`.
    pub(super) fn keep_clear(&self, free: &FreeDistances, rules: &ChoiceRules) -> bool {
        keeps_clear(free, &self.drive, self.from, self.drive_s, rules)
            && keeps_clear(free, &self.stop, self.stop_from, self.stop.ramp_s(), rules)
    }
}

/// Returns true if a motion that begins at `from` keeps its clearance for `duration_s`, checked at each step and at the
/// end. Steps that cannot be too near are skipped, which does not change the result.
fn keeps_clear(
    free: &FreeDistances,
    motion: &LimitedMotion,
    from: Vector2<f64>,
    duration_s: f64,
    rules: &ChoiceRules,
) -> bool {
    let step_m = motion.max_speed_mps() * rules.step_s;
    // Most trajectories that are not clear fail at their end.
    if free.clearance_m(from + motion.position_m(duration_s)) < rules.clearance_m {
        return false;
    }
    let mut step = 0.0;
    loop {
        let t = (step * rules.step_s).min(duration_s);
        let spare_m = free.clearance_m(from + motion.position_m(t)) - rules.clearance_m;
        if spare_m < 0.0 {
            return false;
        }
        if t >= duration_s || spare_m >= step_m * (duration_s - t) / rules.step_s {
            return true;
        }
        step += 1.0 + (spare_m / step_m).floor();
    }
}

/// Returns the minimum clearance (m) of the trajectories to a velocity, including the stop after the reaction time: the
/// reference for the faster check in [`Chooser::choose`](super::Chooser::choose).
#[must_use]
pub fn min_clearance_m(
    free: &FreeDistances,
    start: &Start,
    to_mps: Vector2<f64>,
    rules: &ChoiceRules,
) -> f64 {
    let paths = Trajectories::new(start, to_mps, rules);
    let drive = min_on_path_m(free, &paths.drive, paths.from, paths.drive_s, rules.step_s);
    drive.min(min_on_path_m(free, &paths.stop, paths.stop_from, paths.stop.ramp_s(), rules.step_s))
}

/// Returns the minimum clearance (m) of an immediate stop.
#[must_use]
pub fn stop_clearance_m(free: &FreeDistances, start: &Start, rules: &ChoiceRules) -> f64 {
    let stop = LimitedMotion::new(start.velocity_mps, Vector2::zeros(), rules.acceleration_mps2);
    min_on_path_m(free, &stop, start.position_m, stop.ramp_s(), rules.step_s)
}

fn min_on_path_m(
    free: &FreeDistances,
    motion: &LimitedMotion,
    from: Vector2<f64>,
    duration_s: f64,
    step_s: f64,
) -> f64 {
    let times =
        (0..).map(|step| f64::from(step) * step_s).take_while(|&t| t < duration_s).chain([duration_s]);
    times.map(|t| free.clearance_m(from + motion.position_m(t))).fold(f64::INFINITY, f64::min)
}
