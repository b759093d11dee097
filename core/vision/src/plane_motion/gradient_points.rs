//! Points whose gradient runs along their parallax line: only these measure height.

use nalgebra::{Vector2, Vector3};
use yamabico_geometry::image::ImageView;

use crate::gradient::{Gradient, Scharr};
use crate::vectorize::{self, Kernel};

/// Size of the cells with one point each, px at a width of 256 px.
const CELL_PX: f64 = 7.0;
/// Half the window over which the gradient's energy is summed, px.
const RADIUS: usize = 3;
/// Smallest energy of a point, squared gray levels per pixel.
const MIN_ENERGY: f32 = 48.0;
/// Maximum number of points.
pub const MAX_POINTS: usize = 350;
/// Share of the points from the upper rows, which show the tops of boxes from 2 to 4 m.
const FAR_SHARE: f64 = 0.65;
/// Distance of those rows below the principal point, px at a width of 256 px.
const FAR_ROWS_PX: f64 = 10.0;
/// Units of the gradient per gray level and pixel.
const UNIT: f32 = 128.0;

/// A point with a gradient along its parallax line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GradientPoint {
    /// Column, px.
    pub u: u32,
    /// Row, px.
    pub v: u32,
    /// Energy of the gradient along the parallax line, squared gray levels per pixel, summed over 7 x 7 pixels.
    pub energy: f32,
    /// Displacement along the parallax line (px) that changes the image like one of 1 px across it: 0 for an edge square
    /// to the line, large for one along it. Counted in the sense of the line turned by a quarter turn from u to v.
    pub skew: f32,
}

/// Finds gradient points. Allocates for its first image only.
#[derive(Clone, Debug, Default)]
pub struct GradientPoints {
    scharr: Scharr,
    gradient: Gradient,
    energy: Vec<f32>,
    columns: Vec<f32>,
    strips: Vec<f32>,
    points: Vec<GradientPoint>,
}

impl GradientPoints {
    /// Finds the points in the rows from `top` on, whose parallax lines run through the homogeneous pixel `epipole`.
    /// Most of them lie above the row `center_v` of the principal point, or little below it.
    pub fn find(
        &mut self,
        image: ImageView,
        epipole: Vector3<f64>,
        top: usize,
        center_v: f64,
    ) -> &[GradientPoint] {
        let (width, height) = (image.width(), image.height());
        let scale = width as f64 / 256.0;
        self.scharr.smoothed_gradient(image, &mut self.gradient);
        self.points.clear();
        let border = ((RADIUS as f64 + 4.0) * scale) as usize;
        let cell = ((CELL_PX * scale).round() as usize).max(1);
        let top = top.max(border);
        if height < top + cell + border || width < cell + 2 * border {
            return &self.points;
        }
        self.energy.resize(width * cell, 0.0);
        self.columns.resize(width, 0.0);
        self.strips.resize(width * (cell + 2 * RADIUS), 0.0);
        let mut v = top;
        while v + cell + border <= height {
            let cells = Cells {
                gradient: &self.gradient,
                epipole: epipole.cast(),
                rows: v..v + cell,
                border,
                strips: &mut self.strips,
                columns: &mut self.columns,
                energy: &mut self.energy,
                points: &mut self.points,
            };
            vectorize::run(cells);
            v += cell;
        }
        for point in &mut self.points {
            point.skew = skew(&self.gradient, epipole.cast(), point);
            point.energy /= 1.0 + point.skew * point.skew;
        }
        self.points.retain(|point| point.energy > MIN_ENERGY);
        let far = (center_v + FAR_ROWS_PX * scale).max(0.0) as u32;
        self.keep_strongest(far);
        &self.points
    }

