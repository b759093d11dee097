//! Lens of a pinhole camera: blur, and glare around bright places.

use super::Photometry;

/// Side of the squares whose mean light scatters, pixels.
const COARSE: usize = 8;
/// Reach of one pass of the scattered light, squares; three passes approximate a bell curve.
const REACH: usize = 3;
/// Standard deviations that a blur covers on each side.
const TAILS: f32 = 3.0;

/// Image of a lens; reuses its buffers.
#[derive(Default)]
pub struct Optics<const C: usize> {
    width: usize,
    height: usize,
    pixels: Vec<[f32; C]>,
    spare: Vec<[f32; C]>,
    scattered: Vec<[f32; C]>,
    kernel: Vec<f32>,
}

impl<const C: usize> Optics<C> {
    /// Starts an image of this size, px, to be filled by [`Optics::push`].
    pub fn begin(&mut self, size: [u32; 2]) {
        [self.width, self.height] = size.map(|px| px as usize);
        self.pixels.clear();
    }

    /// Appends a row.
    pub fn push(&mut self, row: &[[f32; C]]) {
        self.pixels.extend_from_slice(row);
    }

    /// Applies the lens, and returns the rows of the image on the sensor.
    pub fn focus(&mut self, lens: Photometry) -> impl Iterator<Item = &[[f32; C]]> {
        // The glare of the light before the blur differs from that after it by less than either changes.
        if lens.blur_px > 0.0 {
            self.blur(lens.blur_px);
        }
        if lens.glare > 0.0 {
            self.scatter(lens.glare);
        }
        self.pixels.chunks_exact(self.width.max(1))
    }

    fn blur(&mut self, sigma_px: f32) {
        let reach = (TAILS * sigma_px).ceil() as usize;
        self.kernel.clear();
        let weight = |i: usize| (-0.5 * ((i as f32 - reach as f32) / sigma_px).powi(2)).exp();
        self.kernel.extend((0..=2 * reach).map(weight));
        let sum: f32 = self.kernel.iter().sum();
        self.kernel.iter_mut().for_each(|weight| *weight /= sum);
        let (w, h) = (self.width, self.height);
        for (step, length) in [(1, w), (w, h)] {
            self.spare.clear();
            self.spare.resize(w * h, [0.0; C]);
            for (i, out) in self.spare.iter_mut().enumerate() {
                let at = i / step % length;
                let start = i - at * step;
                for (k, weight) in self.kernel.iter().enumerate() {
                    // Beyond the border the image continues with its last pixel.
                    let j = (at + k).saturating_sub(reach).min(length - 1);
                    let pixel = &self.pixels[start + j * step];
                    (0..C).for_each(|c| out[c] += weight * pixel[c]);
                }
            }
            std::mem::swap(&mut self.pixels, &mut self.spare);
        }
    }

    fn scatter(&mut self, share: f32) {
        let (w, h) = (self.width.div_ceil(COARSE), self.height.div_ceil(COARSE));
        self.scattered.clear();
        self.scattered.resize(w * h, [0.0; C]);
        for (y, row) in self.pixels.chunks_exact(self.width).enumerate() {
            let rows = COARSE.min(self.height - y / COARSE * COARSE);
            for (x, pixel) in row.iter().enumerate() {
                let area = rows * COARSE.min(self.width - x / COARSE * COARSE);
                let cell = &mut self.scattered[y / COARSE * w + x / COARSE];
                (0..C).for_each(|c| cell[c] += pixel[c] / area as f32);
            }
        }
        for (step, length) in [(1, w), (w, h)].repeat(3) {
            self.spare.clear();
            for i in 0..w * h {
                let at = i / step % length;
                let (low, high) = (at.saturating_sub(REACH), (at + REACH).min(length - 1));
                let mut sum = [0.0; C];
                for j in low..=high {
                    let cell = &self.scattered[i + j * step - at * step];
                    (0..C).for_each(|c| sum[c] += cell[c]);
                }
                self.spare.push(sum.map(|s| s / (high - low + 1) as f32));
            }
            std::mem::swap(&mut self.scattered, &mut self.spare);
        }
        for (i, pixel) in self.pixels.iter_mut().enumerate() {
            let (x, y) = (i % self.width, i / self.width);
            let veil = between(&self.scattered, [w, h], [x, y]);
            (0..C).for_each(|c| pixel[c] += share * (veil[c] - pixel[c]));
        }
    }
}

/// Interpolates between the squares of a coarse image at a pixel of the fine one.
fn between<const C: usize>(coarse: &[[f32; C]], size: [usize; 2], pixel: [usize; 2]) -> [f32; C] {
    let cell = |axis: usize| {
        let at = (pixel[axis] as f32 + 0.5) / COARSE as f32 - 0.5;
        let at = at.clamp(0.0, (size[axis] - 1) as f32);
        let low = at as usize;
        (low, (low + 1).min(size[axis] - 1), at - low as f32)
    };
    let ((x0, x1, fx), (y0, y1, fy)) = (cell(0), cell(1));
    let at = |x: usize, y: usize| &coarse[y * size[0] + x];
    std::array::from_fn(|c| {
        let top = at(x0, y0)[c] + (at(x1, y0)[c] - at(x0, y0)[c]) * fx;
        let bottom = at(x0, y1)[c] + (at(x1, y1)[c] - at(x0, y1)[c]) * fx;
        top + (bottom - top) * fy
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the image of a bright point in the dark.
    fn point(lens: Photometry) -> Vec<f32> {
        let mut optics = Optics::<1>::default();
        optics.begin([65, 49]);
        for y in 0..49 {
            let row: Vec<[f32; 1]> =
                (0..65).map(|x| [if (x, y) == (32, 24) { 100.0 } else { 0.0 }]).collect();
            optics.push(&row);
        }
        optics.focus(lens).flatten().map(|pixel| pixel[0]).collect()
    }

    #[test]
    fn a_blurred_point_has_the_configured_deviation_and_all_of_the_light() {
        let image = point(Photometry { blur_px: 1.5, ..Photometry::default() });
        let sum: f32 = image.iter().sum();
        let square = image.iter().enumerate().map(|(i, light)| light * ((i % 65) as f32 - 32.0).powi(2));
        assert!((sum - 100.0).abs() < 0.01);
        assert!((square.sum::<f32>() / sum - 2.25).abs() < 0.1);
    }

    #[test]
    fn glare_takes_its_share_from_the_point_and_spreads_it() {
        let image = point(Photometry { glare: 0.1, ..Photometry::default() });
        assert!((image[24 * 65 + 32] - 90.0).abs() < 1.0);
        let (near, far) = (image[24 * 65 + 42], image[24 * 65 + 62]);
        assert!(near > 0.0 && far < near && image.iter().all(|light| *light >= 0.0), "{near} {far}");
    }
}
