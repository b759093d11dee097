//! Floor of a world, and flat things on it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use super::Color;

/// Surface of the floor.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Floor {
    /// Reflectance.
    #[default([0.42, 0.39, 0.34])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Shape of the fine texture.
    pub grain: Grain,
    /// Contrast of the fine texture: standard deviation relative to the mean.
    #[default(0.10)]
    #[schemars(range(min = 0.0, max = 0.5))]
    pub speckle: f32,
    /// Size of the finest speckle.
    #[default(0.006)]
    #[schemars(range(min = 0.002, max = 0.1))]
    pub grain_m: f32,
    /// Specular reflection; 0 is matte, 1 is a mirror.
    #[default(0.5)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gloss: f32,
    /// Fraction of the light that a floor of gloss 1 mirrors at normal incidence; it mirrors more at grazing incidence.
    #[default(0.04)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub reflectance: f32,
    /// Sharpness of the mirror image.
    pub reflection: Reflection,
    /// Spacing of the joints along x and y; 0 means none, else at least 0.05.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub joint_spacing_m: [f32; 2],
    /// Rotation of the joints, positive to the left.
    #[schemars(range(min = -90.0, max = 90.0))]
    pub joint_angle_deg: f32,
    /// Width of the joints.
    #[default(0.004)]
    #[schemars(range(min = 0.0, max = 0.05))]
    pub joint_width_m: f32,
    /// Brightness of the joints relative to the floor; 1 is invisible.
    #[default(0.6)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub joint_tone: f32,
    /// Random shift of each row of tiles along x, relative to their length; 0 is a regular grid, 1 is laid like planks.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub stagger: f32,
    /// Contrast between tiles: standard deviation of their brightness relative to the mean.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub tile_contrast: f32,
}

/// Shape of a fine texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Grain {
    /// Noise of several sizes, as in linoleum.
    #[default]
    Speckle,
    /// Chips of stone of several tones with sharp outlines, as in terrazzo.
    Chips,
    /// Rows of lozenges and dots with noise, as in a woven carpet.
    Motif,
}

/// Sharpness of the mirror image in a floor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Reflection {
    /// Softened, as on a worn floor.
    #[default]
    Blurred,
    /// Exact mirror image, as on a polished floor; a mirror camera shows it softened.
    Sharp,
}

/// Flat rectangle on the floor that is no obstacle: paper, tape, a mat, or a patch of sunlight.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Patch {
    /// Center, x and y.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub at_m: [f64; 2],
    /// Length and width.
    #[default([0.297, 0.21])]
    #[schemars(inner(range(min = 0.01, max = 500.0)))]
    pub size_m: [f64; 2],
    /// Rotation about the vertical axis, positive to the left.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub yaw_deg: f64,
    /// Reflectance; without it, the floor itself, in the light of `light`.
    pub color: Option<Color>,
    /// Light on the patch relative to the light around it: above 1 sunlight, below 1 shadow.
    #[default(1.0)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub light: f32,
}
