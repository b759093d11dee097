use nalgebra::Point2;
use thiserror::Error;

use crate::polygon::{cross, nearest_on_segment, sides};

/// Reason why there is no path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum PathError {
    /// The start lies inside an obstacle; [`VisibilityGraph::nearest_exit`] returns the nearest point outside.
    #[error("the start lies in an obstacle")]
    StartInside,
    /// The goal lies inside an obstacle.
    #[error("the goal lies in an obstacle")]
    GoalInside,
    /// Obstacles block every path.
    #[error("obstacles block every path to the goal")]
    Enclosed,
}

/// Penetration of an obstacle that counts as touching, m: paths run along the sides of obstacles.
const TOUCH_TOLERANCE_M: f64 = 1e-9;

/// Shortest paths among convex obstacles, along straight lines between their corners. Searched with A*. Reuses its
/// buffers.
#[derive(Clone, Debug, Default)]
pub struct VisibilityGraph {
    nodes: Vec<Node>,
    path: Vec<Point2<f64>>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    point: Point2<f64>,
    from_start_m: f64,
    to_goal_m: f64,
    before: usize,
    is_done: bool,
}

impl VisibilityGraph {
    /// Finds the shortest path from `start` to `goal`, both included. Returns the path and its length, m. `obstacles`
    /// must be convex and counterclockwise; those with fewer than three corners are ignored.
    ///
    /// # Errors
    /// [`PathError`] if there is no path.
    pub fn shortest<P: AsRef<[Point2<f64>]>>(
        &mut self,
        start: Point2<f64>,
        goal: Point2<f64>,
        obstacles: &[P],
    ) -> Result<(&[Point2<f64>], f64), PathError> {
        let is_inside = |point| obstacles.iter().any(|obstacle| is_inside(obstacle.as_ref(), point));
        if is_inside(start) {
            return Err(PathError::StartInside);
        }
        if is_inside(goal) {
            return Err(PathError::GoalInside);
        }
        let node = |point: Point2<f64>| Node {
            point,
            from_start_m: f64::INFINITY,
            to_goal_m: (goal - point).norm(),
            before: 0,
            is_done: false,
        };
        self.nodes.clear();
        self.nodes.push(Node { from_start_m: 0.0, ..node(start) });
        self.nodes.push(node(goal));
        for obstacle in obstacles {
            let corners = obstacle.as_ref().iter().filter(|corner| !is_inside(**corner));
            self.nodes.extend(corners.map(|corner| node(*corner)));
        }
        while let Some(here) = self.nearest() {
            if here == 1 {
                return Ok(self.trace());
            }
            self.nodes[here].is_done = true;
            self.reach_from(here, obstacles);
        }
        Err(PathError::Enclosed)
    }

    /// Nearest point outside the obstacles that contain `start`; `start` itself if there are none.
    #[must_use]
    pub fn nearest_exit<P: AsRef<[Point2<f64>]>>(start: Point2<f64>, obstacles: &[P]) -> Point2<f64> {
        let around = obstacles.iter().map(AsRef::as_ref).filter(|obstacle| is_inside(obstacle, start));
        let exits = around.flat_map(sides).map(|side| nearest_on_segment(side, start));
        let distance = |point: &Point2<f64>| (point - start).norm_squared();
        exits.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(start)
    }

    /// Returns true if the line crosses no obstacle; touching is allowed.
    #[must_use]
    pub fn is_open<P: AsRef<[Point2<f64>]>>(line: [Point2<f64>; 2], obstacles: &[P]) -> bool {
        !obstacles.iter().any(|obstacle| crosses(obstacle.as_ref(), line))
    }

    /// Index of the open node with the smallest path length estimate.
    fn nearest(&self) -> Option<usize> {
        let open = self.nodes.iter().enumerate().filter(|(_, n)| !n.is_done && n.from_start_m.is_finite());
        let through = |n: &Node| n.from_start_m + n.to_goal_m;
        open.min_by(|a, b| through(a.1).total_cmp(&through(b.1))).map(|(index, _)| index)
    }

