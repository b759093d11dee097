//! From decision to decision: no dithering, and no turning for ever.
//!
//! Differs from \[1\], which decides on each picture alone.

use yamabico_core::time::Time;

use super::decision::{AHEAD_LIMIT, Passage, Side, freer_side, is_blocked};
use super::weights::Weights;

/// A turn ends only below this weight ahead.
pub const RELEASE_LIMIT: f64 = 30.0;
/// A turn is reversed earlier than this (s) after it began ...
pub const REVERSAL_S: f64 = 2.0;
/// ... only where the weights of the sides differ by more than this.
pub const REVERSAL_WEIGHT: f64 = 20.0;
/// After so many reversals the robot keeps on turning to the same side until it finds a way forward: between the two walls of
/// a corner it would turn to and fro for ever.
pub const MAX_REVERSALS: u32 = 1;
/// Sides that differ by more than this let the robot veer while it drives.
const VEER_WEIGHT: f64 = 20.0;
/// Turn rate of a veer, rad/s for each unit of weight.
const VEER_RADPS: f64 = 0.01;
/// Largest turn rate of a veer, rad/s.
const MAX_VEER_RADPS: f64 = 0.2;
/// Least share of the cruising speed.
const MIN_SHARE: f64 = 0.3;
/// More than a full turn without a way forward: the robot is shut in.
const FULL_TURN_RAD: f64 = std::f64::consts::TAU;

/// What the robot does until the next picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Drives.
    Forward {
        /// Share of the cruising speed, 0.3 to 1.
        share: f64,
        /// Turn rate, rad/s, left positive.
        turn_radps: f64,
    },
    /// Turns where it stands.
    Turn(Side),
    /// Stands: both sides are blocked.
    Stop,
    /// Stands: a full turn has shown no way forward.
    ShutIn,
}

/// What a picture says of the way ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outlook {
    /// What intrudes, and whether the robot's own width is free.
    Seen(Weights, Passage),
    /// The picture tells nothing: too little contrast, or hardly any floor.
    Unclear,
}

/// The state between pictures.
#[derive(Clone, Debug)]
pub struct Steering {
    patience_s: f64,
    motion: Motion,
    /// The last turn and when it began.
    turn: Option<(Side, Time)>,
    /// Turns reversed since the robot last drove.
    reversals: u32,
    /// Turned since then, or since the last reversal, radians.
    turned_rad: f64,
    /// Standing since.
    stopped: Option<Time>,
}

impl Steering {
    /// A robot that stands. Blocked on both sides, it looks around after `patience_s`.
    #[must_use]
    pub fn new(patience_s: f64) -> Self {
        Self { patience_s, motion: Motion::Stop, turn: None, reversals: 0, turned_rad: 0.0, stopped: None }
    }

    /// What the robot does.
    #[must_use]
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// Takes what a picture at `at` says, the robot having turned by `turned_rad` (no sign) since the picture before.
    pub fn step(&mut self, outlook: Outlook, turned_rad: f64, at: Time) -> Motion {
        if let Motion::Turn(_) = self.motion {
            self.turned_rad += turned_rad;
        }
        self.motion = match outlook {
            Outlook::Seen(weights, passage) if self.goes_forward(&weights, passage) => {
                self.turned_rad = 0.0;
                self.reversals = 0;
                self.stopped = None;
                forward(&weights)
            }
            _ if self.motion == Motion::ShutIn || self.turned_rad > FULL_TURN_RAD => Motion::ShutIn,
            Outlook::Seen(weights, _) => self.turn_or_stop(&weights, at),
            // Turning where it stands needs no floor ahead, and may show some.
            Outlook::Unclear if matches!(self.motion, Motion::Turn(_)) => self.motion,
            Outlook::Unclear => Motion::Stop,
        };
        self.motion
    }

    fn goes_forward(&self, weights: &Weights, passage: Passage) -> bool {
        match self.motion {
            Motion::Turn(_) | Motion::ShutIn => weights.ahead < RELEASE_LIMIT && passage == Passage::Open,
            Motion::Forward { .. } | Motion::Stop => {
                weights.ahead < AHEAD_LIMIT && passage != Passage::Obstructed
            }
        }
    }

    fn turn_or_stop(&mut self, weights: &Weights, at: Time) -> Motion {
        if !matches!(self.motion, Motion::Turn(_)) && is_blocked(weights) {
            let stopped = *self.stopped.get_or_insert(at);
            if at.seconds_after(stopped) < self.patience_s {
                return Motion::Stop;
            }
        }
        self.stopped = None;
        let wanted = freer_side(weights, self.turn.map(|(side, _)| side));
        let side = match self.turn {
            Some((side, since)) if side != wanted && !self.may_reverse(weights, since, at) => side,
            _ => wanted,
        };
        let goes_on = matches!(self.motion, Motion::Turn(last) if last == side);
        if !goes_on {
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

/// Slower the more intrudes ahead, and away from the heavier side.
fn forward(weights: &Weights) -> Motion {
    let lean = weights.left - weights.right;
    let veer = if lean.abs() > VEER_WEIGHT { VEER_RADPS * lean } else { 0.0 };
    Motion::Forward {
        share: (1.0 - weights.ahead / AHEAD_LIMIT).clamp(MIN_SHARE, 1.0),
        turn_radps: veer.clamp(-MAX_VEER_RADPS, MAX_VEER_RADPS),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(right: f64, left: f64, ahead: f64) -> Outlook {
        let passage = if ahead < AHEAD_LIMIT { Passage::Open } else { Passage::Obstructed };
        Outlook::Seen(Weights { right, left, ahead }, passage)
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
    fn a_turn_ends_below_the_lower_limit_and_with_room_to_spare() {
        let mut steering = Steering::new(3.0);
        assert_eq!(steering.step(seen(50.0, 20.0, 60.0), 0.0, at(0.0)), Motion::Turn(Side::Right));
        assert_eq!(steering.step(seen(30.0, 20.0, 35.0), 0.0, at(0.1)), Motion::Turn(Side::Right));
        let narrow = Outlook::Seen(Weights { right: 9.0, left: 2.0, ahead: 10.0 }, Passage::Narrow);
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
    fn a_corner_does_not_make_it_dither() {
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
    fn a_full_turn_without_a_way_forward_ends_it() {
        let mut steering = Steering::new(3.0);
        steering.step(seen(50.0, 20.0, 60.0), 0.0, at(0.0));
        for i in 1..=7 {
            let unclear = if i % 2 == 0 { Outlook::Unclear } else { seen(50.0, 20.0, 60.0) };
            let motion = steering.step(unclear, 0.9, at(f64::from(i)));
            assert_eq!(motion == Motion::ShutIn, 0.9 * f64::from(i) > FULL_TURN_RAD, "{i}: {motion:?}");
        }
        assert_eq!(steering.step(seen(50.0, 20.0, 60.0), 0.0, at(9.0)), Motion::ShutIn);
        assert!(matches!(steering.step(seen(0.0, 0.0, 5.0), 0.0, at(9.1)), Motion::Forward { .. }));
    }

    #[test]
    fn an_unclear_picture_stops_it_and_moves_nothing() {
        let mut steering = Steering::new(3.0);
        steering.step(seen(0.0, 0.0, 0.0), 0.0, at(0.0));
        for i in 0..100 {
            assert_eq!(steering.step(Outlook::Unclear, 0.0, at(0.1 * f64::from(i))), Motion::Stop);
        }
    }
}
