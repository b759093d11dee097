//! Choice of a heading within the view of the forward camera, from the ends of free floor of the grid's columns.

use nalgebra::Vector2;
use yamabico_core::geometry::Twist;
use yamabico_core::message::FreeDirection;
use yamabico_core::sensor::Robot;

use super::ground::GroundGrid;
use crate::config::Config;
use crate::direction::{Chooser, FreeDistances, HeadingChoice, HeadingRules, Rollout};

/// Turn rate per heading error for a forward camera, 1/s.
const FORWARD_GAIN_PER_S: f64 = 2.0;
/// Time step of a simulated trajectory, s.
const ROLLOUT_STEP_S: f64 = 0.04;
/// Time after which a simulated robot brakes, s; short, since a forward camera shows little to the sides.
const FORWARD_HORIZON_S: f64 = 1.5;
/// Minimum deviation that a change of sides must save, rad.
const FORWARD_SIDE_CHANGE_RAD: f64 = 0.3;

/// Chooser of headings within the view of the forward camera.
#[derive(Clone, Debug)]
pub struct OpenFloor {
    distances: FreeDistances,
    near_m: Vec<f64>,
    chooser: Chooser,
    rules: HeadingRules,
    side: i8,
}

impl OpenFloor {
    /// Creates the chooser for a grid and a robot. `None` if a column shows no floor, or if the robot cannot brake or
    /// turn.
    #[must_use]
    pub fn new(config: &Config, ground: &GroundGrid, robot: &Robot) -> Option<Self> {
        let ends: Option<Vec<FreeDirection>> =
            (0..config.columns as usize).rev().map(|column| ground.end(column, config.rows)).collect();
        let ends = ends.filter(|ends| {
            ends.len() > 1 && ends.is_sorted_by(|right, left| right.azimuth_rad < left.azimuth_rad)
        })?;
        let half_rad = |pair: &[FreeDirection]| 0.5 * (pair[1].azimuth_rad - pair[0].azimuth_rad);
        let (first, last) = (&ends[..2], &ends[ends.len() - 2..]);
        let mut borders = vec![first[0].azimuth_rad - half_rad(first)];
        borders.extend(ends.windows(2).map(|pair| pair[0].azimuth_rad + half_rad(pair)));
        borders.push(last[1].azimuth_rad + half_rad(last));
        // Distance up to which every column shows the floor.
        let farthest_m = ends.iter().map(|end| end.distance_m).fold(f64::INFINITY, f64::min);
        let limits = &robot.limits;
        let [along, turning] = [0, 2].map(|axis| limits.acceleration[axis].min(limits.deceleration[axis]));
        let is_usable = |value: f64| value > 0.0 && value.is_finite();
        (is_usable(along) && is_usable(turning) && is_usable(farthest_m)).then(|| Self {
            near_m: vec![farthest_m; ends.len()],
            distances: FreeDistances::between(Vector2::zeros(), borders, farthest_m),
            chooser: Chooser::default(),
            rules: HeadingRules {
                speed_mps: config.speed_mps.min(limits.speed[0]),
                acceleration_mps2: along,
                turn_radps: config.turn_radps.min(limits.speed[2]),
                turn_acceleration_radps2: turning,
                gain_per_s: FORWARD_GAIN_PER_S,
                step_s: ROLLOUT_STEP_S,
                horizon_s: FORWARD_HORIZON_S,
                clearance_m: robot.radius_m + config.side_m,
                side_change_rad: FORWARD_SIDE_CHANGE_RAD,
                deviation_rad: [0.0, std::f64::consts::TAU],
            },
            side: 0,
        })
    }

    /// Chooses the clear heading nearest to straight ahead for a robot that drives with this twist. `ends` are the ends
    /// of free floor, from right to left. `None` if no heading is clear.
    pub fn choose(&mut self, ends: &[FreeDirection], twist: &Twist) -> Option<HeadingChoice> {
        if ends.len() != self.near_m.len() {
            return None;
        }
        self.near_m.fill(f64::INFINITY);
        for (column, end) in ends.iter().enumerate() {
            // An obstacle counts in its column and in the sector that contains its near edge.
            let sector = (0..self.near_m.len()).find(|&sector| {
                let (right, left) = self.distances.borders(sector);
                (right..left).contains(&end.azimuth_rad)
            });
            for sector in [Some(column), sector].into_iter().flatten() {
                self.near_m[sector] = self.near_m[sector].min(end.distance_m);
            }
        }
        self.distances.set(self.near_m.iter().copied());
        let start = Rollout::new(Vector2::zeros(), 0.0, twist.linear, twist.angular);
        let choice =
            self.chooser.choose_heading_speed(&self.distances, &start, 0.0, self.side, &self.rules)?;
        self.side = choice.side;
        Some(choice)
    }
}
