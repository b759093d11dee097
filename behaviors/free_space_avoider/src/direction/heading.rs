//! The direction for a robot that drives ahead and turns: which heading to turn to, and how it would get there.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector2;
use yamabico_core::geometry::{Twist, wrap_angle};

use super::choice::{Candidate, Chooser, SPEED_LADDER};
use super::free_distances::FreeDistances;

/// Below this turn rate (rad/s) a step is straight.
const STRAIGHT_RADPS: f64 = 1e-9;
/// Turns up to this (rad) are worked out by series.
const SMALL_TURN_RAD: f64 = 0.13;
/// Coefficients of the even powers in sin(x) / x and in cos(x), from the second on: what is left out is below 1e-15.
const SIN: [f64; 4] = [-1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0];
const COS: [f64; 4] = [-1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0];

/// How a robot that drives ahead and turns comes to a heading, and how headings are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingRules {
    /// Speed on the wished heading, m/s.
    pub speed_mps: f64,
    /// Largest acceleration along, m/s^2, above 0.
    pub acceleration_mps2: f64,
    /// Largest turn rate, rad/s.
    pub turn_radps: f64,
    /// Largest change of the turn rate, rad/s^2, above 0.
    pub turn_acceleration_radps2: f64,
    /// Turn rate for each radian of missing heading, 1/s.
    pub gain_per_s: f64,
    /// Time of a step, s.
    pub step_s: f64,
    /// Time that the robot drives before it brakes to a stand, s.
    pub horizon_s: f64,
    /// The robot's radius and what is kept beside it, m.
    pub clearance_m: f64,
    /// Going around on the other side than last time must save so much deviation (rad, at least 0).
    pub side_change_rad: f64,
    /// Least and largest deviation (rad) from the wished heading.
    pub deviation_rad: [f64; 2],
}

/// A heading that is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Speed ahead and turn rate to drive with until the next choice.
    pub twist: Twist,
    /// The heading, radians, frame of the free distances.
    pub heading_rad: f64,
    /// The sector whose middle it is; `None` for the wished heading itself.
    pub sector: Option<usize>,
    /// Headings that were tried before.
    pub rank: usize,
    /// -1, 0 or 1: on which side of the wished heading it lies; left is 1.
    pub side: i8,
}

/// The state of a robot that turns to a heading, step by step; its frame is that of the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rollout {
    /// Place, m.
    pub position_m: Vector2<f64>,
    /// Heading, rad, not wrapped.
    pub theta_rad: f64,
    /// Speed ahead, m/s.
    pub speed_mps: f64,
    /// Turn rate, rad/s.
    pub turn_radps: f64,
    sin_cos: (f64, f64),
}

impl Rollout {
    /// A robot at a place and a heading, driving at a speed and turning at a rate.
    #[must_use]
    pub fn new(position_m: Vector2<f64>, theta_rad: f64, speed_mps: f64, turn_radps: f64) -> Self {
        Self { position_m, theta_rad, speed_mps, turn_radps, sin_cos: theta_rad.sin_cos() }
    }

    /// What the robot is asked for on its way to a heading: it turns in proportion to what is missing, and drives the
    /// slower the more is missing.
    #[must_use]
    pub fn wished(&self, heading_rad: f64, rules: &HeadingRules) -> Twist {
        let missing = self.missing_rad(heading_rad);
        wished(missing, missing.cos(), rules)
    }

    /// What is missing to a heading, -pi to pi rad; one exactly behind is turned to on the right.
    fn missing_rad(&self, heading_rad: f64) -> f64 {
        -wrap_angle(self.theta_rad - heading_rad)
    }

    /// One step on the way to what is asked for.
    pub fn step(&mut self, wished: &Twist, rules: &HeadingRules) {
        let dt = rules.step_s;
        let (max_turn, most) = (rules.turn_acceleration_radps2 * dt, rules.acceleration_mps2 * dt);
        self.turn_radps += (wished.angular - self.turn_radps).clamp(-max_turn, max_turn);
        self.speed_mps += (wished.linear - self.speed_mps).clamp(-most, most);
        let (sin, cos) = self.sin_cos;
        let turn = self.turn_radps * dt;
        self.sin_cos = turned(self.sin_cos, turn);
        self.position_m += if self.turn_radps.abs() < STRAIGHT_RADPS {
            Vector2::new(cos, sin) * (self.speed_mps * dt)
        } else {
            let radius = self.speed_mps / self.turn_radps;
            Vector2::new(self.sin_cos.0 - sin, cos - self.sin_cos.1) * radius
        };
        self.theta_rad += turn;
    }

