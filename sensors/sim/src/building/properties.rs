//! Properties of a drawn building that can be overridden, and by which results can be compared.

use rand::RngExt;
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_core::parameters::{FileKind, Problems};

use super::PICTURE;
use crate::random::{Stream, stream};

/// Farthest point at which the lower edge of the image may meet the floor, m.
const MAX_NEAREST_FLOOR_M: f64 = 1.2;

/// Properties of a building, of the light in it, and of the camera of the robot that drives there.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Properties {
    /// Width of the hallway between the faces of its walls.
    #[schemars(range(min = 1.2, max = 4.0))]
    pub width_m: f64,
    /// Distance from the start of the robot to its goal.
    #[schemars(range(min = 6.0, max = 40.0))]
    pub distance_m: f64,
    /// Baseboards.
    pub baseboard: BaseboardKind,
    /// Floor.
    pub floor: FloorKind,
    /// Difference in brightness between joints and tiles or planks, relative to the floor.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub joint_contrast: f32,
    /// Number of sheets of paper and similar flat things on the floor.
    #[schemars(range(min = 0, max = 50))]
    pub papers: u32,
    /// Decoration of the walls.
    pub walls: WallKind,
    /// Arrangement of the lamps.
    pub lamps: Lamps,
    /// Light from outside.
    pub glare: Glare,
    /// Fraction of the doors that are open.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub open_doors: f64,
    /// Number of boxes in the way.
    #[schemars(range(min = 0, max = 20))]
    pub boxes: u32,
    /// Person in the hallway.
    pub person: PersonKind,
    /// Distance below which people wait for a robot in their way; 0 for people who do not see it.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub gives_way_m: f64,
    /// Height of the camera.
    #[schemars(range(min = 0.1, max = 2.0))]
    pub camera_m: f64,
    /// Tilt of the camera toward the floor.
    #[schemars(range(min = -20.0, max = 45.0))]
    pub tilt_deg: f64,
    /// Horizontal field of view of the camera.
    #[schemars(range(min = 30.0, max = 120.0))]
    pub view_deg: f64,
    /// Blur of the lens: standard deviation of its point spread, pixels.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub blur_px: f32,
    /// Fraction of the light that the lens scatters.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub stray_light: f32,
    /// Standard deviation of the noise of the camera, gray levels.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub noise: f32,
    /// Gain of the camera; at 1, a white wall under standard lamps has a gray level of about 200.
    #[schemars(range(min = 0.05, max = 20.0))]
    pub gain: f32,
    /// Standard deviation of the gain from frame to frame, relative to its mean.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub flicker: f32,
    /// Fraction of frames that are lost.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lost_frames: f64,
}

/// Baseboards of a building.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BaseboardKind {
    /// No baseboards.
    None,
    /// Low, with nearly the color of the wall.
    Faint,
    /// Dark or white.
    Strong,
}

/// Floor of a building.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FloorKind {
    /// Linoleum with a soft gloss.
    Linoleum,
    /// Polished linoleum that mirrors lamps, doors and things exactly.
    Mirror,
    /// Tiles.
    Tiles,
    /// Carpet, plain or with a pattern.
    Carpet,
    /// Wooden planks.
    Planks,
    /// Terrazzo.
    Terrazzo,
    /// Linoleum with stripes along the walls or across.
    Stripes,
}

/// Walls of a building.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WallKind {
    /// One color.
    Plain,
    /// Another color up to chest height.
    TwoTone,
    /// Posters and notices.
    Posters,
}

/// Lamps of a building.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Lamps {
    /// A lamp every two to three meters.
    Row,
    /// Few lamps, with dark floor between them.
    Sparse,
    /// An almost continuous strip.
    Strip,
}

/// Light from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Glare {
    /// No window.
    None,
    /// A bright window at the far end.
    Window,
    /// A very bright window at the far end, windows in one wall, and patches of sunlight on the floor.
    Sun,
}

/// Person in the hallway.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PersonKind {
    /// No person.
    None,
    /// Comes out of a door, stops in the middle, and leaves through a door on the other side.
    Crosses,
    /// Comes toward the robot along one wall, and passes.
    Meets,
    /// Stands at a wall.
    Stands,
}

/// File kind of the overridden properties.
const PROPERTIES: FileKind = FileKind {
    key: "building",
    what: "the properties of a building",
    schema: || schema_for!(Properties),
    rules: |_| Vec::new(),
};

