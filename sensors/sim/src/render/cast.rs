//! Ray caster: radiance along single rays, to verify the rasterizers.

use nalgebra::Vector3;
use parry3d::query::{Ray, RayCullingMode};

use super::project::PosedPinhole;
use super::raster::MAX_BLURRED_RADIANCE;
use super::shade::{BACKGROUND_RADIANCE, BLOCK, Shader, SurfacePoints};
use crate::Scene;
use crate::scene::glam;

/// Maximum length of a ray, in lengths of its direction.
const MAX_REACH: f32 = 300.0;

/// Ray with its neighbors one pixel to the right and one down, which give the size of a pixel on the surface.
#[derive(Clone, Copy, Debug)]
pub struct RayBundle {
    /// Origin in the world frame, m.
    pub origin: Vector3<f64>,
    /// Directions of the ray and of its neighbors in the world frame; any length.
    pub directions: [Vector3<f64>; 3],
}

impl RayBundle {
    /// Returns the radiance along the ray in one (luminance) or three channels.
    #[must_use]
    pub fn radiance<const C: usize>(&self, scene: &Scene) -> [f32; C] {
        self.follow(scene, true)
    }

    fn follow<const C: usize>(&self, scene: &Scene, may_mirror: bool) -> [f32; C] {
        let Some((index, distance)) = self.hit(scene) else { return [BACKGROUND_RADIANCE; C] };
        let shader: Shader<'_, C> = Shader::new(scene, index);
        if shader.emission > 0.0 {
            return [shader.emission; C];
        }
        let surface = &scene.surfaces()[index];
        let normal = surface.normal();
        let height = normal.dot(&(surface.origin - self.origin));
        let [here, right, below] = self.directions.map(|d| {
            let approach = normal.dot(&d);
            // A neighbor that misses the plane gets the length of the ray.
            let hits = approach.abs() > 1e-9 && height / approach > 0.0;
            let reach = if hits { height / approach } else { distance };
            let p = self.origin + d * reach - surface.origin;
            surface.axes.map(|a| a.dot(&p))
        });
        let spread = |k: usize| (right[k] - here[k]).abs() + (below[k] - here[k]).abs();
        let all = |value: f64| [value as f32; BLOCK];
        let points =
            SurfacePoints { u: all(here[0]), v: all(here[1]), du: all(spread(0)), dv: all(spread(1)) };
        let irradiance = shader.irradiance(&points, 1)[0];
        let mut seen = shader.albedo.map(|a| a * irradiance);
        if may_mirror && shader.gloss > 0.0 {
            let cosine = -normal.dot(&self.directions[0].normalize());
            let share = shader.reflection(cosine as f32);
            let reflected = self.mirrored(distance, normal).follow::<C>(scene, false);
            let clip = if surface.material.is_sharp { f32::INFINITY } else { MAX_BLURRED_RADIANCE };
            for c in 0..C {
                seen[c] += share * (reflected[c].min(clip) - seen[c]);
            }
        }
        seen
    }

    /// Returns the first surface that the ray hits, and its distance in lengths of the direction.
    fn hit(&self, scene: &Scene) -> Option<(usize, f64)> {
        let ray = Ray::new(glam(self.origin), glam(self.directions[0]));
        let mut nearest: Option<(usize, f32)> = None;
        for (mesh, first) in scene.meshes() {
            let reach = nearest.map_or(MAX_REACH, |n| n.1);
            let hit = mesh.cast_local_ray_with_culling(&ray, reach, RayCullingMode::IgnoreBackfaces);
            if let Some(hit) = hit {
                nearest = Some((first + hit.subshape as usize / 2, hit.time_of_impact));
            }
        }
        nearest.map(|(index, reach)| (index, f64::from(reach)))
    }

    fn mirrored(&self, distance: f64, normal: Vector3<f64>) -> Self {
        let reflect = |d: Vector3<f64>| d - normal * (2.0 * normal.dot(&d));
        Self {
            origin: self.origin + self.directions[0] * distance + normal * 1e-4,
            directions: self.directions.map(reflect),
        }
    }
}

/// Returns the mean radiance of a pixel of a pinhole camera over `per_side` x `per_side` rays.
pub fn pixel<const C: usize>(
    scene: &Scene,
    posed: &PosedPinhole,
    x: usize,
    y: usize,
    per_side: usize,
) -> [f32; C] {
    let mut sum = [0.0; C];
    let step = 1.0 / per_side as f64;
    for i in 0..per_side * per_side {
        let px = x as f64 + ((i % per_side) as f64 + 0.5) * step;
        let py = y as f64 + ((i / per_side) as f64 + 0.5) * step;
        let directions = [(0.0, 0.0), (step, 0.0), (0.0, step)].map(|(a, b)| posed.direction(px + a, py + b));
        let seen = RayBundle { origin: posed.at, directions }.radiance::<C>(scene);
        (0..C).for_each(|c| sum[c] += seen[c]);
    }
    sum.map(|s| s / (per_side * per_side) as f32)
}
