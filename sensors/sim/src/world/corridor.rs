//! Straight hallway with doors and side corridors, expanded into walls and lamps.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_inline_default::serde_inline_default;
use smart_default::SmartDefault;

use super::{Baseboard, Color, Door, Lamp, Wall, Window};

/// Straight hallway along +x.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Corridor {
    /// World x of the near end.
    #[default(-2.0)]
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub start_x_m: f64,
    /// Length.
    #[default(18.0)]
    #[schemars(range(min = 1.0, max = 200.0))]
    pub length_m: f64,
    /// Width between the faces of the walls.
    #[default(2.0)]
    #[schemars(range(min = 0.8, max = 20.0))]
    pub width_m: f64,
    /// Height of the walls; the ceiling has its own.
    #[default(2.6)]
    #[schemars(range(min = 1.0, max = 10.0))]
    pub height_m: f64,
    /// Thickness of the walls.
    #[default(0.12)]
    #[schemars(range(min = 0.05, max = 0.5))]
    pub thickness_m: f64,
    /// Reflectance of the side walls.
    #[default(super::WALL_COLOR)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Reflectance of the end walls.
    #[default([0.66, 0.66, 0.62])]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub end_color: Color,
    /// Baseboard of all walls; without it, none.
    #[default(Some(Baseboard::default()))]
    #[serde(default)]
    pub baseboard: Option<Baseboard>,
    /// Doors in the side walls.
    #[serde(rename = "door")]
    #[schemars(length(max = 1000))]
    pub doors: Vec<CorridorDoor>,
    /// Side corridors.
    #[serde(rename = "branch")]
    #[schemars(length(max = 1000))]
    pub branches: Vec<Branch>,
    /// Window in the far end; without it, none.
    #[default(Some(Window::default()))]
    #[serde(default)]
    pub window: Option<Window>,
    /// Spacing of the ceiling lamps; 0 means no lamps, else at least 0.5.
    #[default(2.4)]
    #[schemars(range(min = 0.0, max = 50.0))]
    pub lamp_spacing_m: f64,
    /// Size of a lamp along x and y.
    #[default(super::LAMP_SIZE)]
    #[schemars(inner(range(min = 0.01, max = 10.0)))]
    pub lamp_size_m: [f64; 2],
    /// Radiance of the lamps relative to a white surface under them.
    #[default(super::LAMP_BRIGHTNESS)]
    #[schemars(range(min = 0.0, max = 50.0))]
    pub lamp_brightness: f32,
}

/// Side of the hallway.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Side at positive y.
    Left,
    /// Side at negative y.
    Right,
}

/// Door of the hallway: like [`Door`], but `at_m` is a world x.
#[serde_inline_default]
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CorridorDoor {
    /// Side wall with the door.
    pub side: Side,
    /// World x of the center.
    #[schemars(range(min = -1000.0, max = 1200.0))]
    pub at_m: f64,
    /// Width of the opening.
    #[serde_inline_default(Door::default().width_m)]
    #[schemars(range(min = 0.4, max = 3.0))]
    pub width_m: f64,
    /// Height of the opening; at most the wall's height.
    #[serde_inline_default(Door::default().height_m)]
    #[schemars(range(min = 1.5, max = 10.0))]
    pub height_m: f64,
    /// Opening angle of the leaf; 0 is closed.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 120.0))]
    pub open_deg: f64,
    /// Depth of the room behind an open door.
    #[serde_inline_default(Door::default().room_depth_m)]
    #[schemars(range(min = 0.5, max = 10.0))]
    pub room_depth_m: f64,
    /// Reflectance of the leaf.
    #[serde_inline_default(Door::default().color)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Color,
    /// Reflectance of the frame.
    #[serde_inline_default(Door::default().frame_color)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub frame_color: Color,
}

/// Side corridor at a right angle.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Branch {
    /// Side to which it leaves.
    pub side: Side,
    /// World x of the centerline.
    #[schemars(range(min = -1000.0, max = 1200.0))]
    pub at_m: f64,
    /// Width.
    #[schemars(range(min = 0.5, max = 20.0))]
    pub width_m: f64,
    /// Length.
    #[schemars(range(min = 0.5, max = 50.0))]
    pub depth_m: f64,
}

impl CorridorDoor {
    /// Returns a closed door of the default size.
    #[must_use]
    pub fn closed(side: Side, at_m: f64) -> Self {
        let d = Door::default();
        Self {
            side,
            at_m,
            width_m: d.width_m,
            height_m: d.height_m,
            open_deg: 0.0,
            room_depth_m: d.room_depth_m,
            color: d.color,
            frame_color: d.frame_color,
        }
    }