impl Properties {
    /// Draws the properties of a seed. Each has its own random stream, so that one more does not change the others.
    #[must_use]
    pub fn draw(seed: u64) -> Self {
        let of = |name: &str| stream(seed, &format!("building {name}"));
        let between = |name: &str, low: f64, high: f64| hundredths(of(name).random_range(low..=high));
        let width_m = between("width", 1.3, 3.0);
        let glare = one_of(&mut of("glare"), &[Glare::None, Glare::Window, Glare::Sun]);
        let person = one_of(&mut of("person"), &[PersonKind::Crosses, PersonKind::Meets, PersonKind::Stands]);
        let camera_m = between("camera height", 0.35, 0.9);
        let view_deg = between("view", 50.0, 80.0).round();
        let stray_light = match glare {
            Glare::None => 0.0,
            Glare::Window => between("stray light", 0.0, 0.03),
            Glare::Sun => between("stray light", 0.02, 0.06),
        };
        Self {
            width_m,
            distance_m: between("distance", 9.0, 13.0),
            // The name of the stream is part of what a seed means.
            baseboard: one_of(
                &mut of("skirting"),
                &[BaseboardKind::None, BaseboardKind::Faint, BaseboardKind::Strong],
            ),
            floor: one_of(
                &mut of("floor"),
                &[
                    FloorKind::Linoleum,
                    FloorKind::Mirror,
                    FloorKind::Tiles,
                    FloorKind::Carpet,
                    FloorKind::Planks,
                    FloorKind::Terrazzo,
                    FloorKind::Stripes,
                ],
            ),
            joint_contrast: between("joint contrast", 0.05, 0.7) as f32,
            papers: of("papers").random_range(0..=9_u32).saturating_sub(4),
            walls: one_of(&mut of("walls"), &[WallKind::Plain, WallKind::TwoTone, WallKind::Posters]),
            lamps: one_of(&mut of("lamps"), &[Lamps::Row, Lamps::Row, Lamps::Sparse, Lamps::Strip]),
            glare,
            open_doors: between("open doors", 0.0, 0.6),
            boxes: of("boxes").random_range(1..=3),
            // A narrow hallway has no room to pass.
            person: if width_m < 1.7 && person == PersonKind::Meets { PersonKind::Crosses } else { person },
            gives_way_m: 0.4,
            camera_m,
            tilt_deg: between("tilt", 0.0, 12.0).max(least_tilt_deg(camera_m, view_deg)),
            view_deg,
            blur_px: between("blur", 0.0, 1.2) as f32,
            stray_light: stray_light as f32,
            noise: between("noise", 0.5, 5.0) as f32,
            // As far below the nominal gain as above.
            gain: hundredths(2_f64.powf(of("gain").random_range(-0.6..=0.6))) as f32,
            flicker: (between("flicker", -0.04, 0.06) as f32).max(0.0),
            lost_frames: between("lost frames", -0.1, 0.15).max(0.0),
        }
    }

    /// Returns the properties with lines of TOML such as `width_m = 1.4` in place of those drawn.
    ///
    /// # Errors
    /// All lines that name no property or are out of range.
    pub fn with(self, overrides: &[String]) -> Result<Self, Problems> {
        let given = overrides.join("\n");
        // Syntax errors are reported at their place among the overrides.
        let Ok(given) = given.parse::<toml::Table>() else {
            return PROPERTIES.read("--set", &given).map(|_| self);
        };
        let mut table = toml::Table::try_from(self).unwrap_or_default();
        table.extend(given);
        let table = PROPERTIES.read("--set", &toml::to_string(&table).unwrap_or_default())?;
        Ok(table.try_into().unwrap_or(self))
    }
}

/// Returns the minimum tilt at which the image shows the floor close to the robot, degrees.
fn least_tilt_deg(camera_m: f64, view_deg: f64) -> f64 {
    let half = (0.5 * view_deg.to_radians()).tan() * f64::from(PICTURE[1]) / f64::from(PICTURE[0]);
    hundredths(((camera_m / MAX_NEAREST_FLOOR_M).atan() - half.atan()).to_degrees().max(0.0))
}

fn hundredths(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}

/// Returns one of the choices.
pub fn one_of<T: Copy>(rng: &mut Stream, choices: &[T]) -> T {
    choices[rng.random_range(0..choices.len())]
}
