//! Fine textures: periodic tiles of seeded values with mean 0 and standard deviation 1, and their mipmaps.

use rand::RngExt;

use crate::random::stream;
use crate::world::Grain;

/// Number of texels along a side of the finest level.
const SIDE: usize = 256;
/// Number of texels along a side of the square that holds one chip.
const CHIP: usize = 8;
/// Number of texels along a lozenge of a carpet.
const LOZENGE: usize = 64;

/// Periodic texture in a pyramid of resolutions.
#[derive(Clone, Debug)]
pub struct Texture {
    levels: Vec<Vec<f32>>,
}

impl Texture {
    /// Returns the texture of this shape and seed.
    #[must_use]
    pub fn new(grain: Grain, seed: u64) -> Self {
        Self::from_texels(match grain {
            Grain::Speckle => speckle(seed),
            Grain::Chips => chips(seed),
            Grain::Motif => motif(seed),
        })
    }

    fn from_texels(mut texels: Vec<f32>) -> Self {
        let mean = texels.iter().sum::<f32>() / texels.len() as f32;
        let variance = texels.iter().map(|t| (t - mean).powi(2)).sum::<f32>() / texels.len() as f32;
        let gain = variance.sqrt().recip();
        texels.iter_mut().for_each(|t| *t = (*t - mean) * gain);

        let mut levels = vec![texels];
        while let Some(fine) = levels.last().filter(|l| l.len() > 1) {
            let (side, half) = (fine.len().isqrt(), fine.len().isqrt() / 2);
            let coarse = (0..half * half).map(|i| {
                let at = (i / half) * 2 * side + (i % half) * 2;
                (fine[at] + fine[at + 1] + fine[at + side] + fine[at + side + 1]) / 4.0
            });
            let coarse = coarse.collect();
            levels.push(coarse);
        }
        Self { levels }
    }

    /// Returns the value at (u, v) in texels, averaged over about `footprint` texels. Coordinates must not be negative.
    #[cfg(test)]
    fn at(&self, u: f32, v: f32, footprint: f32) -> f32 {
        let level = self.level(footprint);
        level.at(u, v)
    }

    /// Returns the level in which `footprint` texels of the finest level are one.
    #[inline(always)]
    #[must_use]
    pub fn level(&self, footprint: f32) -> Level<'_> {
        let level = ((footprint.to_bits() >> 23) as usize).saturating_sub(127).min(self.levels.len() - 1);
        let shrink = f32::from_bits((127 - level as u32) << 23);
        // The center of a coarse texel lies between the centers of its fine ones.
        Level { texels: &self.levels[level], side: SIDE >> level, shrink, shift: 0.5 * shrink - 0.5 }
    }
}

/// One level of a [`Texture`].
#[derive(Clone, Copy)]
pub struct Level<'a> {
    texels: &'a [f32],
    side: usize,
    shrink: f32,
    shift: f32,
}

impl Level<'_> {
    /// Returns the value at (u, v), in texels of the finest level. Coordinates must not be negative.
    #[inline(always)]
    #[must_use]
    pub fn at(&self, u: f32, v: f32) -> f32 {
        let coordinate = |t: f32| (t * self.shrink + self.shift).max(0.0);
        sample(self.texels, self.side, coordinate(u), coordinate(v))
    }
}

/// Returns noise of several sizes.
fn speckle(seed: u64) -> Vec<f32> {
    let mut rng = stream(seed, "speckle");
    let mut texels = vec![0.0; SIDE * SIDE];
    for octave in 0..5_usize {
        let side = SIDE >> octave;
        let grid: Vec<f32> = (0..side * side).map(|_| rng.random_range(-1.0..1.0)).collect();
        let scale = (side as f32) / SIDE as f32;
        for (i, texel) in texels.iter_mut().enumerate() {
            let (x, y) = ((i % SIDE) as f32 * scale, (i / SIDE) as f32 * scale);
            *texel += sample(&grid, side, x, y);
        }
    }
    texels
}

