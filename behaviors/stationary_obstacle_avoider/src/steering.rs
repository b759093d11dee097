//! Proposals of the avoider in each state.

use yamabico_core::geometry::{Pose2, Twist, angle_difference};
use yamabico_core::message::{Axes, Proposal, Reason};
use yamabico_core::time::Time;

use crate::config::Config;
use crate::halt_state_machine::State;
use crate::passage_avoider::PassageAvoider;
use crate::safe_passage::PLANE_M;

/// Maximum speed in a passage, m/s.
const PASSAGE_MPS: f64 = 0.25;
/// Turn rate per radian of heading error, 1/s.
const TURN_GAIN: f64 = 1.8;
/// Heading error below which a direction of the search is reached, rad.
const DIRECTION_REACHED_RAD: f64 = 0.06;
/// Age of the newest evaluated frame above which the speed is limited, s.
const EVALUATION_STALE_S: f64 = 1.0;

impl PassageAvoider {
    /// Returns the proposal of the current state.
    pub(crate) fn proposal(&mut self, now: Time) -> Proposal {
        let evidence = self.evaluated.or(self.sonar.newest()).unwrap_or(now);
        let robot = self.robot();
        let state = self.order.state;
        let translation = Axes::LINEAR.union(Axes::LATERAL);
        let proposal = match (state, robot) {
            (State::Follow | State::Rejoin, _) => self.follow(now),
            // Without a map, no corridor in view is no reason to stand: another behavior may look for one.
            (State::Lost, _) if self.guidance.is_in_corridor() => self.creep(self.guidance.lost_reason()),
            (State::Lost, _) => Proposal::halt(translation, self.guidance.lost_reason()),
            (State::Avoid, Some(robot)) => self.avoid(&robot),
            (State::Search, Some(robot)) => self.turn_to_direction(&robot, now),
            (State::Blocked, _) => Proposal::halt(Axes::ALL, Reason::PassageBlocked),
            (State::Relook, _) => Proposal::halt(Axes::ALL, Reason::Searching),
            _ => Proposal::halt(Axes::ALL, self.halt_reason),
        };
        // Only a drive rests on the frame: evidence of the others is the present.
        let rests_on_frame = matches!(state, State::Avoid);
        let proposal = proposal.with_evidence(if rests_on_frame { evidence } else { now });
        if state == State::Avoid || state == State::Follow {
            proposal
        } else {
            proposal.with_note(format_args!("{}", state.as_str()))
        }
    }

    /// Abstains, or limits the speed if vision gives no result.
    fn follow(&self, now: Time) -> Proposal {
        let failure = match self.failure {
            Some(reason) => Some(reason),
            None if self.is_evaluation_stale(now) => Some(Reason::StaleInput),
            None => None,
        };
        match failure {
            Some(reason) => self.creep(reason),
            None if self.is_learned => Proposal::abstain(Reason::Clear),
            None => Proposal::abstain(Reason::Clear)
                .with_note(format_args!("no thresholds here: edges on the floor only")),
        }
    }

    /// Limits the speed because vision gives no result, for `reason`.
    fn creep(&self, reason: Reason) -> Proposal {
        Proposal::limit(Axes::LINEAR, Twist::planar(self.config.blind_speed_mps, 0.0), reason)
            .with_note(format_args!("no frame was evaluated: {reason}"))
    }

    /// Turns to the target heading, then drives through the passage nearest to it.
    fn avoid(&mut self, robot: &Pose2) -> Proposal {
        let target = self.order.target_heading.unwrap_or(robot.theta);
        let off = angle_difference(target, robot.theta);
        if self.order.v_zero {
            return turn(off, self.config.max_turn_radps)
                .with_reason(Reason::Nominal)
                .with_note(format_args!("turns to a passage at {:+.0} deg", off.to_degrees()));
        }
        let goal_m = off.clamp(-0.8, 0.8).tan() * PLANE_M;
        let Some(aim) = self.aim(robot, goal_m) else {
            return turn(off, self.config.max_turn_radps)
                .with_reason(Reason::PassageBlocked)
                .with_note(format_args!("no way on at {:+.0} deg", off.to_degrees()));
        };
        let bearing = aim.bearing();
        let Config { blind_speed_mps, speed_mps, .. } = self.config;
        let fastest = if self.failure.is_some() { blind_speed_mps } else { speed_mps.min(PASSAGE_MPS) };
        let speed = fastest * (1.0 - 2.0 * bearing.abs()).clamp(0.2, 1.0);
        let rate = (TURN_GAIN * bearing).clamp(-self.config.max_turn_radps, self.config.max_turn_radps);
        Proposal::drive(Axes::PLANAR, Twist::planar(speed, rate)).with_note(format_args!(
            "past {} things, {:+.0} deg",
            self.known_obstacles.confirmed().count(),
            bearing.to_degrees()
        ))
    }

    /// Turns to the next direction of the search.
    fn turn_to_direction(&mut self, robot: &Pose2, now: Time) -> Proposal {
        let along = *self.search.along.get_or_insert(robot.theta);
        let off = angle_difference(along + self.search.direction(), robot.theta);
        if off.abs() <= DIRECTION_REACHED_RAD {
            self.search.mark_reached(now);
        }
        turn(off, self.config.max_turn_radps).with_reason(Reason::Searching)
    }

    /// Passes an unusable vision result to the state machine if the current search direction gives no usable frame in
    /// time, or if no frame arrives where the robot stands.
    pub(crate) fn report_blindness(&mut self, now: Time) {
        let is_blind = match self.order.state {
            State::Search => self.search.advance_if_timed_out(now),
            State::Relook => self.is_evaluation_stale(now),
            _ => false,
        };
        if is_blind {
            self.pending = Some(self.unusable(now));
        }
    }

    /// Returns true if no frame was evaluated for a while.
    fn is_evaluation_stale(&self, now: Time) -> bool {
        self.evaluated.is_none_or(|evaluated| now.seconds_after(evaluated) > EVALUATION_STALE_S)
    }
}

/// Proposes to turn in place; the turn remains when another behavior halts only translation. `off`: heading error,
/// rad.
fn turn(off: f64, max_radps: f64) -> Proposal {
    let rate = if off.is_finite() { (TURN_GAIN * off).clamp(-max_radps, max_radps) } else { 0.0 };
    Proposal::drive(Axes::PLANAR, Twist::planar(0.0, rate)).uncoupled()
}
