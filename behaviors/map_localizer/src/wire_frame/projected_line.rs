//! Projection of a map edge to an image line, with derivatives with respect to the robot's pose.
//!
//! The image line is the cross product of the edge's ends in the optical frame, which is valid without clipping, also
//! for ends behind the camera.

use nalgebra::{Matrix2x3, Matrix3, Point3, Vector2, Vector3};
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_vision::map::Edge;

/// Minimum norm of a line's normal relative to the distances of the ends; a smaller one has no image.
const MIN_NORM: f64 = 1e-12;
/// Minimum depth of a vertical edge along the optical axis, m.
const MIN_DEPTH_M: f64 = 0.1;

/// Projection from the body frame to homogeneous pixels (px m, px m, m).
#[derive(Clone, Copy, Debug)]
pub struct LineCamera {
    /// Projection of directions.
    pixel_from_body: Matrix3<f64>,
    /// Projection of the camera's position.
    mount: Vector3<f64>,
}

/// Projection from the map frame to homogeneous pixels, for one pose of the robot.
#[derive(Clone, Copy, Debug)]
pub struct LineView {
    /// Projection of directions.
    pixel_from_map: Matrix3<f64>,
    /// Projection of the camera's position relative to the robot.
    mount: Vector3<f64>,
    /// Robot in the map frame, m.
    position: Vector3<f64>,
}

/// Image line with its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectedLine {
    /// (cos alpha, sin alpha, -rho): the dot product with (u, v, 1) is the signed distance of a pixel (u, v).
    pub coefficients: Vector3<f64>,
    /// Derivatives of the coefficients (rows) with respect to the robot's x, y and theta (columns).
    pub jacobian: Matrix3<f64>,
}

/// Signed distances of two image points from a projected line, and their derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Signed distances, px.
    pub distance_px: Vector2<f64>,
    /// Derivatives with respect to the robot's x, y (px/m) and theta (px/rad).
    pub jacobian: Matrix2x3<f64>,
}

/// Line in Hough space: distance from pixel (0, 0) and direction of the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoughLine {
    /// Distance from pixel (0, 0), >= 0, px.
    pub rho: f64,
    /// Direction of the normal, rad.
    pub alpha: f64,
    /// Derivatives of rho with respect to the robot's x, y and theta.
    pub rho_jacobian: Vector3<f64>,
    /// Derivatives of alpha with respect to the robot's x, y and theta.
    pub alpha_jacobian: Vector3<f64>,
}

impl LineCamera {
    /// Creates the projection of a distortion-free camera with this mount on the robot.
    #[must_use]
    pub fn new(intrinsics: &Intrinsics, mount: &Mount) -> Self {
        let Intrinsics { fx, fy, cx, cy, .. } = *intrinsics;
        let pixel_from_camera = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
        let pixel_from_body = pixel_from_camera * mount.rotation_body_from_camera().transpose();
        Self { pixel_from_body, mount: pixel_from_body * mount.position_in_body() }
    }

    /// Returns the projection for this pose of the robot.
    #[must_use]
    #[inline]
    pub fn at(&self, map_from_robot: &Pose2) -> LineView {
        let (sin, cos) = map_from_robot.theta.sin_cos();
        let (ahead, left) = (self.pixel_from_body.column(0), self.pixel_from_body.column(1));
        let columns =
            [ahead * cos - left * sin, ahead * sin + left * cos, self.pixel_from_body.column(2).into()];
        LineView {
            pixel_from_map: Matrix3::from_columns(&columns),
            mount: self.mount,
            position: Vector3::new(map_from_robot.x, map_from_robot.y, 0.0),
        }
    }
}

