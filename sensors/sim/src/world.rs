//! World files: walls, doors, boxes, lamps and people.
//!
//! World frame: x forward along the hallway, y left, z up, floor at z = 0.

mod check;
mod corridor;
mod floor;
mod random;
mod wire_frame;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_inline_default::serde_inline_default;
use smart_default::SmartDefault;
use yamabico_core::parameters::Problems;

pub use check::WORLD_FILE;
pub use corridor::{Branch, Corridor, CorridorDoor, Side};
pub use floor::{Floor, Grain, Patch, Reflection};

/// Linear RGB reflectance, each 0 (black) to 1 (white).
pub type Color = [f32; 3];

/// Reflectance of a plain wall.
pub(crate) const WALL_COLOR: Color = [0.72, 0.71, 0.66];
/// Length, width and height of a standard box, m.
const BOX_SIZE: [f64; 3] = [0.24, 0.24, 0.35];
/// Reflectance of a white box.
pub(crate) const BOX_COLOR: Color = [0.85, 0.85, 0.83];
/// Size of a standard ceiling lamp along x and y, m.
const LAMP_SIZE: [f64; 2] = [1.2, 0.3];
/// Radiance of a standard ceiling lamp relative to a white surface under it.
const LAMP_BRIGHTNESS: f32 = 12.0;

/// Content of a world file.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct World {
    /// Display name; may be empty.
    pub name: String,
    /// Seed of the surfaces' texture; independent of the seed of a run.
    pub texture_seed: u64,
    /// Straight hallway along +x, expanded into walls, doors, lamps and a window.
    pub corridor: Option<Corridor>,
    /// Additional walls.
    #[serde(rename = "wall")]
    #[schemars(length(max = 1000))]
    pub walls: Vec<Wall>,
    /// Boxes on or above the floor.
    #[serde(rename = "box")]
    #[schemars(length(max = 1000))]
    pub boxes: Vec<BoxItem>,
    /// Ceiling lamps in addition to those of the hallway.
    #[serde(rename = "lamp")]
    #[schemars(length(max = 1000))]
    pub lamps: Vec<Lamp>,
    /// People.
    #[serde(rename = "person")]
    #[schemars(length(max = 1000))]
    pub people: Vec<Person>,
    /// Floor.
    pub floor: Floor,
    /// Flat things on the floor.
    #[serde(rename = "patch")]
    #[schemars(length(max = 1000))]
    pub patches: Vec<Patch>,
    /// Ceiling.
    pub ceiling: Ceiling,
    /// Ambient light relative to the light under a lamp.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ambient: Option<f32>,
}

/// Straight wall. Its line is the face on its left, seen from `from_m` to `to_m`; its thickness extends to the right.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Start of the face, x and y.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub from_m: [f64; 2],
    /// End of the face, x and y; at most 500 m from the start.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub to_m: [f64; 2],
    /// Height.
    #[serde_inline_default(Wall::default().height_m)]
    #[schemars(range(min = 0.05, max = 10.0))]
    pub height_m: f64,
    /// Thickness.
    #[serde_inline_default(Wall::default().thickness_m)]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub thickness_m: f64,
    /// Reflectance.
    #[serde_inline_default(WALL_COLOR)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Baseboard of its left face; without it, none.
    #[serde(default)]
    pub baseboard: Option<Baseboard>,
    /// Other color of the lower part of its left face; without it, none.
    #[serde(default)]
    pub dado: Option<Dado>,
    /// Doors in the wall.
    #[serde(default, rename = "door")]
    #[schemars(length(max = 1000))]
    pub doors: Vec<Door>,
    /// Windows in the wall.
    #[serde(default, rename = "window")]
    #[schemars(length(max = 1000))]
    pub windows: Vec<Window>,
    /// Posters on its left face.
    #[serde(default, rename = "poster")]
    #[schemars(length(max = 1000))]
    pub posters: Vec<Poster>,
}

