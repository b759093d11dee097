//! The direction for a robot that can drive in every direction without turning.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use yamabico_core::geometry::wrap_angle;

use super::free_distances::FreeDistances;
use super::limited_motion::LimitedMotion;

/// Deviations from the wished direction that differ by less than this (rad) are equal.
pub const SAME_DEVIATION_RAD: f64 = 1e-9;
/// A deviation below this (rad) is to neither side.
const STRAIGHT_RAD: f64 = 1e-6;

/// Shares of the speed that are tried one after the other, each in directions that deviate from so much to so much (rad):
/// slowly on is better than fast back.
pub const SPEED_LADDER: [(f64, [f64; 2]); 6] =
    [(1.0, ON), (0.5, ON), (0.25, ON), (1.0, BACK), (0.5, BACK), (0.25, BACK)];
const ON: [f64; 2] = [0.0, AHEAD_RAD];
const BACK: [f64; 2] = [AHEAD_RAD, TAU];
/// Directions that differ by less than this (rad) from the one chosen before are the same one.
const SAME_DIRECTION_RAD: f64 = 0.1;
/// Up to this deviation (rad) a direction leads on.
const AHEAD_RAD: f64 = 1.75;

/// Whether the velocity that the robot has counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Velocity {
    /// It does: the robot comes from its velocity to the new one as its acceleration allows.
    Considered,
    /// Every direction is taken at once, as without inertia: for comparison.
    Ignored,
}

/// How directions are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChoiceRules {
    /// The speed to drive at, m/s.
    pub speed_mps: f64,
    /// The largest acceleration in any direction, m/s^2, above 0.
    pub acceleration_mps2: f64,
    /// The robot's radius and what is kept beside it, m.
    pub clearance_m: f64,
    /// Time between two looks at a way, s.
    pub step_s: f64,
    /// Time until the next choice takes effect, s: so long after, the robot must still be able to stop.
    pub reaction_s: f64,
    /// Whether the velocity that the robot has counts.
    pub velocity: Velocity,
    /// Going around on the other side than last time must save so much deviation (rad, at least 0).
    pub side_change_rad: f64,
    /// A direction nearer to the wished one than the one chosen before must keep so much more clear (m, at least 0), so that what
    /// is seen a little differently every time does not turn the robot to and fro.
    pub nearer_m: f64,
    /// Least and largest deviation (rad) from the wished direction.
    pub deviation_rad: [f64; 2],
}

/// What was chosen before; by default, nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Before {
    /// -1, 0 or 1: on which side of the wished direction; left is 1.
    pub side: i8,
    /// The direction, radians, frame of the free distances.
    pub direction_rad: Option<f64>,
}

/// Where the robot is, in the frame of the free distances, and how it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Start {
    /// Place of its center, m.
    pub position_m: Vector2<f64>,
    /// Its velocity, m/s.
    pub velocity_mps: Vector2<f64>,
}

/// A direction that is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The velocity to drive at, m/s.
    pub velocity_mps: Vector2<f64>,
    /// Its direction, radians.
    pub direction_rad: f64,
    /// The sector whose middle it is; `None` for the wished direction itself.
    pub sector: Option<usize>,
    /// Directions that were tried before.
    pub rank: usize,
    /// -1, 0 or 1: on which side of the wished direction it lies; left is 1.
    pub side: i8,
}

/// One direction that may be tried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) direction_rad: f64,
    pub(super) sector: Option<usize>,
    deviation_rad: f64,
}

impl Candidate {
    /// Whether it deviates by at least the one and less than the other.
    pub(super) fn is_within(&self, [min_rad, max_rad]: [f64; 2]) -> bool {
        (min_rad..max_rad).contains(&self.deviation_rad.abs())
    }

    pub(super) fn side(&self) -> i8 {
        match self.deviation_rad {
            deviation if deviation.abs() < STRAIGHT_RAD => 0,
            deviation if deviation > 0.0 => 1,
            _ => -1,
        }
    }
}

impl Before {
    /// What a candidate must keep clear beyond the rules, m.
    fn nearer_m(&self, candidate: &Candidate, goal_rad: f64, rules: &ChoiceRules) -> f64 {
        let Some(before_rad) = self.direction_rad else { return 0.0 };
        let is_same = wrap_angle(candidate.direction_rad - before_rad).abs() < SAME_DIRECTION_RAD;
        let is_nearer = candidate.deviation_rad.abs() < wrap_angle(goal_rad - before_rad).abs();
        if is_nearer && !is_same { rules.nearer_m } else { 0.0 }
    }
}

