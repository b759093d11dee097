//! Choice of a heading for a robot with a linear and an angular axis, by simulated trajectories.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector2;
use yamabico_core::geometry::{Twist, wrap_angle};

use super::choice::{Candidate, Chooser, SPEED_LADDER};
use super::free_distances::FreeDistances;

/// Turn rate below which a step is straight, rad/s.
const STRAIGHT_RADPS: f64 = 1e-9;
/// Maximum turn that is computed by power series, rad.
const SMALL_TURN_RAD: f64 = 0.13;
/// Coefficients of the even powers in sin(x) / x and in cos(x), from the second one; the truncation error is below
/// 1e-15.
const SIN: [f64; 4] = [-1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0];
const COS: [f64; 4] = [-1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0];

/// Rules for the simulation and the choice of headings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingRules {
    /// Speed on the desired heading, m/s.
    pub speed_mps: f64,
    /// Maximum linear acceleration, m/s^2, above 0.
    pub acceleration_mps2: f64,
    /// Maximum turn rate, rad/s.
    pub turn_radps: f64,
    /// Maximum angular acceleration, rad/s^2, above 0.
    pub turn_acceleration_radps2: f64,
    /// Turn rate per heading error, 1/s.
    pub gain_per_s: f64,
    /// Time step of the simulation, s.
    pub step_s: f64,
    /// Time after which the simulated robot brakes to a stop, s.
    pub horizon_s: f64,
    /// Minimum clearance around the robot's center: its radius plus the margin, m.
    pub clearance_m: f64,
    /// Minimum deviation that passing on the other side than before must save, rad, at least 0.
    pub side_change_rad: f64,
    /// Range of the deviation from the desired heading: minimum, and exclusive maximum, rad.
    pub deviation_rad: [f64; 2],
}

/// Heading that was chosen, with the twist toward it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingChoice {
    /// Twist until the next choice, on the linear and angular axes.
    pub twist: Twist,
    /// Heading in the frame of the free distances, rad.
    pub heading_rad: f64,
    /// Sector with this heading in its middle; `None` for the desired heading itself.
    pub sector: Option<usize>,
    /// Number of headings that precede it in the order of preference.
    pub rank: usize,
    /// Side of the desired heading on which it lies: 1 left, -1 right, 0 neither.
    pub side: i8,
}

/// State of a simulated robot that turns to a heading, in the frame of the free distances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rollout {
    /// Position, m.
    pub position_m: Vector2<f64>,
    /// Heading, rad, not wrapped.
    pub theta_rad: f64,
    /// Forward speed, m/s.
    pub speed_mps: f64,
    /// Turn rate, rad/s.
    pub turn_radps: f64,
    sin_cos: (f64, f64),
}

impl Rollout {
    /// Creates the state from position, heading, forward speed and turn rate.
    #[must_use]
    pub fn new(position_m: Vector2<f64>, theta_rad: f64, speed_mps: f64, turn_radps: f64) -> Self {
        Self { position_m, theta_rad, speed_mps, turn_radps, sin_cos: theta_rad.sin_cos() }
    }

    /// Returns the commanded twist toward a heading: the turn rate is proportional to the heading error, and the speed
    /// decreases with it.
    #[must_use]
    pub fn command(&self, heading_rad: f64, rules: &HeadingRules) -> Twist {
        let error_rad = self.error_rad(heading_rad);
        command(error_rad, error_rad.cos(), rules)
    }

    /// Returns the heading error, -pi to pi rad. A heading exactly behind is -pi: the robot turns right.
    fn error_rad(&self, heading_rad: f64) -> f64 {
        -wrap_angle(self.theta_rad - heading_rad)
    }

    /// Simulates one time step with a commanded twist.
    pub fn step(&mut self, command: &Twist, rules: &HeadingRules) {
        let dt = rules.step_s;
        let (max_turn, max_speed) = (rules.turn_acceleration_radps2 * dt, rules.acceleration_mps2 * dt);
        self.turn_radps += (command.angular - self.turn_radps).clamp(-max_turn, max_turn);
        self.speed_mps += (command.linear - self.speed_mps).clamp(-max_speed, max_speed);
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

    /// Returns true if the robot stands still.
    #[must_use]
    pub fn is_still(&self) -> bool {
        self.speed_mps == 0.0 && self.turn_radps == 0.0
    }
}

/// Returns sine and cosine of an angle increased by `turn`.
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

/// Heading to turn to, and the heading error, updated step by step.
#[derive(Clone, Copy, Debug)]
struct TargetHeading {
    sin_cos: (f64, f64),
    error_rad: f64,
}

impl TargetHeading {
    fn new(state: &Rollout, heading_rad: f64) -> Self {
        Self { sin_cos: heading_rad.sin_cos(), error_rad: state.error_rad(heading_rad) }
    }