/// Strip along the bottom of a wall.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Baseboard {
    /// Height.
    #[default(0.10)]
    #[schemars(range(min = 0.02, max = 0.5))]
    pub height_m: f64,
    /// Protrusion from the wall.
    #[default(0.012)]
    #[schemars(range(min = 0.002, max = 0.05))]
    pub depth_m: f64,
    /// Reflectance.
    #[default([0.10, 0.09, 0.085])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
}

/// Lower part of a wall in another color, between the doors.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Dado {
    /// Height of its upper edge.
    #[default(1.1)]
    #[schemars(range(min = 0.2, max = 2.0))]
    pub height_m: f64,
    /// Reflectance.
    #[default([0.45, 0.5, 0.42])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
}

/// Sheet with printed lines on a wall.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Poster {
    /// Center, from the start of the wall.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub at_m: f64,
    /// Width.
    #[default(0.6)]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub width_m: f64,
    /// Height of the lower edge above the floor.
    #[default(1.0)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub base_m: f64,
    /// Height of the sheet; at most the wall's height above the lower edge.
    #[default(0.85)]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub height_m: f64,
    /// Reflectance of the sheet.
    #[default([0.8, 0.78, 0.72])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Spacing of the printed lines, horizontal and vertical; 0 means none, else at least 0.05.
    #[default([0.06, 0.0])]
    #[schemars(inner(range(min = 0.0, max = 10.0)))]
    pub line_spacing_m: [f32; 2],
    /// Brightness of the lines relative to the sheet.
    #[default(0.35)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub line_tone: f32,
}

/// Door with its frame.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Door {
    /// Center of the opening, from the start of the wall.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub at_m: f64,
    /// Width of the opening.
    #[default(0.9)]
    #[schemars(range(min = 0.4, max = 3.0))]
    pub width_m: f64,
    /// Height of the opening; at most the wall's height.
    #[default(2.05)]
    #[schemars(range(min = 1.5, max = 10.0))]
    pub height_m: f64,
    /// Opening angle of the leaf; 0 is closed. An open door leads away from the hallway into a room built for it.
    #[schemars(range(min = 0.0, max = 120.0))]
    pub open_deg: f64,
    /// Depth of the room behind an open door.
    #[default(2.5)]
    #[schemars(range(min = 0.5, max = 10.0))]
    pub room_depth_m: f64,
    /// Reflectance of the leaf.
    #[default([0.36, 0.22, 0.12])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Reflectance of the frame.
    #[default([0.26, 0.27, 0.28])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub frame_color: Color,
}

/// Bright opening in a wall.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Window {
    /// Center, from the start of the wall; without it, the middle of the wall.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub at_m: Option<f64>,
    /// Width.
    #[default(1.2)]
    #[schemars(range(min = 0.2, max = 20.0))]
    pub width_m: f64,
    /// Height of the lower edge above the floor.
    #[default(0.9)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub sill_m: f64,
    /// Height of the opening; at most the wall's height above the sill.
    #[default(1.3)]
    #[schemars(range(min = 0.2, max = 10.0))]
    pub height_m: f64,
    /// Radiance relative to a white surface under a lamp.
    #[default(2.5)]
    #[schemars(range(min = 0.0, max = 20.0))]
    pub brightness: f32,
    /// Reflectance of the frame and its cross bars.
    #[default([0.5, 0.5, 0.5])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub frame_color: Color,
}

/// Box of cardboard or wood.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxItem {
    /// Center of the base, x and y.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub at_m: [f64; 2],
    /// Height of the base above the floor.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub base_m: f64,
    /// Rotation about the vertical axis, positive to the left.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0))]
    pub yaw_deg: f64,
    /// Length, width and height.
    #[serde_inline_default(BOX_SIZE)]
    #[schemars(inner(range(min = 0.01, max = 10.0)))]
    pub size_m: [f64; 3],
    /// Reflectance; `[0.85, 0.85, 0.83]` is white, `[0.30, 0.19, 0.10]` is brown.
    #[serde_inline_default(BOX_COLOR)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Reflectances from which the seed draws one that replaces `color`; without it, none.
    #[serde(default)]
    #[schemars(length(max = 100), inner(inner(range(min = 0.0, max = 1.0))))]
    pub colors: Vec<Color>,
    /// Maximum displacement along x and y drawn from the seed.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub jitter_m: [f64; 2],
    /// Maximum rotation drawn from the seed.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 180.0))]
    pub jitter_deg: f64,
}

