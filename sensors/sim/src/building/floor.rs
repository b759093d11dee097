//! Floor of a drawn building, and what lies flat on it.

use rand::RngExt;

use super::properties::{FloorKind, Properties, one_of};
use super::{BEYOND_M, START_X_M};
use crate::random::{Stream, stream};
use crate::world::{Color, Floor, Grain, Patch, Reflection, World};

/// Adds the floor of `world`, with its stripes and sheets of paper.
pub fn lay(world: &mut World, p: &Properties, seed: u64) {
    let mut rng = stream(seed, "building floor");
    world.floor = floor(p, &mut rng);
    if p.floor == FloorKind::Stripes {
        stripes(world, p, &mut rng);
    }
    papers(world, p, &mut stream(seed, "building papers"));
}

fn floor(p: &Properties, rng: &mut Stream) -> Floor {
    let tone = rng.random_range(0.12..0.55_f32);
    let linoleum = Floor {
        color: tinted(rng, tone, 0.08),
        speckle: rng.random_range(0.02..0.12),
        grain_m: rng.random_range(0.004..0.01),
        gloss: rng.random_range(0.2..0.6),
        ..Floor::default()
    };
    // Joints are darker than most tiles, and brighter than dark ones.
    let joint_tone = if rng.random_bool(if tone < 0.25 { 0.5 } else { 0.15 }) {
        1.0 + p.joint_contrast
    } else {
        1.0 - p.joint_contrast
    };
    match p.floor {
        FloorKind::Linoleum | FloorKind::Stripes => linoleum,
        FloorKind::Mirror => Floor {
            speckle: rng.random_range(0.01..0.05),
            gloss: 1.0,
            reflectance: rng.random_range(0.05..0.2),
            reflection: Reflection::Sharp,
            ..linoleum
        },
        FloorKind::Tiles => {
            let side = rng.random_range(0.2..0.6_f32);
            let polished = rng.random_bool(0.3);
            Floor {
                speckle: rng.random_range(0.01..0.06),
                gloss: if polished { 0.8 } else { rng.random_range(0.0..0.5) },
                reflection: if polished { Reflection::Sharp } else { Reflection::Blurred },
                joint_spacing_m: [side * one_of(rng, &[1.0, 1.0, 2.0]), side],
                joint_angle_deg: one_of(rng, &[0.0, 0.0, 0.0, 45.0]),
                joint_width_m: rng.random_range(0.003..0.01),
                joint_tone,
                tile_contrast: rng.random_range(0.0..0.08),
                ..linoleum
            }
        }
        FloorKind::Carpet => {
            let patterned = rng.random_bool(0.5);
            let tone = rng.random_range(0.06..0.35);
            Floor {
                color: tinted(rng, tone, 0.35),
                grain: if patterned { Grain::Motif } else { Grain::Speckle },
                speckle: rng.random_range(0.12..0.3),
                grain_m: rng.random_range(0.003..0.006),
                gloss: 0.0,
                ..linoleum
            }
        }
        FloorKind::Planks => {
            let tone = rng.random_range(0.14..0.45_f32);
            Floor {
                color: [tone * 1.15, tone * 0.95, tone * 0.7],
                speckle: rng.random_range(0.03..0.1),
                gloss: rng.random_range(0.1..0.6),
                joint_spacing_m: [rng.random_range(0.9..1.8), rng.random_range(0.07..0.2)],
                joint_angle_deg: one_of(rng, &[0.0, 0.0, 90.0]),
                joint_width_m: rng.random_range(0.0015..0.004),
                joint_tone: 1.0 - p.joint_contrast,
                stagger: 1.0,
                tile_contrast: rng.random_range(0.04..0.18),
                ..linoleum
            }
        }
        FloorKind::Terrazzo => Floor {
            grain: Grain::Chips,
            speckle: rng.random_range(0.12..0.35),
            grain_m: rng.random_range(0.002..0.004),
            gloss: rng.random_range(0.2..0.9),
            reflection: one_of(rng, &[Reflection::Blurred, Reflection::Sharp]),
            joint_spacing_m: one_of(rng, &[[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]),
            joint_tone,
            ..linoleum
        },
    }
}

/// Adds stripes along both walls, or across the hallway.
fn stripes(world: &mut World, p: &Properties, rng: &mut Stream) {
    let length = p.distance_m + BEYOND_M - START_X_M;
    let tone = one_of(rng, &[0.08, 0.3, 0.65]);
    let color = Some(tinted(rng, tone, 0.5));
    let width = rng.random_range(0.06..0.2);
    if rng.random_bool(0.6) {
        let from_wall = rng.random_range(0.1..0.3);
        for side in [-1.0, 1.0] {
            let y = side * (p.width_m / 2.0 - from_wall - width / 2.0);
            let at_m = [START_X_M + length / 2.0, y];
            world.patches.push(Patch { at_m, size_m: [length, width], color, ..Patch::default() });
        }
    } else {
        let spacing = rng.random_range(1.0..2.5);
        let mut x = START_X_M + spacing;
        while x < START_X_M + length - width {
            world.patches.push(Patch {
                at_m: [x, 0.0],
                size_m: [width, p.width_m],
                color,
                ..Patch::default()
            });
            x += spacing;
        }
    }
}

/// Adds sheets of paper, and a few larger things such as mats.
fn papers(world: &mut World, p: &Properties, rng: &mut Stream) {
    for _ in 0..p.papers {
        let is_sheet = rng.random_bool(0.75);
        let size_m =
            if is_sheet { [0.297, 0.21] } else { [rng.random_range(0.3..0.7), rng.random_range(0.2..0.5)] };
        let dark = [0.06, 0.07, 0.08];
        let color = if is_sheet {
            [0.85, 0.85, 0.83]
        } else {
            one_of(rng, &[dark, [0.35, 0.1, 0.08], [0.5, 0.45, 0.3]])
        };
        let y = p.width_m / 2.0 - 0.4;
        world.patches.push(Patch {
            at_m: [rng.random_range(1.0..p.distance_m), rng.random_range(-y..=y)],
            size_m,
            yaw_deg: rng.random_range(-90.0..90.0),
            color: Some(color),
            ..Patch::default()
        });
    }
}

/// Returns a color of this tone with a random tint; a strength of 0 is gray.
pub fn tinted(rng: &mut Stream, tone: f32, strength: f32) -> Color {
    let warm = rng.random_range(-strength..=strength);
    let green = rng.random_range(-0.5 * strength..=0.5 * strength);
    [tone * (1.0 + warm), tone * (1.0 + green), tone * (1.0 - warm)].map(|c| c.clamp(0.0, 1.0))
}
