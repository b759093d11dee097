//! Heading of the robot from the vanishing point of the map's main direction, independent of matched edges.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Vector2, Vector3};
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::geometry::{angle_difference, wrap_angle};
use yamabico_vision::corridor::heading::RobotHeading;
use yamabico_vision::map::{EdgeKind, WireFrame};
use yamabico_vision::segments::Segment;
use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};

use crate::slip::Angle;

/// Minimum standard deviation of the heading, rad: errors of the mount and of the lines' selection.
const MIN_SIGMA_RAD: f64 = 0.01;
/// Maximum elevation of a horizontal direction above the floor plane, rad: chance intersections lie anywhere.
const MAX_ELEVATION_RAD: f64 = 0.044;
/// Minimum number of segments that meet in the vanishing point.
const MIN_SEGMENTS: usize = 4;
/// Minimum fraction of the map's horizontal edge length that runs across the main direction for a vanishing point to be
/// possibly that of the cross direction.
const MIN_ACROSS: f64 = 0.1;

/// Observer of the heading modulo the map's main directions. Reuses its buffers.
#[derive(Clone, Debug)]
pub struct AxisHeading {
    finder: VanishingPointFinder,
    axis_rad: f64,
    /// Angle between two main directions of the map, rad: a half or a quarter turn.
    symmetry_rad: f64,
}

/// Heading observed in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenHeading {
    /// Heading in the map frame, of the possible ones the nearest to the expected heading.
    pub heading: Angle,
    /// True if enough segments meet at the height of the horizon: not by chance.
    pub is_supported: bool,
}

impl AxisHeading {
    /// Creates an observer for this map and camera mount.
    #[must_use]
    pub fn new(map: &WireFrame, mount: &Mount) -> Self {
        let down = mount.rotation_body_from_camera().transpose() * Vector3::new(0.0, 0.0, -1.0);
        let config = VanishingPointConfig { down_in_camera: down, ..VanishingPointConfig::default() };
        let (axis_rad, across) = main_direction(map);
        Self {
            finder: VanishingPointFinder::new(config),
            axis_rad,
            symmetry_rad: if across >= MIN_ACROSS { FRAC_PI_2 } else { PI },
        }
    }

    /// Returns the main direction of the map, rad, in (-pi/2, pi/2].
    #[must_use]
    pub fn axis_rad(&self) -> f64 {
        self.axis_rad
    }

    /// Observes the heading in the segments (undistorted) of an image, near the `expected` heading (rad); `None` without
    /// a vanishing point.
    pub fn observe(
        &mut self,
        segments: &[Segment],
        pinhole: &Pinhole,
        mount: &Mount,
        expected: f64,
    ) -> Option<SeenHeading> {
        let intrinsics = pinhole.intrinsics();
        let found = self.finder.find(segments, intrinsics, None).ok()?;
        let from_axis = RobotHeading::from_axis(found.direction, mount);
        let heading = self.axis_rad + from_axis.heading;
        let turns = (angle_difference(expected, heading) / self.symmetry_rad).round();
        let sigma = (found.covariance[(0, 0)].max(0.0).sqrt() / intrinsics.fx).max(MIN_SIGMA_RAD);
        Some(SeenHeading {
            heading: Angle { rad: wrap_angle(heading + turns * self.symmetry_rad), variance: sigma * sigma },
            is_supported: found.inliers.len() >= MIN_SEGMENTS
                && from_axis.elevation.abs() <= MAX_ELEVATION_RAD,
        })
    }
}

/// Returns the most frequent direction of the horizontal edges weighted by length, rad, in (-pi/2, pi/2]: the mean
/// direction within the strongest bin of 1 degree. Also returns the length across it, as a fraction of the total.
fn main_direction(map: &WireFrame) -> (f64, f64) {
    let mut lengths = [0.0; 180];
    let horizontal = || map.edges().iter().filter(|edge| edge.kind == EdgeKind::Horizontal);
    let degree =
        |run: Vector2<f64>| (run.y.atan2(run.x).to_degrees().round() as i32).rem_euclid(180) as usize;
    for edge in horizontal() {
        let run = (edge.to - edge.from).xy();
        lengths[degree(run)] += run.norm();
    }
    let best = (0..180).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b])).unwrap_or(0);
    let mut sum = Vector2::zeros();
    for edge in horizontal() {
        let run = (edge.to - edge.from).xy();
        if degree(run) == best {
            sum += if run.dot(&sum) < 0.0 { -run } else { run };
        }
    }
    let total: f64 = lengths.iter().sum();
    let across = (89..=91).map(|turn| lengths[(best + turn) % 180]).sum::<f64>() / total.max(1e-9);
    let direction = sum.y.atan2(sum.x);
    let is_backward = direction.abs() > FRAC_PI_2;
    (if is_backward { angle_difference(direction, PI) } else { direction }, across)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use yamabico_vision::map::Edge;

    #[test]
    fn the_longest_edges_determine_the_main_direction() {
        let (sin, cos) = 0.3_f64.sin_cos();
        let along =
            |length: f64| Edge::between(Point3::origin(), Point3::new(length * cos, length * sin, 0.0));
        let back = Edge::between(Point3::new(9.0 * cos, 9.0 * sin, 1.0), Point3::new(0.0, 0.0, 1.0));
        let across = Edge::between(Point3::origin(), Point3::new(-2.0 * sin, 2.0 * cos, 0.0));
        let map = WireFrame::new(vec![across, along(5.0), back], Vec::new());
        let (direction, fraction) = main_direction(&map);
        assert!((direction - 0.3).abs() < 1e-9 && (fraction - 2.0 / 16.0).abs() < 1e-9, "{fraction}");
    }
}
