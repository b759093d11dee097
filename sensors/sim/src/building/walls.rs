//! Walls, doors, windows, posters and lamps of a drawn building.

use rand::RngExt;

use super::floor::tinted;
use super::obstacles::Crossing;
use super::properties::{BaseboardKind, Glare, Lamps, Properties, WallKind, one_of};
use super::{BEYOND_M, START_X_M};
use crate::random::{Stream, stream};
use crate::world::{
    Baseboard, Branch, Ceiling, Color, Corridor, CorridorDoor, Dado, Patch, Poster, Side, Wall, Window, World,
};
use yamabico_core::geometry::Hypotenuse;

/// Minimum distance between openings, posters and the ends of a wall, m.
const PILLAR_M: f64 = 0.25;
/// Width of a room behind a door, with its distance from the neighbors, m.
const ROOM_M: f64 = 1.1;
/// Spacing of lamps under which a white surface has brightness 1, m.
const LAMP_SPACING_M: f64 = 2.4;

/// Builds the walls, the lamps and the ceiling of `world`; `crossing` are doors that must be there and open.
pub fn build(world: &mut World, p: &Properties, crossing: Option<Crossing>, seed: u64) {
    let mut rng = stream(seed, "building walls");
    let tone = rng.random_range(0.4..0.8);
    let color = tinted(&mut rng, tone, 0.1);
    let mut corridor = Corridor {
        start_x_m: START_X_M,
        length_m: p.distance_m + BEYOND_M - START_X_M,
        width_m: p.width_m,
        height_m: rng.random_range(2.4..3.0),
        color,
        end_color: color.map(|c| c * 0.92),
        baseboard: baseboard(p.baseboard, color, &mut rng),
        window: end_window(p, &mut rng),
        ..Corridor::default()
    };
    world.ceiling = Ceiling {
        height_m: corridor.height_m,
        joint_spacing_m: one_of(&mut rng, &[[0.6, 0.6], [0.0, 0.0], [1.2, 0.3]]),
        ..Ceiling::default()
    };
    light(&mut corridor, p.lamps, &mut stream(seed, "building lamps"));
    open(&mut corridor, p, crossing, seed);
    world.lamps = corridor.lamps();
    world.walls = corridor.walls();
    let mut rng = stream(seed, "building sun");
    if p.glare == Glare::Sun {
        let side = one_of(&mut rng, &[-1.0, 1.0]);
        for i in 0..world.walls.len() {
            windows(world, i, side, p, &mut rng);
        }
    }
    decorate(&mut world.walls, p.walls, &mut stream(seed, "building posters"));
}

fn baseboard(baseboard: BaseboardKind, wall: Color, rng: &mut Stream) -> Option<Baseboard> {
    let height_m = rng.random_range(0.05..0.15);
    let share = rng.random_range(0.7..0.92);
    let strong = one_of(rng, &[[0.05; 3], [0.1, 0.09, 0.085], [0.2, 0.13, 0.08], [0.85; 3]]);
    let color = match baseboard {
        BaseboardKind::None => return None,
        BaseboardKind::Faint => wall.map(|c| c * share),
        BaseboardKind::Strong => strong,
    };
    Some(Baseboard { height_m, color, ..Baseboard::default() })
}

fn end_window(p: &Properties, rng: &mut Stream) -> Option<Window> {
    let brightness = match p.glare {
        Glare::None => return None,
        Glare::Window => rng.random_range(2.0..6.0),
        Glare::Sun => rng.random_range(8.0..16.0),
    };
    let sill_m = one_of(rng, &[0.15, 0.9]);
    let width_m = rng.random_range(0.5..0.85) * p.width_m;
    Some(Window { width_m, sill_m, height_m: 2.2 - sill_m, brightness, ..Window::default() })
}

fn light(corridor: &mut Corridor, lamps: Lamps, rng: &mut Stream) {
    let across = corridor.width_m >= 1.8 && rng.random_bool(0.4);
    let (spacing_m, size_m) = match lamps {
        Lamps::Row => (rng.random_range(1.8..3.2), if across { [0.3, 1.2] } else { [1.2, 0.3] }),
        Lamps::Sparse => (rng.random_range(3.8..5.2), if across { [0.6, 0.6] } else { [1.2, 0.2] }),
        Lamps::Strip => (2.0, [1.8, 0.12]),
    };
    let area = corridor.lamp_size_m[0] * corridor.lamp_size_m[1] / (size_m[0] * size_m[1]);
    // The mean light on the floor of a standard hallway, or down to half of it.
    let light = rng.random_range(0.55..1.0) * area * spacing_m / LAMP_SPACING_M;
    corridor.lamp_spacing_m = spacing_m;
    corridor.lamp_size_m = size_m;
    corridor.lamp_brightness = (f64::from(corridor.lamp_brightness) * light).min(50.0) as f32;
}