impl LineView {
    /// Returns the edge's image line; `None` if the edge's line passes through the optical center.
    #[must_use]
    #[inline]
    pub fn project(&self, edge: &Edge) -> Option<ProjectedLine> {
        let (from, a) = self.in_pixels(&edge.from);
        let (to, b) = self.in_pixels(&edge.to);
        let line = a.cross(&b);
        let norm = line.xy().norm();
        if norm.is_nan() || norm <= MIN_NORM * (1.0 + a.norm() * b.norm()) {
            return None;
        }
        // A translation of the robot moves both ends the opposite way, a rotation turns both around the robot.
        let (x_axis, y_axis) = (self.pixel_from_map.column(0), self.pixel_from_map.column(1));
        let run = a - b;
        let turned = |v: Vector3<f64>| x_axis * v.y - y_axis * v.x;
        let turn = turned(from).cross(&b) + a.cross(&turned(to));
        let per_norm = norm.recip();
        let coefficients = line * per_norm;
        // A change of the normal's length does not move the line.
        let of_unit = |change: Vector3<f64>| {
            let change = change * per_norm;
            change - coefficients * coefficients.xy().dot(&change.xy())
        };
        let columns = [of_unit(x_axis.cross(&run)), of_unit(y_axis.cross(&run)), of_unit(turn)];
        Some(ProjectedLine { coefficients, jacobian: Matrix3::from_columns(&columns) })
    }

    /// Returns a map point relative to the robot in map axes, and its homogeneous pixel.
    #[inline]
    fn in_pixels(&self, point: &Point3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let from_robot = point.coords - self.position;
        (from_robot, self.pixel_from_map * from_robot - self.mount)
    }
}

impl ProjectedLine {
    /// Returns the unit normal (cos alpha, sin alpha).
    #[must_use]
    #[inline]
    pub fn normal(&self) -> Vector2<f64> {
        self.coefficients.xy()
    }

    /// Returns the signed distance of a pixel and its derivatives with respect to the robot's x, y and theta.
    #[must_use]
    #[inline]
    pub fn distance(&self, pixel: Vector2<f64>) -> (f64, Vector3<f64>) {
        let pixel = pixel.push(1.0);
        (self.coefficients.dot(&pixel), self.jacobian.tr_mul(&pixel))
    }

    /// Returns the residual of both ends of a segment.
    #[must_use]
    #[inline]
    pub fn residual(&self, ends: [Vector2<f64>; 2]) -> Residual {
        let [(r0, h0), (r1, h1)] = ends.map(|end| self.distance(end));
        Residual {
            distance_px: Vector2::new(r0, r1),
            jacobian: Matrix2x3::from_rows(&[h0.transpose(), h1.transpose()]),
        }
    }

    /// Returns the derivatives of the normal's direction alpha with respect to the robot's x, y and theta.
    #[must_use]
    #[inline]
    pub fn alpha_jacobian(&self) -> Vector3<f64> {
        let n = self.coefficients;
        (self.jacobian.row(1) * n.x - self.jacobian.row(0) * n.y).transpose()
    }

    /// Returns the line in Hough space, with rho >= 0.
    #[must_use]
    pub fn hough(&self) -> HoughLine {
        let sign = if self.coefficients.z > 0.0 { -1.0 } else { 1.0 };
        let n = self.coefficients * sign;
        HoughLine {
            rho: -n.z,
            alpha: n.y.atan2(n.x),
            rho_jacobian: -sign * self.jacobian.row(2).transpose(),
            alpha_jacobian: self.alpha_jacobian(),
        }
    }
}

