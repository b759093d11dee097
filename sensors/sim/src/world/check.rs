//! What a world must not say, beyond the range of each key.

use schemars::schema_for;
use yamabico_core::behavior::BuildError;
use yamabico_core::parameters::{FileKind, Problems};

use super::{Corridor, Door, Side, Wall, Window, World};

/// World files, as robot files name them: every range is in the schema, the rules tell what keys must not say together.
pub const WORLD_FILE: FileKind = FileKind {
    key: "world",
    what: "a world file",
    schema: || schema_for!(World),
    rules: |table| match table.clone().try_into::<World>() {
        Ok(world) => world.rules(),
        Err(error) => vec![BuildError::new("", error.message())],
    },
};

/// Least distance of an opening from the next one and from the hallway's ends, meters.
const PILLAR_M: f64 = 0.1;
/// Least distance of joints, meters.
const JOINTS_M: f32 = 0.05;
/// Least distance of lamps, meters.
const LAMPS_M: f64 = 0.5;

impl World {
    /// Checks every value.
    ///
    /// # Errors
    /// All values out of range, each at its key in the TOML text of this world.
    pub fn check(&self) -> Result<(), Problems> {
        // TOML has no whole numbers above 2^63, and every seed is as good as another.
        let world = World { texture_seed: 0, ..self.clone() };
        let text = toml::to_string(&world).unwrap_or_else(|error| error.to_string());
        WORLD_FILE.read("the world", &text).map(drop)
    }

    fn rules(&self) -> Vec<BuildError> {
        let mut broken = Broken::default();
        if let Some(corridor) = &self.corridor {
            broken.corridor(corridor);
        }
        for (i, wall) in self.walls.iter().enumerate() {
            broken.wall(&format!("wall[{i}]"), wall);
        }
        for (i, person) in self.people.iter().enumerate() {
            if person.pause_s.len() > person.path_m.len() {
                broken.say(format!("person[{i}].pause_s"), "has more pauses than the path has corners");
            }
        }
        broken.joints("floor", self.floor.joint_spacing_m);
        broken.joints("ceiling", self.ceiling.joint_spacing_m);
        broken.0
    }
}

#[derive(Default)]
struct Broken(Vec<BuildError>);

impl Broken {
    fn say(&mut self, key: String, what: impl Into<String>) {
        self.0.push(BuildError::new(key, what));
    }

    fn joints(&mut self, owner: &str, spacing_m: [f32; 2]) {
        if spacing_m.iter().any(|&m| m > 0.0 && m < JOINTS_M) {
            self.say(
                format!("{owner}.joint_spacing_m"),
                format!("must be 0 (no joints) or at least {JOINTS_M} m"),
            );
        }
    }

    fn corridor(&mut self, k: &Corridor) {
        if k.lamp_spacing_m > 0.0 && k.lamp_spacing_m < LAMPS_M {
            self.say(
                "corridor.lamp_spacing_m".into(),
                format!("must be 0 (no lamps) or at least {LAMPS_M} m"),
            );
        }
        if let Some(window) = &k.window {
            self.window("corridor.window", window, [0.0, k.width_m], k.height_m);
        }
        let along = [k.start_x_m + PILLAR_M, k.end_x_m() - PILLAR_M];
        let mut taken: Vec<(Side, [f64; 2], &str)> = Vec::new();
        for (i, b) in k.branches.iter().enumerate() {
            let key = format!("corridor.branch[{i}].at_m");
            self.opening(key, around(b.at_m, b.width_m), along, b.side, &taken);
            taken.push((b.side, around(b.at_m, b.width_m), "a side corridor"));
        }
        for (i, d) in k.doors.iter().enumerate() {
            let key = format!("corridor.door[{i}]");
            self.opening(format!("{key}.at_m"), around(d.at_m, d.width_m), along, d.side, &taken);
            taken.push((d.side, around(d.at_m, d.width_m), "another door"));
            self.height(format!("{key}.height_m"), d.height_m, k.height_m);
        }
    }

    fn wall(&mut self, key: &str, w: &Wall) {
        let length = (w.to_m[0] - w.from_m[0]).hypot(w.to_m[1] - w.from_m[1]);
        if !(0.01..=500.0).contains(&length) {
            self.say(format!("{key}.to_m"), format!("is {length} m away from the start; 0.01 to 500 can be"));
            return;
        }
        let mut taken: Vec<(Side, [f64; 2], &str)> = Vec::new();
        for (i, Door { at_m, width_m, height_m, .. }) in w.doors.iter().enumerate() {
            let key = format!("{key}.door[{i}]");
            self.opening(format!("{key}.at_m"), around(*at_m, *width_m), [0.0, length], Side::Left, &taken);
            taken.push((Side::Left, around(*at_m, *width_m), "another door"));
            self.height(format!("{key}.height_m"), *height_m, w.height_m);
        }
        for (i, window) in w.windows.iter().enumerate() {
            let key = format!("{key}.window[{i}]");
            let span = around(window.at_m.unwrap_or(length / 2.0), window.width_m);
            self.window(&key, window, [0.0, length], w.height_m);
            self.overlap(format!("{key}.at_m"), span, Side::Left, &taken);
            taken.push((Side::Left, span, "another window"));
        }
    }

    fn window(&mut self, key: &str, w: &Window, along: [f64; 2], wall_height_m: f64) {
        let middle = (along[0] + along[1]) / 2.0;
        self.inside(format!("{key}.at_m"), around(w.at_m.unwrap_or(middle), w.width_m), along);
        self.height(format!("{key}.height_m"), w.sill_m + w.height_m, wall_height_m);
    }

    fn opening(
        &mut self,
        key: String,
        span: [f64; 2],
        along: [f64; 2],
        side: Side,
        taken: &[(Side, [f64; 2], &str)],
    ) {
        self.inside(key.clone(), span, along);
        self.overlap(key, span, side, taken);
    }

    fn overlap(&mut self, key: String, span: [f64; 2], side: Side, taken: &[(Side, [f64; 2], &str)]) {
        let meets = |other: &[f64; 2]| span[0] < other[1] + PILLAR_M && other[0] < span[1] + PILLAR_M;
        if let Some((.., what)) = taken.iter().find(|(on, other, _)| *on == side && meets(other)) {
            self.say(key, format!("is nearer than {PILLAR_M} m to {what}"));
        }
    }

    fn inside(&mut self, key: String, span: [f64; 2], along: [f64; 2]) {
        if span[0] < along[0] || span[1] > along[1] {
            let [low, high] = along.map(|m| (m * 100.0).round() / 100.0);
            self.say(
                key,
                format!("puts the opening outside its wall, which has room from {low} to {high} m"),
            );
        }
    }

    fn height(&mut self, key: String, top_m: f64, wall_height_m: f64) {
        if top_m > wall_height_m {
            self.say(key, format!("makes an opening {top_m} m high in a wall of {wall_height_m} m"));
        }
    }
}

/// From where to where something `width` wide lies around its middle.
fn around(middle: f64, width: f64) -> [f64; 2] {
    [middle - width / 2.0, middle + width / 2.0]
}
