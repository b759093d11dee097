//! What a world file says: walls, doors, boxes, lamps and people, before anything is built from it.
//!
//! World frame: x forward along the hallway, y left, z up, floor at z = 0. Meters, seconds; degrees only here.

mod check;
mod corridor;
mod random;
mod wire_frame;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use yamabico_core::parameters::Problems;

pub use check::WORLD_FILE;
pub use corridor::{Branch, Corridor, CorridorDoor, Side};

/// Linear RGB reflectance, each 0 (black) to 1 (white).
pub type Color = [f32; 3];

/// Everything that stands, hangs or walks in a world.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct World {
    /// Name for people; may be empty.
    pub name: String,
    /// Seed of the surfaces' speckle. Any integer; the seed of a run does not change the building.
    pub texture_seed: u64,
    /// A straight hallway along +x, expanded into walls, doors, lamps and a window.
    pub corridor: Option<Corridor>,
    /// Further walls, anywhere.
    #[serde(rename = "wall")]
    #[schemars(length(max = 1000))]
    pub walls: Vec<Wall>,
    /// Boxes on the floor or above it.
    #[serde(rename = "box")]
    #[schemars(length(max = 1000))]
    pub boxes: Vec<BoxItem>,
    /// Lit ceiling panels besides those of the hallway.
    #[serde(rename = "lamp")]
    #[schemars(length(max = 1000))]
    pub lamps: Vec<Lamp>,
    /// People.
    #[serde(rename = "person")]
    #[schemars(length(max = 1000))]
    pub people: Vec<Person>,
    /// The floor.
    pub floor: Floor,
    /// The ceiling.
    pub ceiling: Ceiling,
    /// Light that comes from everywhere, relative to the light under a lamp, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ambient: Option<f32>,
}

/// A straight wall. Its line is the face on its LEFT (seen from `from_m` to `to_m`); its thickness lies to the right.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Start of the face, x and y in meters, each -1000 to 1000.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub from_m: [f64; 2],
    /// End of the face, x and y in meters, each -1000 to 1000; at most 500 m away.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub to_m: [f64; 2],
    /// Height in meters, 0.05 to 10.
    #[serde(default = "wall_height")]
    #[schemars(range(min = 0.05, max = 10.0))]
    pub height_m: f64,
    /// Thickness in meters, 0.01 to 1.
    #[serde(default = "wall_thickness")]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub thickness_m: f64,
    /// Reflectance.
    #[serde(default = "wall_color")]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// The strip along the bottom of its left face; none when absent.
    #[serde(default)]
    pub baseboard: Option<Baseboard>,
    /// Doors in it.
    #[serde(default, rename = "door")]
    #[schemars(length(max = 1000))]
    pub doors: Vec<Door>,
    /// Windows in it.
    #[serde(default, rename = "window")]
    #[schemars(length(max = 1000))]
    pub windows: Vec<Window>,
}

/// A strip along the bottom of a wall.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Baseboard {
    /// Height in meters, 0.02 to 0.5.
    #[schemars(range(min = 0.02, max = 0.5))]
    pub height_m: f64,
    /// How far it stands out of the wall, meters, 0.002 to 0.05.
    #[schemars(range(min = 0.002, max = 0.05))]
    pub depth_m: f64,
    /// Reflectance.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
}

/// A door with its frame.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Door {
    /// Center of the opening, meters from the wall's start, 0 to 500.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub at_m: f64,
    /// Width of the opening in meters, 0.4 to 3.
    #[schemars(range(min = 0.4, max = 3.0))]
    pub width_m: f64,
    /// Height of the opening in meters, 1.5 to the wall's height.
    #[schemars(range(min = 1.5, max = 10.0))]
    pub height_m: f64,
    /// How far the leaf is open, degrees, 0 (closed) to 120. It opens away from the hallway, into a room built for it.
    #[schemars(range(min = 0.0, max = 120.0))]
    pub open_deg: f64,
    /// Depth in meters of the room behind an open door, 0.5 to 10.
    #[schemars(range(min = 0.5, max = 10.0))]
    pub room_depth_m: f64,
    /// Reflectance of the leaf.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Reflectance of the frame.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub frame_color: Color,
}

