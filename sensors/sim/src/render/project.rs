//! Projection of surfaces to convex polygons in the image of a pinhole camera.

use nalgebra::{Matrix3, Vector3};
use yamabico_core::camera::Intrinsics;

use super::CameraView;
use super::spans::Outline;
use crate::scene::Surface;

/// Minimum depth at which surfaces are rendered, m along the optical axis.
const MIN_DEPTH_M: f64 = 0.03;

/// Pinhole camera with its pose in the world.
#[derive(Clone, Copy, Debug)]
pub struct PosedPinhole {
    /// Optical center in the world frame, m.
    pub at: Vector3<f64>,
    /// Rotation from the world frame to the optical frame (x right, y down, z forward).
    pub camera_from_world: Matrix3<f64>,
    /// Focal lengths and principal point; pixel (0, 0) covers [0, 1) x [0, 1) in the coordinates used here.
    pub intrinsics: Intrinsics,
}

/// Rendering pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// The world.
    Direct,
    /// The mirror image of the world below the floor.
    Mirrored,
}

/// Linear function of the image coordinates: `x * c[0] + y * c[1] + c[2]`.
pub type Linear = [f64; 3];

/// Outline of a visible surface in the image, with its depth and surface coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Polygon {
    /// Index of the surface.
    pub surface: usize,
    /// 1 / depth, 1/m.
    pub inverse_depth: Linear,
    /// Surface coordinate u / depth.
    pub u: Linear,
    /// Surface coordinate v / depth.
    pub v: Linear,
    /// Upper and lower end in the image.
    pub y: [f64; 2],
    /// Maximum 1 / depth of the corners, 1/m.
    pub nearest: f64,
    edges: [Edge; 5],
    edge_count: usize,
}

#[derive(Clone, Copy, Debug, Default)]
struct Edge {
    y: [f64; 2],
    x: f64,
    slope: f64,
}

impl PosedPinhole {
    /// Returns the camera of a view.
    #[must_use]
    pub fn new(view: &CameraView) -> Self {
        let (sin, cos) = view.robot.theta.sin_cos();
        let world_from_body = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        let world_from_camera = world_from_body * view.mount.rotation_body_from_camera();
        let at =
            world_from_body * view.mount.position_in_body() + Vector3::new(view.robot.x, view.robot.y, 0.0);
        Self { at, camera_from_world: world_from_camera.transpose(), intrinsics: view.intrinsics }
    }

    /// Returns the same camera with an image smaller by `factor` in width and height.
    #[must_use]
    pub fn shrunk(&self, factor: u32) -> Self {
        let k = &self.intrinsics;
        let scale = f64::from(factor);
        let intrinsics = Intrinsics {
            fx: k.fx / scale,
            fy: k.fy / scale,
            cx: (k.cx + 0.5) / scale - 0.5,
            cy: (k.cy + 0.5) / scale - 0.5,
            width: k.width.div_ceil(factor),
            height: k.height.div_ceil(factor),
        };
        Self { intrinsics, ..*self }
    }

    /// Returns the direction of the image point (x, y) in the world frame, with depth 1. Pixel centers have half-integer
    /// coordinates.
    #[must_use]
    pub fn direction(&self, x: f64, y: f64) -> Vector3<f64> {
        let k = &self.intrinsics;
        self.camera_from_world.transpose()
            * Vector3::new((x - 0.5 - k.cx) / k.fx, (y - 0.5 - k.cy) / k.fy, 1.0)
    }

    /// Returns true if a point of image row `y` lies below the horizon.
    #[must_use]
    pub fn looks_down(&self, y: usize) -> bool {
        let row = [y as f64, y as f64 + 1.0];
        let ends = [0.0, f64::from(self.intrinsics.width)];
        row.iter().any(|y| ends.iter().any(|x| self.direction(*x, *y).z < 0.0))
    }

    /// Returns `g . direction` as a function of the image coordinates, for `g` in the optical frame.
    fn linear(&self, g: Vector3<f64>) -> Linear {
        let k = &self.intrinsics;
        let (x, y) = (g.x / k.fx, g.y / k.fy);
        [x, y, g.z - x * (k.cx + 0.5) - y * (k.cy + 0.5)]
    }