    fn command(&self, state: &Rollout, rules: &HeadingRules) -> Twist {
        let (sin, cos) = state.sin_cos;
        command(self.error_rad, sin * self.sin_cos.0 + cos * self.sin_cos.1, rules)
    }

    /// Updates the error after a turn of the robot, by less than half a turn.
    fn update(&mut self, turn_rad: f64) {
        let error_rad = self.error_rad - turn_rad;
        self.error_rad = match error_rad {
            left if left > PI => left - TAU,
            right if right < -PI => right + TAU,
            error_rad => error_rad,
        };
    }
}

/// Returns the commanded twist for a heading error (rad, and its cosine).
fn command(error_rad: f64, cos_error: f64, rules: &HeadingRules) -> Twist {
    let turn = (rules.gain_per_s * error_rad).clamp(-rules.turn_radps, rules.turn_radps);
    Twist::planar(rules.speed_mps * cos_error.max(0.0), turn)
}

/// Simulates a robot that turns to a heading and brakes after `horizon_s`. Yields each state after `start` until the
/// robot stands still, up to one minute after the beginning of braking.
pub fn roll_out(start: Rollout, heading_rad: f64, rules: &HeadingRules) -> impl Iterator<Item = Rollout> {
    let driving = (rules.horizon_s / rules.step_s).round() as u32;
    let max_steps = driving + (60.0 / rules.step_s).ceil() as u32;
    let (rules, mut state, mut target) = (*rules, start, TargetHeading::new(&start, heading_rad));
    (0..max_steps).map_while(move |step| {
        let command = match step {
            step if step < driving => target.command(&state, &rules),
            _ if state.is_still() => return None,
            _ => Twist::ZERO,
        };
        state.step(&command, &rules);
        target.update(state.turn_radps * rules.step_s);
        Some(state)
    })
}

impl Chooser {
    /// Chooses the heading nearest to `goal_rad` for which the simulated robot keeps its clearance until it stops. Ties
    /// are resolved as in [`Chooser::choose`]. `None` if there is no such heading.
    pub fn choose_heading(
        &mut self,
        free: &FreeDistances,
        start: &Rollout,
        goal_rad: f64,
        last_side: i8,
        rules: &HeadingRules,
    ) -> Option<HeadingChoice> {
        if free.clearance_m(start.position_m) < rules.clearance_m {
            return None;
        }
        first_heading(self.order(free, goal_rad, last_side, rules.side_change_rad), free, start, rules)
    }

    /// Chooses a heading like [`Chooser::choose_heading`], but tries lower speeds and then headings backward in the
    /// order of [`SPEED_LADDER`].
    pub fn choose_heading_speed(
        &mut self,
        free: &FreeDistances,
        start: &Rollout,
        goal_rad: f64,
        last_side: i8,
        rules: &HeadingRules,
    ) -> Option<HeadingChoice> {
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

/// Returns the first candidate for which the simulated robot keeps its clearance.
fn first_heading(
    order: &[Candidate],
    free: &FreeDistances,
    start: &Rollout,
    rules: &HeadingRules,
) -> Option<HeadingChoice> {
    let mut tried =
        order.iter().enumerate().filter(|(_, candidate)| candidate.is_within(rules.deviation_rad));
    tried.find_map(|(rank, candidate)| {
        let heading_rad = candidate.direction_rad;
        keeps_clear(free, *start, heading_rad, rules).then(|| HeadingChoice {
            twist: start.command(heading_rad, rules),
            heading_rad,
            sector: candidate.sector,
            rank,
            side: candidate.side(),
        })
    })
}

/// Returns true if a rollout keeps its clearance. States that cannot be too near are skipped, which does not change the
/// result.
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

/// Returns the minimum clearance (m) of a rollout, including its start: the reference for the faster check in
/// [`Chooser::choose_heading`].
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
    fn the_power_series_is_accurate() {
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
    fn skipped_states_change_no_choice() {
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
            let choice = chooser.choose_heading(&free, &start, goal, 0, &RULES);
            assert_eq!(choice.map(|choice| choice.rank), expected);
            taken += usize::from(expected.is_some());
        }
        assert!(taken > 20, "{taken}");
    }

    #[test]
    fn a_stopped_robot_turns_before_it_drives() {
        let mut chooser = Chooser::default();
        let free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
        let still = Rollout::new(Vector2::zeros(), 0.0, 0.0, 0.0);
        let behind = chooser.choose_heading(&free, &still, 2.5, 0, &RULES);
        assert_eq!(behind.map(|choice| choice.twist), Some(Twist::planar(0.0, 3.0)));
        let ahead = chooser.choose_heading(&free, &still, 0.0, 0, &RULES);
        assert_eq!(ahead.map(|choice| choice.twist), Some(Twist::planar(0.4, 0.0)));
    }
}
