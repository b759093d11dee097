//! A flat four-cornered surface and what it is made of.

use nalgebra::Vector3;

use crate::world::Color;

/// What a surface looks and sounds like.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    /// Linear RGB reflectance.
    pub albedo: Color,
    /// Own radiance, relative to a white surface under a lamp.
    pub emission: f32,
    /// Standard deviation of the speckle relative to the mean.
    pub speckle: f32,
    /// Size of the finest speckle, meters.
    pub grain_m: f32,
    /// How much of Fresnel's reflection is seen, 0 to 1. Only horizontal surfaces at z = 0 mirror.
    pub gloss: f32,
    /// Distance of the joints along u and v, meters; 0 means none.
    pub joint_spacing_m: [f32; 2],
    /// Width of the joints, meters.
    pub joint_width_m: f32,
    /// Brightness of the joints relative to the surface.
    pub joint_tone: f32,
}

impl Material {
    /// A matt material without texture.
    #[must_use]
    pub fn matt(albedo: Color) -> Self {
        Self {
            albedo,
            emission: 0.0,
            speckle: 0.0,
            grain_m: 0.01,
            gloss: 0.0,
            joint_spacing_m: [0.0; 2],
            joint_width_m: 0.0,
            joint_tone: 1.0,
        }
    }

    /// A self-luminous material.
    #[must_use]
    pub fn lit(emission: f32) -> Self {
        Self { emission, ..Self::matt([0.0; 3]) }
    }
}

/// A convex planar quadrilateral, seen from one side only.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Corners in world coordinates, counter-clockwise seen from the front.
    pub corners: [Vector3<f64>; 4],
    /// Origin of the surface coordinates (u, v).
    pub origin: Vector3<f64>,
    /// Unit vectors along u and v; their cross product is the normal.
    pub axes: [Vector3<f64>; 2],
    /// Extent along u and v, meters.
    pub size: [f64; 2],
    /// Its material.
    pub material: Material,
    /// Where its light values start, and how many there are along u and v (at least 2).
    pub light: LightGrid,
}

/// A regular grid of light values over a surface, from corner to corner.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightGrid {
    /// Index of the first value; v is the slow direction.
    pub first: usize,
    /// Number of values along u and v.
    pub count: [usize; 2],
}

impl Surface {
    /// The parallelogram `origin`, `origin + u`, `origin + u + v`, `origin + v` (u and v at a right angle, meters).
    #[must_use]
    pub fn rectangle(origin: Vector3<f64>, u: Vector3<f64>, v: Vector3<f64>, material: Material) -> Self {
        Self {
            corners: [origin, origin + u, origin + u + v, origin + v],
            origin,
            axes: [u.normalize(), v.normalize()],
            size: [u.norm(), v.norm()],
            material,
            light: LightGrid::default(),
        }
    }

    /// Unit normal on the seen side.
    #[must_use]
    pub fn normal(&self) -> Vector3<f64> {
        self.axes[0].cross(&self.axes[1])
    }

    /// World point of the surface coordinates, meters.
    #[must_use]
    pub fn point(&self, u: f64, v: f64) -> Vector3<f64> {
        self.origin + self.axes[0] * u + self.axes[1] * v
    }
}

/// The upright prism that a wall, box or leaf occupies, for contact and clearance.
#[derive(Clone, Copy, Debug)]
pub struct Solid {
    /// Corners of its base, counter-clockwise, x and y in meters.
    pub base: [[f64; 2]; 4],
    /// Lower and upper end, meters above the floor.
    pub z: [f64; 2],
}
