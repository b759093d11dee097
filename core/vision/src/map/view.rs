//! The map as a camera at a pose has it before it: projection, clipping and sight lines.

use nalgebra::{Matrix3, Point2, Point3, Vector2, Vector3};

use crate::map::wire_frame::{Edge, Wall};
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Intrinsics, Mount, clip_to_near_plane};

/// Walls that pass nearer to what is looked at do not hide it, meters.
pub const WALL_TOLERANCE_M: f64 = 0.02;
/// A sight line whose direction differs from a wall's by less (sine) runs along it.
const PARALLEL: f64 = 1e-9;

/// A camera with its place on the map.
#[derive(Clone, Copy, Debug)]
pub struct MapView {
    intrinsics: Intrinsics,
    camera_from_map: Matrix3<f64>,
    camera_in_map: Point3<f64>,
}

/// The part of an edge that lies in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clipped {
    /// Its ends in ideal (undistorted) pixels, in the order of the edge.
    pub pixels: [Vector2<f64>; 2],
    /// Its ends in the optical frame, meters.
    pub points_in_camera: [Point3<f64>; 2],
}

impl MapView {
    /// The view of a camera on a robot at `map_from_robot`.
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

    /// The optical center in plan, meters, map frame.
    #[must_use]
    pub fn plan_position(&self) -> Point2<f64> {
        self.camera_in_map.xy()
    }

    /// A point of the map in the optical frame, meters.
    #[must_use]
    pub fn point_in_camera(&self, point_in_map: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.camera_from_map * (point_in_map - self.camera_in_map))
    }

    /// A point of the optical frame in plan, meters, map frame.
    #[must_use]
    pub fn plan_of(&self, point_in_camera: &Point3<f64>) -> Point2<f64> {
        (self.camera_in_map + self.camera_from_map.tr_mul(&point_in_camera.coords)).xy()
    }

    /// The part of an edge beyond the near plane and within [0, width - 1] x [0, height - 1]; `None` where nothing is.
    #[must_use]
    pub fn clip(&self, edge: &Edge) -> Option<Clipped> {
        let (a, b) = (self.point_in_camera(&edge.from), self.point_in_camera(&edge.to));
        let (a, b) = clip_to_near_plane(a, b)?;
        let pixel = |p: &Point3<f64>| self.intrinsics.pixel_from_normalized(p.xy().coords / p.z);
        let (p, q) = (pixel(&a), pixel(&b));
        let far = [f64::from(self.intrinsics.width) - 1.0, f64::from(self.intrinsics.height) - 1.0];
        let (s0, s1) = clip_to_rectangle(p, q, far)?;
        // Equal steps in the picture are not equal steps along the edge: one over the depth is linear in the picture.
        let in_space = |s: f64| a + (b - a) * (s * a.z / (b.z + s * (a.z - b.z)));
        Some(Clipped {
            pixels: [p + (q - p) * s0, p + (q - p) * s1],
            points_in_camera: [
                if s0 > 0.0 { in_space(s0) } else { a },
                if s1 < 1.0 { in_space(s1) } else { b },
            ],
        })
    }

    /// Whether no wall stands between the camera and a place in plan. Walls within [`WALL_TOLERANCE_M`] of the place and
    /// walls along the sight line hide nothing.
    #[must_use]
    pub fn sees(&self, place: Point2<f64>, walls: &[Wall]) -> bool {
        let camera = self.plan_position();
        !walls.iter().any(|wall| is_hidden(camera, place, wall))
    }
}

/// Whether the wall hides `place` from `camera`.
fn is_hidden(camera: Point2<f64>, place: Point2<f64>, wall: &Wall) -> bool {
    let (sight, run) = (place - camera, wall.to - wall.from);
    let cross = sight.perp(&run);
    if cross.abs() <= PARALLEL * sight.norm() * run.norm() {
        return false;
    }
    let between = wall.from - camera;
    let (t, s) = (between.perp(&run) / cross, between.perp(&sight) / cross);
    t > 0.0 && t < 1.0 && (0.0..=1.0).contains(&s) && wall.distance(place) > WALL_TOLERANCE_M
}

/// The share of the way from `p` to `q` that lies within [0, far]: where it begins and ends (Liang and Barsky).
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
    fn a_wall_hides_what_is_behind_it_only() {
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
        fn what_is_clipped_is_the_projection(
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
