//! A small renderer of a floor with a pattern, a box on it, and mirror images in it.

use nalgebra::{Point2, Vector2, Vector3};
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Intrinsics, Mount};
use yamabico_vision::plane_motion::floor_view::{FloorView, turn};

/// Scene around the origin of the odometry frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scene {
    /// Middle of a box's front and its width, m; it is as deep as wide, and 0.35 m high.
    pub thing: Option<(Point2<f64>, f64)>,
    /// Share of the light that the floor mirrors.
    pub mirror: f64,
    /// True for tiles with dark joints every 0.3 m.
    pub has_joints: bool,
}

/// Camera of the tests: 0.55 m high, looking 12 degrees down.
pub fn camera(width: u32, height: u32) -> (Intrinsics, Mount) {
    let mount = Mount { x: 0.1, ..Mount::tilted(0.55, 12_f64.to_radians()) };
    (Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians()), mount)
}

impl Scene {
    /// Picture from `robot` (odometry frame), with noise from the picture's number.
    pub fn render(&self, width: u32, height: u32, robot: &Pose2, number: u64) -> Vec<u8> {
        let (intrinsics, mount) = camera(width, height);
        let view = FloorView::new(intrinsics, mount);
        let origin = turn(robot.theta) * view.position() + Vector3::new(robot.x, robot.y, 0.0);
        let mut data = Vec::with_capacity((width * height) as usize);
        for v in 0..height {
            for u in 0..width {
                let mut level = 0.0;
                for (du, dv) in [(-0.25, -0.25), (0.25, 0.25)] {
                    let pixel = Vector2::new(f64::from(u) + du, f64::from(v) + dv);
                    level += 0.5 * self.shade(origin, turn(robot.theta) * view.ray(pixel));
                }
                let noise = hash(i64::from(u), i64::from(v), number) - 0.5;
                data.push((level + 4.0 * noise).clamp(0.0, 255.0) as u8);
            }
        }
        data
    }

    fn shade(&self, origin: Vector3<f64>, ray: Vector3<f64>) -> f64 {
        if let Some(level) = self.hit_thing(origin, ray) {
            return level;
        }
        if ray.z >= -1e-4 {
            return wall(ray);
        }
        let at = origin + ray * (-origin.z / ray.z);
        let mirrored = Vector3::new(ray.x, ray.y, -ray.z);
        let floor = self.floor(at, (at - origin).norm());
        if self.mirror > 0.0 {
            let seen = self.hit_thing(at, mirrored).unwrap_or_else(|| lamp(at, mirrored));
            return (1.0 - self.mirror) * floor + self.mirror * seen;
        }
        floor
    }

    /// Pattern of the floor; details smaller than a pixel, which is long at a distance, fade.
    fn floor(&self, at: Vector3<f64>, distance: f64) -> f64 {
        let pixel_m = distance * distance / (0.55 * 221.0);
        let seen = |size_m: f64| 1.0 / (1.0 + (pixel_m / size_m).powi(2));
        let grain = 26.0 * seen(0.03) * (smooth_noise(at.x / 0.03, at.y / 0.03, 1) - 0.5)
            + 20.0 * seen(0.11) * (smooth_noise(at.x / 0.11, at.y / 0.11, 2) - 0.5);
        let near_joint = |x: f64| (x / 0.3 - (x / 0.3).round()).abs() < 0.02;
        let joint = if self.has_joints && (near_joint(at.x) || near_joint(at.y)) { -60.0 } else { 0.0 };
        130.0 + grain + joint * seen(0.03)
    }

    fn hit_thing(&self, origin: Vector3<f64>, ray: Vector3<f64>) -> Option<f64> {
        const HEIGHT: f64 = 0.35;
        let (front, width) = self.thing?;
        let low = Vector3::new(front.x, front.y - 0.5 * width, 0.0);
        let high = Vector3::new(front.x + width, front.y + 0.5 * width, HEIGHT);
        let (mut enter, mut leave, mut side) = (1e-6, f64::INFINITY, 0);
        for axis in 0..3 {
            let (a, b) = ((low[axis] - origin[axis]) / ray[axis], (high[axis] - origin[axis]) / ray[axis]);
            let (near, far) = (a.min(b), a.max(b));
            if near > enter {
                (enter, side) = (near, axis);
            }
            leave = leave.min(far);
        }
        let at = origin + ray * enter;
        let tape = (at.z - 0.22).abs() < 0.025 || (at.y - front.y).abs() < 0.02;
        (enter < leave).then(|| [215.0, 180.0, 235.0][side] - if tape { 90.0 } else { 0.0 })
    }
}

/// A wall far away, with stripes.
fn wall(ray: Vector3<f64>) -> f64 {
    170.0 + if (ray.y / ray.x * 12.0).sin() > 0.0 { 25.0 } else { 0.0 }
}

/// Ceiling at 2.6 m with a lamp every 3 m.
fn lamp(at: Vector3<f64>, ray: Vector3<f64>) -> f64 {
    let hit = at + ray * (2.6 / ray.z.max(1e-3));
    let along = (hit.x / 3.0 - (hit.x / 3.0).round()).abs();
    if along < 0.05 && hit.y.abs() < 0.25 { 500.0 } else { 90.0 }
}

fn smooth_noise(x: f64, y: f64, seed: u64) -> f64 {
    let (i, j) = (x.floor(), y.floor());
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let (a, b) = (ease(x - i), ease(y - j));
    let corner = |di: i64, dj: i64| hash(i as i64 + di, j as i64 + dj, seed);
    let upper = corner(0, 0) + a * (corner(1, 0) - corner(0, 0));
    let lower = corner(0, 1) + a * (corner(1, 1) - corner(0, 1));
    upper + b * (lower - upper)
}

/// Number from 0 to 1 for a place.
fn hash(i: i64, j: i64, seed: u64) -> f64 {
    let mut x =
        (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (j as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    x = (x ^ seed.wrapping_mul(0x1656_67b1_9e37_79f9)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 29).wrapping_mul(0x94d0_49bb_1331_11eb);
    (x >> 40) as f64 / (1_u64 << 24) as f64
}
