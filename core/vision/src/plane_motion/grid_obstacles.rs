//! Things on the evidence grid: connected cells, with the near edge that the robot would meet.

use nalgebra::{Matrix2, Point2, Vector2};
use yamabico_geometry::Pose2;

use super::evidence_grid::{CELL_M, CELLS, EvidenceGrid};

/// Depth of the cells, from the nearest one on, that make the near edge, m.
const EDGE_M: f64 = 0.3;
/// Share of a thing's largest log odds from which its cells count for the edge: those before it are smear along the line
/// of sight.
const EDGE_SHARE: f64 = 0.3;
/// Standard deviation of a thing's distance that all its cells share, m.
const RANGE_SIGMA_M: f64 = 0.1;
/// Maximum number of things reported; the nearest come first.
const MAX_OBSTACLES: usize = 32;

/// A thing on the grid, odometry frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridObstacle {
    /// Middle of the near edge, m.
    pub foot: Point2<f64>,
    /// Covariance of `foot`, square meters.
    pub covariance: Matrix2<f64>,
    /// Distance from the robot's center to the nearest cell, m.
    pub near_m: f64,
    /// Half the width of the near edge across the line of sight, m.
    pub half_width_m: f64,
    /// Largest smoothed log odds of its cells.
    pub peak: f64,
    /// Number of cells.
    pub cells: usize,
}

/// Finds things on a grid. Allocates when it is created and no more.
#[derive(Clone, Debug)]
pub struct ObstacleFinder {
    is_open: Vec<bool>,
    stack: Vec<usize>,
    members: Vec<usize>,
    obstacles: Vec<GridObstacle>,
}

impl Default for ObstacleFinder {
    fn default() -> Self {
        Self {
            is_open: vec![false; CELLS * CELLS],
            stack: Vec::with_capacity(CELLS * CELLS),
            members: Vec::with_capacity(CELLS * CELLS),
            obstacles: Vec::with_capacity(MAX_OBSTACLES),
        }
    }
}

impl ObstacleFinder {
    /// Finds the things whose smoothed log odds exceed `threshold`, for a robot at `robot` (odometry frame) whose
    /// heading has the standard deviation `turn_sigma` (rad). Cells at places that are not `counted`, such as those of
    /// known walls, are left out. The nearest thing comes first.
    pub fn find(
        &mut self,
        grid: &EvidenceGrid,
        robot: &Pose2,
        threshold: f64,
        turn_sigma: f64,
        counted: impl Fn(Point2<f64>) -> bool,
    ) -> &[GridObstacle] {
        self.obstacles.clear();
        for (cell, (open, &log_odds)) in self.is_open.iter_mut().zip(grid.smoothed()).enumerate() {
            *open = f64::from(log_odds) > threshold && counted(grid.center(cell));
        }
        for start in 0..self.is_open.len() {
            if !self.is_open[start] {
                continue;
            }
            self.collect(start);
            let obstacle = self.describe(grid, robot, turn_sigma);
            if self.obstacles.len() < MAX_OBSTACLES {
                self.obstacles.push(obstacle);
            }
        }
        self.obstacles.sort_unstable_by(|a, b| a.near_m.total_cmp(&b.near_m));
        &self.obstacles
    }

    /// Gathers the cells connected to `start`, diagonals included.
    fn collect(&mut self, start: usize) {
        self.members.clear();
        self.is_open[start] = false;
        self.stack.push(start);
        while let Some(cell) = self.stack.pop() {
            self.members.push(cell);
            let (x, y) = (cell % CELLS, cell / CELLS);
            for y in y.saturating_sub(1)..=(y + 1).min(CELLS - 1) {
                for x in x.saturating_sub(1)..=(x + 1).min(CELLS - 1) {
                    let next = x + y * CELLS;
                    if std::mem::replace(&mut self.is_open[next], false) {
                        self.stack.push(next);
                    }
                }
            }
        }
    }

    fn describe(&self, grid: &EvidenceGrid, robot: &Pose2, turn_sigma: f64) -> GridObstacle {
        let robot_at = Point2::new(robot.x, robot.y);
        let distance = |cell: usize| (grid.center(cell) - robot_at).norm();
        let weight = |cell: usize| f64::from(grid.smoothed()[cell]);
        let peak = self.members.iter().map(|&cell| weight(cell)).fold(0.0, f64::max);
        let strong = || self.members.iter().copied().filter(move |&cell| weight(cell) >= EDGE_SHARE * peak);
        let near_m = strong().map(distance).fold(f64::INFINITY, f64::min);
        let edge = || strong().filter(move |&cell| distance(cell) <= near_m + EDGE_M);
        let total: f64 = edge().map(weight).sum();
        let mean = edge().map(|cell| grid.center(cell).coords * weight(cell)).sum::<Vector2<f64>>() / total;
        let sight = (mean - robot_at.coords).try_normalize(1e-9).unwrap_or(Vector2::x());
        let across = Vector2::new(-sight.y, sight.x);
        let mut scatter = Matrix2::identity() * (CELL_M * CELL_M / 12.0);
        let (mut left, mut right) = (0.0_f64, 0.0_f64);
        for cell in edge() {
            let from_mean = grid.center(cell).coords - mean;
            scatter += from_mean * from_mean.transpose() * (weight(cell) / total);
            let aside = from_mean.dot(&across);
            (left, right) = (left.max(aside), right.min(aside));
        }
        let turned = near_m * turn_sigma;
        let common = sight * sight.transpose() * (RANGE_SIGMA_M * RANGE_SIGMA_M)
            + across * across.transpose() * (turned * turned);
        GridObstacle {
            foot: mean.into(),
            covariance: scatter + common,
            near_m,
            half_width_m: 0.5 * (left - right + CELL_M),
            peak,
            cells: self.members.len(),
        }
    }
}
