//! Checks of a world that involve several keys; the range of each key is in the schema.

use schemars::schema_for;
use yamabico_core::behavior::ParameterError;
use yamabico_core::geometry::Hypotenuse;
use yamabico_core::parameters::{FileKind, Problems};

use super::{Corridor, Door, Side, Wall, Window, World};

/// File kind of world files.
pub const WORLD_FILE: FileKind = FileKind {
    key: "world",
    what: "a world file",
    schema: || schema_for!(World),
    rules: |table| match table.clone().try_into::<World>() {
        Ok(world) => world.rules(),
        Err(error) => vec![ParameterError::new("", error.message())],
    },
};

/// Minimum distance of an opening from other openings and from the ends of the hallway, m.
const MIN_PILLAR_M: f64 = 0.1;
/// Minimum spacing of joints, m.
const MIN_JOINT_SPACING_M: f32 = 0.05;
/// Minimum spacing of lamps, m.
const MIN_LAMP_SPACING_M: f64 = 0.5;

impl World {
    /// Checks all values.
    ///
    /// # Errors
    /// All invalid values, each with its key and its position in the TOML text of this world.
    pub fn check(&self) -> Result<(), Problems> {
        // TOML has no integers above 2^63, and every seed is valid.
        let world = World { texture_seed: 0, ..self.clone() };
        let text = toml::to_string(&world).unwrap_or_else(|error| error.to_string());
        WORLD_FILE.read("the world", &text).map(drop)
    }

    fn rules(&self) -> Vec<ParameterError> {
        let mut violations = Violations::default();
        if let Some(corridor) = &self.corridor {
            violations.corridor(corridor);
        }
        for (i, wall) in self.walls.iter().enumerate() {
            violations.wall(&format!("wall[{i}]"), wall);
        }
        for (i, person) in self.people.iter().enumerate() {
            if person.pause_s.len() > person.path_m.len() {
                violations.push(
                    format!("person[{i}].pause_s"),
                    "must not have more pauses than `path_m` has corners",
                );
            }
        }
        violations.joints("floor", "joint_spacing_m", self.floor.joint_spacing_m);
        violations.joints("ceiling", "joint_spacing_m", self.ceiling.joint_spacing_m);
        violations.0
    }
}

#[derive(Default)]
struct Violations(Vec<ParameterError>);

impl Violations {
    fn push(&mut self, key: String, what: impl Into<String>) {
        self.0.push(ParameterError::new(key, what));
    }

    fn joints(&mut self, owner: &str, key: &str, spacing_m: [f32; 2]) {
        if spacing_m.iter().any(|&m| m > 0.0 && m < MIN_JOINT_SPACING_M) {
            self.push(
                format!("{owner}.{key}"),
                format!("must be 0 (none) or at least {MIN_JOINT_SPACING_M} m"),
            );
        }
    }

    fn corridor(&mut self, k: &Corridor) {
        if k.lamp_spacing_m > 0.0 && k.lamp_spacing_m < MIN_LAMP_SPACING_M {
            self.push(
                "corridor.lamp_spacing_m".into(),
                format!("must be 0 (no lamps) or at least {MIN_LAMP_SPACING_M} m"),
            );
        }
        if let Some(window) = &k.window {
            self.window("corridor.window", window, [0.0, k.width_m], k.height_m);
        }
        let along = [k.start_x_m + MIN_PILLAR_M, k.end_x_m() - MIN_PILLAR_M];
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
        let length = (w.to_m[0] - w.from_m[0]).hypotenuse(w.to_m[1] - w.from_m[1]);
        if !(0.01..=500.0).contains(&length) {
            self.push(
                format!("{key}.to_m"),
                format!("must be 0.01 to 500 m from `from_m`, but is {length} m"),
            );
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
        for (i, poster) in w.posters.iter().enumerate() {
            let key = format!("{key}.poster[{i}]");
            self.joints(&key, "line_spacing_m", poster.line_spacing_m);
            self.opening(
                format!("{key}.at_m"),
                around(poster.at_m, poster.width_m),
                [0.0, length],
                Side::Left,
                &taken,
            );
            self.height(format!("{key}.height_m"), poster.base_m + poster.height_m, w.height_m);
        }
        if let Some(dado) = w.dado {
            let sills = w.windows.iter().map(|window| window.sill_m);
            let lowest_m = sills.fold(w.height_m, f64::min);
            if dado.height_m > lowest_m {
                self.push(
                    format!("{key}.dado.height_m"),
                    format!("must end below the windows and the top of the wall, at {lowest_m} m"),
                );
            }
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
        let meets = |other: &[f64; 2]| span[0] < other[1] + MIN_PILLAR_M && other[0] < span[1] + MIN_PILLAR_M;
        if let Some((.., what)) = taken.iter().find(|(on, other, _)| *on == side && meets(other)) {
            self.push(key, format!("must leave at least {MIN_PILLAR_M} m to {what}"));
        }
    }

    fn inside(&mut self, key: String, span: [f64; 2], along: [f64; 2]) {
        if span[0] < along[0] || span[1] > along[1] {
            let [low, high] = along.map(|m| (m * 100.0).round() / 100.0);
            self.push(key, format!("must keep the opening inside the wall, from {low} m to {high} m"));
        }
    }

    fn height(&mut self, key: String, top_m: f64, wall_height_m: f64) {
        if top_m > wall_height_m {
            self.push(key, format!("must keep the opening inside the wall: it ends at {top_m} m, the wall at {wall_height_m} m"));
        }
    }
}

/// Returns the interval of this width around its middle.
fn around(middle: f64, width: f64) -> [f64; 2] {
    [middle - width / 2.0, middle + width / 2.0]
}