/// Chooses directions; allocates only for more sectors than ever before.
#[derive(Clone, Debug, Default)]
pub struct Chooser {
    candidates: Vec<Candidate>,
}

impl Chooser {
    /// The direction nearest to `goal_rad` in which the robot keeps clear of everything hidden, and could still stop after
    /// its reaction time. Of two directions equally near that on the side chosen before wins, or else the left one. `None` where
    /// there is no such direction.
    pub fn choose(
        &mut self,
        free: &FreeDistances,
        start: &Start,
        goal_rad: f64,
        before: &Before,
        rules: &ChoiceRules,
    ) -> Option<Choice> {
        // Every way begins here.
        if free.clearance_m(start.position_m) < rules.clearance_m {
            return None;
        }
        let order = self.order(free, goal_rad, before.side, rules.side_change_rad);
        let mut tried =
            order.iter().enumerate().filter(|(_, candidate)| candidate.is_within(rules.deviation_rad));
        tried.find_map(|(rank, candidate)| {
            let direction_rad = candidate.direction_rad;
            let velocity_mps = Vector2::new(direction_rad.cos(), direction_rad.sin()) * rules.speed_mps;
            let ways = Ways::new(start, velocity_mps, rules);
            let clearance_m = rules.clearance_m + before.nearer_m(candidate, goal_rad, rules);
            let rules = ChoiceRules { clearance_m, ..*rules };
            let is_clear = keeps_clear(free, &ways.drive, start.position_m, ways.drive_s, &rules)
                && keeps_clear(free, &ways.stop, ways.stop_from, ways.stop.ramp_s(), &rules);
            is_clear.then(|| Choice {
                velocity_mps,
                direction_rad,
                sector: candidate.sector,
                rank,
                side: candidate.side(),
            })
        })
    }

    /// The same, at half and at a quarter of the speed where the whole is too fast, and only then back ([`SPEED_LADDER`]).
    pub fn choose_speed(
        &mut self,
        free: &FreeDistances,
        start: &Start,
        goal_rad: f64,
        before: &Before,
        rules: &ChoiceRules,
    ) -> Option<Choice> {
        SPEED_LADDER.iter().find_map(|&(share, deviation_rad)| {
            let rules = ChoiceRules { speed_mps: share * rules.speed_mps, deviation_rad, ..*rules };
            self.choose(free, start, goal_rad, before, &rules)
        })
    }

    /// The wished direction and the middles of all sectors, nearest first; those on the other side than last time later.
    pub(super) fn order(
        &mut self,
        free: &FreeDistances,
        goal_rad: f64,
        last_side: i8,
        side_change_rad: f64,
    ) -> &[Candidate] {
        let candidate = |sector: Option<usize>| {
            let direction_rad = sector.map_or(goal_rad, |sector| free.middle(sector));
            Candidate { direction_rad, sector, deviation_rad: -wrap_angle(goal_rad - direction_rad) }
        };
        self.candidates.clear();
        self.candidates.push(candidate(None));
        self.candidates.extend((0..free.len()).map(|sector| candidate(Some(sector))));
        let key = |candidate: &Candidate| {
            let deviation = candidate.deviation_rad;
            let side = if deviation >= 0.0 { 1 } else { -1 };
            let is_other_side = last_side != 0 && side != last_side;
            let number = candidate.sector.map_or(0, |sector| sector + 1);
            let change = if is_other_side && candidate.side() != 0 { side_change_rad } else { 0.0 };
            (((deviation.abs() + change) / SAME_DEVIATION_RAD).round() as i64, is_other_side, -side, number)
        };
        self.candidates.sort_unstable_by_key(key);
        &self.candidates
    }
}

/// What is looked at for one direction.
struct Ways {
    drive: LimitedMotion,
    drive_s: f64,
    stop: LimitedMotion,
    stop_from: Vector2<f64>,
}

impl Ways {
    fn new(start: &Start, to_mps: Vector2<f64>, rules: &ChoiceRules) -> Self {
        let from_mps = match rules.velocity {
            Velocity::Considered => start.velocity_mps,
            Velocity::Ignored => to_mps,
        };
        let acceleration = rules.acceleration_mps2;
        let drive = LimitedMotion::new(from_mps, to_mps, acceleration);
        Self {
            drive,
            // Straight on after the ramp for as long as braking takes, which is the way that braking takes.
            drive_s: drive.ramp_s() + rules.speed_mps / (2.0 * acceleration),
            stop: LimitedMotion::new(drive.velocity_mps(rules.reaction_s), Vector2::zeros(), acceleration),
            stop_from: start.position_m + drive.position_m(rules.reaction_s),
        }
    }
}

