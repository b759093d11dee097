//! Buildings drawn from a seed: a hallway with its floor, walls, light, boxes and people, and the camera of a robot in it.
//!
//! ```
//! use yamabico_sim::building::Building;
//!
//! let building = Building::new(7, &["floor = \"mirror\"".into()])?;
//! assert_eq!(building.world_toml(), Building::new(7, &["floor = \"mirror\"".into()])?.world_toml());
//! # Ok::<(), yamabico_core::parameters::Problems>(())
//! ```

mod floor;
mod obstacles;
mod properties;
mod walls;

use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::parameters::Problems;

use crate::Photometry;
use crate::random::stream;
use crate::world::World;

pub use properties::{BaseboardKind, FloorKind, Glare, Lamps, PersonKind, Properties, WallKind};

/// World x of the near end of the hallway, m.
const START_X_M: f64 = -2.0;
/// Length of the hallway beyond the goal, m.
const BEYOND_M: f64 = 3.5;
/// Width and height of the camera's images, px.
const PICTURE: [u32; 2] = [256, 240];

/// Building drawn from a seed.
#[derive(Clone, Debug)]
pub struct Building {
    /// Seed.
    pub seed: u64,
    /// Properties that can be overridden; the seed draws the rest.
    pub properties: Properties,
    /// Its world file.
    pub world: World,
}

impl Building {
    /// Returns the building of a seed. Each override is a line of TOML, such as `width_m = 1.4`; the properties that are not
    /// overridden stay those of the seed.
    ///
    /// # Errors
    /// All overrides that name no property or are out of range.
    pub fn new(seed: u64, overrides: &[String]) -> Result<Self, Problems> {
        let properties = Properties::draw(seed).with(overrides)?;
        let drawn = draw_world(seed, &properties);
        // Rounded as in the file, so that both are the same world.
        let world = World::from_toml(&toml_of(&drawn))?;
        Ok(Self { seed, properties, world })
    }

    /// Returns the text of the world file.
    #[must_use]
    pub fn world_toml(&self) -> String {
        let properties = toml::to_string(&self.properties).unwrap_or_default();
        let properties: String = properties.lines().map(|line| format!("#     {line}\n")).collect();
        format!(
            "#:schema ../configs/schemas/world.json\n# Building {}, drawn from its seed with these properties:\n#\n{properties}#\n\
             # Frame: x along the hallway, y to the left, z up; the floor is z = 0, the centerline y = 0.\n\n{}",
            self.seed,
            toml_of(&self.world)
        )
    }

    /// Returns the camera of the robot, and its pose on the robot.
    #[must_use]
    pub fn camera(&self) -> (Intrinsics, Mount) {
        let p = &self.properties;
        let intrinsics = Intrinsics::from_horizontal_fov(PICTURE[0], PICTURE[1], p.view_deg.to_radians());
        (intrinsics, Mount::tilted(p.camera_m, p.tilt_deg.to_radians()))
    }

    /// Returns the camera's photometry.
    #[must_use]
    pub fn photometry(&self) -> Photometry {
        let p = &self.properties;
        Photometry {
            exposure: p.gain,
            noise_sigma: p.noise,
            flicker: p.flicker,
            blur_px: p.blur_px,
            glare: p.stray_light,
            ..Photometry::default()
        }
    }
}

fn draw_world(seed: u64, p: &Properties) -> World {
    let mut world = World {
        name: format!("building {seed}"),
        // TOML has no integers above 2^63.
        texture_seed: seed >> 1,
        ambient: Some(0.45),
        ..World::default()
    };
    let crossing = obstacles::place_people(&mut world, p, &mut stream(seed, "building people"));
    walls::build(&mut world, p, crossing, seed);
    floor::lay(&mut world, p, seed);
    obstacles::place_boxes(&mut world, p, &mut stream(seed, "building boxes"));
    world
}

/// Returns the TOML of a world with values rounded to a tenth of a millimeter.
fn toml_of(world: &World) -> String {
    let mut value = toml::Value::try_from(world).unwrap_or_else(|_| toml::Value::Table(toml::Table::new()));
    round(&mut value);
    toml::to_string(&value).unwrap_or_default()
}

fn round(value: &mut toml::Value) {
    match value {
        toml::Value::Float(number) => *number = (*number * 1e4).round() / 1e4,
        toml::Value::Array(items) => items.iter_mut().for_each(round),
        toml::Value::Table(table) => table.iter_mut().for_each(|(_, value)| round(value)),
        _ => {}
    }
}
