//! Choice of a direction for a holonomic robot, which drives in every direction without turning.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use yamabico_core::geometry::wrap_angle;

use super::free_distances::FreeDistances;
use super::trajectories::Trajectories;

/// Difference below which two deviations from the desired direction are equal, rad.
const SAME_DEVIATION_RAD: f64 = 1e-9;
/// Deviation below which a direction is on neither side, rad.
const STRAIGHT_RAD: f64 = 1e-6;

/// Shares of the speed in the order in which they are tried, each with its range of deviations (rad): driving onward
/// slowly precedes driving backward fast.
pub const SPEED_LADDER: [(f64, [f64; 2]); 6] = [
    (1.0, ONWARD_RAD),
    (0.5, ONWARD_RAD),
    (0.25, ONWARD_RAD),
    (1.0, BACKWARD_RAD),
    (0.5, BACKWARD_RAD),
    (0.25, BACKWARD_RAD),
];
const ONWARD_RAD: [f64; 2] = [0.0, MAX_ONWARD_RAD];
const BACKWARD_RAD: [f64; 2] = [MAX_ONWARD_RAD, TAU];
/// Difference below which a direction is the same as the one chosen before, rad.
const SAME_DIRECTION_RAD: f64 = 0.1;
/// Maximum deviation of a direction that leads onward, rad.
const MAX_ONWARD_RAD: f64 = 1.75;

/// Use of the robot's velocity in the choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Velocity {
    /// The robot changes its velocity with limited acceleration.
    Considered,
    /// The robot changes its velocity at once; for comparison.
    Ignored,
}

/// Rules for the choice of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChoiceRules {
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Maximum acceleration in any direction, m/s^2, above 0.
    pub acceleration_mps2: f64,
    /// Minimum clearance around the robot's center: its radius plus the margin, m.
    pub clearance_m: f64,
    /// Time step at which trajectories are checked, s.
    pub step_s: f64,
    /// Time until the next choice takes effect, after which the robot must still be able to stop, s.
    pub reaction_s: f64,
    /// Use of the robot's velocity.
    pub velocity: Velocity,
    /// Minimum deviation that passing on the other side than before must save, rad, at least 0.
    pub side_change_rad: f64,
    /// Additional clearance required of a direction nearer to the desired one than the previous choice, m, at least 0.
    /// Prevents oscillation due to noise.
    pub nearer_m: f64,
    /// Range of the deviation from the desired direction: minimum, and exclusive maximum, rad.
    pub deviation_rad: [f64; 2],
}

/// Result of the previous choice; by default there was none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PreviousChoice {
    /// Side of the desired direction: 1 left, -1 right, 0 neither.
    pub side: i8,
    /// Direction in the frame of the free distances, rad.
    pub direction_rad: Option<f64>,
}

/// State of the robot from which directions are judged, in the frame of the free distances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Start {
    /// Position of the robot's center, m.
    pub position_m: Vector2<f64>,
    /// Velocity, m/s.
    pub velocity_mps: Vector2<f64>,
}

/// Direction that was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Velocity, m/s.
    pub velocity_mps: Vector2<f64>,
    /// Direction of the velocity, rad.
    pub direction_rad: f64,
    /// Sector with this direction in its middle; `None` for the desired direction itself.
    pub sector: Option<usize>,
    /// Number of directions that precede it in the order of preference.
    pub rank: usize,
    /// Side of the desired direction on which it lies: 1 left, -1 right, 0 neither.
    pub side: i8,
}

/// Direction that may be chosen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) direction_rad: f64,
    pub(super) sector: Option<usize>,
    deviation_rad: f64,
}

