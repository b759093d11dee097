//! Edge points: local maxima of the gradient magnitude, each with the sector of its gradient direction.

use crate::gradient::{GradientRows, SCHARR_UNIT, SMOOTH_UNIT, Smoothing};
use crate::vectorize::{self, Kernel};
use yamabico_geometry::image::ImageView;

/// Gradient units for a step of one gray level between two adjacent pixels.
pub(super) const UNITS_PER_LEVEL: f32 = (SCHARR_UNIT * SMOOTH_UNIT) as f32;
/// Number of sectors of the gradient direction: 22.5 degrees each, from +u toward +v.
pub(super) const SECTORS: usize = 16;

/// Flag of every edge pixel in its mark.
pub(super) const EDGE: u8 = 0x10;
/// Flag of an edge pixel that reaches the high threshold.
pub(super) const STRONG: u8 = 0x20;
/// Bits of a mark that hold its sector.
pub(super) const SECTOR: u8 = 0x0f;
/// tan(22.5 degrees) in units of 1/65536.
const TAN_SECTOR: u32 = 27_146;

/// Edge point with sub-pixel position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct EdgePoint {
    /// Column, px.
    pub u: f32,
    /// Row, px.
    pub v: f32,
    /// Gradient along u, in [`UNITS_PER_LEVEL`].
    pub gx: f32,
    /// Gradient along v, in [`UNITS_PER_LEVEL`].
    pub gy: f32,
}

/// Edge pixels of one image, with its gradient.
#[derive(Clone, Debug, Default)]
pub(super) struct EdgeMap {
    width: usize,
    per_width: f64,
    /// One mark per pixel, row by row; 0 where there is no edge. Border pixels are never edges.
    pub marks: Vec<u8>,
    /// Gradient (along u, along v) of every pixel.
    gradient: Vec<[i16; 2]>,
    /// Gradient of the current row and of the two rows before it, in slot v % 3.
    gx: [Vec<i16>; 3],
    gy: [Vec<i16>; 3],
    rows: GradientRows,
}

impl EdgeMap {
    /// Marks the pixels of `image` whose smoothed gradient is a local maximum along the axis nearest to its direction
    /// and at least `low` (in [`UNITS_PER_LEVEL`]); those of at least `high` are marked as strong.
    ///
    /// Two axes leave one point per row (or column) of a straight edge. Differs from the usual four directions:
    /// diagonals would sample an edge 1.4 times more coarsely and mix two spacings along one edge. The magnitude is max
    /// + 3/8 min of the two derivatives, within 7 % of the Euclidean norm.
    pub(super) fn find(&mut self, image: ImageView, low: f32, high: f32) {
        let count = image.width() * image.height();
        self.width = image.width();
        self.per_width = 1.0 / image.width() as f64;
        self.marks.clear();
        self.marks.resize(count, 0);
        self.gradient.resize(count, [0; 2]);
        for row in self.gx.iter_mut().chain(&mut self.gy) {
            row.resize(image.width(), 0);
        }
        self.rows.start(image.width(), Smoothing::Binomial5);
        vectorize::run(Find { image, low: low as i16, high: high as i16, map: self });
    }

    /// Image width, px.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    #[inline(always)]
    fn gradient_at(&self, index: usize) -> (i32, i32) {
        let [gx, gy] = self.gradient[index];
        (i32::from(gx), i32::from(gy))
    }

    /// Sub-pixel position of edge pixel `index` (row by row, not a border pixel): the vertex of the parabola through
    /// the directional derivative at the pixel and its two neighbors along the nearest axis.
    #[inline(always)]
    pub(super) fn point(&self, index: usize) -> EdgePoint {
        let (gx, gy) = self.gradient_at(index);
        let is_steep = gx.abs() >= gy.abs();
        let step = if is_steep { 1 } else { self.width };
        let (before_x, before_y) = self.gradient_at(index - step);
        let (after_x, after_y) = self.gradient_at(index + step);
        let before = (gx * before_x + gy * before_y) as f32;
        let after = (gx * after_x + gy * after_y) as f32;
        let curvature = (2.0 * (gx * gx + gy * gy) as f32 - before - after).max(1.0);
        let offset = (0.5 * (after - before) / curvature).clamp(-0.5, 0.5);
        // Division by a reciprocal: the half keeps the quotient off the integers, so the result is exact, without the
        // divider's latency.
        let row = ((index as f64 + 0.5) * self.per_width) as usize;
        let column = index - row * self.width;
        let (du, dv) = if is_steep { (offset, 0.0) } else { (0.0, offset) };
        EdgePoint { u: column as f32 + du, v: row as f32 + dv, gx: gx as f32, gy: gy as f32 }
    }
}

struct Find<'a> {
    image: ImageView<'a>,
    low: i16,
    high: i16,
    map: &'a mut EdgeMap,
}

