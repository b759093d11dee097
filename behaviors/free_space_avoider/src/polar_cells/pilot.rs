//! Maneuver of the robot from free distances, for holonomic and nonholonomic drives.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use yamabico_core::behavior::ParameterError;
use yamabico_core::geometry::{Pose2, Twist, wrap_angle};
use yamabico_core::message::Axis;
use yamabico_core::sensor::{MountedMirror, Robot};
use yamabico_core::time::Time;

use super::avoider::velocity;
use crate::config::{Config, VelocityRule};
use crate::direction::trajectories::stop_clearance_m;
use crate::direction::{
    ChoiceRules, Chooser, FreeDistances, HeadingRules, PreviousChoice, Rollout, Start, Velocity,
};
use crate::stopping::COMMAND_S;

/// Time step at which trajectories of a holonomic robot are checked, s.
const CHECK_STEP_S: f64 = 0.02;
/// Time step at which a nonholonomic robot is simulated, s.
const SIMULATION_STEP_S: f64 = 0.04;
/// Time after which a simulated robot brakes, s.
const HORIZON_S: f64 = 2.0;
/// Turn rate per heading error, 1/s.
const GAIN_PER_S: f64 = 4.0;
/// Minimum deviation that a change of sides must save, rad.
const SIDE_CHANGE_RAD: f64 = 0.5;
/// Additional clearance required of a direction nearer to the goal than the previous one, m.
const NEARER_M: f64 = 0.03;
/// Deviation from the direction with the largest free distance below which the robot does not turn to it, rad.
const FACING_RAD: f64 = 0.15;
/// Minimum speed of the approach to the goal, m/s.
const MIN_SPEED_MPS: f64 = 0.02;
/// Share of the speed with which the robot backs out.
const BACK_OUT_SHARE: f64 = 0.25;
/// Tolerance of the clearance while backing out, m.
const ROUNDING_M: f64 = 1e-3;

/// Maneuver of the robot until the next proposal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Maneuver {
    /// Drive.
    Drive {
        /// Twist in the robot frame.
        twist: Twist,
        /// Share of the cruising speed, 0 to 1.
        share: f64,
    },
    /// Drive away from an obstacle that is nearer than the clearance.
    BackOut(Twist),
    /// Turn in place, rad/s, positive to the left.
    Turn(f64),
    /// Stop: no direction is free.
    Wait {
        /// Time without a free direction, s.
        blocked_s: f64,
    },
    /// Stop: no direction has been free for longer than the timeout.
    Blocked {
        /// Time without a free direction, s.
        blocked_s: f64,
    },
    /// Brake with the maximum deceleration: a normal stop ends too near an obstacle.
    Brake,
}

/// Planner of maneuvers. Remembers the previous choice and the time since when no direction is free.
#[derive(Clone, Debug)]
pub struct Pilot {
    chooser: Chooser,
    rules: ChoiceRules,
    heading: HeadingRules,
    is_holonomic: bool,
    radius_m: f64,
    blocked_timeout_s: f64,
    previous: PreviousChoice,
    blocked_since: Option<Time>,
}

