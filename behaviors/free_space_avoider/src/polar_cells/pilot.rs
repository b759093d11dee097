//! From free distances to a motion, for both kinds of drive: the choice of a direction, slower where it must be, out of what
//! is too near, and what to do where there is none.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use yamabico_core::behavior::BuildError;
use yamabico_core::geometry::{Pose2, Twist, wrap_angle};
use yamabico_core::message::Axis;
use yamabico_core::sensor::{MountedMirror, Robot};
use yamabico_core::time::Time;

use super::avoider::velocity;
use crate::config::{Config, VelocityRule};
use crate::direction::choice::stop_clearance_m;
use crate::direction::{Before, ChoiceRules, Chooser, FreeDistances, HeadingRules, Rollout, Start, Velocity};
use crate::stopping::COMMAND_S;

/// Time between two looks at a way, s.
const STEP_S: f64 = 0.02;
/// The same for a robot that turns, whose way must be followed step by step, s.
const TURNING_STEP_S: f64 = 0.04;
/// Time that a robot that turns looks ahead before it would brake, s.
const HORIZON_S: f64 = 2.0;
/// Turn rate for each radian of missing heading, 1/s.
const GAIN_PER_S: f64 = 4.0;
/// Going around on the other side than last time must save so much deviation, rad.
const SIDE_CHANGE_RAD: f64 = 0.5;
/// A direction nearer to the wished one than the one before must keep so much more clear, m.
const NEARER_M: f64 = 0.03;
/// Turned so near (rad) to the freest direction, a robot that finds no way has none.
const FACING_RAD: f64 = 0.15;
/// Slowest (m/s) that the robot comes to its goal.
const SLOWEST_MPS: f64 = 0.02;
/// The share of the speed to back out with.
const BACK_OUT_SHARE: f64 = 0.25;
/// So much (m) nearer to what is too near the robot may come by rounding.
const ROUNDING_M: f64 = 1e-3;

/// What the robot does until it is asked again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steer {
    /// Drives.
    Drive {
        /// Robot frame.
        twist: Twist,
        /// Of the cruising speed, 0 to 1.
        share: f64,
    },
    /// Drives away from what came nearer than it should.
    BackOut(Twist),
    /// Turns where it stands, rad/s, left positive.
    Turn(f64),
    /// Stands, for so long, and keeps on looking.
    Wait {
        /// Seconds without a free direction.
        blocked_s: f64,
    },
    /// The same for longer than its patience.
    Blocked {
        /// Seconds without a free direction.
        blocked_s: f64,
    },
    /// Brakes as hard as it can: even its stop comes too near.
    Brake,
}

/// Chooses, and remembers on which side it went around and for how long there has been no way.
#[derive(Clone, Debug)]
pub struct Pilot {
    chooser: Chooser,
    rules: ChoiceRules,
    heading: HeadingRules,
    is_holonomic: bool,
    radius_m: f64,
    patience_s: f64,
    before: Before,
    blocked_since: Option<Time>,
}

impl Pilot {
    /// A pilot for this robot with this camera.
    ///
    /// # Errors
    /// A robot that cannot speed up or brake.
    pub fn new(config: &Config, robot: &Robot, camera: &MountedMirror) -> Result<Self, BuildError> {
        let limits = &robot.limits;
        let slower = |axis: usize| limits.acceleration[axis].min(limits.deceleration[axis]);
        let is_holonomic = robot.axes.contains(Axis::Lateral);
        let along = if is_holonomic { slower(0).min(slower(1)) } else { slower(0) };
        let turning = slower(2);
        if !(along > 0.0 && along.is_finite() && (is_holonomic || turning > 0.0 && turning.is_finite())) {
            return Err(BuildError::new("", "the robot's accelerations are no usable numbers"));
        }
        let build_up_s = along / limits.jerk[0];
        let gentle_s = if build_up_s.is_finite() { 0.5 * build_up_s } else { 0.0 };
        let clearance_m = robot.radius_m + config.margin_m;
        let speed_mps = config.speed_mps.min(limits.speed[0]);
        let rules = ChoiceRules {
            speed_mps,
            acceleration_mps2: along,
            clearance_m,
            step_s: STEP_S,
            reaction_s: camera.period_s + COMMAND_S + gentle_s,
            velocity: match config.velocity {
                VelocityRule::Considered => Velocity::Considered,
                VelocityRule::Ignored => Velocity::Ignored,
            },
            side_change_rad: SIDE_CHANGE_RAD,
            nearer_m: NEARER_M,
            deviation_rad: [0.0, TAU],
        };
        let heading = HeadingRules {
            speed_mps,
            acceleration_mps2: along,
            turn_radps: config.turn_radps.min(limits.speed[2]),
            turn_acceleration_radps2: turning,
            gain_per_s: GAIN_PER_S,
            step_s: TURNING_STEP_S,
            horizon_s: HORIZON_S,
            clearance_m,
            side_change_rad: SIDE_CHANGE_RAD,
            deviation_rad: [0.0, TAU],
        };
        Ok(Self {
            chooser: Chooser::default(),
            rules,
            heading,
            is_holonomic,
            radius_m: robot.radius_m,
            patience_s: config.patience_s,
            before: Before::default(),
            blocked_since: None,
        })
    }

    /// How directions are judged.
    #[must_use]
    pub fn rules(&self) -> &ChoiceRules {
        &self.rules
    }

