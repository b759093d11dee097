//! A gray image arranged for bilinear interpolation: one read gives the four levels around a position.

use yamabico_geometry::image::ImageView;

/// Gray image whose entry (u, v) holds the levels at (u, v), (u + 1, v), (u, v + 1) and (u + 1, v + 1), lowest byte
/// first.
#[derive(Clone, Debug, Default)]
pub struct QuadImage {
    width: usize,
    height: usize,
    mean: f32,
    quads: Vec<u32>,
}

/// Added to a position, rounds it down to an integer in the lowest bits.
const FLOOR: f32 = 8_388_607.5;
const FLOOR_BITS: u32 = 0x4b00_0000;

impl QuadImage {
    /// Creates a black image.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, mean: 0.0, quads: vec![0; width * height] }
    }

    /// Copies `image`, of any size. The last row and column repeat themselves.
    pub fn copy(&mut self, image: ImageView) {
        (self.width, self.height) = (image.width(), image.height());
        self.quads.resize(self.width * self.height, 0);
        let mut sum = 0;
        for (v, quads) in self.quads.chunks_exact_mut(self.width).enumerate() {
            let (here, below) = (image.row(v), image.row((v + 1).min(self.height - 1)));
            let pairs = here.windows(2).zip(below.windows(2));
            for (quad, (here, below)) in quads.iter_mut().zip(pairs) {
                *quad = u32::from_le_bytes([here[0], here[1], below[0], below[1]]);
            }
            if let ([.., quad], [.., here], [.., below]) = (quads, here, below) {
                *quad = u32::from_le_bytes([*here, *here, *below, *below]);
            }
            sum += here.iter().map(|&level| u64::from(level)).sum::<u64>();
        }
        self.mean = sum as f32 / (self.width * self.height) as f32;
    }

    /// Width, px.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Mean gray level.
    #[must_use]
    pub fn mean(&self) -> f32 {
        self.mean
    }

    /// Gray levels at positions, which must lie at least one pixel inside the border; arbitrary elsewhere.
    #[inline(always)]
    pub(crate) fn sample<const N: usize>(&self, x: &[f32; N], y: &[f32; N]) -> [f32; N] {
        let (mut index, mut right, mut down) = ([0_u32; N], [0_f32; N], [0_f32; N]);
        let width = self.width as u32;
        for i in 0..N {
            let (u, v) = (x[i] + FLOOR, y[i] + FLOOR);
            right[i] = x[i] - (u - (FLOOR + 0.5));
            down[i] = y[i] - (v - (FLOOR + 0.5));
            let (u, v) = (u.to_bits().wrapping_sub(FLOOR_BITS), v.to_bits().wrapping_sub(FLOOR_BITS));
            index[i] = v.wrapping_mul(width).wrapping_add(u);
        }
        // Without a branch for each sample: the last entry stands for positions beyond the image.
        let Some(last) = self.quads.len().checked_sub(1) else { return [0.0; N] };
        let all = &self.quads[..=last];
        let mut quads = [0_u32; N];
        for i in 0..N {
            quads[i] = all[(index[i] as usize).min(last)];
        }
        let mut levels = [0_f32; N];
        for i in 0..N {
            let level = |shift: u32| (quads[i] >> shift & 255) as i32 as f32;
            let above = level(0) + right[i] * (level(8) - level(0));
            let below = level(16) + right[i] * (level(24) - level(16));
            levels[i] = above + down[i] * (below - above);
        }
        levels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_of_gray_levels_is_interpolated_exactly() {
        let data: Vec<u8> = (0..20 * 10).map(|i| (5 * (i % 20) + 7 * (i / 20)) as u8).collect();
        let mut image = QuadImage::default();
        image.copy(ImageView::new(&data, 20, 10, 20).unwrap());
        let (x, y) = ([1.0, 3.25, 10.5, 17.999], [1.0, 2.5, 7.75, 1.001]);
        for (i, level) in image.sample(&x, &y).into_iter().enumerate() {
            assert!((level - (5.0 * x[i] + 7.0 * y[i])).abs() < 1e-3, "{level} at {} {}", x[i], y[i]);
        }
        let mean = data.iter().map(|&level| f32::from(level)).sum::<f32>() / 200.0;
        assert!((image.mean() - mean).abs() < 1e-3);
    }
}
