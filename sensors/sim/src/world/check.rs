//! Values that a world must not have.

use thiserror::Error;

use super::{Colour, Door, Side, Wall, Window, World};

/// Why a world was refused.
#[derive(Debug, Error)]
pub enum WorldError {
    /// The text is not TOML or not a world; the message points into it.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    /// Values out of range, each `key: what is wrong`.
    #[error("{}", .0.join("\n"))]
    Values(Vec<String>),
}

impl World {
    /// Checks every value.
    ///
    /// # Errors
    /// [`WorldError::Values`] with all values out of range.
    pub fn check(&self) -> Result<(), WorldError> {
        let mut c = Checker::default();
        if let Some(k) = &self.corridor {
            c.finite("corridor.start_x_m", k.start_x_m);
            c.range("corridor.length_m", k.length_m, 1.0, 200.0);
            c.range("corridor.width_m", k.width_m, 0.8, 20.0);
            c.range("corridor.height_m", k.height_m, 1.0, 10.0);
            c.range("corridor.thickness_m", k.thickness_m, 0.05, 0.5);
            c.range("corridor.lamp_spacing_m", k.lamp_spacing_m, 0.0, 50.0);
            c.range("corridor.lamp_brightness", f64::from(k.lamp_brightness), 0.0, 50.0);
            for (i, b) in k.branches.iter().enumerate() {
                let key = format!("corridor.branch[{i}]");
                c.range(&format!("{key}.depth_m"), b.depth_m, 0.5, 50.0);
                c.range(&format!("{key}.width_m"), b.width_m, 0.5, 20.0);
                c.inside(&key, b.at_m - k.start_x_m, b.width_m, k.length_m);
            }
            for (i, d) in k.doors.iter().enumerate() {
                let key = format!("corridor.door[{i}]");
                c.inside(&key, d.at_m - k.start_x_m, d.width_m, k.length_m);
                let crossed = |side: Side, at: f64, width: f64| {
                    side == d.side && (at - d.at_m).abs() < (width + d.width_m) / 2.0 + 0.1
                };
                if k.branches.iter().any(|b| crossed(b.side, b.at_m, b.width_m)) {
                    c.say(&key, "overlaps a side corridor");
                }
                if k.doors[..i].iter().any(|o| crossed(o.side, o.at_m, o.width_m)) {
                    c.say(&key, "overlaps another door");
                }
            }
            for (i, w) in k.walls().iter().enumerate() {
                c.wall(&format!("corridor wall {i}"), w);
            }
        }
        for (i, w) in self.walls.iter().enumerate() {
            c.wall(&format!("wall[{i}]"), w);
        }
        for (i, b) in self.boxes.iter().enumerate() {
            let key = format!("box[{i}]");
            for (v, name) in b.at_m.iter().chain([&b.base_m, &b.yaw_deg]).zip(["x", "y", "base_m", "yaw_deg"])
            {
                c.finite(&format!("{key}.{name}"), *v);
            }
            b.size_m.iter().for_each(|s| c.range(&format!("{key}.size_m"), *s, 0.01, 10.0));
            c.colour(&format!("{key}.colour"), b.colour);
        }
        for (i, l) in self.lamps.iter().enumerate() {
            let key = format!("lamp[{i}]");
            l.at_m.iter().for_each(|v| c.finite(&format!("{key}.at_m"), *v));
            l.size_m.iter().for_each(|s| c.range(&format!("{key}.size_m"), *s, 0.01, 10.0));
            c.range(&format!("{key}.brightness"), f64::from(l.brightness), 0.0, 50.0);
        }
        for (i, p) in self.people.iter().enumerate() {
            let key = format!("person[{i}]");
            if p.path_m.is_empty() {
                c.say(&format!("{key}.path_m"), "needs at least one corner");
            }
            if p.pause_s.len() > p.path_m.len() {
                c.say(&format!("{key}.pause_s"), "has more pauses than the path has corners");
            }
            p.path_m.iter().flatten().for_each(|v| c.finite(&format!("{key}.path_m"), *v));
            p.pause_s.iter().for_each(|v| c.range(&format!("{key}.pause_s"), *v, 0.0, 3600.0));
            c.range(&format!("{key}.start_s"), p.start_s, 0.0, 86_400.0);
            c.range(&format!("{key}.jitter_s"), p.jitter_s, 0.0, 60.0);
            c.range(&format!("{key}.speed_mps"), p.speed_mps, 0.01, 3.0);
            c.range(&format!("{key}.height_m"), p.height_m, 0.5, 2.2);
        }
        c.colour("floor.colour", self.floor.colour);
        c.range("floor.speckle", f64::from(self.floor.speckle), 0.0, 0.5);
        c.range("floor.grain_m", f64::from(self.floor.grain_m), 0.002, 0.1);
        c.range("floor.gloss", f64::from(self.floor.gloss), 0.0, 1.0);
        c.range("floor.joint_tone", f64::from(self.floor.joint_tone), 0.0, 1.0);
        c.range("ceiling.height_m", self.ceiling.height_m, 2.0, 10.0);
        c.range("ambient", f64::from(self.ambient.unwrap_or(0.0)), 0.0, 1.0);
        if c.found.is_empty() { Ok(()) } else { Err(WorldError::Values(c.found)) }
    }
}