    /// Keeps [`MAX_POINTS`], of which most lie above the row `far`.
    fn keep_strongest(&mut self, far: u32) {
        if self.points.len() <= MAX_POINTS {
            return;
        }
        let strongest_far = |p: &GradientPoint| (p.v >= far, -p.energy);
        self.points.sort_unstable_by(|a, b| {
            let (a, b) = (strongest_far(a), strongest_far(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        let far_count = self.points.partition_point(|p| p.v < far);
        let near_count = self.points.len() - far_count;
        let kept_far = far_count
            .min(((MAX_POINTS as f64 * FAR_SHARE) as usize).max(MAX_POINTS.saturating_sub(near_count)));
        let kept_near = MAX_POINTS - kept_far;
        self.points.copy_within(far_count..far_count + kept_near.min(near_count), kept_far);
        self.points.truncate(kept_far + kept_near.min(near_count));
    }
}

/// Ratio of the mixed and the pure sum of gradient products along and across the parallax line around a point.
fn skew(gradient: &Gradient, epipole: Vector3<f32>, point: &GradientPoint) -> f32 {
    let (u, v) = (point.u as usize, point.v as usize);
    let line = Vector2::new(u as f32 * epipole.z - epipole.x, v as f32 * epipole.z - epipole.y);
    let along = line.try_normalize(1e-12).unwrap_or(Vector2::x());
    let (mut xx, mut xy, mut yy) = (0.0_f32, 0.0_f32, 0.0_f32);
    for v in v.saturating_sub(RADIUS)..=v + RADIUS {
        let row = v * gradient.width();
        let window = row + u.saturating_sub(RADIUS)..row + u + RADIUS + 1;
        let (Some(gx), Some(gy)) = (gradient.gx().get(window.clone()), gradient.gy().get(window)) else {
            continue;
        };
        for (&gx, &gy) in gx.iter().zip(gy) {
            let (gx, gy) = (f32::from(gx), f32::from(gy));
            (xx, xy, yy) = (xx + gx * gx, xy + gx * gy, yy + gy * gy);
        }
    }
    let pure = xx * along.x * along.x + 2.0 * xy * along.x * along.y + yy * along.y * along.y;
    let mixed = (yy - xx) * along.x * along.y + xy * (along.x * along.x - along.y * along.y);
    mixed / pure.max(1e-6)
}

/// One row of cells.
struct Cells<'a> {
    gradient: &'a Gradient,
    epipole: Vector3<f32>,
    rows: std::ops::Range<usize>,
    border: usize,
    /// Squared gradient along the parallax line, of the cells' rows and [`RADIUS`] rows around.
    strips: &'a mut [f32],
    columns: &'a mut [f32],
    energy: &'a mut [f32],
    points: &'a mut Vec<GradientPoint>,
}

impl Kernel for Cells<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let width = self.gradient.width();
        let first = self.rows.start - RADIUS;
        for (i, strip) in self.strips.chunks_exact_mut(width).enumerate() {
            let v = first + i;
            let (gx, gy) =
                (&self.gradient.gx()[v * width..][..width], &self.gradient.gy()[v * width..][..width]);
            let dy = v as f32 * self.epipole.z - self.epipole.y;
            for (u, ((out, &gx), &gy)) in strip.iter_mut().zip(gx).zip(gy).enumerate() {
                let dx = u as i32 as f32 * self.epipole.z - self.epipole.x;
                let along = f32::from(gx) * dx + f32::from(gy) * dy;
                *out = along * along / ((dx * dx + dy * dy + 1e-12) * (UNIT * UNIT));
            }
        }
        let strips: &[f32] = self.strips;
        for (i, energy) in self.energy.chunks_exact_mut(width).enumerate() {
            self.columns.copy_from_slice(&strips[i * width..][..width]);
            for k in 1..=2 * RADIUS {
                for (sum, &value) in self.columns.iter_mut().zip(&strips[(i + k) * width..][..width]) {
                    *sum += value;
                }
            }
            let columns: &[f32] = self.columns;
            let inner = &mut energy[RADIUS..width - RADIUS];
            inner.copy_from_slice(&columns[..width - 2 * RADIUS]);
            for k in 1..=2 * RADIUS {
                for (sum, &value) in inner.iter_mut().zip(&columns[k..]) {
                    *sum += value;
                }
            }
        }
        let cell = self.rows.len();
        let mut u = self.border;
        while u + cell + self.border <= width {
            let mut best = GradientPoint { u: 0, v: 0, energy: MIN_ENERGY, skew: 0.0 };
            for (i, row) in self.energy.chunks_exact(width).enumerate() {
                for (k, &energy) in row[u..u + cell].iter().enumerate() {
                    if energy > best.energy {
                        best = GradientPoint {
                            u: (u + k) as u32,
                            v: (self.rows.start + i) as u32,
                            energy,
                            skew: 0.0,
                        };
                    }
                }
            }
            if best.v > 0 {
                self.points.push(best);
            }
            u += cell;
        }
    }
}