impl Candidate {
    /// Returns true if the deviation is at least `min_rad` and below `max_rad`.
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

impl PreviousChoice {
    /// Returns the additional clearance required of a candidate, m.
    fn additional_clearance_m(&self, candidate: &Candidate, goal_rad: f64, rules: &ChoiceRules) -> f64 {
        let Some(previous_rad) = self.direction_rad else { return 0.0 };
        let is_same = wrap_angle(candidate.direction_rad - previous_rad).abs() < SAME_DIRECTION_RAD;
        let is_nearer = candidate.deviation_rad.abs() < wrap_angle(goal_rad - previous_rad).abs();
        if is_nearer && !is_same { rules.nearer_m } else { 0.0 }
    }
}

/// Chooser of directions. Allocates only if there are more sectors than in any choice before.
#[derive(Clone, Debug, Default)]
pub struct Chooser {
    candidates: Vec<Candidate>,
}

impl Chooser {
    /// Chooses the direction nearest to `goal_rad` in which the robot keeps its clearance and can still stop after its
    /// reaction time. Of two equally near directions it prefers the side of the previous choice, otherwise left. `None`
    /// if there is no such direction.
    pub fn choose(
        &mut self,
        free: &FreeDistances,
        start: &Start,
        goal_rad: f64,
        previous: &PreviousChoice,
        rules: &ChoiceRules,
    ) -> Option<Choice> {
        // Every trajectory begins here.
        if free.clearance_m(start.position_m) < rules.clearance_m {
            return None;
        }
        let order = self.order(free, goal_rad, previous.side, rules.side_change_rad);
        let mut tried =
            order.iter().enumerate().filter(|(_, candidate)| candidate.is_within(rules.deviation_rad));
        tried.find_map(|(rank, candidate)| {
            let direction_rad = candidate.direction_rad;
            let velocity_mps = Vector2::new(direction_rad.cos(), direction_rad.sin()) * rules.speed_mps;
            let paths = Trajectories::new(start, velocity_mps, rules);
            let clearance_m = rules.clearance_m + previous.additional_clearance_m(candidate, goal_rad, rules);
            let rules = ChoiceRules { clearance_m, ..*rules };
            paths.keep_clear(free, &rules).then(|| Choice {
                velocity_mps,
                direction_rad,
                sector: candidate.sector,
                rank,
                side: candidate.side(),
            })
        })
    }

    /// Chooses a direction like [`Chooser::choose`], but tries lower speeds and then directions backward in the order
    /// of [`SPEED_LADDER`].
    pub fn choose_speed(
        &mut self,
        free: &FreeDistances,
        start: &Start,
        goal_rad: f64,
        previous: &PreviousChoice,
        rules: &ChoiceRules,
    ) -> Option<Choice> {
        SPEED_LADDER.iter().find_map(|&(share, deviation_rad)| {
            let rules = ChoiceRules { speed_mps: share * rules.speed_mps, deviation_rad, ..*rules };
            self.choose(free, start, goal_rad, previous, &rules)
        })
    }

    /// Returns the desired direction and the middles of all sectors in the order of preference: by deviation, which
    /// `side_change_rad` increases on the other side than `last_side`.
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

#[cfg(test)]
mod tests {
    use super::super::trajectories::min_clearance_m;
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

    #[test]
    fn skipped_steps_change_no_choice() {
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
            let choice = chooser.choose(&free, &start, goal, &PreviousChoice::default(), &RULES);
            assert_eq!(choice.map(|choice| choice.rank), expected);
            taken += usize::from(expected.is_some());
        }
        assert!(taken > 20, "{taken}");
    }

    #[test]
    fn a_mirrored_scene_gives_the_mirrored_choice() {
        let mut random = Pcg64::seed_from_u64(4);
        let mut chooser = Chooser::default();
        for _ in 0..200 {
            let (distances, start, goal) = random_case(&mut random);
            let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
            free.set(distances.iter().copied());
            let here = chooser.choose(
                &free,
                &start,
                goal,
                &PreviousChoice { side: 1, ..PreviousChoice::default() },
                &RULES,
            );
            free.set(distances.iter().rev().copied());
            let mirrored =
                Start { velocity_mps: start.velocity_mps.component_mul(&Vector2::new(1.0, -1.0)), ..start };
            let there = chooser.choose(
                &free,
                &mirrored,
                -goal,
                &PreviousChoice { side: -1, ..PreviousChoice::default() },
                &RULES,
            );
            let (Some(here), Some(there)) = (here, there) else {
                assert_eq!(here.is_some(), there.is_some());
                continue;
            };
            assert!(wrap_angle(here.direction_rad + there.direction_rad).abs() < 1e-9);
            assert_eq!(here.side, -there.side);
        }
    }