/// A bright opening.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Window {
    /// Center, meters from the wall's start, 0 to 500; the wall's middle when absent.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub at_m: Option<f64>,
    /// Width in meters, 0.2 to 20.
    #[schemars(range(min = 0.2, max = 20.0))]
    pub width_m: f64,
    /// Height of its lower edge above the floor, meters, 0 to 10.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub sill_m: f64,
    /// Height of the opening, meters, 0.2 to the wall's height above the sill.
    #[schemars(range(min = 0.2, max = 10.0))]
    pub height_m: f64,
    /// Radiance relative to a white surface under a lamp, 0 to 20.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub brightness: f32,
    /// Reflectance of the frame and its cross bars.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub frame_color: Color,
}

/// A box of cardboard or wood.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxItem {
    /// Center of its base, x and y in meters, each -1000 to 1000.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub at_m: [f64; 2],
    /// Height of its base above the floor, meters, 0 to 10.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub base_m: f64,
    /// Turn about the vertical axis, degrees, + to the left, -360 to 360.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0))]
    pub yaw_deg: f64,
    /// Length, width and height in meters, each 0.01 to 10.
    #[serde(default = "box_size")]
    #[schemars(inner(range(min = 0.01, max = 10.0)))]
    pub size_m: [f64; 3],
    /// Reflectance; `[0.85, 0.85, 0.83]` is white, `[0.30, 0.19, 0.10]` brown.
    #[serde(default = "box_color")]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// The seed picks one of these reflectances instead of `color`; none when absent.
    #[serde(default)]
    #[schemars(length(max = 100), inner(inner(range(min = 0.0, max = 1.0))))]
    pub colors: Vec<Color>,
    /// The seed moves the box by up to this much either way, along x and y in meters, each 0 to 100.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub jitter_m: [f64; 2],
    /// The seed turns the box by up to this much either way, degrees, 0 to 180.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 180.0))]
    pub jitter_deg: f64,
}

/// A lit ceiling panel.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lamp {
    /// Center, x and y in meters, each -1000 to 1000.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub at_m: [f64; 2],
    /// Extent along x and y, meters, each 0.01 to 10.
    #[serde(default = "lamp_size")]
    #[schemars(inner(range(min = 0.01, max = 10.0)))]
    pub size_m: [f64; 2],
    /// Radiance relative to a white surface under a lamp, 0 (dark) to 50.
    #[serde(default = "lamp_brightness")]
    #[schemars(range(min = 0.0, max = 50.0))]
    pub brightness: f32,
}

/// Somebody who stands or walks.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Person {
    /// Corners of the walk, x and y in meters, each -1000 to 1000; one corner means that they stand.
    #[schemars(length(min = 1, max = 1000), inner(inner(range(min = -1000.0, max = 1000.0))))]
    pub path_m: Vec<[f64; 2]>,
    /// Pause in seconds at each corner, in order, each 0 to 3600; missing ones are 0.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 3600.0)))]
    pub pause_s: Vec<f64>,
    /// When they set off, seconds after the start of the run, 0 to 86400.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 86_400.0))]
    pub start_s: f64,
    /// The seed moves the start by up to this much either way, seconds, 0 to 60.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub jitter_s: f64,
    /// Walking speed in m/s, 0.01 to 3.
    #[serde(default = "walking_speed")]
    #[schemars(range(min = 0.01, max = 3.0))]
    pub speed_mps: f64,
    /// They wait, for up to 30 s, while a robot is in their way and nearer than this, meters, 0 to 10; at 0 they walk on whatever is
    /// there.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub gives_way_m: f64,
    /// Height in meters, 0.5 to 2.2.
    #[serde(default = "person_height")]
    #[schemars(range(min = 0.5, max = 2.2))]
    pub height_m: f64,
    /// Reflectance of the shirt.
    #[serde(default = "shirt_color")]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub shirt: Color,
    /// Reflectance of the trousers.
    #[serde(default = "trousers_color")]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub trousers: Color,
}