/// Adds doors and, in some buildings, a side corridor.
fn open(corridor: &mut Corridor, p: &Properties, crossing: Option<Crossing>, seed: u64) {
    let mut rng = stream(seed, "building doors");
    let tone = rng.random_range(0.08..0.5);
    let color = tinted(&mut rng, tone, 0.4);
    let frame_tone = one_of(&mut rng, &[0.1, 0.3, 0.6]);
    let frame_color = tinted(&mut rng, frame_tone, 0.1);
    let door = |side: Side, at_m: f64, open_deg: f64| CorridorDoor {
        open_deg,
        color,
        frame_color,
        ..CorridorDoor::closed(side, at_m)
    };
    if let Some([left, right]) = crossing {
        corridor.doors.push(door(Side::Left, left, 90.0));
        corridor.doors.push(door(Side::Right, right, 90.0));
    }
    if rng.random_bool(0.35) {
        let branch = Branch {
            side: one_of(&mut rng, &[Side::Left, Side::Right]),
            at_m: rng.random_range(3.0..p.distance_m),
            width_m: rng.random_range(1.2..1.8),
            depth_m: rng.random_range(2.5..4.5),
        };
        if is_free(corridor, branch.side, branch.at_m, branch.width_m) {
            corridor.branches.push(branch);
        }
    }
    let pitch = rng.random_range(1.6..4.0);
    for side in [Side::Left, Side::Right] {
        let mut x = corridor.start_x_m + rng.random_range(0.9..2.5);
        while x < corridor.end_x_m() - 0.9 {
            let is_open = rng.random_bool(p.open_doors);
            let angle_deg = rng.random_range(45.0..100.0);
            if is_free(corridor, side, x, 0.9) {
                corridor.doors.push(door(side, x, if is_open { angle_deg } else { 0.0 }));
            }
            x += pitch * rng.random_range(0.7..1.4);
        }
    }
}

/// Returns true if an opening leaves room for the rooms behind the doors next to it.
fn is_free(corridor: &Corridor, side: Side, at_m: f64, width_m: f64) -> bool {
    let apart = |other: f64, other_width: f64| (other - at_m).abs() > (width_m + other_width) / 2.0 + ROOM_M;
    corridor.doors.iter().filter(|d| d.side == side).all(|d| apart(d.at_m, d.width_m))
        && corridor.branches.iter().filter(|b| b.side == side).all(|b| apart(b.at_m, b.width_m))
}

/// Adds windows to a wall on one side of the hallway, and the sunlight that falls through them.
fn windows(world: &mut World, wall: usize, side: f64, p: &Properties, rng: &mut Stream) {
    let Wall { from_m, to_m, .. } = world.walls[wall];
    let y = side * p.width_m / 2.0;
    if from_m[1] != y || to_m[1] != y {
        return;
    }
    let shift = side * rng.random_range(-0.8..0.8);
    for [start, end] in free(&world.walls[wall]) {
        let width_m = rng.random_range(0.8..1.6);
        if end - start < width_m + 2.0 * PILLAR_M || rng.random_bool(0.3) {
            continue;
        }
        let at_m = (start + end) / 2.0;
        let brightness = rng.random_range(2.0..5.0);
        world.walls[wall].windows.push(Window {
            at_m: Some(at_m),
            width_m,
            sill_m: 1.15,
            height_m: 1.1,
            brightness,
            ..Window::default()
        });
        let x = from_m[0] + (to_m[0] - from_m[0]).signum() * at_m;
        let depth = rng.random_range(0.3..0.8) * p.width_m;
        world.patches.push(Patch {
            at_m: [x + shift, -side * rng.random_range(-0.1..0.1) * p.width_m],
            size_m: [0.85 * width_m, depth],
            yaw_deg: rng.random_range(-25.0..25.0),
            light: rng.random_range(1.6..3.0),
            color: None,
        });
    }
}

/// Paints the lower part of the walls, or hangs posters.
fn decorate(walls: &mut [Wall], kind: WallKind, rng: &mut Stream) {
    let tone = rng.random_range(0.15..0.6);
    let dado = Dado { height_m: rng.random_range(0.8..1.14), color: tinted(rng, tone, 0.35) };
    for wall in walls {
        let is_low = wall.windows.iter().any(|window| window.sill_m < dado.height_m);
        match kind {
            WallKind::Plain => {}
            WallKind::TwoTone if is_low => {}
            WallKind::TwoTone => wall.dado = Some(dado),
            WallKind::Posters => {
                for [start, end] in free(wall) {
                    hang(wall, start, end, rng);
                }
            }
        }
    }
}

/// Hangs posters from `start` to `end` of a wall.
fn hang(wall: &mut Wall, start: f64, end: f64, rng: &mut Stream) {
    let mut at = start + PILLAR_M;
    loop {
        let (width_m, height_m) = (rng.random_range(0.25..1.2), rng.random_range(0.3..1.1));
        at += rng.random_range(0.0..1.2);
        if at + width_m + PILLAR_M > end {
            return;
        }
        let tone = rng.random_range(0.1..0.85);
        wall.posters.push(Poster {
            at_m: at + width_m / 2.0,
            width_m,
            base_m: f64::max(0.4, 1.5 - height_m / 2.0 + rng.random_range(-0.15..0.15)),
            height_m,
            color: tinted(rng, tone, 0.4),
            line_spacing_m: one_of(rng, &[[0.0, 0.0], [0.07, 0.0], [0.15, 0.0], [0.2, 0.15]]),
            line_tone: rng.random_range(0.2..0.8),
        });
        at += width_m + PILLAR_M;
    }
}

/// Returns the stretches of a wall without doors and windows, m from its start.
fn free(wall: &Wall) -> Vec<[f64; 2]> {
    let length = f64::hypotenuse(wall.to_m[0] - wall.from_m[0], wall.to_m[1] - wall.from_m[1]);
    let doors = wall.doors.iter().map(|d| [d.at_m - d.width_m / 2.0, d.at_m + d.width_m / 2.0]);
    let windows = wall.windows.iter().map(|w| {
        let at = w.at_m.unwrap_or(length / 2.0);
        [at - w.width_m / 2.0, at + w.width_m / 2.0]
    });
    let mut taken: Vec<[f64; 2]> = doors.chain(windows).chain([[length, length]]).collect();
    taken.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut start = 0.0;
    let mut stretches = Vec::new();
    for [low, high] in taken {
        if low > start {
            stretches.push([start, low]);
        }
        start = high;
    }
    stretches
}
