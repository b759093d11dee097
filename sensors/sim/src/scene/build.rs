//! Builds the surfaces, solids and emitters of a world.

use nalgebra::{Vector2, Vector3};

use super::light::Emitter;
use super::surface::{Material, Solid, Surface, Tiles};
use crate::world::{Ceiling, Color, Corridor, Door, Lamp, Reflection, Wall, Window, World};

/// Parts of the building.
#[derive(Default)]
pub struct Parts {
    pub surfaces: Vec<Surface>,
    pub solids: Vec<Solid>,
    pub emitters: Vec<Emitter>,
}

/// Upright box: bottom corner, and horizontal edges `along` and `across` (to the left of `along`).
pub(super) struct Slab {
    pub corner: Vector2<f64>,
    pub along: Vector2<f64>,
    pub across: Vector2<f64>,
    pub z: [f64; 2],
}

/// Width by which a door frame overlaps the wall beside the opening, m.
pub(crate) const FRAME_WIDTH_M: f64 = 0.06;
/// Width by which a door frame reaches into the opening, m.
pub(crate) const REBATE_M: f64 = 0.03;
/// Depth by which a door frame protrudes from the wall, m.
pub(crate) const FRAME_DEPTH_M: f64 = 0.02;
/// Thickness of a door leaf, m.
pub(crate) const LEAF_M: f64 = 0.04;
/// Width of the bars around a window pane, m.
pub(crate) const WINDOW_BAR_M: f64 = 0.05;

impl Parts {
    pub fn new(world: &World, seed: u64) -> Self {
        let mut b = Self::default();
        let walls: Vec<Wall> =
            world.corridor.iter().flat_map(Corridor::walls).chain(world.walls.iter().cloned()).collect();
        walls.iter().for_each(|w| b.wall(w));
        for item in world.boxes.iter().enumerate().map(|(index, item)| item.placed(index, seed)) {
            let (sin, cos) = item.yaw_deg.to_radians().sin_cos();
            let along = Vector2::new(cos, sin) * item.size_m[0];
            let across = Vector2::new(-sin, cos) * item.size_m[1];
            let corner = Vector2::from(item.at_m) - (along + across) / 2.0;
            let z = [item.base_m, item.base_m + item.size_m[2]];
            let material = Material { speckle: 0.03, grain_m: 0.004, ..Material::matte(item.color) };
            b.slab(&Slab { corner, along, across, z }, material);
        }
        let lamps: Vec<Lamp> =
            world.corridor.iter().flat_map(Corridor::lamps).chain(world.lamps.iter().copied()).collect();
        lamps.iter().for_each(|l| b.lamp(l, world.ceiling.height_m));
        b.floor(world);
        b.ceiling(&world.ceiling);
        b
    }

    fn wall(&mut self, w: &Wall) {
        let from = Vector2::from(w.from_m);
        let run = Vector2::from(w.to_m) - from;
        let length = run.norm();
        let along = run / length;
        let left = Vector2::new(-along.y, along.x);
        let material = wall_material(w.color);
        let piece = |a: f64, b: f64, z: [f64; 2]| Slab {
            corner: from + along * a - left * w.thickness_m,
            along: along * (b - a),
            across: left * w.thickness_m,
            z,
        };

        let mut openings: Vec<[f64; 4]> = w
            .doors
            .iter()
            .map(|d| [d.at_m - d.width_m / 2.0, d.at_m + d.width_m / 2.0, 0.0, d.height_m])
            .chain(w.windows.iter().map(|g| {
                let at = g.at_m.unwrap_or(length / 2.0);
                [at - g.width_m / 2.0, at + g.width_m / 2.0, g.sill_m, g.sill_m + g.height_m]
            }))
            .collect();
        openings.sort_by(|a, b| a[0].total_cmp(&b[0]));

        let mut start = 0.0;
        for [a, b, low, high] in openings.iter().copied().chain([[length, length, 0.0, 0.0]]) {
            if a > start + 1e-6 {
                self.slab(&piece(start, a, [0.0, w.height_m]), material);
            }
            if b > a && low > 1e-6 {
                self.slab(&piece(a, b, [0.0, low]), material);
            }
            if b > a && high < w.height_m - 1e-6 {
                self.slab(&piece(a, b, [high, w.height_m]), material);
            }
            start = b;
        }
        if let Some(board) = w.baseboard {
            for [a, b] in between_doors(w, length) {
                let strip = Slab {
                    corner: from + along * a,
                    along: along * (b - a),
                    across: left * board.depth_m,
                    z: [0.0, board.height_m],
                };
                self.faces(&strip, Material::matte(board.color));
            }
        }
        self.decorate(w, from, along, length);
        for d in &w.doors {
            self.door(d, from + along * d.at_m, along, w.thickness_m);
        }
        for g in &w.windows {
            self.window(g, from + along * g.at_m.unwrap_or(length / 2.0), along, w.thickness_m);
        }
    }

