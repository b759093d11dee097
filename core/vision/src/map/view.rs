//! Map geometry relative to a camera at a pose: projection, clipping and visibility.

use nalgebra::{Matrix3, Point2, Point3, Vector2, Vector3};

use crate::map::wire_frame::{Edge, Wall};
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Intrinsics, Mount, clip_to_near_plane};

/// Distance from a wall within which a point is not hidden by it, m.
pub const WALL_TOLERANCE_M: f64 = 0.02;
/// Sine of the angle below which a sight line is parallel to a wall.
const PARALLEL_SINE: f64 = 1e-9;

/// Camera at a pose on the map.
#[derive(Clone, Copy, Debug)]
pub struct MapView {
    intrinsics: Intrinsics,
    camera_from_map: Matrix3<f64>,
    camera_in_map: Point3<f64>,
}

/// Part of an edge inside the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClippedEdge {
    /// Endpoints in undistorted pixels, in the order of the edge.
    pub pixels: [Vector2<f64>; 2],
    /// Endpoints in the optical frame, m.
    pub points_in_camera: [Point3<f64>; 2],
}

impl MapView {
    /// Creates the view of a camera on a robot at `map_from_robot`.
    #[must_use]
    pub fn new(intrinsics: &Intrinsics, mount: &Mount, map_from_robot: &Pose2) -> Self {
        let (sin, cos) = map_from_robot.theta.sin_cos();
        let turn = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        let map_from_camera = turn * mount.rotation_body_from_camera();
        let origin = Vector3::new(map_from_robot.x, map_from_robot.y, 0.0) + turn * mount.position_in_body();
        Self {
            intrinsics: *intrinsics,
            camera_from_map: map_from_camera.transpose(),
            camera_in_map: Point3::from(origin),
        }
    }

    /// Horizontal position of the optical center, map frame, m.
    #[must_use]
    pub fn plan_position(&self) -> Point2<f64> {
        self.camera_in_map.xy()
    }

    /// Transforms a point from the map frame to the optical frame, m.
    #[must_use]
    pub fn point_in_camera(&self, point_in_map: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.camera_from_map * (point_in_map - self.camera_in_map))
    }

    /// Transforms a point from the optical frame to its horizontal position in the map frame, m.
    #[must_use]
    pub fn plan_of(&self, point_in_camera: &Point3<f64>) -> Point2<f64> {
        (self.camera_in_map + self.camera_from_map.tr_mul(&point_in_camera.coords)).xy()
    }

    /// Clips an edge to the near plane and to the image, [0, width - 1] x [0, height - 1]. `None` if nothing remains.
    #[must_use]
    pub fn clip(&self, edge: &Edge) -> Option<ClippedEdge> {
        let (a, b) = (self.point_in_camera(&edge.from), self.point_in_camera(&edge.to));
        let (a, b) = clip_to_near_plane(a, b)?;
        let pixel = |p: &Point3<f64>| self.intrinsics.pixel_from_normalized(p.xy().coords / p.z);
        let (p, q) = (pixel(&a), pixel(&b));
        let far = [f64::from(self.intrinsics.width) - 1.0, f64::from(self.intrinsics.height) - 1.0];
        let (s0, s1) = clip_to_rectangle(p, q, far)?;
        // Perspective interpolation: inverse depth is linear in the image.
        let in_space = |s: f64| a + (b - a) * (s * a.z / (b.z + s * (a.z - b.z)));
        Some(ClippedEdge {
            pixels: [p + (q - p) * s0, p + (q - p) * s1],
            points_in_camera: [
                if s0 > 0.0 { in_space(s0) } else { a },
                if s1 < 1.0 { in_space(s1) } else { b },
            ],
        })
    }

    /// Returns true if no wall lies between the camera and a point in plan. Walls within [`WALL_TOLERANCE_M`] of the
    /// point and walls parallel to the sight line do not hide it.
    #[must_use]
    pub fn is_visible(&self, point: Point2<f64>, walls: &[Wall]) -> bool {
        let camera = self.plan_position();
        !walls.iter().any(|wall| is_hidden(camera, point, wall))
    }
}