/// Whether a motion that begins at `from` keeps its distance for `duration_s`: looked at every step and at its end. Steps
/// that cannot come near enough are left out, which changes no answer.
fn keeps_clear(
    free: &FreeDistances,
    motion: &LimitedMotion,
    from: Vector2<f64>,
    duration_s: f64,
    rules: &ChoiceRules,
) -> bool {
    let step_m = motion.fastest_mps() * rules.step_s;
    // Most ways that fail do so at their end.
    if free.clearance_m(from + motion.position_m(duration_s)) < rules.clearance_m {
        return false;
    }
    let mut step = 0.0;
    loop {
        let t = (step * rules.step_s).min(duration_s);
        let spare_m = free.clearance_m(from + motion.position_m(t)) - rules.clearance_m;
        if spare_m < 0.0 {
            return false;
        }
        if t >= duration_s || spare_m >= step_m * (duration_s - t) / rules.step_s {
            return true;
        }
        step += 1.0 + (spare_m / step_m).floor();
    }
}

/// The smallest clearance (m) of all the steps that are looked at when the robot changes from one velocity to another and
/// would stop after its reaction time: the plain reference of what [`Chooser::choose`] decides by.
#[must_use]
pub fn min_clearance_m(
    free: &FreeDistances,
    start: &Start,
    to_mps: Vector2<f64>,
    rules: &ChoiceRules,
) -> f64 {
    let ways = Ways::new(start, to_mps, rules);
    let drive = min_on_way_m(free, &ways.drive, start.position_m, ways.drive_s, rules.step_s);
    drive.min(min_on_way_m(free, &ways.stop, ways.stop_from, ways.stop.ramp_s(), rules.step_s))
}

/// The smallest clearance (m) of all the steps of a stop.
#[must_use]
pub fn stop_clearance_m(free: &FreeDistances, start: &Start, rules: &ChoiceRules) -> f64 {
    let stop = LimitedMotion::new(start.velocity_mps, Vector2::zeros(), rules.acceleration_mps2);
    min_on_way_m(free, &stop, start.position_m, stop.ramp_s(), rules.step_s)
}

