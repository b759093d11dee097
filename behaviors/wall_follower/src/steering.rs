//! Proposals: along the corridor, away from a near wall, and back at the corridor's end.

use yamabico_core::camera::Calibration;
use yamabico_core::geometry::{Pose2, Twist, angle_difference};
use yamabico_core::message::{Axes, Proposal, Reason};

use crate::WallFollower;
use crate::centering::{align_in_place, allowed_speed};
use crate::config::AtEnd;
use crate::corridor_track::Estimate;

/// Heading error (rad) above which the robot turns back in place before it drives.
const TURN_FIRST_RAD: f64 = 1.05;
/// Heading (rad) away from a wall that is too near.
const STEER_AWAY_RAD: f64 = 0.262;
/// Speed while steering away from a near wall, and along a corridor out of view, m/s.
pub(crate) const CREEP_MPS: f64 = 0.1;
/// Probability of a corridor below which a wall ahead is no end of it.
const IN_CORRIDOR: f64 = 0.5;
/// Share of the cruising speed before a wall whose distance is not measured.
const UNMEASURED_WALL_SHARE: f64 = 0.5;
/// Heading from the opposite direction at which a turn at the end of the corridor ends, rad.
const TURNED_RAD: f64 = 0.1;

impl WallFollower {
    /// Share of the cruising speed that the evidence allows.
    pub(crate) fn speed_share(&self) -> f64 {
        self.evidence.map_or(1.0, |(probability, action)| action.speed_share(probability))
    }

    /// Proposes to follow the corridor at `share` of the cruising speed, less where it is less probable or a wall is ahead.
    pub(crate) fn follow(&self, estimate: &Estimate, share: f64) -> Proposal {
        let probability = self.evidence.map_or(1.0, |(probability, _)| probability);
        let limit = self.ahead.speed_limit(self.config.speed_mps, self.config.stop_ahead_m);
        let is_unmeasured = self.ahead.range_m().is_some() && !self.sight.knows_distances();
        let limit =
            if is_unmeasured { limit.min(UNMEASURED_WALL_SHARE * self.config.speed_mps) } else { limit };
        if limit <= 0.0 {
            let reason = if probability < IN_CORRIDOR { Reason::WallAhead } else { Reason::CorridorEnds };
            let range_m = self.ahead.range_m().unwrap_or(0.0);
            return Proposal::abstain(reason).with_note(format_args!("wall ahead at {range_m:.2} m"));
        }
        let proposal = self.steer(estimate, share, limit);
        match self.evidence {
            Some((probability, _)) => proposal.with_confidence(probability),
            None => proposal,
        }
    }

    /// Proposes to steer by the estimate, at `share` of the cruising speed and at most `limit` m/s.
    fn steer(&self, estimate: &Estimate, share: f64, limit: f64) -> Proposal {
        let walls = &estimate.walls;
        let clearance_m = walls.nearest_m() - self.radius_m;
        if estimate.heading.abs() > TURN_FIRST_RAD || share <= 0.0 {
            return turn_in_place(estimate.heading, 0.0, self.config.max_turn_radps)
                .with_reason(Reason::EdgeOn);
        }
        if clearance_m < self.config.near_wall_m {
            return self.steer_away(estimate, clearance_m, share, limit);
        }
        let lateral_m = walls.lateral_left_of_target(estimate.width_m, self.config.single_wall_m);
        let astray = self.law.astray(estimate.heading, lateral_m);
        let speed = share * allowed_speed(self.config.speed_mps, astray, clearance_m);
        let speed = speed.min(limit);
        let turn = self.law.turn_rate(speed, estimate.heading, lateral_m);
        let reason = match (walls.left_m, walls.right_m) {
            (Some(_), Some(_)) => Reason::Nominal,
            (Some(_), None) => Reason::OneWallLeft,
            (None, Some(_)) => Reason::OneWallRight,
            (None, None) => match self.sight.camera().calibration {
                Calibration::Measured => Reason::NoWall,
                Calibration::Guessed => Reason::NoHeightCalibration,
            },
        };
        let proposal = Proposal::drive(Axes::PLANAR, Twist::planar(speed, turn))
            .with_reason(reason)
            .with_confidence(presumed_confidence(estimate));
        let degrees = estimate.heading.to_degrees();
        if self.is_mount_wrong {
            proposal.with_note(format_args!("heading {degrees:+.1} deg; mount or calibration is wrong"))
        } else {
            proposal.with_note(format_args!("heading {degrees:+.1} deg, {lateral_m:+.2} m left of the line"))
        }
    }

