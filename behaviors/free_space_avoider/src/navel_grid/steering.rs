//! Hysteresis between decisions: prevents oscillation and endless turns.
//!
//! Differs from \[1\], which decides from each image alone.

use yamabico_core::time::Time;

use super::decision::{AHEAD_LIMIT, Passage, Side, freer_side, is_blocked};
use super::weights::Weights;

/// Weight ahead below which a turn ends.
const RELEASE_LIMIT: f64 = 30.0;
/// Time after which a turn may be reversed for any difference of the sides, s.
const REVERSAL_S: f64 = 2.0;
/// Difference of the side weights above which a turn is reversed at once.
const REVERSAL_WEIGHT: f64 = 20.0;
/// Maximum number of reversals until the robot drives forward; prevents oscillation in corners.
const MAX_REVERSALS: u32 = 1;
/// Difference of the side weights above which the robot veers while it drives.
const VEER_WEIGHT: f64 = 20.0;
/// Turn rate of a veer per unit of weight, rad/s.
const VEER_RADPS: f64 = 0.01;
/// Maximum turn rate of a veer, rad/s.
const MAX_VEER_RADPS: f64 = 0.2;
/// Minimum share of the cruising speed.
const MIN_SHARE: f64 = 0.3;
/// Total turn without a free path forward after which the robot is enclosed, rad.
const FULL_TURN_RAD: f64 = std::f64::consts::TAU;

/// Motion of the robot until the next frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Driving forward.
    Forward {
        /// Share of the cruising speed, 0.3 to 1.
        share: f64,
        /// Turn rate, rad/s, positive to the left.
        turn_radps: f64,
    },
    /// Turning in place.
    Turn(Side),
    /// Stopped: both sides are blocked.
    Stop,
    /// Stopped: a full turn has shown no free path.
    Enclosed,
}

/// Observation of the path ahead in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Observation {
    /// Weights of the obstacles, and state of the path.
    Seen(Weights, Passage),
    /// No information: too little contrast, or hardly any floor.
    Unclear,
}

/// State of the steering between frames.
#[derive(Clone, Debug)]
pub struct Steering {
    blocked_timeout_s: f64,
    motion: Motion,
    /// Side and start of the last turn.
    turn: Option<(Side, Time)>,
    /// Number of reversals since the robot last drove forward.
    reversals: u32,
    /// Angle turned since the robot last drove forward or reversed its turn, rad.
    turned_rad: f64,
    /// Time at which the robot stopped since both sides were blocked.
    stopped_at: Option<Time>,
}

impl Steering {
    /// Creates the steering of a stopped robot. Blocked on both sides, the robot looks around after
    /// `blocked_timeout_s`.
    #[must_use]
    pub fn new(blocked_timeout_s: f64) -> Self {
        Self {
            blocked_timeout_s,
            motion: Motion::Stop,
            turn: None,
            reversals: 0,
            turned_rad: 0.0,
            stopped_at: None,
        }
    }

    /// Returns the current motion.
    #[must_use]
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// Updates the motion with an observation at time `at`; `turned_rad` is the absolute turn since the observation
    /// before.
    pub fn step(&mut self, observation: Observation, turned_rad: f64, at: Time) -> Motion {
        if let Motion::Turn(_) = self.motion {
            self.turned_rad += turned_rad;
        }
        self.motion = match observation {
            Observation::Seen(weights, passage) if self.goes_forward(&weights, passage) => {
                self.turned_rad = 0.0;
                self.reversals = 0;
                self.stopped_at = None;
                forward(&weights)
            }
            _ if self.motion == Motion::Enclosed || self.turned_rad > FULL_TURN_RAD => Motion::Enclosed,
            Observation::Seen(weights, _) => self.turn_or_stop(&weights, at),
            // A turn in place needs no free floor ahead and may reveal some.
            Observation::Unclear if matches!(self.motion, Motion::Turn(_)) => self.motion,
            Observation::Unclear => Motion::Stop,
        };
        self.motion
    }

