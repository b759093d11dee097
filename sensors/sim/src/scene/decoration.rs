//! Flat decoration of a building that is no obstacle: painted lower walls, posters, and things on the floor.

use nalgebra::{Vector2, Vector3};

use super::build::{Parts, between_doors, lift};
use super::surface::{Material, Surface, Tiles};
use crate::world::{Patch, Poster, Wall};

/// Distance of a painted lower wall from the wall, less than that of a baseboard, m.
const DADO_M: f64 = 0.001;
/// Distance of a poster from the wall, m.
const POSTER_M: f64 = 0.004;
/// Width of the printed lines of a poster relative to their spacing.
const LINE_SHARE: f32 = 0.35;
/// Height of the first patch above the floor, m.
const PATCH_M: f64 = 2e-4;
/// Height of each further patch above the one before, m.
const PATCH_STEP_M: f64 = 1e-6;

impl Parts {
    /// Adds the painted lower part of a wall, and its posters.
    pub(super) fn decorate(&mut self, w: &Wall, from: Vector2<f64>, along: Vector2<f64>, length_m: f64) {
        let left = Vector2::new(-along.y, along.x);
        let mut sheet = |span: [f64; 2], z: [f64; 2], off_m: f64, material: Material| {
            let origin = lift(from + along * span[1] + left * off_m, z[0]);
            let (u, v) = (lift(along * (span[0] - span[1]), 0.0), Vector3::z() * (z[1] - z[0]));
            self.surfaces.push(Surface::rectangle(origin, u, v, material));
        };
        if let Some(dado) = w.dado {
            for span in between_doors(w, length_m) {
                sheet(span, [0.0, dado.height_m], DADO_M, Material::matte(dado.color));
            }
        }
        for p in &w.posters {
            let span = [p.at_m - p.width_m / 2.0, p.at_m + p.width_m / 2.0];
            sheet(span, [p.base_m, p.base_m + p.height_m], POSTER_M, print(p));
        }
    }

    /// Adds patch number `index` on the floor, which is surface number `floor`.
    pub(super) fn patch(&mut self, patch: &Patch, index: usize, floor: usize) {
        let z = PATCH_M + PATCH_STEP_M * index as f64;
        let (sin, cos) = patch.yaw_deg.to_radians().sin_cos();
        let along = Vector2::new(cos, sin) * patch.size_m[0];
        let across = Vector2::new(-sin, cos) * patch.size_m[1];
        let corner = lift(Vector2::from(patch.at_m) - (along + across) / 2.0, z);
        let material = Material { light: patch.light, ..Material::matte(patch.color.unwrap_or_default()) };
        let sheet = Surface::rectangle(corner, lift(along, 0.0), lift(across, 0.0), material);
        let whole = self.surfaces[floor];
        self.surfaces.push(match patch.color {
            Some(_) => sheet,
            None => Surface {
                corners: sheet.corners,
                origin: whole.origin + Vector3::z() * z,
                material: Material { light: patch.light, ..whole.material },
                part_of: Some(floor),
                ..whole
            },
        });
    }
}

fn print(p: &Poster) -> Material {
    let [level, upright] = p.line_spacing_m;
    let finest = [level, upright].into_iter().filter(|m| *m > 0.0).fold(f32::INFINITY, f32::min);
    let tiles = Tiles {
        spacing_m: [upright, level],
        joint_width_m: if finest.is_finite() { LINE_SHARE * finest } else { 0.0 },
        joint_tone: p.line_tone,
        ..Tiles::NONE
    };
    Material { tiles, ..Material::matte(p.color) }
}
