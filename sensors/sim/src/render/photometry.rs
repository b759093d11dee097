//! Image sensor: vignetting, exposure, response curve and noise, from radiance to gray levels.

use rand::Rng;
use rand_pcg::Pcg64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

/// Properties of the lens and the image sensor.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Photometry {
    /// Gain; at 1, a white wall under standard lamps has a gray level of about 200.
    #[default(1.0)]
    #[schemars(range(min = 0.05, max = 20.0))]
    pub exposure: f32,
    /// Fraction of the light missing in the corners of the image.
    #[default(0.25)]
    #[schemars(range(min = 0.0, max = 0.9))]
    pub vignetting: f32,
    /// Standard deviation of the noise, gray levels.
    #[default(2.0)]
    #[schemars(range(min = 0.0, max = 50.0))]
    pub noise_sigma: f32,
    /// Standard deviation of the gain from frame to frame, relative to its mean.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub flicker: f32,
    /// Blur of the lens: standard deviation of its point spread, pixels. Pinhole cameras only.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub blur_px: f32,
    /// Glare: fraction of the light that the lens scatters over its surroundings. Pinhole cameras only.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub glare: f32,
}

impl Photometry {
    /// Returns true for a lens without blur and glare.
    #[must_use]
    pub fn has_perfect_lens(&self) -> bool {
        self.blur_px <= 0.0 && self.glare <= 0.0
    }
}

/// Radiance with gray level 255 at exposure 1.
const WHITE_LEVEL: f32 = 1.25;
/// Number of entries of the noise table; a power of two.
const NOISE_STEPS: usize = 4096;

/// Image sensor with its noise.
pub struct ImageSensor {
    /// Properties of the lens and the sensor.
    pub photometry: Photometry,
    rng: Pcg64,
    /// Gain of the frame, relative to the mean.
    gain: f32,
    /// Quantiles of the standard normal distribution.
    normal: Vec<f32>,
}

impl ImageSensor {
    /// Returns a sensor with noise from `rng`.
    #[must_use]
    pub fn new(photometry: Photometry, rng: Pcg64) -> Self {
        Self { photometry, rng, gain: 1.0, normal: normal_quantiles(NOISE_STEPS) }
    }

    /// Starts a frame, and draws its gain.
    pub fn open_shutter(&mut self) {
        if self.photometry.flicker > 0.0 {
            let quantile = self.normal[self.rng.next_u64() as usize % NOISE_STEPS];
            self.gain = (1.0 + self.photometry.flicker * quantile).max(0.0);
        }
    }

    /// Converts the radiance of row `y` of an image of this size (width, height) to gray levels, with interleaved channels.
    pub fn digitize<const C: usize>(
        &mut self,
        size: [u32; 2],
        y: usize,
        row: &[[f32; C]],
        pixels: &mut [u8],
    ) {
        let [width, height] = size.map(f64::from);
        let corner = 0.25 * (width * width + height * height);
        let fall = f64::from(self.photometry.vignetting) / corner;
        let center = 0.5 * (width - 1.0);
        let dy = y as f64 - 0.5 * (height - 1.0);
        let gain = self.gain * self.photometry.exposure / WHITE_LEVEL;
        let (fall, center, dy2) = (fall as f32, center as f32, (dy * dy) as f32);
        if self.photometry.noise_sigma > 0.0 {
            self.digitize_noisy(row, gain, fall, center, dy2, pixels);
            return;
        }
        for (x, (radiance, out)) in row.iter().zip(pixels.chunks_exact_mut(C)).enumerate() {
            let dx = x as f32 - center;
            let gain = gain * (1.0 - fall * (dx * dx + dy2));
            for c in 0..C {
                // The square root approximates the usual gamma of 1/2.2.
                out[c] = ((radiance[c] * gain).min(1.0).sqrt() * 255.0 + 0.5) as u8;
            }
        }
    }

    fn digitize_noisy<const C: usize>(
        &mut self,
        row: &[[f32; C]],
        gain: f32,
        fall: f32,
        center: f32,
        dy2: f32,
        pixels: &mut [u8],
    ) {
        let sigma = self.photometry.noise_sigma;
        let mut bits = 0_u64;
        for (x, (radiance, out)) in row.iter().zip(pixels.chunks_exact_mut(C)).enumerate() {
            let dx = x as f32 - center;
            let gain = gain * (1.0 - fall * (dx * dx + dy2));
            for c in 0..C {
                if (x * C + c).is_multiple_of(5) {
                    bits = self.rng.next_u64();
                }
                let noise = sigma * self.normal[(bits as usize) % NOISE_STEPS];
                bits >>= 12;
                out[c] = ((radiance[c] * gain).min(1.0).sqrt() * 255.0 + noise + 0.5) as u8;
            }
        }
    }
}

/// Returns the quantiles of the standard normal distribution at (i + 1/2) / `count`.
fn normal_quantiles(count: usize) -> Vec<f32> {
    let step = 5e-4;
    let mut quantiles = vec![0.0; count];
    let mut share = 0.5;
    let mut z = 0.0_f64;
    for i in count / 2..count {
        let target = (i as f64 + 0.5) / count as f64;
        while share < target && z < 6.0 {
            share += step * (-(z + 0.5 * step).powi(2) / 2.0).exp() / std::f64::consts::TAU.sqrt();
            z += step;
        }
        quantiles[i] = z as f32;
        quantiles[count - 1 - i] = -z as f32;
    }
    quantiles
}

#[cfg(test)]
mod tests {
    use super::normal_quantiles;

    #[test]
    fn noise_has_mean_zero_and_unit_deviation() {
        let q = normal_quantiles(4096);
        let mean = q.iter().sum::<f32>() / 4096.0;
        let variance = q.iter().map(|z| z * z).sum::<f32>() / 4096.0;
        assert!(mean.abs() < 1e-6 && (variance - 1.0).abs() < 0.01, "{mean} {variance}");
        assert!((q[3993] - 1.96).abs() < 0.01, "{}", q[3993]);
    }
}
