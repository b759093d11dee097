//! Edge points: local maxima of the gradient with their sub-pixel place.

use crate::image::ImageView;
use crate::vision::gradient::{GradientRows, SCHARR_UNIT, SMOOTH_UNIT, Smoothing};
use crate::vision::vectorise::{self, Kernel};

/// Gradient units for one grey level of a step between two pixels.
pub(super) const UNITS_PER_LEVEL: f32 = (SCHARR_UNIT * SMOOTH_UNIT) as f32;

/// A local maximum of the gradient across an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EdgePoint {
    /// Sub-pixel column, px.
    pub u: f32,
    /// Sub-pixel row, px.
    pub v: f32,
    /// Gradient along u, in [`UNITS_PER_LEVEL`].
    pub gx: f32,
    /// Gradient along v.
    pub gy: f32,
}

impl EdgePoint {
    pub(super) fn squared_gradient(&self) -> f32 {
        self.gx * self.gx + self.gy * self.gy
    }
}

/// The edge points of one image, row by row, with the buffers that find them.
#[derive(Clone, Debug, Default)]
pub(super) struct EdgePoints {
    /// All points, sorted by row, then column.
    pub points: Vec<EdgePoint>,
    /// The pixel column of each point.
    pub columns: Vec<u16>,
    /// Where each row's points begin, and where the last row's end.
    pub row_starts: Vec<u32>,
    gradient: GradientRows,
    rows: [Row; 3],
    is_edge: Vec<u8>,
}

/// Gradient of one row and its absolute values.
#[derive(Clone, Debug, Default)]
struct Row {
    gx: Vec<i16>,
    gy: Vec<i16>,
    abs_gx: Vec<i16>,
    abs_gy: Vec<i16>,
}

impl EdgePoints {
    /// Finds all points of `image` (at most 65,535 columns) whose gradient is at least `threshold` (in
    /// [`UNITS_PER_LEVEL`]).
    ///
    /// A point is a maximum along the axis nearest to its gradient, which leaves one point a row (or column) of a straight
    /// edge. Differs from the usual four directions: the diagonals sample an edge 1.4 times more coarsely and give two
    /// spacings along one chain.
    pub(super) fn find(&mut self, image: ImageView, threshold: f32) {
        let width = image.width();
        self.points.clear();
        self.columns.clear();
        self.row_starts.clear();
        self.gradient.start(width, Smoothing::Binomial5);
        for row in &mut self.rows {
            for plane in [&mut row.gx, &mut row.gy, &mut row.abs_gx, &mut row.abs_gy] {
                plane.resize(width, 0);
            }
        }
        // Whole words are read behind the last pixel: they must hold no edge.
        self.is_edge.clear();
        self.is_edge.resize(width.next_multiple_of(8), 0);
        vectorise::run(Find { image, threshold, edges: self });
    }
}

struct Find<'a> {
    image: ImageView<'a>,
    threshold: f32,
    edges: &'a mut EdgePoints,
}

impl Kernel for Find<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { image, threshold, edges } = self;
        let height = image.height();
        for v in 0..height {
            let Row { gx, gy, abs_gx, abs_gy } = &mut edges.rows[v % 3];
            edges.gradient.row(image, v, gx, gy);
            absolute(gx, abs_gx);
            absolute(gy, abs_gy);
            if v >= 1 {
                edges.row_starts.push(edges.points.len() as u32);
            }
            if v >= 2 {
                let [above, here, below] = [(v + 1) % 3, (v + 2) % 3, v % 3].map(|slot| &edges.rows[slot]);
                mark_maxima(
                    above,
                    here,
                    below,
                    (threshold * std::f32::consts::FRAC_1_SQRT_2) as i16,
                    &mut edges.is_edge,
                );
                let found = Found { points: &mut edges.points, columns: &mut edges.columns };
                collect(&edges.is_edge, [above, here, below], v - 1, threshold * threshold, found);
            }
        }
        // The first and the last row hold no maxima.
        edges.row_starts.push(edges.points.len() as u32);
        edges.row_starts.push(edges.points.len() as u32);
    }
}

struct Found<'a> {
    points: &'a mut Vec<EdgePoint>,
    columns: &'a mut Vec<u16>,
}

#[inline(always)]
fn absolute(values: &[i16], out: &mut [i16]) {
    for (out, value) in out.iter_mut().zip(values) {
        *out = value.abs();
    }
}

