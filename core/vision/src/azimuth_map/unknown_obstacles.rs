use nalgebra::Point2;
use std::f64::consts::TAU;

use crate::polygon::convex_hull;

/// Inflation of obstacles by the size of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inflation {
    /// Radius of the circle around each edge, m.
    pub radius_m: f64,
    /// Number of sides of the polygon circumscribed about the circle, at least 3.
    pub sides: u32,
}

impl Inflation {
    /// Creates the inflation for a robot of this radius and edges with standard deviation `sigma_m`, with a margin of
    /// 0.05 m.
    #[must_use]
    pub fn of_robot(robot_radius_m: f64, sigma_m: f64) -> Self {
        Self { radius_m: robot_radius_m + 2.0 * sigma_m + 0.05, sides: 16 }
    }
}

/// Clusters edges into obstacles. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct ObstacleClusters {
    labels: Vec<usize>,
}

impl ObstacleClusters {
    /// Labels each edge with the index of the first edge of its obstacle. Edges at most `link_m` apart belong together,
    /// unless `are_apart` returns true for them.
    pub fn label(
        &mut self,
        edges: &[Point2<f64>],
        link_m: f64,
        are_apart: impl Fn(usize, usize) -> bool,
    ) -> &[usize] {
        self.labels.clear();
        self.labels.extend(0..edges.len());
        for i in 0..edges.len() {
            for j in 0..i {
                let [a, b] = [self.labels[i], self.labels[j]];
                if a != b && (edges[i] - edges[j]).norm() <= link_m && !are_apart(i, j) {
                    let (kept, replaced) = (a.min(b), a.max(b));
                    self.labels
                        .iter_mut()
                        .filter(|label| **label == replaced)
                        .for_each(|label| *label = kept);
                }
            }
        }
        &self.labels
    }
}

/// Writes to `out` the configuration-space obstacle of these edges, counterclockwise: the convex hull of a polygon
/// around each edge. The robot's center must stay outside. `corners` is scratch memory. Empty without edges.
pub fn inflate(
    edges: impl IntoIterator<Item = Point2<f64>>,
    inflation: &Inflation,
    corners: &mut Vec<Point2<f64>>,
    out: &mut Vec<Point2<f64>>,
) {
    let sides = inflation.sides.max(3);
    let radius = inflation.radius_m / (std::f64::consts::PI / f64::from(sides)).cos();
    corners.clear();
    for edge in edges {
        for k in 0..sides {
            let (sin, cos) = (TAU * f64::from(k) / f64::from(sides)).sin_cos();
            corners.push(Point2::new(edge.x + radius * cos, edge.y + radius * sin));
        }
    }
    convex_hull(corners, out);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polygon::{nearest_on_segment, sides};

    #[test]
    fn the_robot_has_room_all_around() {
        let edges = [Point2::new(1.0, 2.0), Point2::new(1.4, 2.1)];
        let (mut corners, mut polygon) = (Vec::new(), Vec::new());
        let inflation = Inflation::of_robot(0.2, 0.01);
        inflate(edges, &inflation, &mut corners, &mut polygon);
        for side in sides(&polygon) {
            for edge in edges {
                assert!((nearest_on_segment(side, edge) - edge).norm() >= inflation.radius_m - 1e-12);
            }
        }
        inflate([], &inflation, &mut corners, &mut polygon);
        assert!(polygon.is_empty());
    }

    #[test]
    fn a_passage_keeps_two_obstacles_apart() {
        let edges = [0.0, 0.3, 0.6].map(|x| Point2::new(x, 0.0));
        let mut clusters = ObstacleClusters::default();
        assert_eq!(clusters.label(&edges, 0.35, |_, _| false), [0, 0, 0]);
        assert_eq!(clusters.label(&edges, 0.35, |i, j| (i, j) == (2, 1)), [0, 0, 2]);
    }
}