/// Returns true if the wall hides `point` from `camera`.
fn is_hidden(camera: Point2<f64>, point: Point2<f64>, wall: &Wall) -> bool {
    let (sight, run) = (point - camera, wall.to - wall.from);
    let cross = sight.perp(&run);
    if cross.abs() <= PARALLEL_SINE * sight.norm() * run.norm() {
        return false;
    }
    let between = wall.from - camera;
    let (t, s) = (between.perp(&run) / cross, between.perp(&sight) / cross);
    t > 0.0 && t < 1.0 && (0.0..=1.0).contains(&s) && wall.distance(point) > WALL_TOLERANCE_M
}

/// Clips the segment from `p` to `q` to [0, far] and returns the start and end parameters (Liang and Barsky).
fn clip_to_rectangle(p: Vector2<f64>, q: Vector2<f64>, far: [f64; 2]) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let (start, run) = (p[axis], q[axis] - p[axis]);
        for (towards, room) in [(-run, start), (run, far[axis] - start)] {
            if towards == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if towards < 0.0 {
                enter = enter.max(room / towards);
            } else {
                leave = leave.min(room / towards);
            }
        }
    }
    (enter <= leave).then_some((enter, leave))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use yamabico_geometry::camera::Pinhole;

    fn view(pose: Pose2) -> (MapView, Mount) {
        let intrinsics = Intrinsics::from_horizontal_fov(256, 240, 60_f64.to_radians());
        let mount = Mount { x: 0.1, y: 0.02, pan: 0.1, ..Mount::tilted(0.6, 0.1) };
        (MapView::new(&intrinsics, &mount, &pose), mount)
    }

    #[test]
    fn points_agree_with_the_rigid_transforms() {
        let pose = Pose2::new(1.0, -0.5, 0.3);
        let (view, mount) = view(pose);
        let point = Point3::new(5.0, 1.0, 2.0);
        let in_body = pose.inverse().transform_point(point.xy());
        let expected = mount.body_from_camera().inverse() * Point3::new(in_body.x, in_body.y, 2.0);
        assert!((view.point_in_camera(&point) - expected).norm() < 1e-12);
        assert!((view.plan_of(&expected) - point.xy()).norm() < 1e-12);
    }

    #[test]
    fn a_wall_hides_only_points_behind_it() {
        let wall = Wall { from: Point2::new(3.0, -1.0), to: Point2::new(3.0, 1.0) };
        let camera = Point2::new(0.0, 0.0);
        assert!(is_hidden(camera, Point2::new(4.0, 0.0), &wall));
        assert!(!is_hidden(camera, Point2::new(2.0, 0.0), &wall));
        assert!(!is_hidden(camera, Point2::new(3.01, 0.5), &wall), "the wall's own edge");
        assert!(!is_hidden(camera, Point2::new(4.0, 2.0), &wall), "beside it");
        let along = Wall { from: Point2::new(1.0, 0.0), to: Point2::new(2.0, 0.0) };
        assert!(!is_hidden(camera, Point2::new(4.0, 0.0), &along));
    }

    proptest! {
        #[test]
        fn clipped_ends_match_the_projection(
            x in 1.0..9.0, y in -2.0..2.0, z in 0.0..2.5, dx in -6.0..6.0, dy in -2.0..2.0, dz in -2.0..2.0,
        ) {
            let (view, _) = view(Pose2::new(0.5, 0.2, -0.1));
            let intrinsics = Intrinsics::from_horizontal_fov(256, 240, 60_f64.to_radians());
            let from = Point3::new(x, y, z);
            let edge = Edge::between(from, from + Vector3::new(dx, dy, dz));
            if let Some(clipped) = view.clip(&edge) {
                for (pixel, point) in clipped.pixels.iter().zip(&clipped.points_in_camera) {
                    let again = Pinhole::ideal(intrinsics).project(point).unwrap();
                    prop_assert!((again - pixel).norm() < 1e-6);
                    prop_assert!((-1e-9..=255.0 + 1e-9).contains(&pixel.x) && (-1e-9..=239.0 + 1e-9).contains(&pixel.y));
                }
            } else {
                let in_camera = view.point_in_camera(&from);
                let inside = Pinhole::ideal(intrinsics).project(&in_camera).is_ok_and(|p| {
                    (0.0..=255.0).contains(&p.x) && (0.0..=239.0).contains(&p.y)
                });
                prop_assert!(!inside, "a visible end and nothing is left");
            }
        }
    }
}
