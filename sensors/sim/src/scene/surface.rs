//! Planar quadrilateral surface and its material.

use nalgebra::Vector3;

use crate::world::Color;

/// Optical properties of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    /// Linear RGB reflectance.
    pub albedo: Color,
    /// Emitted radiance, relative to a white surface below a lamp.
    pub emission: f32,
    /// Standard deviation of the speckle, relative to the mean.
    pub speckle: f32,
    /// Size of the finest speckle, m.
    pub grain_m: f32,
    /// Fraction of the Fresnel reflection, 0 to 1. Only horizontal surfaces at z = 0 reflect.
    pub gloss: f32,
    /// Spacing of the joints along u and v, m; 0: no joints.
    pub joint_spacing_m: [f32; 2],
    /// Width of the joints, m.
    pub joint_width_m: f32,
    /// Brightness of the joints relative to the surface.
    pub joint_tone: f32,
}

impl Material {
    /// Returns a matte material without texture.
    #[must_use]
    pub fn matte(albedo: Color) -> Self {
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

    /// Returns a luminous material.
    #[must_use]
    pub fn luminous(emission: f32) -> Self {
        Self { emission, ..Self::matte([0.0; 3]) }
    }
}

/// Convex planar quadrilateral, visible from the front only.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Corners in the world frame (m), counter-clockwise if viewed from the front.
    pub corners: [Vector3<f64>; 4],
    /// Origin of the surface coordinates (u, v).
    pub origin: Vector3<f64>,
    /// Unit vectors along u and v; their cross product is the normal.
    pub axes: [Vector3<f64>; 2],
    /// Extent along u and v, m.
    pub size: [f64; 2],
    /// Material.
    pub material: Material,
    /// Light values.
    pub light: LightGrid,
}

/// Regular grid of light values on a surface, from corner to corner.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightGrid {
    /// Index of the first value; v is the slow direction.
    pub first: usize,
    /// Number of values along u and v, at least 2 each.
    pub count: [usize; 2],
}

impl Surface {
    /// Returns the rectangle `origin`, `origin + u`, `origin + u + v`, `origin + v` (m); u and v must be perpendicular.
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

    /// Returns the unit normal on the front.
    #[must_use]
    pub fn normal(&self) -> Vector3<f64> {
        self.axes[0].cross(&self.axes[1])
    }

    /// Returns the point at surface coordinates (u, v), in the world frame, m.
    #[must_use]
    pub fn point(&self, u: f64, v: f64) -> Vector3<f64> {
        self.origin + self.axes[0] * u + self.axes[1] * v
    }
}

/// Upright prism occupied by a wall, box or door leaf, for contact and clearance.
#[derive(Clone, Copy, Debug)]
pub struct Solid {
    /// Corners of the base, counter-clockwise, x and y in the world frame, m.
    pub base: [[f64; 2]; 4],
    /// Heights of the lower and upper end above the floor, m.
    pub z: [f64; 2],
}