    /// Adds a door; `at` is the middle of the opening on the left face of the wall.
    fn door(&mut self, d: &Door, at: Vector2<f64>, along: Vector2<f64>, thickness: f64) {
        let left = Vector2::new(-along.y, along.x);
        let half = d.width_m / 2.0;
        let deep = thickness + 2.0 * FRAME_DEPTH_M;
        let back = at - left * (thickness + FRAME_DEPTH_M);
        let frame = Material::matte(d.frame_color);
        let bar = |a: f64, b: f64, z: [f64; 2]| Slab {
            corner: back + along * a,
            along: along * (b - a),
            across: left * deep,
            z,
        };
        self.slab(&bar(-half - FRAME_WIDTH_M, -half + REBATE_M, [0.0, d.height_m]), frame);
        self.slab(&bar(half - REBATE_M, half + FRAME_WIDTH_M, [0.0, d.height_m]), frame);
        self.slab(
            &bar(
                -half - FRAME_WIDTH_M,
                half + FRAME_WIDTH_M,
                [d.height_m - REBATE_M, d.height_m + FRAME_WIDTH_M],
            ),
            frame,
        );

        let hinge = at - along * (half - REBATE_M) - left * (thickness * 0.6);
        let (sin, cos) = (-d.open_deg.to_radians()).sin_cos();
        let turned = Vector2::new(cos * along.x - sin * along.y, sin * along.x + cos * along.y);
        let out = Vector2::new(-turned.y, turned.x);
        let leaf = Material { speckle: 0.05, grain_m: 0.02, ..Material::matte(d.color) };
        let width = d.width_m - 2.0 * REBATE_M;
        let corner = hinge - out * LEAF_M;
        self.slab(
            &Slab { corner, along: turned * width, across: out * LEAF_M, z: [0.004, d.height_m - REBATE_M] },
            leaf,
        );
        let handle = Slab {
            corner: hinge + turned * (width - 0.16),
            along: turned * 0.11,
            across: out * 0.045,
            z: [1.02, 1.045],
        };
        self.faces(&handle, Material::matte([0.6, 0.6, 0.6]));

        if d.open_deg > 0.0 {
            self.room(d, at - left * thickness, along, thickness);
        }
    }

    /// Adds three walls behind an open door; `at` is the middle of the opening on the far face of the wall.
    fn room(&mut self, d: &Door, at: Vector2<f64>, along: Vector2<f64>, thickness: f64) {
        let left = Vector2::new(-along.y, along.x);
        let half = d.width_m / 2.0 + 0.5;
        let height = d.height_m + 0.5;
        let deep = at - left * d.room_depth_m;
        let material = wall_material([0.55, 0.54, 0.5]);
        let corners = [at - along * half, deep - along * half, deep + along * half, at + along * half];
        for pair in corners.windows(2) {
            let run = pair[1] - pair[0];
            let across = Vector2::new(-run.y, run.x).normalize() * thickness;
            self.slab(&Slab { corner: pair[0] - across, along: run, across, z: [0.0, height] }, material);
        }
    }

