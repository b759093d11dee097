//! Lighting: direct light of lamps and windows with shadows, plus ambient light.

use nalgebra::Vector3;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;

use super::surface::Surface;

/// Direct light at which a white surface has brightness 1: that below a row of standard lamps.
const WHITE_IRRADIANCE: f64 = 0.95;
/// Fraction of the ambient light that reaches surfaces without direct light.
const DARK_SHARE: f32 = 0.4;
/// Contribution of an emitter below which it is ignored.
const NEGLIGIBLE: f64 = 2e-3;
/// Spacing of light values on large surfaces, m.
const TEXEL_M: f64 = 0.15;
/// Distance from an edge at which its light is computed, so that the point lies outside the neighboring surface, m.
const INSET_M: f64 = 0.03;

/// Small part of a luminous surface.
#[derive(Clone, Copy, Debug)]
pub struct Emitter {
    /// Center in the world frame, m.
    pub at: Vector3<f64>,
    /// Unit normal.
    pub normal: Vector3<f64>,
    /// Radiance times area.
    pub power: f64,
}

/// Light of a scene.
#[derive(Clone, Debug)]
pub struct Lighting {
    /// Parts of the lamps and windows.
    pub emitters: Vec<Emitter>,
    /// Ambient light.
    pub ambient: f32,
}

impl Lighting {
    /// Returns the light on a surface element at `at` with this normal, 1 below a row of lamps. `blockers` cast shadows.
    #[must_use]
    pub fn at(&self, at: Vector3<f64>, normal: Vector3<f64>, blockers: Option<&TriMesh>) -> f32 {
        let direct: f64 = self.emitters.iter().map(|e| direct(e, at, normal, blockers)).sum();
        let direct = (direct / WHITE_IRRADIANCE) as f32;
        let openness = DARK_SHARE + (1.0 - DARK_SHARE) * (direct * 3.0).min(1.0);
        // Surfaces that face down receive as much light from the floor as from the whole room.
        let openness = if normal.z < -0.5 { 1.0 } else { openness };
        direct + self.ambient * openness
    }

    /// Computes the light grids of `surfaces`, and appends their values to `values`.
    pub fn bake(&self, surfaces: &mut [Surface], blockers: &TriMesh, values: &mut Vec<f32>) {
        for index in 0..surfaces.len() {
            if let Some(whole) = surfaces[index].part_of {
                surfaces[index].light = surfaces[whole].light;
                continue;
            }
            let s = &mut surfaces[index];
            let normal = s.normal();
            s.light.first = values.len();
            s.light.count = s.size.map(|m| (m / TEXEL_M).ceil() as usize + 1).map(|n| n.clamp(2, 400));
            let [nu, nv] = s.light.count;
            let coordinate = |i: usize, n: usize, size: f64| {
                let inset = INSET_M.min(size / 2.0);
                (size * i as f64 / (n - 1) as f64).clamp(inset, size - inset)
            };
            for j in 0..nv {
                for i in 0..nu {
                    if s.material.emission > 0.0 {
                        values.push(0.0);
                        continue;
                    }
                    let at = s.point(coordinate(i, nu, s.size[0]), coordinate(j, nv, s.size[1]));
                    let at = at + normal * 0.01;
                    values.push(self.at(at, normal, Some(blockers)));
                }
            }
        }
    }
}

fn direct(e: &Emitter, at: Vector3<f64>, normal: Vector3<f64>, blockers: Option<&TriMesh>) -> f64 {
    let ray = e.at - at;
    let square = ray.norm_squared().max(0.01);
    let facing = normal.dot(&ray) * -e.normal.dot(&ray) / square;
    let light = e.power * facing / square;
    if facing <= 0.0 || normal.dot(&ray) <= 0.0 || light < NEGLIGIBLE {
        return 0.0;
    }
    let Some(mesh) = blockers else { return light };
    let ray = Ray::new(glam(at), glam(ray));
    if mesh.cast_local_ray(&ray, 0.999, false).is_some() { 0.0 } else { light }
}

/// Returns the vector in the type of the ray caster.
#[must_use]
pub fn glam(v: Vector3<f64>) -> parry3d::math::Vector {
    parry3d::math::Vector::new(v.x as f32, v.y as f32, v.z as f32)
}