    fn goes_forward(&self, weights: &Weights, passage: Passage) -> bool {
        match self.motion {
            Motion::Turn(_) | Motion::Enclosed => weights.ahead < RELEASE_LIMIT && passage == Passage::Open,
            Motion::Forward { .. } | Motion::Stop => {
                weights.ahead < AHEAD_LIMIT && passage != Passage::Obstructed
            }
        }
    }

    fn turn_or_stop(&mut self, weights: &Weights, at: Time) -> Motion {
        if !matches!(self.motion, Motion::Turn(_)) && is_blocked(weights) {
            let stopped_at = *self.stopped_at.get_or_insert(at);
            if at.seconds_after(stopped_at) < self.blocked_timeout_s {
                return Motion::Stop;
            }
        }
        self.stopped_at = None;
        let freer = freer_side(weights, self.turn.map(|(side, _)| side));
        let side = match self.turn {
            Some((side, since)) if side != freer && !self.may_reverse(weights, since, at) => side,
            _ => freer,
        };
        let continues = matches!(self.motion, Motion::Turn(last) if last == side);
        if !continues {
            if matches!(self.motion, Motion::Turn(_)) {
                self.reversals += 1;
                self.turned_rad = 0.0;
            }
            self.turn = Some((side, at));
        }
        Motion::Turn(side)
    }

    fn may_reverse(&self, weights: &Weights, since: Time, at: Time) -> bool {
        let is_clear = (weights.right - weights.left).abs() > REVERSAL_WEIGHT;
        self.reversals < MAX_REVERSALS && (is_clear || at.seconds_after(since) >= REVERSAL_S)
    }
}