    #[test]
    fn another_obstacle_never_brings_the_choice_nearer_to_the_goal() {
        let mut random = Pcg64::seed_from_u64(5);
        let mut chooser = Chooser::default();
        for _ in 0..200 {
            let (mut distances, start, goal) = random_case(&mut random);
            let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
            free.set(distances.iter().copied());
            let before = chooser.choose(&free, &start, goal, &PreviousChoice::default(), &RULES);
            distances[random.random_range(0..32)] *= 0.5;
            free.set(distances);
            let after = chooser.choose(&free, &start, goal, &PreviousChoice::default(), &RULES);
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
                .choose(
                    &free,
                    &Start::default(),
                    0.0,
                    &PreviousChoice { side: last, ..PreviousChoice::default() },
                    &rules,
                )
                .map(|choice| choice.side)
        };
        assert_eq!([side(0, 0.5), side(1, 0.0), side(-1, 0.0)], [Some(-1); 3]);
        assert_eq!((side(1, 0.5), side(-1, 0.5)), (Some(1), Some(-1)));
    }

    #[test]
    fn driving_onward_slowly_precedes_driving_backward_fast() {
        let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
        free.set((0..32).map(|j| if (11..21).contains(&j) { 1.2 } else { 0.3 }));
        let mut chooser = Chooser::default();
        let fast = chooser.choose(&free, &Start::default(), 0.0, &PreviousChoice::default(), &RULES);
        assert!(fast.is_some_and(|choice| choice.velocity_mps.x < -0.35), "{fast:?}");
        let slow = chooser.choose_speed(&free, &Start::default(), 0.0, &PreviousChoice::default(), &RULES);
        assert!(slow.is_some_and(|choice| choice.velocity_mps.x > 0.0), "{slow:?}");
    }

    #[test]
    fn in_a_closed_ring_the_robot_drives_slowly() {
        let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
        free.set([0.3; 32]);
        let mut chooser = Chooser::default();
        assert_eq!(chooser.choose(&free, &Start::default(), 0.5, &PreviousChoice::default(), &RULES), None);
        let slow = chooser.choose_speed(&free, &Start::default(), 0.5, &PreviousChoice::default(), &RULES);
        assert_eq!(slow.map(|slow| slow.velocity_mps.norm()), Some(0.2));
    }

    #[test]
    fn a_direction_nearer_to_the_goal_needs_additional_clearance() {
        let mut free = FreeDistances::all_around(Vector2::zeros(), 32, 1.2);
        // An obstacle ahead is just far enough: 16 mm of reaction, 267 mm of braking, 100 mm of clearance.
        free.set((0..32).map(|j| if (1..31).contains(&j) { 1.2 } else { 0.39 }));
        let mut chooser = Chooser::default();
        let mut direction = |before: Option<f64>, nearer_m: f64| {
            let rules = ChoiceRules { nearer_m, ..RULES };
            let start = Start { velocity_mps: Vector2::new(0.4, 0.0), ..Start::default() };
            let before = PreviousChoice { direction_rad: before, ..PreviousChoice::default() };
            chooser.choose(&free, &start, 0.0, &before, &rules).map(|choice| choice.direction_rad)
        };
        assert_eq!(
            [direction(None, 0.03), direction(Some(0.6), 0.0), direction(Some(0.0), 0.03)],
            [Some(0.0); 3]
        );
        assert!(direction(Some(0.6), 0.03).is_some_and(|direction| direction.abs() > 0.1));
    }
}