    /// Adds a window; `at` is the middle of the opening on the left face of the wall.
    fn window(&mut self, g: &Window, at: Vector2<f64>, along: Vector2<f64>, thickness: f64) {
        let left = Vector2::new(-along.y, along.x);
        let half = g.width_m / 2.0;
        let z = [g.sill_m, g.sill_m + g.height_m];
        let frame = Material::matte(g.frame_color);
        let pane = at - left * (thickness * 0.8);
        let origin = lift(pane + along * half, g.sill_m);
        let up = Vector3::new(0.0, 0.0, g.height_m);
        let glass = Material::luminous(g.brightness);
        self.surfaces.push(Surface::rectangle(origin, lift(-along * g.width_m, 0.0), up, glass));
        let bar = |a: f64, b: f64, z: [f64; 2]| Slab {
            corner: pane + along * a + left * 0.002,
            along: along * (b - a),
            across: left * (thickness * 0.8 + 0.015),
            z,
        };
        let w = WINDOW_BAR_M;
        for (a, b) in [(-half, -half + w), (half - w, half)] {
            self.slab(&bar(a, b, z), frame);
        }
        self.slab(&bar(-half + w, half - w, [z[0], z[0] + w]), frame);
        self.slab(&bar(-half + w, half - w, [z[1] - w, z[1]]), frame);
        let cross = Slab { across: left * 0.05, ..bar(-w / 2.0, w / 2.0, [z[0] + w, z[1] - w]) };
        self.slab(&cross, frame);
        for (i, j) in [(-0.25, 0.25), (0.25, 0.25), (-0.25, 0.75), (0.25, 0.75)] {
            self.emitters.push(Emitter {
                at: lift(at + along * (i * g.width_m) + left * 0.03, g.sill_m + j * g.height_m),
                normal: lift(left, 0.0),
                power: f64::from(g.brightness) * g.width_m * g.height_m / 4.0,
            });
        }
    }

    fn lamp(&mut self, l: &Lamp, ceiling_m: f64) {
        let [sx, sy] = l.size_m;
        let z = ceiling_m - 0.012;
        let frame = Slab {
            corner: Vector2::new(l.at_m[0] - sx / 2.0 - 0.02, l.at_m[1] - sy / 2.0 - 0.02),
            along: Vector2::new(sx + 0.04, 0.0),
            across: Vector2::new(0.0, sy + 0.04),
            z: [z, ceiling_m],
        };
        self.faces(&frame, Material::matte([0.75; 3]));
        let origin = Vector3::new(l.at_m[0] - sx / 2.0, l.at_m[1] + sy / 2.0, z - 0.003);
        let (u, v) = (Vector3::new(sx, 0.0, 0.0), Vector3::new(0.0, -sy, 0.0));
        self.surfaces.push(Surface::rectangle(origin, u, v, Material::luminous(l.brightness)));
        let long = if sx >= sy { Vector3::new(sx / 4.0, 0.0, 0.0) } else { Vector3::new(0.0, sy / 4.0, 0.0) };
        for sign in [-1.0, 1.0] {
            self.emitters.push(Emitter {
                at: Vector3::new(l.at_m[0], l.at_m[1], z - 0.02) + long * sign,
                normal: -Vector3::z(),
                power: f64::from(l.brightness) * sx * sy / 2.0,
            });
        }
    }

    /// Adds the floor and what lies flat on it.
    fn floor(&mut self, world: &World) {
        let floor = &world.floor;
        let [low, high] = self.extent();
        let (sin, cos) = f64::from(floor.joint_angle_deg).to_radians().sin_cos();
        let material = Material {
            grain: floor.grain,
            speckle: floor.speckle,
            grain_m: floor.grain_m,
            gloss: floor.gloss,
            reflectance: floor.reflectance,
            is_sharp: floor.reflection == Reflection::Sharp,
            tiles: Tiles {
                spacing_m: floor.joint_spacing_m,
                joint_width_m: floor.joint_width_m,
                joint_tone: floor.joint_tone,
                turn: [cos as f32, sin as f32],
                stagger: floor.stagger,
                contrast: floor.tile_contrast,
            },
            ..Material::matte(floor.color)
        };
        let (u, v) = (Vector3::x() * (high.x - low.x), Vector3::y() * (high.y - low.y));
        let whole = self.surfaces.len();
        self.surfaces.push(Surface::rectangle(lift(low, 0.0), u, v, material));
        for (i, patch) in world.patches.iter().enumerate() {
            self.patch(patch, i, whole);
        }
    }