impl Pilot {
    /// Creates the pilot for a robot with a mirror camera.
    ///
    /// # Errors
    /// An acceleration or deceleration of the robot is not positive and finite.
    pub fn new(config: &Config, robot: &Robot, camera: &MountedMirror) -> Result<Self, ParameterError> {
        let limits = &robot.limits;
        let weaker = |axis: usize| limits.acceleration[axis].min(limits.deceleration[axis]);
        let is_holonomic = robot.axes.contains(Axis::Lateral);
        let along = if is_holonomic { weaker(0).min(weaker(1)) } else { weaker(0) };
        let turning = weaker(2);
        if !(along > 0.0 && along.is_finite() && (is_holonomic || turning > 0.0 && turning.is_finite())) {
            return Err(ParameterError::new(
                "",
                "needs positive, finite accelerations and decelerations: correct the robot's limits",
            ));
        }
        // The jerk limit delays braking by half the time in which the deceleration builds up.
        let build_up_s = along / limits.jerk[0];
        let delay_s = if build_up_s.is_finite() { 0.5 * build_up_s } else { 0.0 };
        let clearance_m = robot.radius_m + config.margin_m;
        let speed_mps = config.speed_mps.min(limits.speed[0]);
        let rules = ChoiceRules {
            speed_mps,
            acceleration_mps2: along,
            clearance_m,
            step_s: CHECK_STEP_S,
            reaction_s: camera.period_s + COMMAND_S + delay_s,
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
            step_s: SIMULATION_STEP_S,
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
            blocked_timeout_s: config.blocked_timeout_s,
            previous: PreviousChoice::default(),
            blocked_since: None,
        })
    }

    /// Chooses the maneuver of a robot that has `moved` since the capture of the image and now moves with `twist`. The
    /// goal is a direction (rad, robot frame) and a distance (m).
    pub fn steer(
        &mut self,
        free: &FreeDistances,
        moved: &Pose2,
        twist: &Twist,
        (goal_rad, distance_m): (f64, f64),
        now: Time,
    ) -> Maneuver {
        let goal_speed_mps = (2.0 * self.rules.acceleration_mps2 * distance_m).sqrt().max(MIN_SPEED_MPS);
        let speed_mps = self.rules.speed_mps.min(goal_speed_mps);
        let goal_in_frame_rad = goal_rad + moved.theta;
        let found = if self.is_holonomic {
            self.steer_sideways(free, moved, twist, goal_in_frame_rad, speed_mps)
        } else {
            self.steer_ahead(free, moved, twist, goal_in_frame_rad, speed_mps)
        };
        if let Some(maneuver) = found {
            self.blocked_since = None;
            return maneuver;
        }
        let blocked_s = now.seconds_after(*self.blocked_since.get_or_insert(now));
        let start = start(moved, twist);
        let is_moving = start.velocity_mps.norm() > MIN_SPEED_MPS;
        if is_moving && stop_clearance_m(free, &start, &self.rules) < self.radius_m {
            return Maneuver::Brake;
        }
        if !self.is_holonomic
            && !is_moving
            && let Some(turn) = self.turn(free, moved, goal_in_frame_rad)
        {
            return turn;
        }
        if blocked_s < self.blocked_timeout_s {
            Maneuver::Wait { blocked_s }
        } else {
            Maneuver::Blocked { blocked_s }
        }
    }

    fn steer_sideways(
        &mut self,
        free: &FreeDistances,
        moved: &Pose2,
        twist: &Twist,
        goal_rad: f64,
        speed_mps: f64,
    ) -> Option<Maneuver> {
        let start = start(moved, twist);
        let rules = ChoiceRules { speed_mps, ..self.rules };
        let to_robot = |velocity: Vector2<f64>| {
            let velocity = Pose2::new(0.0, 0.0, -moved.theta).rotate_vector(velocity);
            Twist::new(velocity.x, velocity.y, 0.0)
        };
        if let Some(choice) = self.chooser.choose_speed(free, &start, goal_rad, &self.previous, &rules) {
            self.previous = PreviousChoice { side: choice.side, direction_rad: Some(choice.direction_rad) };
            let share = choice.velocity_mps.norm() / self.rules.speed_mps;
            return Some(Maneuver::Drive { twist: to_robot(choice.velocity_mps), share });
        }
        let clearance_m = self.clearance_to_back_out(free, &start)?;
        let slow =
            ChoiceRules { speed_mps: BACK_OUT_SHARE * self.rules.speed_mps, clearance_m, ..self.rules };
        let choice = self.chooser.choose(free, &start, goal_rad, &self.previous, &slow)?;
        Some(Maneuver::BackOut(to_robot(choice.velocity_mps)))
    }

    fn steer_ahead(
        &mut self,
        free: &FreeDistances,
        moved: &Pose2,
        twist: &Twist,
        goal_rad: f64,
        speed_mps: f64,
    ) -> Option<Maneuver> {
        let now = start(moved, twist);
        let start = Rollout::new(now.position_m, moved.theta, twist.linear, twist.angular);
        let rules = HeadingRules { speed_mps, ..self.heading };
        if let Some(choice) =
            self.chooser.choose_heading_speed(free, &start, goal_rad, self.previous.side, &rules)
        {
            self.previous.side = choice.side;
            let share = choice.twist.linear / self.rules.speed_mps;
            return Some(Maneuver::Drive { twist: choice.twist, share });
        }
        let clearance_m = self.clearance_to_back_out(free, &now)?;
        let slow =
            HeadingRules { speed_mps: BACK_OUT_SHARE * self.rules.speed_mps, clearance_m, ..self.heading };
        let choice = self.chooser.choose_heading(free, &start, goal_rad, self.previous.side, &slow)?;
        Some(Maneuver::BackOut(choice.twist))
    }

    /// Returns the clearance to keep while backing out; `None` unless an obstacle is nearer than the required clearance
    /// but outside the robot.
    fn clearance_to_back_out(&self, free: &FreeDistances, start: &Start) -> Option<f64> {
        let clearance_m = free.clearance_m(start.position_m);
        (self.radius_m..self.rules.clearance_m)
            .contains(&clearance_m)
            .then(|| (clearance_m - ROUNDING_M).max(self.radius_m))
    }

    /// Returns a turn toward the direction with the largest free distance, among equal ones the nearest to the goal.
    /// `None` if the robot already faces it or no direction is free.
    fn turn(&self, free: &FreeDistances, moved: &Pose2, goal_rad: f64) -> Option<Maneuver> {
        let distances = free.free_m().iter().copied().enumerate();
        let aside = |sector: usize| wrap_angle(free.middle(sector) - goal_rad).abs();
        let (sector, _) = distances
            .max_by(|a, b| a.1.total_cmp(&b.1).then(aside(b.0).total_cmp(&aside(a.0))))
            .filter(|(_, free_m)| *free_m > self.rules.clearance_m)?;
        let error_rad = wrap_angle(free.middle(sector) - moved.theta);
        let max_radps = self.heading.turn_radps;
        (error_rad.abs() > FACING_RAD)
            .then(|| Maneuver::Turn((GAIN_PER_S * error_rad).clamp(-max_radps, max_radps)))
    }
}

fn start(moved: &Pose2, twist: &Twist) -> Start {
    Start { position_m: moved.position().coords, velocity_mps: moved.rotate_vector(velocity(twist)) }
}