/// The floor's surface.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Floor {
    /// Reflectance.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Contrast of the speckle (standard deviation relative to the mean), 0 to 0.5.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub speckle: f32,
    /// Size of the finest speckle in meters, 0.002 to 0.1.
    #[schemars(range(min = 0.002, max = 0.1))]
    pub grain_m: f32,
    /// How much it mirrors, 0 (matt) to 1 (polished).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gloss: f32,
    /// Distance of the joints along x and y, meters, each 0.05 to 100; 0 means none.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub joint_spacing_m: [f32; 2],
    /// Width of the joints in meters, 0 to 0.05.
    #[schemars(range(min = 0.0, max = 0.05))]
    pub joint_width_m: f32,
    /// Brightness of the joints relative to the floor, 0 (black) to 1 (invisible).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub joint_tone: f32,
}

/// The ceiling's surface.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Ceiling {
    /// Height in meters, 2 to 10.
    #[schemars(range(min = 2.0, max = 10.0))]
    pub height_m: f64,
    /// Reflectance.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Distance of the joints along x and y, meters, each 0.05 to 100; 0 means none.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub joint_spacing_m: [f32; 2],
}

impl World {
    /// Reads and checks a world file's text.
    ///
    /// # Errors
    /// Everything that is wrong in it, with its place.
    pub fn from_toml(text: &str) -> Result<Self, Problems> {
        WORLD_FILE.read("the world", text).map(|table| table.try_into().unwrap_or_default())
    }

    /// An empty straight hallway along +x from x = -2 m: lamps, baseboards and an end window, no doors.
    ///
    /// `length_m` and `width_m` are meters between the faces of the walls.
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
            size_m: box_size(),
            color: box_color(),
            colors: Vec::new(),
            jitter_m: [0.0; 2],
            jitter_deg: 0.0,
        }
    }
}

impl Default for Baseboard {
    fn default() -> Self {
        Self { height_m: 0.10, depth_m: 0.012, color: [0.10, 0.09, 0.085] }
    }
}

impl Default for Door {
    fn default() -> Self {
        Self {
            at_m: 0.0,
            width_m: 0.9,
            height_m: 2.05,
            open_deg: 0.0,
            room_depth_m: 2.5,
            color: [0.36, 0.22, 0.12],
            frame_color: [0.26, 0.27, 0.28],
        }
    }
}

impl Default for Window {
    fn default() -> Self {
        Self {
            at_m: None,
            width_m: 1.2,
            sill_m: 0.9,
            height_m: 1.3,
            brightness: 2.5,
            frame_color: [0.5, 0.5, 0.5],
        }
    }
}

impl Default for Floor {
    fn default() -> Self {
        Self {
            color: [0.42, 0.39, 0.34],
            speckle: 0.10,
            grain_m: 0.006,
            gloss: 0.5,
            joint_spacing_m: [0.0, 0.0],
            joint_width_m: 0.004,
            joint_tone: 0.6,
        }
    }
}

impl Default for Ceiling {
    fn default() -> Self {
        Self { height_m: 2.6, color: [0.80, 0.80, 0.78], joint_spacing_m: [0.6, 0.6] }
    }
}

fn wall_height() -> f64 {
    2.6
}
fn wall_thickness() -> f64 {
    0.12
}
pub(crate) fn wall_color() -> Color {
    [0.72, 0.71, 0.66]
}
fn box_size() -> [f64; 3] {
    [0.24, 0.24, 0.35]
}
fn box_color() -> Color {
    [0.85, 0.85, 0.83]
}
fn lamp_size() -> [f64; 2] {
    [1.2, 0.3]
}
fn lamp_brightness() -> f32 {
    12.0
}
fn walking_speed() -> f64 {
    0.8
}
fn person_height() -> f64 {
    1.75
}
fn shirt_color() -> Color {
    [0.25, 0.32, 0.55]
}
fn trousers_color() -> Color {
    [0.07, 0.08, 0.11]
}