fn min_on_way_m(
    free: &FreeDistances,
    motion: &LimitedMotion,
    from: Vector2<f64>,
    duration_s: f64,
    step_s: f64,
) -> f64 {
    let times =
        (0..).map(|step| f64::from(step) * step_s).take_while(|&t| t < duration_s).chain([duration_s]);
    times.map(|t| free.clearance_m(from + motion.position_m(t))).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;
    use std::f64::consts::PI;

    const RULES: ChoiceRules = ChoiceRules {
        speed_mps: 0.4,
        acceleration_mps2: 0.3,
        clearance_m: 0.1,
        step_s: 0.02,
        reaction_s: 0.04,
        velocity: Velocity::Considered,
        side_change_rad: 0.0,
        nearer_m: 0.0,
        deviation_rad: [0.0, TAU],
    };

    fn random_case(random: &mut Pcg64) -> (Vec<f64>, Start, f64) {
        let distances = (0..32).map(|_| random.random_range(0.1..1.8)).collect();
        let velocity = Vector2::new(random.random_range(-0.4..0.4), random.random_range(-0.2..0.2));
        (distances, Start { velocity_mps: velocity, ..Start::default() }, random.random_range(-PI..PI))
    }

    /// The quick check decides as the plain one does, for the direction taken and for all that were passed over.
    #[test]
    fn leaving_steps_out_changes_no_choice() {
        let mut random = Pcg64::seed_from_u64(3);
        let (mut chooser, mut taken) = (Chooser::default(), 0);
        for _ in 0..300 {
            let (distances, start, goal) = random_case(&mut random);
            let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
            free.set(distances);
            let expected = Chooser::default().order(&free, goal, 0, 0.0).iter().position(|candidate| {
                let to = Vector2::new(candidate.direction_rad.cos(), candidate.direction_rad.sin()) * 0.4;
                min_clearance_m(&free, &start, to, &RULES) >= RULES.clearance_m
            });
            let choice = chooser.choose(&free, &start, goal, &Before::default(), &RULES);
            assert_eq!(choice.map(|choice| choice.rank), expected);
            taken += usize::from(expected.is_some());
        }
        assert!(taken > 20, "{taken}");
    }

    #[test]
    fn the_mirror_image_is_answered_by_the_mirror_image() {
        let mut random = Pcg64::seed_from_u64(4);
        let mut chooser = Chooser::default();
        for _ in 0..200 {
            let (distances, start, goal) = random_case(&mut random);
            let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
            free.set(distances.iter().copied());
            let here = chooser.choose(&free, &start, goal, &Before { side: 1, ..Before::default() }, &RULES);
            free.set(distances.iter().rev().copied());
            let mirrored =
                Start { velocity_mps: start.velocity_mps.component_mul(&Vector2::new(1.0, -1.0)), ..start };
            let there =
                chooser.choose(&free, &mirrored, -goal, &Before { side: -1, ..Before::default() }, &RULES);
            let (Some(here), Some(there)) = (here, there) else {
                assert_eq!(here.is_some(), there.is_some());
                continue;
            };
            assert!(wrap_angle(here.direction_rad + there.direction_rad).abs() < 1e-9);
            assert_eq!(here.side, -there.side);
        }
    }

    #[test]
    fn another_obstacle_never_brings_the_choice_nearer_to_the_wish() {
        let mut random = Pcg64::seed_from_u64(5);
        let mut chooser = Chooser::default();
        for _ in 0..200 {
            let (mut distances, start, goal) = random_case(&mut random);
            let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
            free.set(distances.iter().copied());
            let before = chooser.choose(&free, &start, goal, &Before::default(), &RULES);
            distances[random.random_range(0..32)] *= 0.5;
            free.set(distances);
            let after = chooser.choose(&free, &start, goal, &Before::default(), &RULES);
            match (before, after) {
                (Some(before), Some(after)) => assert!(after.rank >= before.rank),
                (before, after) => assert!(before.is_some() || after.is_none()),
            }
        }
    }

    #[test]
    fn the_side_is_kept_unless_the_other_saves_enough() {
        let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
        // Blocked ahead, a little farther to the left than to the right.
        free.set((0..32).map(|j| if (3..30).contains(&j) { 1.2 } else { 0.3 }));
        let mut chooser = Chooser::default();
        let mut side = |last: i8, side_change_rad: f64| {
            let rules = ChoiceRules { side_change_rad, ..RULES };
            chooser
                .choose(&free, &Start::default(), 0.0, &Before { side: last, ..Before::default() }, &rules)
                .map(|choice| choice.side)
        };
        assert_eq!([side(0, 0.5), side(1, 0.0), side(-1, 0.0)], [Some(-1); 3]);
        assert_eq!((side(1, 0.5), side(-1, 0.5)), (Some(1), Some(-1)));
    }

    #[test]
    fn slowly_on_comes_before_fast_back() {
        let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
        free.set((0..32).map(|j| if (11..21).contains(&j) { 1.2 } else { 0.3 }));
        let mut chooser = Chooser::default();
        let fast = chooser.choose(&free, &Start::default(), 0.0, &Before::default(), &RULES);
        assert!(fast.is_some_and(|choice| choice.velocity_mps.x < -0.35), "{fast:?}");
        let slow = chooser.choose_speed(&free, &Start::default(), 0.0, &Before::default(), &RULES);
        assert!(slow.is_some_and(|choice| choice.velocity_mps.x > 0.0), "{slow:?}");
    }

    #[test]
    fn a_closed_ring_is_driven_in_slowly() {
        let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
        free.set([0.3; 32]);
        let mut chooser = Chooser::default();
        assert_eq!(chooser.choose(&free, &Start::default(), 0.5, &Before::default(), &RULES), None);
        let slow = chooser.choose_speed(&free, &Start::default(), 0.5, &Before::default(), &RULES);
        assert_eq!(slow.map(|slow| slow.velocity_mps.norm()), Some(0.2));
    }

    #[test]
    fn a_direction_nearer_to_the_wish_must_be_clearer_than_the_one_that_is_kept() {
        let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
        // Ahead something is just far enough away: 16 mm until the robot reacts, 267 mm to stop and 100 mm to keep.
        free.set((0..32).map(|j| if (1..31).contains(&j) { 1.2 } else { 0.39 }));
        let mut chooser = Chooser::default();
        let mut direction = |before: Option<f64>, nearer_m: f64| {
            let rules = ChoiceRules { nearer_m, ..RULES };
            let start = Start { velocity_mps: Vector2::new(0.4, 0.0), ..Start::default() };
            let before = Before { direction_rad: before, ..Before::default() };
            chooser.choose(&free, &start, 0.0, &before, &rules).map(|choice| choice.direction_rad)
        };
        assert_eq!(
            [direction(None, 0.03), direction(Some(0.6), 0.0), direction(Some(0.0), 0.03)],
            [Some(0.0); 3]
        );
        assert!(direction(Some(0.6), 0.03).is_some_and(|direction| direction.abs() > 0.1));
    }
}