#[derive(Default)]
struct Checker {
    found: Vec<String>,
}

impl Checker {
    fn say(&mut self, key: &str, what: &str) {
        self.found.push(format!("{key}: {what}"));
    }

    fn range(&mut self, key: &str, value: f64, low: f64, high: f64) {
        if !(low..=high).contains(&value) {
            self.found.push(format!("{key}: {value} is outside {low} to {high}"));
        }
    }

    fn finite(&mut self, key: &str, value: f64) {
        if !value.is_finite() {
            self.found.push(format!("{key}: {value} is not a finite number"));
        }
    }

    fn colour(&mut self, key: &str, colour: Colour) {
        colour.iter().for_each(|v| self.range(key, f64::from(*v), 0.0, 1.0));
    }

    fn inside(&mut self, key: &str, at: f64, width: f64, length: f64) {
        if !(at - width / 2.0 >= 0.0 && at + width / 2.0 <= length) {
            self.say(key, "does not lie inside the hallway");
        }
    }

    fn wall(&mut self, key: &str, w: &Wall) {
        w.from_m.iter().chain(&w.to_m).for_each(|v| self.finite(key, *v));
        let length = (w.to_m[0] - w.from_m[0]).hypot(w.to_m[1] - w.from_m[1]);
        self.range(&format!("{key}: length"), length, 0.01, 500.0);
        self.range(&format!("{key}.height_m"), w.height_m, 0.05, 10.0);
        self.range(&format!("{key}.thickness_m"), w.thickness_m, 0.01, 1.0);
        self.colour(&format!("{key}.colour"), w.colour);
        if let Some(b) = w.baseboard {
            self.range(&format!("{key}.baseboard.height_m"), b.height_m, 0.02, 0.5);
            self.range(&format!("{key}.baseboard.depth_m"), b.depth_m, 0.002, 0.05);
            self.colour(&format!("{key}.baseboard.colour"), b.colour);
        }
        let mut spans: Vec<(f64, f64)> = Vec::new();
        for d in &w.doors {
            self.door(key, d, w.height_m);
            spans.push((d.at_m - d.width_m / 2.0, d.at_m + d.width_m / 2.0));
        }
        for g in &w.windows {
            self.window(key, g, w.height_m);
            let at = g.at_m.unwrap_or(length / 2.0);
            spans.push((at - g.width_m / 2.0, at + g.width_m / 2.0));
        }
        spans.sort_by(|a, b| a.0.total_cmp(&b.0));
        if spans.iter().any(|s| s.0 < 0.0 || s.1 > length) {
            self.say(key, "an opening reaches beyond its ends");
        }
        if spans.windows(2).any(|p| p[0].1 > p[1].0) {
            self.say(key, "two openings overlap");
        }
    }

    fn door(&mut self, key: &str, d: &Door, wall_height: f64) {
        self.range(&format!("{key}: door width_m"), d.width_m, 0.4, 3.0);
        self.range(&format!("{key}: door height_m"), d.height_m, 1.5, wall_height);
        self.range(&format!("{key}: door open_deg"), d.open_deg, 0.0, 120.0);
        self.range(&format!("{key}: door room_depth_m"), d.room_depth_m, 0.5, 10.0);
        self.colour(&format!("{key}: door colour"), d.colour);
        self.colour(&format!("{key}: door frame_colour"), d.frame_colour);
    }

    fn window(&mut self, key: &str, g: &Window, wall_height: f64) {
        self.range(&format!("{key}: window width_m"), g.width_m, 0.1, 20.0);
        self.range(&format!("{key}: window sill_m"), g.sill_m, 0.0, wall_height);
        self.range(&format!("{key}: window height_m"), g.height_m, 0.1, wall_height - g.sill_m);
        self.range(&format!("{key}: window brightness"), f64::from(g.brightness), 0.0, 20.0);
    }
}