/// Ceiling lamp.
#[serde_inline_default]
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lamp {
    /// Center, x and y.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub at_m: [f64; 2],
    /// Size along x and y.
    #[serde_inline_default(LAMP_SIZE)]
    #[schemars(inner(range(min = 0.01, max = 10.0)))]
    pub size_m: [f64; 2],
    /// Radiance relative to a white surface under a standard lamp; 0 is dark.
    #[serde_inline_default(LAMP_BRIGHTNESS)]
    #[schemars(range(min = 0.0, max = 50.0))]
    pub brightness: f32,
}

/// Standing or walking person.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Person {
    /// Corners of the walk, x and y; a person with one corner stands.
    #[schemars(length(min = 1, max = 1000), inner(inner(range(min = -1000.0, max = 1000.0))))]
    pub path_m: Vec<[f64; 2]>,
    /// Pause at each corner, in order; missing values are 0.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 3600.0)))]
    pub pause_s: Vec<f64>,
    /// Start of the walk, from the start of the run.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 86_400.0))]
    pub start_s: f64,
    /// Maximum shift of the start drawn from the seed.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub jitter_s: f64,
    /// Walking speed.
    #[serde_inline_default(0.8)]
    #[schemars(range(min = 0.01, max = 3.0))]
    pub speed_mps: f64,
    /// Distance below which the person waits, for up to 30 s, for a robot in the way; 0 disables waiting.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub gives_way_m: f64,
    /// Height.
    #[serde_inline_default(1.75)]
    #[schemars(range(min = 0.5, max = 2.2))]
    pub height_m: f64,
    /// Reflectance of the shirt.
    #[serde_inline_default([0.25, 0.32, 0.55])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub shirt: Color,
    /// Reflectance of the trousers.
    #[serde_inline_default([0.07, 0.08, 0.11])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub trousers: Color,
}

/// Surface of the ceiling.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Ceiling {
    /// Height.
    #[default(2.6)]
    #[schemars(range(min = 2.0, max = 10.0))]
    pub height_m: f64,
    /// Reflectance.
    #[default([0.80, 0.80, 0.78])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Spacing of the joints along x and y; 0 means none, else at least 0.05.
    #[default([0.6, 0.6])]
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub joint_spacing_m: [f32; 2],
}

impl World {
    /// Parses and checks the text of a world file.
    ///
    /// # Errors
    /// All syntax errors and invalid values, with their positions in the text.
    pub fn from_toml(text: &str) -> Result<Self, Problems> {
        WORLD_FILE.read("the world", text).map(|table| table.try_into().unwrap_or_default())
    }

    /// Returns a straight hallway along +x from x = -2 m, with lamps, baseboards and an end window, without doors.
    ///
    /// `length_m` and `width_m` are measured between the faces of the walls.
    #[must_use]
    pub fn corridor(length_m: f64, width_m: f64) -> Self {
        Self { corridor: Some(Corridor { length_m, width_m, ..Corridor::default() }), ..Self::default() }
    }
}

impl Default for BoxItem {
    fn default() -> Self {
        Self {
            at_m: [0.0; 2],
            base_m: 0.0,
            yaw_deg: 0.0,
            size_m: BOX_SIZE,
            color: BOX_COLOR,
            colors: Vec::new(),
            jitter_m: [0.0; 2],
            jitter_deg: 0.0,
        }
    }
}

impl Default for Wall {
    fn default() -> Self {
        Self {
            from_m: [0.0; 2],
            to_m: [1.0, 0.0],
            height_m: 2.6,
            thickness_m: 0.12,
            color: WALL_COLOR,
            baseboard: None,
            dado: None,
            doors: Vec::new(),
            windows: Vec::new(),
            posters: Vec::new(),
        }
    }
}