/// Returns chips of random size, shape and tone in an even ground.
fn chips(seed: u64) -> Vec<f32> {
    let mut rng = stream(seed, "chips");
    let side = SIDE / CHIP;
    // Center in texels, half axes, and tone.
    let chips: Vec<[f32; 5]> = (0..side * side)
        .map(|i| {
            let within = |cell: usize, share: f32| (cell as f32 + share) * CHIP as f32;
            [
                within(i % side, rng.random_range(0.2..0.8)),
                within(i / side, rng.random_range(0.2..0.8)),
                CHIP as f32 * rng.random_range(0.2..0.6_f32),
                CHIP as f32 * rng.random_range(0.2..0.6_f32),
                rng.random_range(-1.0..1.0),
            ]
        })
        .collect();
    let wrapped = |difference: f32| difference - SIDE as f32 * (difference / SIDE as f32).round();
    (0..SIDE * SIDE)
        .map(|i| {
            let (x, y) = (i % SIDE, i / SIDE);
            let mut tone = 0.1 * rng.random_range(-1.0..1.0_f32);
            for neighbor in 0..9 {
                let cell = |at: usize, step: usize| (at / CHIP + step + side - 1) % side;
                let [cx, cy, a, b, shade] = chips[cell(y, neighbor / 3) * side + cell(x, neighbor % 3)];
                let (dx, dy) = (wrapped(x as f32 - cx).abs() / a, wrapped(y as f32 - cy).abs() / b);
                // Between an ellipse and a lozenge: broken stone.
                if dx + dy + dx.max(dy) < 2.0 {
                    tone = shade;
                }
            }
            tone
        })
        .collect()
}

/// Returns lozenges with a dot in each, and noise.
fn motif(seed: u64) -> Vec<f32> {
    let mut rng = stream(seed, "motif");
    (0..SIDE * SIDE)
        .map(|i| {
            let half = 0.5 * LOZENGE as f32;
            let within = |t: usize| ((t % LOZENGE) as f32 + 0.5 - half).abs() / half;
            let reach = within(i % SIDE) + within(i / SIDE);
            let figure = if (0.85..1.15).contains(&reach) {
                -1.0
            } else if reach < 0.35 {
                1.2
            } else {
                0.15
            };
            figure + rng.random_range(-1.0..1.0_f32)
        })
        .collect()
}

/// Interpolates bilinearly in a periodic grid. `side` must be a power of two, coordinates below 2^31.
#[inline(always)]
fn sample(grid: &[f32], side: usize, x: f32, y: f32) -> f32 {
    // A cast to a signed number is one instruction, to an unsigned one several.
    let (ix, iy) = (x as i32, y as i32);
    let (fx, fy) = (x - ix as f32, y - iy as f32);
    let (ix, iy) = (ix as usize, iy as usize);
    let mask = side - 1;
    let (x0, x1) = (ix & mask, (ix + 1) & mask);
    let (y0, y1) = ((iy & mask) * side, ((iy + 1) & mask) * side);
    let top = grid[y0 + x0] + (grid[y0 + x1] - grid[y0 + x0]) * fx;
    let bottom = grid[y1 + x0] + (grid[y1 + x1] - grid[y1 + x0]) * fx;
    top + (bottom - top) * fy
}

#[cfg(test)]
mod tests {
    use super::{SIDE, Texture};
    use crate::world::Grain;

    #[test]
    fn textures_have_unit_contrast_near_and_fade_far() {
        for grain in [Grain::Speckle, Grain::Chips, Grain::Motif] {
            let texture = Texture::new(grain, 3);
            let contrast = |footprint: f32| {
                let n = SIDE * SIDE;
                let at = |i: usize| texture.at((i % SIDE) as f32, (i / SIDE) as f32, footprint);
                (0..n).map(|i| at(i).powi(2)).sum::<f32>() / n as f32
            };
            assert!((contrast(0.5) - 1.0).abs() < 0.01, "{grain:?}");
            assert!(contrast(16.0) < 0.5 * contrast(2.0), "{grain:?}");
            assert!(contrast(300.0) < 1e-6, "{grain:?}: the mean is zero");
        }
    }
}