    /// Returns an open door of the default size.
    #[must_use]
    pub fn open(side: Side, at_m: f64) -> Self {
        Self { open_deg: 85.0, ..Self::closed(side, at_m) }
    }
}

impl Corridor {
    /// Returns the world x of the far end, m.
    #[must_use]
    pub fn end_x_m(&self) -> f64 {
        self.start_x_m + self.length_m
    }

    /// Returns the walls, counter-clockwise around the free space, which is on their left.
    pub(crate) fn walls(&self) -> Vec<Wall> {
        let (x0, x1, half) = (self.start_x_m, self.end_x_m(), self.width_m / 2.0);
        let mut walls = Vec::new();
        self.side_walls(Side::Right, &mut walls);
        walls.push(Wall {
            windows: self.window.into_iter().collect(),
            color: self.end_color,
            ..self.plain([x1, -half], [x1, half])
        });
        self.side_walls(Side::Left, &mut walls);
        walls.push(Wall { color: self.end_color, ..self.plain([x0, half], [x0, -half]) });
        walls
    }

    /// Returns the ceiling lamps, including those of the side corridors.
    pub(crate) fn lamps(&self) -> Vec<Lamp> {
        if self.lamp_spacing_m <= 0.0 {
            return Vec::new();
        }
        let count = (self.length_m / self.lamp_spacing_m).round().max(1.0) as usize;
        let pitch = self.length_m / count as f64;
        let lamp = |at_m, size_m| Lamp { at_m, size_m, brightness: self.lamp_brightness };
        let main =
            (0..count).map(|i| lamp([self.start_x_m + pitch * (i as f64 + 0.5), 0.0], self.lamp_size_m));
        let [long, wide] = self.lamp_size_m;
        let side = self.branches.iter().map(|b| {
            let y = self.width_m / 2.0 + b.depth_m / 2.0;
            lamp([b.at_m, if b.side == Side::Left { y } else { -y }], [wide, long])
        });
        main.chain(side).collect()
    }

    fn plain(&self, from_m: [f64; 2], to_m: [f64; 2]) -> Wall {
        Wall {
            from_m,
            to_m,
            height_m: self.height_m,
            thickness_m: self.thickness_m,
            color: self.color,
            baseboard: self.baseboard,
            ..Wall::default()
        }
    }

    /// One side, walked with the free space on the left: +x on the right side, -x on the left side.
    fn side_walls(&self, side: Side, walls: &mut Vec<Wall>) {
        let sign = if side == Side::Right { 1.0 } else { -1.0 };
        let y = -sign * self.width_m / 2.0;
        let (start, end) = if side == Side::Right {
            (self.start_x_m, self.end_x_m())
        } else {
            (self.end_x_m(), self.start_x_m)
        };
        let mut branches: Vec<_> = self.branches.iter().filter(|b| b.side == side).collect();
        branches.sort_by(|a, b| (sign * a.at_m).total_cmp(&(sign * b.at_m)));

        let mut x = start;
        for b in branches {
            let (near, far) = (b.at_m - sign * b.width_m / 2.0, b.at_m + sign * b.width_m / 2.0);
            let deep = y - sign * b.depth_m;
            self.straight(side, x, near, walls);
            walls.push(self.plain([near, y], [near, deep]));
            walls.push(self.plain([near, deep], [far, deep]));
            walls.push(self.plain([far, deep], [far, y]));
            x = far;
        }
        self.straight(side, x, end, walls);
    }

    fn straight(&self, side: Side, from_x: f64, to_x: f64, walls: &mut Vec<Wall>) {
        let y = if side == Side::Right { -self.width_m / 2.0 } else { self.width_m / 2.0 };
        let (low, high) = (from_x.min(to_x), from_x.max(to_x));
        let doors = self
            .doors
            .iter()
            .filter(|d| d.side == side && d.at_m > low && d.at_m < high)
            .map(|d| Door {
                at_m: (d.at_m - from_x).abs(),
                width_m: d.width_m,
                height_m: d.height_m,
                open_deg: d.open_deg,
                room_depth_m: d.room_depth_m,
                color: d.color,
                frame_color: d.frame_color,
            })
            .collect();
        walls.push(Wall { doors, ..self.plain([from_x, y], [to_x, y]) });
    }
}

#[cfg(test)]
mod tests {
    use crate::World;

    #[test]
    fn a_corridor_has_a_window_and_baseboards_only_if_configured() {
        let corridor = |text: &str| World::from_toml(text).unwrap().corridor.unwrap();
        let bare = corridor("[corridor]\nlength_m = 10");
        assert!(bare.window.is_none() && bare.baseboard.is_none());
        let both = corridor("[corridor.window]\n[corridor.baseboard]");
        assert!(both.window.is_some() && both.baseboard.is_some());
    }
}
