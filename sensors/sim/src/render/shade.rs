//! Shading: radiance of points on a surface.

use crate::scene::{PERSON_RADIUS_M, Scene, Surface};

/// Radiance where no surface is visible.
pub const BACKGROUND_RADIANCE: f32 = 0.02;
/// Number of points that are shaded together.
pub const BLOCK: usize = 8;
/// Reflectance of a smooth floor at normal incidence.
const NORMAL_REFLECTANCE: f32 = 0.04;
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
        let is_floor = surface.origin.z == 0.0 && surface.normal().z > 0.9;
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
                let level = self.scene.speckle().level(footprint);
                for i in 0..count {
                    irradiance[i] *= 1.0 + m.speckle * level.at(u[i] * texels, v[i] * texels);
                }
            }
        }
        let [pu, pv] = m.joint_spacing_m;
        if pu > 0.0 || pv > 0.0 {
            for i in 0..count {
                let along = joint_share(u[i], points.du[i], pu, m.joint_width_m);
                let across = joint_share(v[i], points.dv[i], pv, m.joint_width_m);
                irradiance[i] *= 1.0 - (1.0 - m.joint_tone) * (1.0 - (1.0 - along) * (1.0 - across));
            }
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
        self.gloss * (NORMAL_REFLECTANCE + (1.0 - NORMAL_REFLECTANCE) * square * square * graze)
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
            let foot = [
                (person.at[0] - self.surface.origin.x) as f32,
                (person.at[1] - self.surface.origin.y) as f32,
            ];
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

/// Returns the fraction of [at - size / 2, at + size / 2] that lies on joints of this width, which start at every multiple
/// of `spacing`.
#[inline]
fn joint_share(at: f32, size: f32, spacing: f32, width: f32) -> f32 {
    if spacing <= 0.0 {
        return 0.0;
    }
    let size = size.clamp(1e-4, 8.0 * spacing);
    let joints_up_to = |t: f32| {
        let turns = t / spacing;
        let whole = turns as i32 as f32;
        whole * width + ((turns - whole) * spacing).min(width)
    };
    // Both ends must be positive.
    let low = at - 0.5 * size + 8.0 * spacing;
    (joints_up_to(low + size) - joints_up_to(low)) / size
}

#[cfg(test)]
mod tests {
    use super::joint_share;

    #[test]
    fn joint_share_is_one_on_a_joint_none_beside_it_and_the_mean_from_afar() {
        assert!((joint_share(0.602, 0.001, 0.6, 0.004) - 1.0).abs() < 1e-2);
        assert!(joint_share(0.3, 0.1, 0.6, 0.004).abs() < 1e-4);
        assert!((joint_share(0.6, 0.004, 0.6, 0.004) - 0.5).abs() < 1e-2);
        assert!((joint_share(3.1, 2.4, 0.6, 0.004) - 0.004 / 0.6).abs() < 1e-4);
    }
}
