//! Shading: radiance of points on a surface.

use nalgebra::Vector3;

use super::tiles;
use crate::scene::{PERSON_RADIUS_M, Scene, Surface};

/// Radiance where no surface is visible.
pub const BACKGROUND_RADIANCE: f32 = 0.02;
/// Number of points that are shaded together.
pub const BLOCK: usize = 8;
/// Height up to which an upward surface counts as part of the floor, m.
const FLOOR_M: f64 = 2e-3;
/// Radius of the soft shadow at the feet of a person, m.
const SHADOW_RADIUS_M: f64 = 2.2 * PERSON_RADIUS_M;
/// Number of texels per pixel from which on the speckle is not visible.
const FADED: f32 = 64.0;
/// Fraction of the light that is missing at the center of the shadow.
const SHADOW_DEPTH: f32 = 0.55;

/// Shader of one surface.
pub struct Shader<'a, const C: usize> {
    scene: &'a Scene,
    surface: &'a Surface,
    /// Reflectance per channel.
    pub albedo: [f32; C],
    /// Emitted radiance.
    pub emission: f32,
    /// Fraction of the Fresnel reflection; 0 for other surfaces than the floor.
    pub gloss: f32,
    light: &'a [f32],
    light_scale: [f32; 2],
    light_top: [f32; 2],
    is_floor: bool,
}

/// Surface coordinates of points (u, v), and size of a pixel at each (du, dv), m. Unused entries are finite.
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfacePoints {
    pub u: [f32; BLOCK],
    pub v: [f32; BLOCK],
    pub du: [f32; BLOCK],
    pub dv: [f32; BLOCK],
}

impl<'a, const C: usize> Shader<'a, C> {
    /// Returns the shader of surface number `index`.
    #[must_use]
    pub fn new(scene: &'a Scene, index: usize) -> Self {
        let surface = &scene.surfaces()[index];
        let m = &surface.material;
        let [nu, nv] = surface.light.count;
        let first = surface.light.first;
        let is_floor = (0.0..FLOOR_M).contains(&surface.origin.z) && surface.normal().z > 0.9;
        Self {
            scene,
            surface,
            albedo: channels(m.albedo),
            emission: m.emission,
            gloss: if is_floor { m.gloss } else { 0.0 },
            light: &scene.light()[first..first + nu * nv],
            light_scale: [0, 1].map(|k| ((surface.light.count[k] - 1) as f64 / surface.size[k]) as f32),
            light_top: [nu, nv].map(|n| (n - 1) as f32 - 1e-3),
            is_floor,
        }
    }

    /// Returns light times texture at the first `count` points, the factor of the reflectance.
    #[inline(always)]
    #[must_use]
    pub fn irradiance(&self, points: &SurfacePoints, count: usize) -> [f32; BLOCK] {
        let m = &self.surface.material;
        let u = points.u.map(|u| u.max(0.0));
        let v = points.v.map(|v| v.max(0.0));
        let mut irradiance = self.incident(&u, &v, count);
        if m.speckle > 0.0 {
            let texels = m.grain_m.recip();
            let middle = count / 2;
            let footprint = points.du[middle].max(points.dv[middle]) * texels;
            if footprint < FADED {
                let level = self.scene.texture(m.grain).level(footprint);
                for i in 0..count {
                    irradiance[i] *= 1.0 + m.speckle * level.at(u[i] * texels, v[i] * texels);
                }
            }
        }
        tiles::apply(&m.tiles, &u, &v, points, count, &mut irradiance);
        if m.light != 1.0 {
            irradiance.iter_mut().for_each(|light| *light *= m.light);
        }
        if self.is_floor {
            self.shadow(&u, &v, &mut irradiance);
        }
        irradiance
    }

    /// Returns the Fresnel reflection (Schlick's approximation) at this cosine of the angle of incidence.
    #[inline]
    #[must_use]
    pub fn reflection(&self, cos_incidence: f32) -> f32 {
        let graze = 1.0 - cos_incidence.clamp(0.0, 1.0);
        let square = graze * graze;
        let normal = self.surface.material.reflectance;
        self.gloss * (normal + (1.0 - normal) * square * square * graze)
    }

    #[inline(always)]
    fn incident(&self, u: &[f32; BLOCK], v: &[f32; BLOCK], count: usize) -> [f32; BLOCK] {
        let row = self.surface.light.count[0];
        let mut incident = [0.0; BLOCK];
        for i in 0..count {
            let x = (u[i] * self.light_scale[0]).min(self.light_top[0]);
            let y = (v[i] * self.light_scale[1]).min(self.light_top[1]);
            let (ix, iy) = (x as i32, y as i32);
            let (fx, fy) = (x - ix as f32, y - iy as f32);
            let at = iy as usize * row + ix as usize;
            let light = &self.light[at..at + row + 2];
            let top = light[0] + (light[1] - light[0]) * fx;
            let bottom = light[row] + (light[row + 1] - light[row]) * fx;
            incident[i] = top + (bottom - top) * fy;
        }
        incident
    }

    /// Darkens the floor at the feet of people.
    fn shadow(&self, u: &[f32; BLOCK], v: &[f32; BLOCK], irradiance: &mut [f32; BLOCK]) {
        for person in self.scene.people() {
            let from_origin = Vector3::new(person.at[0], person.at[1], 0.0) - self.surface.origin;
            let foot = self.surface.axes.map(|axis| axis.dot(&from_origin) as f32);
            for i in 0..BLOCK {
                let (du, dv) = (u[i] - foot[0], v[i] - foot[1]);
                let q = (du * du + dv * dv) * (1.0 / (SHADOW_RADIUS_M * SHADOW_RADIUS_M)) as f32;
                let near = (1.0 - q).max(0.0);
                irradiance[i] *= 1.0 - SHADOW_DEPTH * near * near;
            }
        }
    }
}

/// Returns a color in one (luminance) or three channels.
#[must_use]
pub fn channels<const C: usize>(color: [f32; 3]) -> [f32; C] {
    if C == 1 {
        [0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]; C]
    } else {
        std::array::from_fn(|i| color[i.min(2)])
    }
}
