//! Geometry of the two edges of an intersection: the partner of an edge, and the bearing between them.
//!
//! Kweon et al. (1991), section 3.5. Differs from the paper: exact for any heading and tilt, where the paper neglects them;
//! the bearing between two edges is the mean of their bearings, not of their columns.

use nalgebra::{Vector2, Vector3};
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_vision::corridor::wall_distance::CorridorView;

/// Returns the direction across the corridor, to its left, in the optical frame: unit length. Through the intrinsics it is
/// the homogeneous vanishing point of all lines across, at infinity for a camera that looks along the corridor.
#[must_use]
pub fn across_in_camera(view: &CorridorView) -> Vector3<f64> {
    view.corridor_from_camera.transpose() * Vector3::y()
}

/// Returns the pixel on `other_wall`, a pixel line (a, b, c) with a u + b v + c = 0, that lies straight across the corridor from the
/// floor point seen at `base`. `None` if the two lines do not meet in the image plane.
#[must_use]
pub fn partner(base: Vector2<f64>, other_wall: Vector3<f64>, view: &CorridorView) -> Option<Vector2<f64>> {
    let vanishing_point = view.intrinsics.matrix() * across_in_camera(view);
    let meeting = base.push(1.0).cross(&vanishing_point).cross(&other_wall);
    let pixel = meeting.xy() / meeting.z;
    (pixel.x.is_finite() && pixel.y.is_finite()).then_some(pixel)
}

/// Returns the slope dy/dx, in normalized coordinates, of the line between two pixels.
#[must_use]
pub fn slope(from: Vector2<f64>, to: Vector2<f64>, intrinsics: &Intrinsics) -> f64 {
    let along = intrinsics.normalized_from_pixel(to) - intrinsics.normalized_from_pixel(from);
    along.y / along.x
}

/// Returns the slope dy/dx of the line across the corridor through a normalized point, for a level camera with this heading (rad).
#[must_use]
pub fn level_slope(normalized: Vector2<f64>, heading: f64) -> f64 {
    let (sin, cos) = heading.sin_cos();
    normalized.y * sin / (cos + normalized.x * sin)
}

/// Returns the bearing (rad, positive to the left) of an undistorted pixel in the robot frame.
#[must_use]
pub fn bearing(pixel: Vector2<f64>, intrinsics: &Intrinsics, mount: &Mount) -> f64 {
    let ray = mount.rotation_body_from_camera() * intrinsics.normalized_from_pixel(pixel).push(1.0);
    ray.y.atan2(ray.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_vision::corridor::heading::CameraAttitude;
    use yamabico_vision::corridor::wall_distance::line_through;

    #[test]
    fn the_partner_is_straight_across_with_roll_too() {
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 1.05);
        for (heading, tilt, roll) in [(0.0, 0.0, 0.0), (0.2, 0.1, 0.05), (-0.3, -0.05, -0.1)] {
            let view = CorridorView::new(CameraAttitude { heading, tilt }, roll, 0.6, intrinsics);
            let pixel = |x: f64, y: f64| {
                let point = view.corridor_from_camera.transpose() * Vector3::new(x, y, -0.6);
                intrinsics.pixel_from_normalized(point.xy() / point.z)
            };
            let other_wall = line_through(pixel(3.0, -1.2), pixel(9.0, -1.2));
            let found = partner(pixel(5.0, 0.8), other_wall, &view).unwrap();
            assert!((found - pixel(5.0, -1.2)).norm() < 1e-9);
        }
    }

    #[test]
    fn lines_that_do_not_meet_have_no_partner() {
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 1.05);
        let view = CorridorView::new(CameraAttitude::default(), 0.0, 0.6, intrinsics);
        assert_eq!(partner(Vector2::new(100.0, 300.0), Vector3::new(0.0, 1.0, -250.0), &view), None);
        assert_eq!(partner(Vector2::new(f64::NAN, 300.0), Vector3::new(1.0, 0.0, -250.0), &view), None);
    }
}
