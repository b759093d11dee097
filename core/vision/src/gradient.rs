//! Scharr gradient, with or without 5x5 binomial smoothing, in one pass over the rows.

use super::vectorize::{self, Kernel};
use yamabico_geometry::image::ImageView;

/// Value of [`Gradient::gx`] for a step of one gray level between two columns, from [`Scharr::gradient`].
pub const SCHARR_UNIT: i32 = 16;
/// Fixed-point scale of the smoothed image: quarters of a gray level.
pub const SMOOTH_UNIT: i32 = 4;

/// Gradient of an image as two contiguous planes.
#[derive(Clone, Debug, Default)]
pub struct Gradient {
    width: usize,
    gx: Vec<i16>,
    gy: Vec<i16>,
}

impl Gradient {
    /// Width, px.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Derivative along u, row by row, in 1/16 gray level (unsmoothed) or 1/64 gray level (smoothed) of a step between
    /// two pixels.
    pub fn gx(&self) -> &[i16] {
        &self.gx
    }

    /// Derivative along v, row by row; unit as in [`Gradient::gx`].
    pub fn gy(&self) -> &[i16] {
        &self.gy
    }

    fn resize(&mut self, width: usize, height: usize) {
        self.width = width;
        self.gx.resize(width * height, 0);
        self.gy.resize(width * height, 0);
    }
}

/// Scharr operator (3 10 3) with its row buffers. The border is replicated.
#[derive(Clone, Debug, Default)]
pub struct Scharr {
    rows: GradientRows,
}

impl Scharr {
    /// Computes the gradient of the unsmoothed image.
    pub fn gradient(&mut self, image: ImageView, out: &mut Gradient) {
        self.run(image, Smoothing::None, out);
    }

    /// Computes the gradient after 5x5 binomial smoothing (1 4 6 4 1)/16.
    pub fn smoothed_gradient(&mut self, image: ImageView, out: &mut Gradient) {
        self.run(image, Smoothing::Binomial5, out);
    }

    fn run(&mut self, image: ImageView, smoothing: Smoothing, out: &mut Gradient) {
        out.resize(image.width(), image.height());
        self.rows.start(image.width(), smoothing);
        vectorize::run(WholeImage { image, rows: &mut self.rows, out });
    }
}

struct WholeImage<'a> {
    image: ImageView<'a>,
    rows: &'a mut GradientRows,
    out: &'a mut Gradient,
}

impl Kernel for WholeImage<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let width = self.image.width();
        let rows = self.out.gx.chunks_exact_mut(width).zip(self.out.gy.chunks_exact_mut(width));
        for (v, (gx, gy)) in rows.enumerate() {
            self.rows.row(self.image, v, gx, gy);
        }
    }
}

/// Smoothing before differentiation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Smoothing {
    #[default]
    None,
    Binomial5,
}

/// Row-by-row gradient, from a ring buffer of three (smoothed) rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct GradientRows {
    smoothing: Smoothing,
    /// Row v of the (smoothed) image in slot v % 3, with one replicated pixel on either side.
    ring: [Vec<i16>; 3],
    /// Column sums, with room for two replicated pixels on either side.
    across: Vec<i16>,
    along: Vec<i16>,
}

impl GradientRows {
    /// Prepares for an image of this width.
    pub(crate) fn start(&mut self, width: usize, smoothing: Smoothing) {
        self.smoothing = smoothing;
        for row in &mut self.ring {
            row.resize(width + 2, 0);
        }
        self.across.resize(width + 4, 0);
        self.along.resize(width + 4, 0);
    }

    /// Writes the gradient of row `v`. Must be called for v = 0, 1, 2, ... in this order.
    #[inline(always)]
    pub(crate) fn row(&mut self, image: ImageView, v: usize, gx: &mut [i16], gy: &mut [i16]) {
        let last = image.height() - 1;
        if v == 0 {
            self.fill(image, 0, 2);
            self.fill(image, 0, 0);
        }
        self.fill(image, (v + 1).min(last), (v + 1) % 3);
        let [above, here, below] = [(v + 2) % 3, v % 3, (v + 1) % 3].map(|slot| &self.ring[slot]);
        scharr_row([above, here, below], &mut self.across, &mut self.along, gx, gy);
    }

    #[inline(always)]
    fn fill(&mut self, image: ImageView, v: usize, slot: usize) {
        let width = image.width();
        let out = &mut self.ring[slot];
        match self.smoothing {
            Smoothing::None => {
                for (out, &p) in out[1..=width].iter_mut().zip(image.row(v)) {
                    *out = i16::from(p);
                }
            }
            Smoothing::Binomial5 => {
                let rows = [v.saturating_sub(2), v.saturating_sub(1), v, v + 1, v + 2].map(|v| image.row(v));
                smooth_row(rows, &mut self.across, &mut out[1..=width]);
            }
        }
        out[0] = out[1];
        out[width + 1] = out[width];
    }
}