    /// Finds the outlines of the surfaces that face the camera and reach into the image, nearest first.
    pub fn project(&self, surfaces: &[Surface], pass: Pass, out: &mut Vec<Polygon>) {
        out.clear();
        out.extend(surfaces.iter().enumerate().filter_map(|(i, s)| self.polygon(i, s, pass)));
        out.sort_by(|a, b| b.nearest.total_cmp(&a.nearest).then(a.surface.cmp(&b.surface)));
    }

    fn polygon(&self, index: usize, s: &Surface, pass: Pass) -> Option<Polygon> {
        let sign = if pass == Pass::Mirrored { -1.0 } else { 1.0 };
        let flip = |p: Vector3<f64>| Vector3::new(p.x, p.y, sign * p.z);
        let turn = |p: Vector3<f64>| self.camera_from_world * flip(p);
        let origin = self.camera_from_world * (flip(s.origin) - self.at);
        let (a, b) = (turn(s.axes[0]), turn(s.axes[1]));
        let normal = a.cross(&b);
        let distance = normal.dot(&origin);
        if distance * sign > -1e-9 {
            return None;
        }

        let mut corners = [Vector3::zeros(); 5];
        let mut count = 0;
        let points = s.corners.map(|c| self.camera_from_world * (flip(c) - self.at));
        for i in 0..4 {
            let (p, q) = (points[i], points[(i + 1) % 4]);
            if p.z >= MIN_DEPTH_M {
                corners[count] = p;
                count += 1;
            }
            if (p.z >= MIN_DEPTH_M) != (q.z >= MIN_DEPTH_M) {
                corners[count] = p + (q - p) * ((MIN_DEPTH_M - p.z) / (q.z - p.z));
                count += 1;
            }
        }
        if count < 3 {
            return None;
        }

        let k = &self.intrinsics;
        let pixels = corners.map(|p| (k.fx * p.x / p.z + k.cx + 0.5, k.fy * p.y / p.z + k.cy + 0.5));
        let pixels = &pixels[..count];
        let low = |f: fn(&(f64, f64)) -> f64| pixels.iter().map(f).fold(f64::MAX, f64::min);
        let high = |f: fn(&(f64, f64)) -> f64| pixels.iter().map(f).fold(f64::MIN, f64::max);
        let y = [low(|p| p.1), high(|p| p.1)];
        let outside = high(|p| p.0) <= 0.0 || low(|p| p.0) >= f64::from(k.width);
        if outside || y[1] <= 0.0 || y[0] >= f64::from(k.height) {
            return None;
        }

        let mut edges = [Edge::default(); 5];
        let mut edge_count = 0;
        for i in 0..count {
            let (p, q) = (pixels[i], pixels[(i + 1) % count]);
            let (p, q) = if p.1 <= q.1 { (p, q) } else { (q, p) };
            if q.1 > p.1 {
                edges[edge_count] = Edge { y: [p.1, q.1], x: p.0, slope: (q.0 - p.0) / (q.1 - p.1) };
                edge_count += 1;
            }
        }
        let inverse_depth = self.linear(normal / distance);
        let tie = |axis: Vector3<f64>| {
            let (g, offset) = (self.linear(axis), axis.dot(&origin));
            [0, 1, 2].map(|i| g[i] - offset * inverse_depth[i])
        };
        let nearest = corners[..count].iter().map(|c| c.z.recip()).fold(0.0, f64::max);
        Some(Polygon { surface: index, inverse_depth, u: tie(a), v: tie(b), y, nearest, edges, edge_count })
    }
}

impl Outline for Polygon {
    #[inline]
    fn span(&self, y: f64) -> Option<(f64, f64)> {
        let (mut low, mut high) = (f64::MAX, f64::MIN);
        for e in &self.edges[..self.edge_count] {
            if e.y[0] <= y && y < e.y[1] {
                let x = e.x + (y - e.y[0]) * e.slope;
                low = low.min(x);
                high = high.max(x);
            }
        }
        (low < high).then_some((low, high))
    }

    #[inline]
    fn inverse_depth(&self, y: f64) -> (f64, f64) {
        let [slope, down, offset] = self.inverse_depth;
        (slope, down * y + offset)
    }
}