    fn ceiling(&mut self, ceiling: &Ceiling) {
        let [low, high] = self.extent();
        let material = Material {
            speckle: 0.03,
            grain_m: 0.02,
            tiles: Tiles {
                spacing_m: ceiling.joint_spacing_m,
                joint_width_m: 0.012,
                joint_tone: 0.75,
                ..Tiles::NONE
            },
            ..Material::matte(ceiling.color)
        };
        let origin = Vector3::new(low.x, high.y, ceiling.height_m);
        let (u, v) = (Vector3::x() * (high.x - low.x), Vector3::y() * (high.y - low.y));
        self.surfaces.push(Surface::rectangle(origin, u, -v, material));
    }

    /// Returns the lowest and the highest x and y of the building.
    fn extent(&self) -> [Vector2<f64>; 2] {
        let points = || self.solids.iter().flat_map(|s| s.base);
        let low = [0, 1].map(|k| points().map(|p| p[k]).fold(-0.5_f64, f64::min) - 0.5);
        let high = [0, 1].map(|k| points().map(|p| p[k]).fold(0.5_f64, f64::max) + 0.5);
        [low.into(), high.into()]
    }

    /// Adds a box that is an obstacle.
    fn slab(&mut self, s: &Slab, material: Material) {
        let p = [s.corner, s.corner + s.along, s.corner + s.along + s.across, s.corner + s.across];
        self.solids.push(Solid { base: p.map(|q| [q.x, q.y]), z: s.z });
        self.faces(s, material);
    }

    /// Adds the sides and the top of a box, and its bottom if that is above the floor.
    pub(super) fn faces(&mut self, s: &Slab, material: Material) {
        let up = Vector3::new(0.0, 0.0, s.z[1] - s.z[0]);
        let p = [s.corner, s.corner + s.along, s.corner + s.along + s.across, s.corner + s.across];
        for i in 0..4 {
            let (a, b) = (p[i], p[(i + 1) % 4]);
            self.surfaces.push(Surface::rectangle(lift(a, s.z[0]), lift(b - a, 0.0), up, material));
        }
        let (along, across) = (lift(s.along, 0.0), lift(s.across, 0.0));
        self.surfaces.push(Surface::rectangle(lift(p[0], s.z[1]), along, across, material));
        if s.z[0] > 0.05 {
            self.surfaces.push(Surface::rectangle(lift(p[3], s.z[0]), along, -across, material));
        }
    }
}

/// Returns the stretches of a wall between its doors, m from its start.
pub(crate) fn between_doors(wall: &Wall, length_m: f64) -> Vec<[f64; 2]> {
    let gaps = wall.doors.iter().map(|d| {
        let half = d.width_m / 2.0 + FRAME_WIDTH_M;
        [d.at_m - half, d.at_m + half]
    });
    let mut gaps: Vec<_> = gaps.chain([[length_m, length_m]]).collect();
    gaps.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut start = 0.0;
    let mut stretches = Vec::new();
    for [a, b] in gaps {
        if a > start + 1e-6 {
            stretches.push([start, a]);
        }
        start = b;
    }
    stretches
}

fn wall_material(color: Color) -> Material {
    Material { speckle: 0.012, grain_m: 0.02, ..Material::matte(color) }
}

/// Returns the point at this height above `p`.
pub(super) fn lift(p: Vector2<f64>, z: f64) -> Vector3<f64> {
    Vector3::new(p.x, p.y, z)
}
