//! How much light falls where: direct light of lamps and windows with shadows, plus light that comes from everywhere.

use nalgebra::Vector3;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;

use super::surface::Surface;

/// Direct light that makes a white surface as bright as 1: what falls below a row of the usual lamps.
const WHITE_IRRADIANCE: f64 = 0.95;
/// Share of the light from everywhere that also reaches places without any direct light.
const DARK_SHARE: f32 = 0.4;
/// Contributions below this are not followed.
const NEGLIGIBLE: f64 = 2e-3;
/// Distance in meters of light values on large surfaces.
const TEXEL_M: f64 = 0.15;
/// Distance in meters from an edge at which its light is taken, so that it does not stand inside the neighbor.
const INSET_M: f64 = 0.03;

/// A small piece of a shining surface.
#[derive(Clone, Copy, Debug)]
pub struct Emitter {
    /// Center, world, meters.
    pub at: Vector3<f64>,
    /// Unit direction that it shines to.
    pub normal: Vector3<f64>,
    /// Radiance times area.
    pub power: f64,
}

/// All light of a scene.
#[derive(Clone, Debug)]
pub struct Lighting {
    /// Lamps and windows in pieces.
    pub emitters: Vec<Emitter>,
    /// Light from everywhere.
    pub ambient: f32,
}

impl Lighting {
    /// Light on a surface element at `at` that faces `normal`, 1 under a row of lamps; shadows thrown by `blockers`.
    #[must_use]
    pub fn at(&self, at: Vector3<f64>, normal: Vector3<f64>, blockers: Option<&TriMesh>) -> f32 {
        let direct: f64 = self.emitters.iter().map(|e| direct(e, at, normal, blockers)).sum();
        let direct = (direct / WHITE_IRRADIANCE) as f32;
        let openness = DARK_SHARE + (1.0 - DARK_SHARE) * (direct * 3.0).min(1.0);
        // Down-facing surfaces see the lit floor, which shines back as much as the whole room.
        let openness = if normal.z < -0.5 { 1.0 } else { openness };
        direct + self.ambient * openness
    }

    /// Fills the grids of `surfaces`, appending to `values`.
    pub fn bake(&self, surfaces: &mut [Surface], blockers: &TriMesh, values: &mut Vec<f32>) {
        for s in surfaces {
            let normal = s.normal();
            s.light.first = values.len();
            s.light.count = s.size.map(|m| (m / TEXEL_M).ceil() as usize + 1).map(|n| n.clamp(2, 400));
            let [nu, nv] = s.light.count;
            let place = |i: usize, n: usize, size: f64| {
                let inset = INSET_M.min(size / 2.0);
                (size * i as f64 / (n - 1) as f64).clamp(inset, size - inset)
            };
            for j in 0..nv {
                for i in 0..nu {
                    if s.material.emission > 0.0 {
                        values.push(0.0);
                        continue;
                    }
                    let at = s.point(place(i, nu, s.size[0]), place(j, nv, s.size[1])) + normal * 0.01;
                    values.push(self.at(at, normal, Some(blockers)));
                }
            }
        }
    }
}

fn direct(e: &Emitter, at: Vector3<f64>, normal: Vector3<f64>, blockers: Option<&TriMesh>) -> f64 {
    let way = e.at - at;
    let square = way.norm_squared().max(0.01);
    let facing = normal.dot(&way) * -e.normal.dot(&way) / square;
    let light = e.power * facing / square;
    if facing <= 0.0 || normal.dot(&way) <= 0.0 || light < NEGLIGIBLE {
        return 0.0;
    }
    let Some(mesh) = blockers else { return light };
    let ray = Ray::new(glam(at), glam(way));
    if mesh.cast_local_ray(&ray, 0.999, false).is_some() { 0.0 } else { light }
}

/// The same vector in the ray caster's type.
#[must_use]
pub fn glam(v: Vector3<f64>) -> parry3d::math::Vector {
    parry3d::math::Vector::new(v.x as f32, v.y as f32, v.z as f32)
}
