//! The motion of each rung.

use yamabico_core::geometry::{Pose2, angle_difference, wrap_angle};
use yamabico_core::message::Twist;

use crate::config::{Config, Rung};
use crate::ladder::Attempt;
use crate::room::Room;
use crate::trail::Trail;

/// Angle at which a turn is complete, rad.
const ALIGNED_RAD: f64 = 0.05;
/// Turn rate per angle left, 1/s.
const TURN_GAIN: f64 = 3.0;
/// Time beyond the expected one after which a motion is given up, s.
const SLACK_S: f64 = 1.5;
/// Distance of the point on the trail to which the robot drives back, m.
const LOOK_BACK_M: f64 = 0.15;
/// Angle of that point from straight behind above which the robot turns in place first, rad.
const ASKEW_RAD: f64 = 0.6;
/// Clearance to keep between the footprint and an echo or obstacle, m.
const CLEAR_M: f64 = 0.15;

/// State of the robot that a maneuver needs.
#[derive(Debug)]
pub struct Surroundings<'a> {
    /// Pose, odometry frame.
    pub pose: Pose2,
    /// Time for which the robot has stood still, s.
    pub stood_s: f64,
    /// Room around the robot.
    pub room: Room,
    /// True while a halt stops the translation.
    pub is_held: bool,
    /// Path on which the robot came.
    pub trail: &'a mut Trail,
    /// 1 if `turn` turns to the left, -1 if to the right.
    pub side: f64,
}

/// Returns the twist of the attempt, `None` once it is over.
#[must_use]
pub fn twist(attempt: &Attempt, around: &mut Surroundings<'_>, config: &Config) -> Option<Twist> {
    let stand = |stood_s: f64, duration_s: f64| (stood_s < duration_s).then_some(Twist::ZERO);
    match attempt.rung {
        Rung::Wait => stand(around.stood_s, config.wait_s),
        Rung::LookAgain => stand(around.stood_s, config.look_s),
        Rung::Ask => stand(attempt.elapsed_s, config.ask_s),
        Rung::Turn => turn(attempt, &around.pose, around.side * config.turn_deg.to_radians(), config),
        Rung::BackOff => back_off(attempt, around, config),
        Rung::OtherSide => turn_to_other_side(attempt, &around.pose, around.side, config)
            .or_else(|| drive_ahead(attempt, around, config)),
    }
}

/// Returns true if the attempt is past its turn and drives ahead, which any halt ends; `side` as in [`Surroundings`].
#[must_use]
pub fn drives_ahead(attempt: &Attempt, pose: &Pose2, side: f64, config: &Config) -> bool {
    attempt.rung == Rung::OtherSide && turn_to_other_side(attempt, pose, side, config).is_none()
}

fn turn_to_other_side(attempt: &Attempt, pose: &Pose2, side: f64, config: &Config) -> Option<Twist> {
    turn(attempt, pose, -side * config.side_deg.to_radians(), config)
}

/// Turns in place by `angle_rad` from the beginning of the attempt.
fn turn(attempt: &Attempt, pose: &Pose2, angle_rad: f64, config: &Config) -> Option<Twist> {
    let left_rad = angle_rad - angle_difference(pose.theta, attempt.start.theta);
    let is_late = attempt.elapsed_s > angle_rad.abs() / config.turn_radps + SLACK_S;
    (left_rad.abs() > ALIGNED_RAD && !is_late && attempt.start.distance(pose) < CLEAR_M)
        .then(|| Twist::planar(0.0, turn_rate(left_rad, config)))
}

fn turn_rate(left_rad: f64, config: &Config) -> f64 {
    (TURN_GAIN * left_rad).clamp(-config.turn_radps, config.turn_radps)
}

/// Drives back along the trail, and not beyond its beginning.
fn back_off(attempt: &Attempt, around: &mut Surroundings<'_>, config: &Config) -> Option<Twist> {
    let is_late = attempt.elapsed_s > 2.0 * config.back_m / config.speed_mps + SLACK_S;
    let is_done = attempt.start.distance(&around.pose) >= config.back_m;
    if is_late || is_done || around.room.behind_m < CLEAR_M {
        return None;
    }
    let target = around.trail.pop_reached(&around.pose, LOOK_BACK_M)?;
    let to_target = target - around.pose.position();
    let behind_rad = wrap_angle(to_target.y.atan2(to_target.x) - around.pose.theta - std::f64::consts::PI);
    if behind_rad.abs() > ASKEW_RAD {
        return Some(Twist::planar(0.0, turn_rate(behind_rad, config)));
    }
    // The arc through the target has this curvature, whichever way it is driven.
    let curvature = -2.0 * behind_rad.sin() / to_target.norm();
    let turn_radps = (-config.speed_mps * curvature).clamp(-config.turn_radps, config.turn_radps);
    Some(Twist::planar(-config.speed_mps, turn_radps))
}

/// Drives straight ahead while there is room, the heading is that of the turn, and nothing halts.
fn drive_ahead(attempt: &Attempt, around: &Surroundings<'_>, config: &Config) -> Option<Twist> {
    let heading_rad = attempt.start.theta - around.side * config.side_deg.to_radians();
    if around.is_held || angle_difference(around.pose.theta, heading_rad).abs() > 2.0 * ALIGNED_RAD {
        return None;
    }
    let driven_m = attempt.start.distance(&around.pose);
    let turning_s = config.side_deg.to_radians() / config.turn_radps + SLACK_S;
    let is_late = attempt.elapsed_s > turning_s + config.side_m / config.speed_mps + SLACK_S;
    let left_m = config.side_m - driven_m;
    // Without a beam ahead the room is NaN, and there is none.
    (left_m > 0.0 && !is_late && around.room.ahead_m > left_m + CLEAR_M)
        .then(|| Twist::planar(config.speed_mps, 0.0))
}