/// Marks the pixels (1 in `is_edge`) whose dominant derivative reaches the threshold and is the largest along its axis.
#[inline(always)]
fn mark_maxima(above: &Row, here: &Row, below: &Row, threshold: i16, is_edge: &mut [u8]) {
    let width = here.gx.len();
    if width < 3 {
        return;
    }
    let inner = width - 2;
    let (left, right) = (&here.abs_gx[..inner], &here.abs_gx[2..]);
    let (x, y) = (&here.abs_gx[1..=inner], &here.abs_gy[1..=inner]);
    let (up, down) = (&above.abs_gy[1..=inner], &below.abs_gy[1..=inner]);
    let (right, is_edge) = (&right[..inner], &mut is_edge[1..=inner]);
    for u in 0..inner {
        let steep = x[u] >= y[u];
        let across = (x[u] > left[u]) & (x[u] >= right[u]) & (x[u] >= threshold);
        let down = (y[u] > up[u]) & (y[u] >= down[u]) & (y[u] >= threshold);
        is_edge[u] = ((steep & across) | (!steep & down)) as u8;
    }
}

#[inline(always)]
fn collect(is_edge: &[u8], rows: [&Row; 3], v: usize, squared_threshold: f32, found: Found) {
    let (words, _) = is_edge.as_chunks::<8>();
    for (w, word) in words.iter().enumerate() {
        let mut bits = u64::from_le_bytes(*word);
        while bits != 0 {
            let u = 8 * w + bits.trailing_zeros() as usize / 8;
            bits &= bits - 1;
            let point = sub_pixel_point(rows, u, v);
            if point.squared_gradient() >= squared_threshold {
                found.points.push(point);
                found.columns.push(u as u16);
            }
        }
    }
}

/// Parabola through the derivative along the point's own gradient, at the point and its two neighbours on the axis.
#[inline(always)]
fn sub_pixel_point(rows: [&Row; 3], u: usize, v: usize) -> EdgePoint {
    let [above, here, below] = rows;
    let (gx, gy) = (i32::from(here.gx[u]), i32::from(here.gy[u]));
    let along = |row: &Row, u: usize| (gx * i32::from(row.gx[u]) + gy * i32::from(row.gy[u])) as f32;
    let steep = gx.abs() >= gy.abs();
    let (before, after) =
        if steep { (along(here, u - 1), along(here, u + 1)) } else { (along(above, u), along(below, u)) };
    let curvature = before - 2.0 * along(here, u) + after;
    let offset = if curvature < 0.0 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 };
    let (du, dv) = if steep { (offset, 0.0) } else { (0.0, offset) };
    EdgePoint { u: u as f32 + du, v: v as f32 + dv, gx: gx as f32, gy: gy as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An anti-aliased half plane: bright where u cos a + v sin a > rho.
    fn half_plane(width: usize, height: usize, angle: f64, rho: f64) -> Vec<u8> {
        let (sin, cos) = angle.sin_cos();
        let level = |u: usize, v: usize| {
            let d = (u as f64 * cos + v as f64 * sin - rho + 0.5).clamp(0.0, 1.0);
            (40.0 + 160.0 * d).round() as u8
        };
        (0..height).flat_map(|v| (0..width).map(move |u| level(u, v))).collect()
    }

    #[test]
    fn points_lie_on_the_edge_one_a_row_or_column() {
        for degrees in [0.0_f64, 7.0, 20.0, 33.0, 45.0, 58.0, 77.0, 90.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let rho = 32.3 * cos + 24.2 * sin;
            let data = half_plane(64, 48, degrees.to_radians(), rho);
            let mut edges = EdgePoints::default();
            edges.find(ImageView::new(&data, 64, 48, 64).unwrap(), 20.0 * UNITS_PER_LEVEL);
            let inner: Vec<_> =
                edges.points.iter().filter(|p| p.u > 4.0 && p.u < 59.0 && p.v > 4.0 && p.v < 43.0).collect();
            let expected = if degrees < 45.1 { 38 } else { 54 };
            assert!(inner.len().abs_diff(expected) <= 16, "{degrees}: {} points", inner.len());
            for p in inner {
                let distance = f64::from(p.u) * cos + f64::from(p.v) * sin - rho;
                assert!(distance.abs() < 0.1, "{degrees}: {distance} at {p:?}");
                assert!(p.gx >= 0.0 || cos < 0.1);
            }
            assert_eq!(edges.row_starts.len(), 49);
        }
    }
}