    /// Whether the robot stands.
    #[must_use]
    pub fn is_still(&self) -> bool {
        self.speed_mps == 0.0 && self.turn_radps == 0.0
    }
}

/// Sine and cosine of an angle that grows by `turn`.
fn turned((sin, cos): (f64, f64), turn: f64) -> (f64, f64) {
    let (s, c) = if turn.abs() <= SMALL_TURN_RAD {
        let q = turn * turn;
        let s = turn * (1.0 + q * (SIN[0] + q * (SIN[1] + q * (SIN[2] + q * SIN[3]))));
        let c = 1.0 + q * (COS[0] + q * (COS[1] + q * (COS[2] + q * COS[3])));
        (s, c)
    } else {
        turn.sin_cos()
    };
    (sin * c + cos * s, cos * c - sin * s)
}

/// A heading on the way to which a robot is, and what is missing to it, kept from step to step.
#[derive(Clone, Copy, Debug)]
struct Aim {
    sin_cos: (f64, f64),
    missing_rad: f64,
}

impl Aim {
    fn new(state: &Rollout, heading_rad: f64) -> Self {
        Self { sin_cos: heading_rad.sin_cos(), missing_rad: state.missing_rad(heading_rad) }
    }

    fn wished(&self, state: &Rollout, rules: &HeadingRules) -> Twist {
        let (sin, cos) = state.sin_cos;
        wished(self.missing_rad, sin * self.sin_cos.0 + cos * self.sin_cos.1, rules)
    }

    /// Follows a robot that has turned, by less than half a turn.
    fn follow(&mut self, turn_rad: f64) {
        let missing = self.missing_rad - turn_rad;
        self.missing_rad = match missing {
            left if left > PI => left - TAU,
            right if right < -PI => right + TAU,
            missing => missing,
        };
    }
}

/// What is asked for where so much heading is missing (rad, and its cosine).
fn wished(missing_rad: f64, cos_missing: f64, rules: &HeadingRules) -> Twist {
    let turn = (rules.gain_per_s * missing_rad).clamp(-rules.turn_radps, rules.turn_radps);
    Twist::planar(rules.speed_mps * cos_missing.max(0.0), turn)
}

/// Every state on the way from `start` to a heading and to the stand after it, without the start. The robot is asked to
/// stand after `horizon_s`; the way ends when it does, or after a minute.
pub fn roll_out(start: Rollout, heading_rad: f64, rules: &HeadingRules) -> impl Iterator<Item = Rollout> {
    let driving = (rules.horizon_s / rules.step_s).round() as u32;
    let most = driving + (60.0 / rules.step_s).ceil() as u32;
    let (rules, mut state, mut aim) = (*rules, start, Aim::new(&start, heading_rad));
    (0..most).map_while(move |step| {
        let wished = match step {
            step if step < driving => aim.wished(&state, &rules),
            _ if state.is_still() => return None,
            _ => Twist::ZERO,
        };
        state.step(&wished, &rules);
        aim.follow(state.turn_radps * rules.step_s);
        Some(state)
    })
}

impl Chooser {
    /// The heading nearest to `goal_rad` that the robot comes to, and to a stand after it, clear of everything hidden; ties
    /// as in [`Chooser::choose`]. `None` where there is no such heading.
    pub fn choose_heading(
        &mut self,
        free: &FreeDistances,
        start: &Rollout,
        goal_rad: f64,
        last_side: i8,
        rules: &HeadingRules,
    ) -> Option<Drive> {
        if free.clearance_m(start.position_m) < rules.clearance_m {
            return None;
        }
        first_heading(self.order(free, goal_rad, last_side, rules.side_change_rad), free, start, rules)
    }

    /// The same, at half and at a quarter of the speed where the whole is too fast, and only then back ([`SPEED_LADDER`]).
    pub fn choose_heading_speed(
        &mut self,
        free: &FreeDistances,
        start: &Rollout,
        goal_rad: f64,
        last_side: i8,
        rules: &HeadingRules,
    ) -> Option<Drive> {
        if free.clearance_m(start.position_m) < rules.clearance_m {
            return None;
        }
        let order = self.order(free, goal_rad, last_side, rules.side_change_rad);
        SPEED_LADDER.iter().find_map(|&(share, deviation_rad)| {
            let rules = HeadingRules { speed_mps: share * rules.speed_mps, deviation_rad, ..*rules };
            first_heading(order, free, start, &rules)
        })
    }
}