impl Kernel for Find<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { image, low, high, map } = self;
        let width = map.width;
        for v in 0..image.height() {
            let here = v * width;
            let (gx, gy) = (&mut map.gx[v % 3], &mut map.gy[v % 3]);
            map.rows.row(image, v, gx, gy);
            for ((pair, &x), &y) in map.gradient[here..here + width].iter_mut().zip(gx.iter()).zip(gy.iter())
            {
                *pair = [x, y];
            }
            if v >= 2 && width >= 3 {
                let [above, middle, below] = [(v + 1) % 3, (v + 2) % 3, v % 3];
                let rows = Rows {
                    gx: &map.gx[middle],
                    gy: [above, middle, below].map(|slot| map.gy[slot].as_slice()),
                };
                mark_maxima(&rows, low, high, &mut map.marks[here - width..here]);
            }
        }
    }
}

/// Derivative along u of one row, and derivatives along v of the row above, the row itself and the row below.
struct Rows<'a> {
    gx: &'a [i16],
    gy: [&'a [i16]; 3],
}

#[inline(always)]
fn mark_maxima(rows: &Rows, low: i16, high: i16, marks: &mut [u8]) {
    let inner = marks.len() - 2;
    let [left, here, right] = [0, 1, 2].map(|shift| &rows.gx[shift..shift + inner]);
    let [up, middle, down] = rows.gy.map(|row| &row[1..=inner]);
    let marks = &mut marks[1..=inner];
    for u in 0..inner {
        let (gx, gy) = (here[u], middle[u]);
        let (x, y) = (gx.abs(), gy.abs());
        let (larger, smaller) = (x.max(y), x.min(y));
        let magnitude = larger + (smaller >> 2) + (smaller >> 3);
        let is_steep = x >= y;
        let across = (x > left[u].abs()) & (x >= right[u].abs());
        let upright = (y > up[u].abs()) & (y >= down[u].abs());
        let is_edge = ((is_steep & across) | (!is_steep & upright)) & (magnitude >= low);
        let is_oblique = smaller > ((larger as u32 * TAN_SECTOR) >> 16) as i16;
        // Sector within the first quadrant, mirrored below into the quadrant of the gradient.
        let first = if is_steep { is_oblique as i16 } else { 3 - is_oblique as i16 };
        let sector = first ^ ((gx >> 15) & 7) ^ ((gy >> 15) & 15);
        let strong = if magnitude >= high { i16::from(STRONG) } else { 0 };
        let mark = sector | i16::from(EDGE) | strong;
        marks[u] = if is_edge { mark as u8 } else { 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Returns an anti-aliased half plane, bright where u cos a + v sin a > rho.
    fn half_plane(width: usize, height: usize, angle: f64, rho: f64) -> Vec<u8> {
        let (sin, cos) = angle.sin_cos();
        let level = |u: usize, v: usize| {
            let d = (u as f64 * cos + v as f64 * sin - rho + 0.5).clamp(0.0, 1.0);
            (40.0 + 160.0 * d).round() as u8
        };
        (0..height).flat_map(|v| (0..width).map(move |u| level(u, v))).collect()
    }

    #[test]
    fn points_lie_on_the_edge_in_their_sector() {
        for degrees in [3.0_f64, 20.0, 30.0, 50.0, 77.0, 100.0, 170.0, 200.0, 250.0, 275.0, 345.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let rho = 32.3 * cos + 24.2 * sin;
            let data = half_plane(64, 48, degrees.to_radians(), rho);
            let mut edges = EdgeMap::default();
            let image = ImageView::new(&data, 64, 48, 64).unwrap();
            edges.find(image, 20.0 * UNITS_PER_LEVEL, 60.0 * UNITS_PER_LEVEL);
            let mut count = 0;
            for (index, &mark) in edges.marks.iter().enumerate().filter(|(_, mark)| **mark != 0) {
                let point = edges.point(index);
                if point.u < 4.0 || point.u > 59.0 || point.v < 4.0 || point.v > 43.0 {
                    continue;
                }
                let distance = f64::from(point.u) * cos + f64::from(point.v) * sin - rho;
                assert!(distance.abs() < 0.1, "{degrees}: {distance} at {point:?}");
                let sector = f64::from(mark & SECTOR);
                let off = (degrees - (sector + 0.5) * 22.5).rem_euclid(360.0);
                assert!(off.min(360.0 - off) < 16.0, "{degrees}: sector {sector}");
                assert_ne!(mark & STRONG, 0);
                count += 1;
            }
            assert!((30..70).contains(&count), "{degrees}: {count} points");
        }
    }

    #[test]
    fn both_instruction_sets_mark_the_same() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(7);
        for (width, height) in [(1, 1), (2, 9), (3, 3), (37, 11), (100, 8)] {
            let data: Vec<u8> = (0..width * height).map(|_| random.random()).collect();
            let image = ImageView::new(&data, width, height, width).unwrap();
            let mut fast = EdgeMap::default();
            fast.find(image, 4.0 * UNITS_PER_LEVEL, 9.0 * UNITS_PER_LEVEL);
            let mut base = fast.clone();
            base.marks.fill(0);
            let (low, high) = ((4.0 * UNITS_PER_LEVEL) as i16, (9.0 * UNITS_PER_LEVEL) as i16);
            Find { image, low, high, map: &mut base }.run();
            assert_eq!(fast.marks, base.marks, "{width} x {height}");
            assert!(width < 30 || fast.marks.iter().any(|&mark| mark != 0));
        }
    }
}
