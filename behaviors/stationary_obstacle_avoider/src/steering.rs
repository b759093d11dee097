//! What the avoider proposes in each state: silence, a turn, a drive through a passage, a halt.

use yamabico_core::geometry::{Pose2, Twist, angle_difference};
use yamabico_core::message::{Axes, Proposal, Reason};
use yamabico_core::time::Time;

use crate::StationaryObstacleAvoider;
use crate::halt_state_machine::{Look, State};
use crate::safe_passage::PLANE_M;
use crate::way::{Surroundings, aim};

/// Turn rate per radian of heading error, 1/s.
const TURN_GAIN: f64 = 1.8;
/// Turned to a direction of the search, rad.
const SEARCHED_RAD: f64 = 0.06;
/// Without a look at a picture for longer (s), vision tells nothing.
const LOOK_STALE_S: f64 = 1.0;

impl StationaryObstacleAvoider {
    /// What it proposes in the state that it is in.
    pub(crate) fn proposal(&mut self, now: Time) -> Proposal {
        let evidence = self.looked.or(self.sonar.newest()).unwrap_or(now);
        let robot = self.robot();
        let state = self.order.state;
        let translation = Axes::LINEAR.union(Axes::LATERAL);
        let proposal = match (state, robot) {
            (State::Follow | State::Rejoin, _) => self.follow(now),
            (State::Lost, _) => Proposal::halt(translation, self.why_lost()),
            (State::Avoid, Some(robot)) => self.avoid(&robot),
            (State::Search, Some(robot)) => self.turn_to_look(&robot, now),
            (State::Blocked, _) => Proposal::halt(Axes::ALL, Reason::PassageBlocked),
            (State::Relook, _) => Proposal::halt(Axes::ALL, Reason::Searching),
            _ => Proposal::halt(Axes::ALL, Reason::Echo),
        };
        // A halt, a limit or an abstention rests on there being nothing better.
        let rests_on_looks = matches!(state, State::Avoid);
        let proposal = proposal.with_evidence(if rests_on_looks { evidence } else { now });
        if state == State::Avoid || state == State::Follow {
            proposal
        } else {
            proposal.with_note(format_args!("{}", state.as_str()))
        }
    }

    /// Others drive; slowly where vision tells nothing.
    fn follow(&self, now: Time) -> Proposal {
        let is_blind = self.looked.is_none_or(|looked| now.seconds_after(looked) > LOOK_STALE_S);
        let why = match self.trouble {
            Some(reason) => Some(reason),
            None if is_blind => Some(Reason::StaleInput),
            None => None,
        };
        match why {
            Some(reason) => {
                let limits = Twist::planar(self.config.blind_speed_mps, f64::INFINITY);
                Proposal::limit(Axes::LINEAR, Twist { angular: 0.0, ..limits }, reason)
                    .with_note(format_args!("vision tells nothing: {reason}"))
            }
            None => Proposal::abstain(Reason::Clear),
        }
    }

    /// Towards the target heading, as far as walls and things allow.
    fn avoid(&mut self, robot: &Pose2) -> Proposal {
        let target = self.order.target_heading.unwrap_or(robot.theta);
        let off = angle_difference(target, robot.theta);
        if self.order.v_zero {
            return turn(off, self.config.largest_turn_radps)
                .because(Reason::Nominal)
                .with_note(format_args!("turns to a passage at {:+.0} deg", off.to_degrees()));
        }
        let around = Surroundings {
            robot,
            map: self.detector.map(),
            things: &self.things,
            floor: &self.floor,
            path: &self.path,
        };
        let wanted_m = off.clamp(-0.8, 0.8).tan() * PLANE_M;
        let Some(aim) = aim(&around, wanted_m, self.lean_m, &self.room, &mut self.passage) else {
            return turn(off, self.config.largest_turn_radps)
                .because(Reason::PassageBlocked)
                .with_note(format_args!("no way on at {:+.0} deg", off.to_degrees()));
        };
        let bearing = aim.bearing();
        let fastest =
            if self.trouble.is_some() { self.config.blind_speed_mps } else { self.config.speed_mps };
        let speed = fastest * (1.0 - 2.0 * bearing.abs()).clamp(0.2, 1.0);
        let rate =
            (TURN_GAIN * bearing).clamp(-self.config.largest_turn_radps, self.config.largest_turn_radps);
        Proposal::drive(Axes::PLANAR, Twist::planar(speed, rate)).with_note(format_args!(
            "past {} things, {:+.0} deg",
            self.things.confirmed().count(),
            bearing.to_degrees()
        ))
    }

    /// The next direction of the search.
    fn turn_to_look(&mut self, robot: &Pose2, now: Time) -> Proposal {
        let along = *self.search.along.get_or_insert(robot.theta);
        let off = angle_difference(along + self.search.direction(), robot.theta);
        if off.abs() <= SEARCHED_RAD {
            self.search.arrive(now);
        }
        turn(off, self.config.largest_turn_radps).because(Reason::Searching)
    }

    /// Goes on with the search where no picture of a direction can be judged.
    pub(crate) fn leave_blind_direction(&mut self, now: Time) {
        if self.order.state == State::Search && self.search.is_blind(now) {
            self.pending =
                Some(Look { image_s: now.as_secs_f64(), valid: false, clear: false, bearing: None });
        }
    }

    fn why_lost(&self) -> Reason {
        match self.localized {
            None => Reason::NoInput,
            Some(localized) if !localized.is_usable => Reason::Lost,
            Some(_) => Reason::StaleInput,
        }
    }
}

/// A turn where the robot stands; keeps turning where a halt names only translation.
fn turn(off: f64, largest_radps: f64) -> Proposal {
    let rate = if off.is_finite() { (TURN_GAIN * off).clamp(-largest_radps, largest_radps) } else { 0.0 };
    Proposal::drive(Axes::PLANAR, Twist::planar(0.0, rate)).uncoupled()
}