/// The first of the candidates that the robot comes to, clear of everything hidden.
fn first_heading(
    order: &[Candidate],
    free: &FreeDistances,
    start: &Rollout,
    rules: &HeadingRules,
) -> Option<Drive> {
    let mut tried =
        order.iter().enumerate().filter(|(_, candidate)| candidate.is_within(rules.deviation_rad));
    tried.find_map(|(rank, candidate)| {
        let heading_rad = candidate.direction_rad;
        keeps_clear(free, *start, heading_rad, rules).then(|| Drive {
            twist: start.wished(heading_rad, rules),
            heading_rad,
            sector: candidate.sector,
            rank,
            side: candidate.side(),
        })
    })
}

/// Whether a rollout keeps its distance. States that cannot have come near enough are left out.
fn keeps_clear(free: &FreeDistances, start: Rollout, heading_rad: f64, rules: &HeadingRules) -> bool {
    let step_m = rules.speed_mps.max(start.speed_mps.abs()) * rules.step_s;
    let mut spare_m = 0.0;
    roll_out(start, heading_rad, rules).all(|state| {
        spare_m -= step_m;
        if spare_m < 0.0 {
            spare_m = free.clearance_m(state.position_m) - rules.clearance_m;
        }
        spare_m >= 0.0
    })
}

/// The smallest clearance (m) of all states of a rollout and its start: the plain reference of what
/// [`Chooser::choose_heading`] decides by.
#[must_use]
pub fn min_clearance_m(free: &FreeDistances, start: Rollout, heading_rad: f64, rules: &HeadingRules) -> f64 {
    let states = std::iter::once(start).chain(roll_out(start, heading_rad, rules));
    states.map(|state| free.clearance_m(state.position_m)).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    const RULES: HeadingRules = HeadingRules {
        speed_mps: 0.4,
        acceleration_mps2: 0.3,
        turn_radps: 3.0,
        turn_acceleration_radps2: 8.0,
        gain_per_s: 4.0,
        step_s: 0.02,
        horizon_s: 2.0,
        clearance_m: 0.1,
        side_change_rad: 0.0,
        deviation_rad: [0.0, 7.0],
    };

    #[test]
    fn turning_by_series_is_turning() {
        let mut angle: f64 = 0.3;
        let mut sin_cos = angle.sin_cos();
        for step in 0..1000 {
            let turn = 0.12 * (f64::from(step) * 0.7).sin();
            angle += turn;
            sin_cos = turned(sin_cos, turn);
            assert!((sin_cos.0 - angle.sin()).abs() < 1e-12 && (sin_cos.1 - angle.cos()).abs() < 1e-12);
        }
    }

    #[test]
    fn leaving_states_out_changes_no_choice() {
        let mut random = Pcg64::seed_from_u64(8);
        let (mut chooser, mut taken) = (Chooser::default(), 0);
        for _ in 0..200 {
            let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
            let distances: Vec<f64> = (0..32).map(|_| random.random_range(0.15..2.5)).collect();
            free.set(distances);
            let goal = random.random_range(-3.0..3.0);
            let (speed, turn) = (random.random_range(-0.1..0.4), random.random_range(-2.0..2.0));
            let start = Rollout::new(Vector2::zeros(), 0.0, speed, turn);
            let expected = Chooser::default().order(&free, goal, 0, 0.0).iter().position(|candidate| {
                min_clearance_m(&free, start, candidate.direction_rad, &RULES) >= RULES.clearance_m
            });
            let drive = chooser.choose_heading(&free, &start, goal, 0, &RULES);
            assert_eq!(drive.map(|drive| drive.rank), expected);
            taken += usize::from(expected.is_some());
        }
        assert!(taken > 20, "{taken}");
    }

    #[test]
    fn a_robot_that_stands_turns_before_it_drives() {
        let mut chooser = Chooser::default();
        let free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
        let still = Rollout::new(Vector2::zeros(), 0.0, 0.0, 0.0);
        let behind = chooser.choose_heading(&free, &still, 2.5, 0, &RULES);
        assert_eq!(behind.map(|drive| drive.twist), Some(Twist::planar(0.0, 3.0)));
        let ahead = chooser.choose_heading(&free, &still, 0.0, 0, &RULES);
        assert_eq!(ahead.map(|drive| drive.twist), Some(Twist::planar(0.4, 0.0)));
    }
}