    fn reach_from<P: AsRef<[Point2<f64>]>>(&mut self, here: usize, obstacles: &[P]) {
        let from = self.nodes[here];
        for (index, node) in self.nodes.iter_mut().enumerate().filter(|(_, node)| !node.is_done) {
            let length = from.from_start_m + (node.point - from.point).norm();
            if index == here || length >= node.from_start_m {
                continue;
            }
            let line = [from.point, node.point];
            if Self::is_open(line, obstacles) {
                (node.from_start_m, node.before) = (length, here);
            }
        }
    }

    fn trace(&mut self) -> (&[Point2<f64>], f64) {
        self.path.clear();
        let mut at = 1;
        while at != 0 {
            self.path.push(self.nodes[at].point);
            at = self.nodes[at].before;
        }
        self.path.push(self.nodes[0].point);
        self.path.reverse();
        (&self.path, self.nodes[1].from_start_m)
    }
}

/// Returns true if the point lies inside a convex polygon by more than the tolerance.
fn is_inside(polygon: &[Point2<f64>], point: Point2<f64>) -> bool {
    polygon.len() >= 3 && sides(polygon).all(|[a, b]| cross(a, b, point) > TOUCH_TOLERANCE_M * (b - a).norm())
}

/// Returns true if part of the line lies inside a convex polygon by more than the tolerance, by clipping it against
/// each side.
fn crosses(polygon: &[Point2<f64>], [from, to]: [Point2<f64>; 2]) -> bool {
    if polygon.len() < 3 {
        return false;
    }
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for [a, b] in sides(polygon) {
        let length = (b - a).norm();
        let (start, end) =
            (cross(a, b, from) / length - TOUCH_TOLERANCE_M, cross(a, b, to) / length - TOUCH_TOLERANCE_M);
        if start <= 0.0 && end <= 0.0 {
            return false;
        }
        if start < 0.0 {
            first = first.max(start / (start - end));
        } else if end < 0.0 {
            last = last.min(start / (start - end));
        }
        if first >= last {
            return false;
        }
    }
    (last - first) * (to - from).norm() > TOUCH_TOLERANCE_M
}

#[cfg(test)]
mod tests {
    use yamabico_geometry::Hypotenuse;

    use super::*;

    fn square(x: f64, y: f64, half: f64) -> Vec<Point2<f64>> {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(i, j)| Point2::new(x + i * half, y + j * half))
            .to_vec()
    }

    #[test]
    fn the_path_takes_the_nearer_side() {
        let mut graph = VisibilityGraph::default();
        let (start, goal) = (Point2::new(0.0, 0.1), Point2::new(4.0, 0.1));
        let (path, length) = graph.shortest(start, goal, &[square(2.0, 0.0, 0.5)]).unwrap();
        assert_eq!(path, [start, Point2::new(1.5, 0.5), Point2::new(2.5, 0.5), goal]);
        assert!((length - (2.0 * 1.5_f64.hypotenuse(0.4) + 1.0)).abs() < 1e-12);
        assert_eq!(graph.shortest(start, goal, &[] as &[Vec<_>]).unwrap().0, [start, goal]);
    }

    #[test]
    fn unreachable_goals_are_rejected() {
        let mut graph = VisibilityGraph::default();
        let (start, goal) = (Point2::new(0.0, 0.0), Point2::new(4.0, 0.0));
        let around_goal = [square(4.0, 0.0, 0.2)];
        assert_eq!(graph.shortest(start, goal, &around_goal), Err(PathError::GoalInside));
        let around_start = [square(0.0, 0.1, 0.2)];
        assert_eq!(graph.shortest(start, goal, &around_start), Err(PathError::StartInside));
        let out = VisibilityGraph::nearest_exit(start, &around_start);
        assert!((out - Point2::new(0.0, -0.1)).norm() < 1e-12);
        assert!(graph.shortest(out, goal, &around_start).is_ok());
        // Four walls that overlap at their ends.
        let wall = |x: f64, y: f64, half_x: f64, half_y: f64| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(i, j)| Point2::new(x + i * half_x, y + j * half_y))
                .to_vec()
        };
        let room = [
            wall(1.0, 0.0, 0.1, 1.2),
            wall(-1.0, 0.0, 0.1, 1.2),
            wall(0.0, 1.0, 1.2, 0.1),
            wall(0.0, -1.0, 1.2, 0.1),
        ];
        assert_eq!(graph.shortest(start, goal, &room), Err(PathError::Enclosed));
    }
}