    /// Proposes to steer away from a near wall, and to turn in place first if it is very near.
    fn steer_away(&self, estimate: &Estimate, clearance_m: f64, share: f64, limit: f64) -> Proposal {
        let left_m = estimate.walls.left_m.map_or(f64::INFINITY, f64::abs);
        let is_left = left_m <= estimate.walls.nearest_m();
        let target = if is_left { -STEER_AWAY_RAD } else { STEER_AWAY_RAD };
        let leads_away = estimate.heading * target.signum() > 0.5 * STEER_AWAY_RAD;
        let turn = align_in_place(estimate.heading, target, self.config.max_turn_radps);
        let speed = if clearance_m < self.config.stop_wall_m && !leads_away {
            0.0
        } else {
            (share * self.config.speed_mps.min(CREEP_MPS)).min(limit)
        };
        Proposal::drive(Axes::PLANAR, Twist::planar(speed, turn))
            .uncoupled()
            .with_reason(Reason::WallNear)
            .with_note(format_args!("wall at {clearance_m:.2} m"))
    }

    /// Proposes to drive on slowly from the heading `from` toward `to` (rad, odometry frame), along a corridor out of view; if that is far
    /// off, to turn in place first.
    pub(crate) fn creep_along(&self, from: f64, to: f64) -> Proposal {
        let largest_radps = self.config.max_turn_radps;
        let proposal = if angle_difference(from, to).abs() > STEER_AWAY_RAD {
            turn_in_place(from, to, largest_radps)
        } else {
            let speed = self.config.speed_mps.min(CREEP_MPS);
            Proposal::drive(Axes::PLANAR, Twist::planar(speed, align_in_place(from, to, largest_radps)))
        };
        proposal
            .with_reason(Reason::Searching)
            .with_note(format_args!("creeps on in the direction of the corridor"))
    }

    /// Proposes to turn back at the end of the corridor, if that is configured and the robot stands before a wall.
    pub(crate) fn turn_at_end(
        &mut self,
        pose: Option<Pose2>,
        estimate: Option<&Estimate>,
    ) -> Option<Proposal> {
        let pose = pose.filter(|_| self.config.at_end == AtEnd::Turn)?;
        if self.turning_to.is_none() {
            let at_wall = self.ahead.range_m().is_some_and(|range_m| range_m <= self.config.stop_ahead_m);
            let heading = estimate.filter(|_| at_wall)?.heading;
            self.turning_to = Some(pose.theta - heading + std::f64::consts::PI);
        }
        let target = self.turning_to?;
        if angle_difference(target, pose.theta).abs() > TURNED_RAD {
            let turn = turn_in_place(pose.theta, target, self.config.max_turn_radps);
            return Some(turn.with_reason(Reason::CorridorEnds));
        }
        self.turning_to = None;
        self.ahead.forget();
        self.direction.forget();
        self.track.lose();
        self.sight.forget();
        None
    }
}

/// Proposes a turn in place toward `target`. Uncoupled: it continues under a halt of translation only.
pub(crate) fn turn_in_place(heading: f64, target: f64, largest_radps: f64) -> Proposal {
    Proposal::drive(Axes::PLANAR, Twist::planar(0.0, align_in_place(heading, target, largest_radps)))
        .uncoupled()
}

/// Confidence of the method that does not judge, by the uncertainty of the heading.
pub(crate) fn presumed_confidence(estimate: &Estimate) -> f64 {
    1.0 / (1.0 + (estimate.heading_sigma / 0.02).powi(2))
}
