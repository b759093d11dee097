//! How bright a surface point looks.

use crate::scene::{PERSON_RADIUS_M, Scene, Surface};

/// Reflectance of a smooth floor seen from straight above.
const NORMAL_REFLECTANCE: f32 = 0.04;
/// Radius of the soft shadow at a person's feet, metres.
const SHADOW_RADIUS_M: f64 = 2.2 * PERSON_RADIUS_M;
/// Share of the light that is missing right between somebody's feet.
const SHADOW_DEPTH: f32 = 0.55;

/// The looks of one surface, ready to be asked for many points.
pub struct Shader<'a, const C: usize> {
    scene: &'a Scene,
    surface: &'a Surface,
    /// Reflectance in the picture's channels.
    pub albedo: [f32; C],
    /// Own radiance.
    pub emission: f32,
    /// Fresnel's reflection is scaled by this; 0 away from the floor.
    pub gloss: f32,
    light: &'a [f32],
    light_scale: [f32; 2],
    light_top: [f32; 2],
    is_floor: bool,
}

/// A point on a surface and the size of a pixel there, metres along u and v.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    pub u: f32,
    pub v: f32,
    pub du: f32,
    pub dv: f32,
}

impl<'a, const C: usize> Shader<'a, C> {
    /// The looks of surface number `index`.
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

    /// Light times texture at a spot: what the reflectance is multiplied with.
    #[inline(always)]
    #[must_use]
    pub fn shine(&self, spot: Spot) -> f32 {
        let (u, v) = (spot.u.max(0.0), spot.v.max(0.0));
        let m = &self.surface.material;
        let mut shine = self.incident(u, v);
        if m.speckle > 0.0 {
            let texels = m.grain_m.recip();
            let footprint = spot.du.max(spot.dv) * texels;
            if footprint < 64.0 {
                shine *= 1.0 + m.speckle * self.scene.speckle().at(u * texels, v * texels, footprint);
            }
        }
        let [pu, pv] = m.joint_spacing_m;
        if pu > 0.0 || pv > 0.0 {
            let along = joint_share(u, spot.du, pu, m.joint_width_m);
            let across = joint_share(v, spot.dv, pv, m.joint_width_m);
            shine *= 1.0 - (1.0 - m.joint_tone) * (1.0 - (1.0 - along) * (1.0 - across));
        }
        if self.is_floor {
            shine *= self.shadows(u, v);
        }
        shine
    }

    /// Fresnel's reflection (Schlick's form) for a ray that meets the surface at this cosine of incidence.
    #[inline]
    #[must_use]
    pub fn reflection(&self, cos_incidence: f32) -> f32 {
        let graze = 1.0 - cos_incidence.clamp(0.0, 1.0);
        let square = graze * graze;
        self.gloss * (NORMAL_REFLECTANCE + (1.0 - NORMAL_REFLECTANCE) * square * square * graze)
    }

    #[inline(always)]
    fn incident(&self, u: f32, v: f32) -> f32 {
        let (x, y) = (
            (u * self.light_scale[0]).min(self.light_top[0]),
            (v * self.light_scale[1]).min(self.light_top[1]),
        );
        let (ix, iy) = (x as i32, y as i32);
        let (fx, fy) = (x - ix as f32, y - iy as f32);
        let (ix, iy) = (ix as usize, iy as usize);
        let at = iy * self.surface.light.count[0] + ix;
        let below = at + self.surface.light.count[0];
        let top = self.light[at] + (self.light[at + 1] - self.light[at]) * fx;
        let bottom = self.light[below] + (self.light[below + 1] - self.light[below]) * fx;
        top + (bottom - top) * fy
    }

    fn shadows(&self, u: f32, v: f32) -> f32 {
        let mut share = 1.0;
        for place in self.scene.places() {
            let du = u - (place.at[0] - self.surface.origin.x) as f32;
            let dv = v - (place.at[1] - self.surface.origin.y) as f32;
            let q = (du * du + dv * dv) * (1.0 / (SHADOW_RADIUS_M * SHADOW_RADIUS_M)) as f32;
            if q < 1.0 {
                share *= 1.0 - SHADOW_DEPTH * (1.0 - q) * (1.0 - q);
            }
        }
        share
    }
}

/// A colour in one (luminance) or three channels.
#[must_use]
pub fn channels<const C: usize>(colour: [f32; 3]) -> [f32; C] {
    if C == 1 {
        [0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]; C]
    } else {
        std::array::from_fn(|i| colour[i.min(2)])
    }
}

/// The share of [at - size / 2, at + size / 2] that lies on joints `width` wide, which start at every multiple of
/// `spacing`.
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
    // Shifted so that both ends are positive.
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