/// Returns the image column (px) of a vertical edge at (x, y) = `edge` in a level camera without roll, and its
/// derivatives with respect to the robot's x, y and theta; `None` if the depth is 0.1 m or less.
#[must_use]
pub fn vertical_edge_column(
    edge: Vector2<f64>,
    map_from_robot: &Pose2,
    intrinsics: &Intrinsics,
    mount: &Mount,
) -> Option<(f64, Vector3<f64>)> {
    let robot = Vector2::new(map_from_robot.x, map_from_robot.y);
    let camera = map_from_robot.transform_point(nalgebra::Point2::new(mount.x, mount.y)).coords;
    let (sin, cos) = (map_from_robot.theta + mount.pan).sin_cos();
    let d = edge - camera;
    let (ahead, left) = (cos * d.x + sin * d.y, -sin * d.x + cos * d.y);
    if ahead.is_nan() || ahead <= MIN_DEPTH_M {
        return None;
    }
    let scale = intrinsics.fx / (ahead * ahead);
    let jacobian = Vector3::new(-d.y, d.x, d.dot(&(edge - robot))) * scale;
    Some((intrinsics.cx - intrinsics.fx * left / ahead, jacobian))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use yamabico_core::camera::Pinhole;

    fn random_case(random: &mut rand_pcg::Pcg64) -> (Intrinsics, Mount, Pose2, Edge) {
        let mut of = |low: f64, high: f64| random.random_range(low..high);
        let mount = Mount {
            x: of(-0.2, 0.2),
            y: of(-0.1, 0.1),
            z: of(0.3, 1.0),
            pan: of(-0.3, 0.3),
            tilt: of(-0.1, 0.3),
            roll: of(-0.1, 0.1),
        };
        let pose = Pose2::new(of(-2.0, 2.0), of(-1.0, 1.0), of(-0.5, 0.5));
        let from = Point3::new(of(4.0, 9.0), of(-2.0, 2.0), of(0.0, 1.0));
        let to = from + Vector3::new(of(-1.0, 1.0), of(-1.0, 1.0), of(-1.0, 2.0));
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 1.0);
        (intrinsics, mount, pose, Edge::between(from, to))
    }

    #[test]
    fn the_line_passes_through_the_images_of_the_ends() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(1);
        for _ in 0..200 {
            let (intrinsics, mount, pose, edge) = random_case(&mut random);
            let line = LineCamera::new(&intrinsics, &mount).at(&pose).project(&edge).unwrap();
            for end in [edge.from, edge.to] {
                let in_body = pose.inverse().transform_point(end.xy());
                let in_camera = mount.body_from_camera().inverse() * Point3::new(in_body.x, in_body.y, end.z);
                let pixel = Pinhole::ideal(intrinsics).project(&in_camera).unwrap();
                assert!(line.distance(pixel).0.abs() < 1e-8);
            }
        }
    }

    #[test]
    fn derivatives_match_finite_differences() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(2);
        const STEP: f64 = 1e-6;
        for _ in 0..200 {
            let (intrinsics, mount, pose, edge) = random_case(&mut random);
            let camera = LineCamera::new(&intrinsics, &mount);
            let line = camera.at(&pose).project(&edge).unwrap();
            let (h, pixel) = (line.hough(), Vector2::new(300.0, 200.0));
            let (_, slope) = line.distance(pixel);
            for k in 0..3 {
                let moved = |step: f64| {
                    let mut by = [0.0; 3];
                    by[k] = step;
                    let pose = Pose2::new(pose.x + by[0], pose.y + by[1], pose.theta + by[2]);
                    camera.at(&pose).project(&edge).unwrap()
                };
                let (ahead, back) = (moved(STEP), moved(-STEP));
                let central = |f: &dyn Fn(&ProjectedLine) -> f64| (f(&ahead) - f(&back)) / (2.0 * STEP);
                let close = |a: f64, b: f64| (a - b).abs() < 1e-4 * (1.0 + a.abs());
                assert!(close(slope[k], central(&|line| line.distance(pixel).0)));
                assert!(close(h.rho_jacobian[k], central(&|line| line.hough().rho)));
                assert!(close(h.alpha_jacobian[k], central(&|line| line.hough().alpha)));
            }
        }
    }

    #[test]
    fn an_edge_through_the_optical_center_has_no_image() {
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 1.0);
        let view = LineCamera::new(&intrinsics, &Mount::level(0.6)).at(&Pose2::IDENTITY);
        let edge = Edge::between(Point3::new(1.0, 0.0, 0.6), Point3::new(2.0, 0.0, 0.6));
        assert!(view.project(&edge).is_none());
    }

    #[test]
    fn a_vertical_edge_behind_the_camera_has_no_column() {
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 1.0);
        let column = |x: f64| {
            vertical_edge_column(Vector2::new(x, 0.3), &Pose2::IDENTITY, &intrinsics, &Mount::level(0.6))
        };
        assert!(column(0.05).is_none() && column(-3.0).is_none() && column(0.2).is_some());
    }
}
