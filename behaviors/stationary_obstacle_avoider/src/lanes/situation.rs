//! Input of a step of the drive, and what follows from it alone: whether to stand, to go on, and how fast.

use nalgebra::Point2;
use yamabico_core::geometry::{Pose2, Twist, angle_difference};

use super::planner::Plan;
use super::way_out::Leg;

/// Free length at which the robot stands, and over which it slows down, m.
const STAND_M: f64 = 0.35;
const SLOW_M: f64 = 0.7;
/// Range of an echo ahead from which the speed is reduced, m, and the smallest share.
const SLOW_ECHO_M: f64 = 1.0;
const MIN_ECHO_SHARE: f64 = 0.35;
/// Range of an echo aside that is too near, m.
const NEAR_ASIDE_M: f64 = 0.25;
/// Bearing of the aim above which a robot that waits before a free lane turns in place, rad.
const TURN_WAITING_RAD: f64 = 0.15;
/// Length of the arc to the aim below which the robot turns in place instead, or stands if it looks there, m.
const SHORT_ARC_M: f64 = 0.12;
/// Turn rate per radian, 1/s.
const TURN_GAIN: f64 = 2.0;
/// Share of the speed where there is little room beside the lane.
const NO_ROOM_SHARE: f64 = 0.7;
/// Distance by which an echo must be beyond the gate before the robot goes on, m, and the free length it needs.
const RELEASE_M: f64 = 0.12;
const RELEASE_FREE_M: f64 = 0.8;
/// Offset from the path up to which the drive is handed over, m.
const HAND_OVER_M: f64 = 0.06;

/// Input of a step. Positions are in the robot frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Situation {
    /// Current time, s.
    pub now_s: f64,
    pub plan: Plan,
    /// Point of the lane to steer for, m.
    pub aim: Point2<f64>,
    /// Pose by odometry.
    pub odometry: Pose2,
    /// Direction of the path, robot frame, rad.
    pub path_heading: f64,
    /// Ranges of the nearest echoes, m; infinite without one.
    pub echo_ahead_m: f64,
    pub echo_left_m: f64,
    pub echo_right_m: f64,
    /// True if no scan arrives.
    pub is_sonar_silent: bool,
    /// Range of an echo ahead that makes the robot stand, m.
    pub gate_m: f64,
    /// Distance kept from obstacles, m.
    pub clearance_m: f64,
    /// Distance that is free straight ahead, m.
    pub straight_m: f64,
    /// Distance that is free along the arc to the aim, m.
    pub arc_m: f64,
    /// Maximum speed, m/s, and turn rate, rad/s.
    pub speed_mps: f64,
    pub max_turn_radps: f64,
    /// True if something that moves is near the path ahead.
    pub is_crossed: bool,
    /// True if the robot is at the end of its path: an obstacle ahead does not matter.
    pub is_arrived: bool,
    /// Share of the places to the left and to the right of the path where the robot could stand.
    pub room: [f64; 2],
    /// First leg of a route around what blocks all lanes, if the robot looks for one and there is one.
    pub way_out: Option<Leg>,
}

impl Situation {
    /// True if an echo ahead, or a silent sonar, makes the robot stand.
    pub fn must_stand(&self) -> bool {
        self.is_sonar_silent || self.echo_ahead_m < self.gate_m
    }

    /// Side of what is too near aside, 1 left, -1 right; `None` if nothing is.
    pub fn near_side(&self) -> Option<f64> {
        let side = if self.echo_right_m < self.echo_left_m { -1.0 } else { 1.0 };
        (self.echo_left_m.min(self.echo_right_m) < NEAR_ASIDE_M).then_some(side)
    }

    /// True if the robot may leave the place where it waits.
    pub fn is_released(&self) -> bool {
        !self.is_sonar_silent
            && self.echo_ahead_m > self.gate_m + RELEASE_M
            && self.plan.best.free_m > RELEASE_FREE_M
            && !self.is_aim_blocked()
    }

    /// True if the robot looks at its aim, but would touch something on the way.
    pub fn is_aim_blocked(&self) -> bool {
        self.is_arc_short() && self.bearing().abs() < TURN_WAITING_RAD
    }

    /// Bearing of the aim, rad.
    pub fn bearing(&self) -> f64 {
        self.aim.y.atan2(self.aim.x)
    }

    /// True if something ahead makes the robot stand, but its lane is free and leads past it.
    pub fn is_beside_lane(&self) -> bool {
        !self.is_sonar_silent
            && self.must_stand()
            && self.plan.best.free_m > RELEASE_FREE_M
            && self.bearing().abs() > TURN_WAITING_RAD
    }

    /// Turn in place to the aim.
    pub fn turn_to_aim(&self) -> Twist {
        turn_by(self.bearing(), self.max_turn_radps)
    }

    /// True if the robot would touch something soon on the arc to its aim.
    pub fn is_arc_short(&self) -> bool {
        self.arc_m < SHORT_ARC_M
    }

    /// True if the path is free, so that other behaviors may drive.
    pub fn is_path_open(&self) -> bool {
        !self.is_arc_short()
            && self.plan.nominal.is_open(self.clearance_m)
            && self.plan.best.offset_m.abs() <= HAND_OVER_M
    }

    /// Share of the speed that the free length of the best lane, and an echo ahead, allow.
    pub fn share(&self) -> f64 {
        let free = ((self.plan.best.free_m - STAND_M) / SLOW_M).clamp(0.0, 1.0);
        let echo = (self.echo_ahead_m / SLOW_ECHO_M).clamp(MIN_ECHO_SHARE, 1.0);
        free * echo
    }

    /// Speed in the best lane, m/s.
    pub fn lane_mps(&self) -> f64 {
        let room = self.plan.best.room(self.clearance_m);
        self.speed_mps * self.share() * (NO_ROOM_SHARE + (1.0 - NO_ROOM_SHARE) * room)
    }
}

/// Turn in place by `angle` (rad, positive left), at most that fast (rad/s).
pub(super) fn turn_by(angle: f64, max_radps: f64) -> Twist {
    let rate = TURN_GAIN * angle_difference(angle, 0.0);
    Twist::planar(0.0, rate.clamp(-max_radps, max_radps))
}