    /// The motion of a robot that has `moved` since the free distances were seen and now moves with `twist`, to a goal in a
    /// direction (radians, robot frame) and at a distance (m).
    pub fn steer(
        &mut self,
        free: &FreeDistances,
        moved: &Pose2,
        twist: &Twist,
        (goal_rad, distance_m): (f64, f64),
        now: Time,
    ) -> Steer {
        let goal_speed_mps = (2.0 * self.rules.acceleration_mps2 * distance_m).sqrt().max(SLOWEST_MPS);
        let speed_mps = self.rules.speed_mps.min(goal_speed_mps);
        let goal_in_picture_rad = goal_rad + moved.theta;
        let found = if self.is_holonomic {
            self.steer_sideways(free, moved, twist, goal_in_picture_rad, speed_mps)
        } else {
            self.steer_ahead(free, moved, twist, goal_in_picture_rad, speed_mps)
        };
        if let Some(steer) = found {
            self.blocked_since = None;
            return steer;
        }
        let blocked_s = now.seconds_after(*self.blocked_since.get_or_insert(now));
        let start = start(moved, twist);
        let is_moving = start.velocity_mps.norm() > SLOWEST_MPS;
        if is_moving && stop_clearance_m(free, &start, &self.rules) < self.radius_m {
            return Steer::Brake;
        }
        if !self.is_holonomic
            && !is_moving
            && let Some(turn) = self.turn(free, moved, goal_in_picture_rad)
        {
            return turn;
        }
        if blocked_s < self.patience_s { Steer::Wait { blocked_s } } else { Steer::Blocked { blocked_s } }
    }

    fn steer_sideways(
        &mut self,
        free: &FreeDistances,
        moved: &Pose2,
        twist: &Twist,
        goal_rad: f64,
        speed_mps: f64,
    ) -> Option<Steer> {
        let start = start(moved, twist);
        let rules = ChoiceRules { speed_mps, ..self.rules };
        let to_robot = |velocity: Vector2<f64>| {
            let velocity = Pose2::new(0.0, 0.0, -moved.theta).rotate_vector(velocity);
            Twist::new(velocity.x, velocity.y, 0.0)
        };
        if let Some(choice) = self.chooser.choose_speed(free, &start, goal_rad, &self.before, &rules) {
            self.before = Before { side: choice.side, direction_rad: Some(choice.direction_rad) };
            let share = choice.velocity_mps.norm() / self.rules.speed_mps;
            return Some(Steer::Drive { twist: to_robot(choice.velocity_mps), share });
        }
        let clearance_m = self.clearance_to_back_out(free, &start)?;
        let slow =
            ChoiceRules { speed_mps: BACK_OUT_SHARE * self.rules.speed_mps, clearance_m, ..self.rules };
        let choice = self.chooser.choose(free, &start, goal_rad, &self.before, &slow)?;
        Some(Steer::BackOut(to_robot(choice.velocity_mps)))
    }

    fn steer_ahead(
        &mut self,
        free: &FreeDistances,
        moved: &Pose2,
        twist: &Twist,
        goal_rad: f64,
        speed_mps: f64,
    ) -> Option<Steer> {
        let place = start(moved, twist);
        let start = Rollout::new(place.position_m, moved.theta, twist.linear, twist.angular);
        let rules = HeadingRules { speed_mps, ..self.heading };
        if let Some(drive) =
            self.chooser.choose_heading_speed(free, &start, goal_rad, self.before.side, &rules)
        {
            self.before.side = drive.side;
            let share = drive.twist.linear / self.rules.speed_mps;
            return Some(Steer::Drive { twist: drive.twist, share });
        }
        let clearance_m = self.clearance_to_back_out(free, &place)?;
        let slow =
            HeadingRules { speed_mps: BACK_OUT_SHARE * self.rules.speed_mps, clearance_m, ..self.heading };
        let drive = self.chooser.choose_heading(free, &start, goal_rad, self.before.side, &slow)?;
        Some(Steer::BackOut(drive.twist))
    }

    /// Where something is nearer than it should be, but not in the robot: what may be kept while driving away from it.
    fn clearance_to_back_out(&self, free: &FreeDistances, start: &Start) -> Option<f64> {
        let clearance_m = free.clearance_m(start.position_m);
        (self.radius_m..self.rules.clearance_m)
            .contains(&clearance_m)
            .then(|| (clearance_m - ROUNDING_M).max(self.radius_m))
    }

    /// A turn towards the direction that is free farthest, of several the one nearest to the goal; `None` where the robot looks
    /// there already, or nothing is free.
    fn turn(&self, free: &FreeDistances, moved: &Pose2, goal_rad: f64) -> Option<Steer> {
        let distances = free.free_m().iter().copied().enumerate();
        let aside = |sector: usize| wrap_angle(free.middle(sector) - goal_rad).abs();
        let (sector, _) = distances
            .max_by(|a, b| a.1.total_cmp(&b.1).then(aside(b.0).total_cmp(&aside(a.0))))
            .filter(|(_, free_m)| *free_m > self.rules.clearance_m)?;
        let missing = wrap_angle(free.middle(sector) - moved.theta);
        let most = self.heading.turn_radps;
        (missing.abs() > FACING_RAD).then(|| Steer::Turn((GAIN_PER_S * missing).clamp(-most, most)))
    }
}

fn start(moved: &Pose2, twist: &Twist) -> Start {
    Start { position_m: moved.position().coords, velocity_mps: moved.rotate_vector(velocity(twist)) }
}