/// Returns the forward motion: the higher the weight ahead the slower, and away from the side with more obstacles.
fn forward(weights: &Weights) -> Motion {
    let difference = weights.left - weights.right;
    let veer = if difference.abs() > VEER_WEIGHT { VEER_RADPS * difference } else { 0.0 };
    Motion::Forward {
        share: (1.0 - weights.ahead / AHEAD_LIMIT).clamp(MIN_SHARE, 1.0),
        turn_radps: veer.clamp(-MAX_VEER_RADPS, MAX_VEER_RADPS),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(right: f64, left: f64, ahead: f64) -> Observation {
        let passage = if ahead < AHEAD_LIMIT { Passage::Open } else { Passage::Obstructed };
        Observation::Seen(Weights { right, left, ahead }, passage)
    }

    fn at(seconds: f64) -> Time {
        Time::from_secs_f64(seconds)
    }

    #[test]
    fn forward_slows_down_and_veers_away() {
        let mut steering = Steering::new(3.0);
        let full = Motion::Forward { share: 1.0, turn_radps: 0.0 };
        assert_eq!(steering.step(seen(10.0, 0.0, 0.0), 0.0, at(0.0)), full);
        let Motion::Forward { share, turn_radps } = steering.step(seen(35.0, 10.0, 20.0), 0.0, at(0.1))
        else {
            panic!("{:?}", steering.motion());
        };
        assert!((share - 0.5).abs() < 1e-12 && (turn_radps + 0.25).abs() < 0.06, "{share}, {turn_radps}");
        let slowest = Motion::Forward { share: 0.3, turn_radps: 0.2 };
        assert_eq!(steering.step(seen(0.0, 90.0, 39.0), 0.0, at(0.2)), slowest);
    }

    #[test]
    fn a_turn_ends_below_the_lower_limit_and_with_additional_clearance() {
        let mut steering = Steering::new(3.0);
        assert_eq!(steering.step(seen(50.0, 20.0, 60.0), 0.0, at(0.0)), Motion::Turn(Side::Right));
        assert_eq!(steering.step(seen(30.0, 20.0, 35.0), 0.0, at(0.1)), Motion::Turn(Side::Right));
        let narrow = Observation::Seen(Weights { right: 9.0, left: 2.0, ahead: 10.0 }, Passage::Narrow);
        assert_eq!(steering.step(narrow, 0.0, at(0.2)), Motion::Turn(Side::Right));
        assert!(matches!(steering.step(seen(9.0, 2.0, 29.0), 0.0, at(0.3)), Motion::Forward { .. }));
        assert!(matches!(steering.step(narrow, 0.0, at(0.4)), Motion::Forward { .. }));
    }

    #[test]
    fn a_turn_is_reversed_late_or_for_a_clear_reason() {
        let mut steering = Steering::new(3.0);
        steering.step(seen(50.0, 40.0, 60.0), 0.0, at(0.0));
        assert_eq!(steering.step(seen(40.0, 50.0, 60.0), 0.0, at(0.5)), Motion::Turn(Side::Right));
        assert_eq!(steering.step(seen(40.0, 61.0, 60.0), 0.0, at(0.6)), Motion::Turn(Side::Left));
        let mut steering = Steering::new(3.0);
        steering.step(seen(50.0, 40.0, 60.0), 0.0, at(0.0));
        assert_eq!(steering.step(seen(40.0, 50.0, 60.0), 0.0, at(1.9)), Motion::Turn(Side::Right));
        assert_eq!(steering.step(seen(40.0, 50.0, 60.0), 0.0, at(2.0)), Motion::Turn(Side::Left));
    }

    #[test]
    fn the_robot_does_not_oscillate_in_a_corner() {
        let mut steering = Steering::new(3.0);
        let mut turns = Vec::new();
        for i in 0..30 {
            let heavy_right = if i % 2 == 0 { seen(70.0, 30.0, 60.0) } else { seen(30.0, 70.0, 60.0) };
            turns.push(steering.step(heavy_right, 0.1, at(2.5 * f64::from(i))));
        }
        let reversals = turns.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert_eq!(reversals, 1);
        assert!(matches!(steering.step(seen(0.0, 0.0, 0.0), 0.0, at(80.0)), Motion::Forward { .. }));
        assert_eq!(steering.step(seen(30.0, 70.0, 60.0), 0.0, at(80.1)), Motion::Turn(Side::Left));
        assert_eq!(steering.step(seen(70.0, 30.0, 60.0), 0.0, at(80.2)), Motion::Turn(Side::Right));
    }

    #[test]
    fn blocked_on_both_sides_it_stops_and_then_looks_around() {
        let mut steering = Steering::new(3.0);
        assert_eq!(steering.step(seen(90.0, 85.0, 120.0), 0.0, at(0.0)), Motion::Stop);
        assert_eq!(steering.step(seen(90.0, 85.0, 120.0), 0.0, at(2.9)), Motion::Stop);
        assert_eq!(steering.step(seen(90.0, 85.0, 120.0), 0.0, at(3.0)), Motion::Turn(Side::Right));
        assert_eq!(steering.step(seen(90.0, 85.0, 120.0), 0.0, at(3.1)), Motion::Turn(Side::Right));
    }

    #[test]
    fn a_full_turn_without_a_free_path_ends_the_turn() {
        let mut steering = Steering::new(3.0);
        steering.step(seen(50.0, 20.0, 60.0), 0.0, at(0.0));
        for i in 1..=7 {
            let unclear = if i % 2 == 0 { Observation::Unclear } else { seen(50.0, 20.0, 60.0) };
            let motion = steering.step(unclear, 0.9, at(f64::from(i)));
            assert_eq!(motion == Motion::Enclosed, 0.9 * f64::from(i) > FULL_TURN_RAD, "{i}: {motion:?}");
        }
        assert_eq!(steering.step(seen(50.0, 20.0, 60.0), 0.0, at(9.0)), Motion::Enclosed);
        assert!(matches!(steering.step(seen(0.0, 0.0, 5.0), 0.0, at(9.1)), Motion::Forward { .. }));
    }

    #[test]
    fn an_unclear_image_stops_the_robot_and_starts_no_turn() {
        let mut steering = Steering::new(3.0);
        steering.step(seen(0.0, 0.0, 0.0), 0.0, at(0.0));
        for i in 0..100 {
            assert_eq!(steering.step(Observation::Unclear, 0.0, at(0.1 * f64::from(i))), Motion::Stop);
        }
    }
}
