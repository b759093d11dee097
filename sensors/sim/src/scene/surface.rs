//! Planar quadrilateral surface and its material.

use nalgebra::Vector3;

use crate::world::{Color, Grain};

/// Optical properties of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    /// Linear RGB reflectance.
    pub albedo: Color,
    /// Emitted radiance, relative to a white surface below a lamp.
    pub emission: f32,
    /// Shape of the fine texture.
    pub grain: Grain,
    /// Standard deviation of the fine texture, relative to the mean.
    pub speckle: f32,
    /// Size of the finest speckle, m.
    pub grain_m: f32,
    /// Fraction of the Fresnel reflection, 0 to 1. Only horizontal surfaces on the floor reflect.
    pub gloss: f32,
    /// Fresnel reflection at normal incidence, 0 to 1.
    pub reflectance: f32,
    /// True if the mirror image is sharp.
    pub is_sharp: bool,
    /// Light relative to the light around the surface.
    pub light: f32,
    /// Joints and the tiles between them.
    pub tiles: Tiles,
}

/// Joints of a surface, and the tiles between them.
#[derive(Clone, Copy, Debug)]
pub struct Tiles {
    /// Spacing of the joints along u and v, m; 0: no joints.
    pub spacing_m: [f32; 2],
    /// Width of the joints, m.
    pub joint_width_m: f32,
    /// Brightness of the joints relative to the surface.
    pub joint_tone: f32,
    /// Direction of the rows in surface coordinates: cosine and sine of its angle to u.
    pub turn: [f32; 2],
    /// Random shift of each row along itself, relative to the spacing.
    pub stagger: f32,
    /// Standard deviation of the brightness of the tiles, relative to the mean.
    pub contrast: f32,
}

impl Tiles {
    /// A surface without joints.
    pub const NONE: Self = Self {
        spacing_m: [0.0; 2],
        joint_width_m: 0.0,
        joint_tone: 1.0,
        turn: [1.0, 0.0],
        stagger: 0.0,
        contrast: 0.0,
    };

    /// Returns true for a grid of joints along u and v, with tiles of equal brightness.
    #[must_use]
    pub fn is_regular(&self) -> bool {
        self.turn[1] == 0.0 && self.stagger == 0.0 && self.contrast == 0.0
    }
}

impl Material {
    /// Returns a matte material without texture.
    #[must_use]
    pub fn matte(albedo: Color) -> Self {
        Self {
            albedo,
            emission: 0.0,
            grain: Grain::Speckle,
            speckle: 0.0,
            grain_m: 0.01,
            gloss: 0.0,
            reflectance: 0.0,
            is_sharp: false,
            light: 1.0,
            tiles: Tiles::NONE,
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
    /// Index of an earlier surface with the same coordinates and light, of which this one is a part.
    pub part_of: Option<usize>,
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
            part_of: None,
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