/// 5x5 binomial of five rows, in quarters of a gray level.
#[inline(always)]
fn smooth_row(rows: [&[u8]; 5], sums: &mut [i16], out: &mut [i16]) {
    let width = out.len();
    let [a, b, c, d, e] = rows.map(|row| &row[..width]);
    {
        let sums = &mut sums[2..width + 2];
        for u in 0..width {
            let outer = u16::from(a[u]) + u16::from(e[u]);
            let inner = u16::from(b[u]) + u16::from(d[u]);
            sums[u] = (outer + 4 * inner + 6 * u16::from(c[u])) as i16;
        }
    }
    let (first, last) = (sums[2], sums[width + 1]);
    sums[..2].fill(first);
    sums[width + 2..width + 4].fill(last);
    let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|shift| &sums[shift..shift + width]);
    for u in 0..width {
        let outer = a[u] as u16 + e[u] as u16;
        let inner = b[u] as u16 + d[u] as u16;
        out[u] = ((outer + 4 * inner + 6 * c[u] as u16 + 32) >> 6) as i16;
    }
}

/// Scharr gradient of the middle of three rows, each with one replicated pixel on either side.
#[inline(always)]
fn scharr_row(rows: [&Vec<i16>; 3], across: &mut [i16], along: &mut [i16], gx: &mut [i16], gy: &mut [i16]) {
    let width = gx.len();
    let [a, b, c] = rows.map(|row| &row[..width + 2]);
    {
        let (across, along) = (&mut across[..width + 2], &mut along[..width + 2]);
        for u in 0..width + 2 {
            across[u] = 3 * (a[u] + c[u]) + 10 * b[u];
            along[u] = c[u] - a[u];
        }
    }
    let (left, right) = (&across[..width], &across[2..width + 2]);
    let (l, m, r) = (&along[..width], &along[1..width + 1], &along[2..width + 2]);
    let gy = &mut gy[..width];
    for u in 0..width {
        gx[u] = right[u] - left[u];
        gy[u] = 3 * (l[u] + r[u]) + 10 * m[u];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Smoothing by definition: 5x5 sum, then rounding to quarters; the fast path does not truncate before that.
    fn smoothed(image: ImageView, u: isize, v: isize) -> i32 {
        let weight = [1, 4, 6, 4, 1];
        let (u, v) = (u.clamp(0, image.width() as isize - 1), v.clamp(0, image.height() as isize - 1));
        let mut sum = 0;
        for (j, wj) in weight.iter().enumerate() {
            for (i, wi) in weight.iter().enumerate() {
                let (x, y) = ((u + i as isize - 2).max(0) as usize, (v + j as isize - 2).max(0) as usize);
                sum += wi * wj * i32::from(image.pixel(x, y));
            }
        }
        (sum + 32) >> 6
    }

    fn scharr(at: impl Fn(isize, isize) -> i32, u: isize, v: isize) -> (i16, i16) {
        let x = |du, dv| at(u + du, v + dv);
        let gx = 3 * (x(1, -1) - x(-1, -1)) + 10 * (x(1, 0) - x(-1, 0)) + 3 * (x(1, 1) - x(-1, 1));
        let gy = 3 * (x(-1, 1) - x(-1, -1)) + 10 * (x(0, 1) - x(0, -1)) + 3 * (x(1, 1) - x(1, -1));
        (gx as i16, gy as i16)
    }

    fn bare(image: ImageView, u: isize, v: isize) -> i32 {
        i32::from(image.pixel(u.max(0) as usize, v.max(0) as usize))
    }

    #[test]
    fn equals_the_definition_on_every_size_and_instruction_set() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(6);
        let (mut operator, mut out, mut base) = (Scharr::default(), Gradient::default(), Gradient::default());
        for (width, height) in [(1, 1), (2, 1), (1, 3), (5, 2), (33, 6), (70, 9)] {
            let data: Vec<u8> = (0..width * height)
                .map(|_| if random.random::<bool>() { 255 } else { random.random::<u8>() & 1 })
                .collect();
            let image = ImageView::new(&data, width, height, width).unwrap();
            for smoothing in [Smoothing::None, Smoothing::Binomial5] {
                operator.run(image, smoothing, &mut out);
                base.resize(width, height);
                operator.rows.start(width, smoothing);
                WholeImage { image, rows: &mut operator.rows, out: &mut base }.run();
                for v in 0..height {
                    for u in 0..width {
                        let expected = match smoothing {
                            Smoothing::None => scharr(|u, v| bare(image, u, v), u as isize, v as isize),
                            Smoothing::Binomial5 => {
                                scharr(|u, v| smoothed(image, u, v), u as isize, v as isize)
                            }
                        };
                        let i = v * width + u;
                        assert_eq!((out.gx[i], out.gy[i]), expected, "{width} x {height} at {u} {v}");
                        assert_eq!((base.gx[i], base.gy[i]), expected, "base instruction set");
                    }
                }
            }
        }
    }

    #[test]
    fn a_unit_step_has_the_stated_unit() {
        let data = [10, 10, 11, 11];
        let image = ImageView::new(&data, 4, 1, 4).unwrap();
        let mut out = Gradient::default();
        Scharr::default().gradient(image, &mut out);
        assert_eq!(i32::from(out.gx()[1]), SCHARR_UNIT);
    }
}
