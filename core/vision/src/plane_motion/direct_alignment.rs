//! Correction of motion and mount by direct alignment of the near floor, before any single point is judged.
//!
//! Minimizes the difference between the current picture and the previous one, warped by the floor's homography, over
//! motion and mount. Lucas & Kanade (1981); Bergen et al. (1992). Differs from these: the gradient is the mean of both
//! pictures' gradients, that of the current one carried through the warp, and is computed once for each scale.

use nalgebra::{Matrix3, SMatrix};
use yamabico_geometry::Pose2;

use super::band_pass::{BAND_UNIT, BandImage};
use super::floor_view::FloorView;
use super::look_history::SCALES_PX;
use super::motion_prior::{CommonCovariance, CommonMode};
use crate::vectorize::{self, Kernel};

/// Distance up to which the floor is aligned, m.
pub const REACH_M: f64 = 2.5;
/// Spacing of the aligned pixels in the coarse and in the fine picture, at a width of 256 px.
const SPACING_PX: [f64; 2] = [4.0, 3.0];
/// Maximum number of steps in the coarse and in the fine picture.
const ROUNDS: [usize; 2] = [4, 6];
/// Standard deviations of distance (m) and turn (rad) up to which the fine picture alone is aligned.
const FINE_SIGMAS: [f64; 2] = [5e-3, 2.8e-3];
/// Area that tells as much as one independent pixel, square pixels at a width of 256 px, for a sigma of 1 px.
const CORRELATED_PX2: f64 = 36.0;
/// Fewest pixels in both pictures.
const MIN_PIXELS: usize = 200;
/// Smallest standard deviation of a difference, gray levels.
const MIN_SIGMA: f32 = 0.5;
/// Step below which the alignment has converged (m, rad).
const CONVERGED: f64 = 1e-4;
/// Pixels processed together.
const CHUNK: usize = 32;
/// Border that the previous picture must leave around a pixel, px.
const BORDER: f32 = 4.0;
const NONE: f32 = 1e9;

type Slopes = SMatrix<f64, 5, 5>;

/// Motion and mount after alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// Corrected motion.
    pub motion: Pose2,
    /// Tilt of the camera beyond its mount, rad.
    pub tilt: f64,
    /// Roll of the camera beyond its mount, rad.
    pub roll: f64,
    /// Covariance of motion, tilt and roll.
    pub covariance: CommonCovariance,
    /// Number of pixels compared; 0 if there were too few and the prior was kept.
    pub pixels: usize,
    /// Number of pixels that moved with the floor.
    pub inliers: usize,
}

impl Alignment {
    /// True if less than 60 % of the near floor moved as one plane: something hides it, and nothing may be judged.
    #[must_use]
    pub fn is_misregistered(&self) -> bool {
        self.pixels > 0 && (self.inliers as f64) < 0.6 * self.pixels as f64
    }
}

/// Odometry and mount before the alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentPrior {
    /// Motion by odometry.
    pub motion: Pose2,
    /// Covariance of motion, tilt and roll.
    pub covariance: CommonCovariance,
    /// Current estimate of the camera's tilt beyond its mount, rad. The prior of tilt and roll lies half-way back.
    pub tilt: f64,
    /// Current estimate of the camera's roll beyond its mount, rad.
    pub roll: f64,
}

/// Aligned pixels of one scale, as columns.
#[derive(Clone, Debug, Default)]
struct Pixels {
    u: Vec<f32>,
    v: Vec<f32>,
    level: Vec<f32>,
    /// Derivative of the warped previous picture by motion, tilt and roll.
    slopes: [Vec<f32>; 5],
    residual: Vec<f32>,
    /// Weight of a pixel by its spacing and scale.
    information: f64,
}

/// Aligns the near floor of two pictures. Allocates when it is created and no more.
#[derive(Clone, Debug)]
pub struct DirectAligner {
    view: FloorView,
    scales: [Pixels; 2],
    sorted: Vec<f32>,
}

impl DirectAligner {
    /// Creates an aligner for the camera.
    #[must_use]
    pub fn new(view: FloorView) -> Self {
        let [width, height] = view.intrinsics().size();
        let (scale, top) = (f64::from(width) / 256.0, Self::top_row(&view).max(4));
        let scales = [0, 1].map(|i| {
            let spacing = (SPACING_PX[i] * scale).round().max(1.0) as usize;
            let mut pixels = Pixels::default();
            for v in (top..(height as usize).saturating_sub(4)).step_by(spacing) {
                for u in (6..(width as usize).saturating_sub(4)).step_by(spacing) {
                    pixels.u.push(u as f32);
                    pixels.v.push(v as f32);
                }
            }
            // Whole chunks: repeated pixels without slope are added at the end.
            let whole = pixels.u.len().next_multiple_of(CHUNK);
            pixels.u.resize(whole, -1.0);
            pixels.v.resize(whole, -1.0);
            pixels.level = vec![0.0; whole];
            pixels.residual = vec![NONE; whole];
            pixels.slopes = std::array::from_fn(|_| vec![0.0; whole]);
            let sigma = SCALES_PX[i] * scale.sqrt();
            pixels.information = (SPACING_PX[i].powi(2) / (CORRELATED_PX2 * sigma.max(1.0))).min(1.0);
            pixels
        });
        let sorted = Vec::with_capacity(scales[1].u.len());
        Self { view, scales, sorted }
    }

    /// First row that shows the floor within [`REACH_M`].
    #[must_use]
    pub fn top_row(view: &FloorView) -> usize {
        let far = nalgebra::Vector3::new(view.position().x + REACH_M, view.position().y, 0.0);
        let height = view.intrinsics().height as usize;
        view.project(&view.camera_from_robot(&far)).map_or(0, |p| (p.y.max(0.0) as usize).min(height))
    }

    /// Aligns the pictures with these bands, coarse and fine.
    pub fn align(
        &mut self,
        current: &[BandImage; 2],
        previous: &[BandImage; 2],
        prior: &AlignmentPrior,
    ) -> Alignment {
        let kept = Alignment {
            motion: prior.motion,
            tilt: prior.tilt,
            roll: prior.roll,
            covariance: prior.covariance,
            pixels: 0,
            inliers: 0,
        };
        let Some(information) = prior.covariance.try_inverse() else { return kept };
        let expected = CommonMode::new(0.0, 0.0, 0.0, -0.5 * prior.tilt, -0.5 * prior.roll);
        let mut offset = CommonMode::zeros();
        let mut best = kept;
        let is_near = prior.covariance[(0, 0)] < FINE_SIGMAS[0] * FINE_SIGMAS[0]
            && prior.covariance[(2, 2)] < FINE_SIGMAS[1] * FINE_SIGMAS[1];
        for scale in usize::from(is_near)..2 {
            let homography = Homography::new(&self.view, prior, &offset);
            self.scales[scale].prepare(&current[scale], &previous[scale], &homography);
            for _ in 0..ROUNDS[scale] {
                let homography = self.warp(prior, &offset);
                let pixels = &mut self.scales[scale];
                let count = pixels.compare(&previous[scale], &homography);
                if count < MIN_PIXELS {
                    return kept;
                }
                let sigma = median_size(&pixels.residual, &mut self.sorted).max(MIN_SIGMA);
                let (sums, gradient, inliers) = pixels.sums(sigma);
                let weight = pixels.information / f64::from(sigma * sigma);
                let normal = sums * weight + information;
                let right = gradient * weight - information * (offset - expected);
                let Some(covariance) = normal.try_inverse() else { return kept };
                let step = covariance * right;
                offset += step;
                best = Alignment { covariance, pixels: count, inliers, ..best };
                if step.amax() < CONVERGED {
                    break;
                }
            }
        }
        let motion = &prior.motion;
        Alignment {
            motion: Pose2::new(motion.x + offset[0], motion.y + offset[1], motion.theta + offset[2]),
            tilt: prior.tilt + offset[3],
            roll: prior.roll + offset[4],
            ..best
        }
    }

    fn warp(&self, prior: &AlignmentPrior, offset: &CommonMode) -> Matrix3<f32> {
        warp(&self.view, prior, offset).cast()
    }
}

fn warp(view: &FloorView, prior: &AlignmentPrior, offset: &CommonMode) -> Matrix3<f64> {
    let motion = &prior.motion;
    let motion = Pose2 { x: motion.x + offset[0], y: motion.y + offset[1], theta: motion.theta + offset[2] };
    view.turned(prior.tilt + offset[3], prior.roll + offset[4]).homography(&motion, 0.0)
}

/// A homography with its derivatives by motion, tilt and roll.
struct Homography {
    matrix: Matrix3<f32>,
    slopes: [Matrix3<f32>; 5],
}

impl Homography {
    fn new(view: &FloorView, prior: &AlignmentPrior, offset: &CommonMode) -> Self {
        const STEP: f64 = 1e-5;
        let slopes = std::array::from_fn(|i| {
            let mut step = CommonMode::zeros();
            step[i] = STEP;
            let (ahead, behind) = (warp(view, prior, &(offset + step)), warp(view, prior, &(offset - step)));
            ((ahead - behind) / (2.0 * STEP)).cast()
        });
        Self { matrix: warp(view, prior, offset).cast(), slopes }
    }
}

impl Pixels {
    /// Reads levels from the current picture, and slopes from both.
    fn prepare(&mut self, current: &BandImage, previous: &BandImage, homography: &Homography) {
        vectorize::run(Prepare { pixels: self, current, previous, homography });
    }

    /// Differences of the pictures under the homography; returns the number of pixels that both show.
    fn compare(&mut self, previous: &BandImage, homography: &Matrix3<f32>) -> usize {
        vectorize::run(Compare { pixels: self, previous, homography })
    }

    /// Sums of the normal equations with Tukey weights, and the number of pixels with weight.
    fn sums(&self, sigma: f32) -> (Slopes, CommonMode, usize) {
        vectorize::run(Sums { pixels: self, sigma })
    }
}

struct Prepare<'a> {
    pixels: &'a mut Pixels,
    current: &'a BandImage,
    previous: &'a BandImage,
    homography: &'a Homography,
}

impl Kernel for Prepare<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { pixels, current, previous, homography: Homography { matrix: h, slopes } } = self;
        let row = |m: &Matrix3<f32>, k: usize, u: f32, v: f32| m[(k, 0)] * u + m[(k, 1)] * v + m[(k, 2)];
        let places = pixels.u.as_chunks::<CHUNK>().0.iter().zip(pixels.v.as_chunks::<CHUNK>().0);
        let levels = pixels.level.as_chunks_mut::<CHUNK>().0;
        for (chunk, ((u, v), level)) in places.zip(levels).enumerate() {
            // Gradient: half the sum of that in the previous picture, and that of the current one through the inverse of the warp.
            let (mut px, mut py) = ([0_f32; CHUNK], [0_f32; CHUNK]);
            for i in 0..CHUNK {
                (level[i], px[i], py[i]) = current.level_and_gradient(u[i], v[i]);
            }
            let (mut x, mut y, mut half) = ([0_f32; CHUNK], [0_f32; CHUNK], [0_f32; CHUNK]);
            for i in 0..CHUNK {
                let inverse = 1.0 / row(h, 2, u[i], v[i]);
                (x[i], y[i]) = (row(h, 0, u[i], v[i]) * inverse, row(h, 1, u[i], v[i]) * inverse);
                let of_x = |k: usize| (h[(0, k)] - x[i] * h[(2, k)]) * inverse;
                let of_y = |k: usize| (h[(1, k)] - y[i] * h[(2, k)]) * inverse;
                let (xu, xv, yu, yv) = (of_x(0), of_x(1), of_y(0), of_y(1));
                let determinant = xu * yv - xv * yu;
                (px[i], py[i]) =
                    ((px[i] * yv - py[i] * yu) / determinant, (py[i] * xu - px[i] * xv) / determinant);
                half[i] = 0.5 * inverse;
            }
            for i in 0..CHUNK {
                let (_, there_x, there_y) = previous.level_and_gradient(x[i] + 0.5, y[i] + 0.5);
                (px[i], py[i]) = (half[i] * (px[i] + there_x), half[i] * (py[i] + there_y));
            }
            for (slope, m) in pixels.slopes.iter_mut().zip(slopes) {
                let Some(slope) = slope.as_chunks_mut::<CHUNK>().0.get_mut(chunk) else { continue };
                for i in 0..CHUNK {
                    let lost = row(m, 2, u[i], v[i]);
                    let value = px[i] * (row(m, 0, u[i], v[i]) - x[i] * lost)
                        + py[i] * (row(m, 1, u[i], v[i]) - y[i] * lost);
                    slope[i] = if value.is_finite() { value } else { 0.0 };
                }
            }
        }
    }
}

struct Compare<'a> {
    pixels: &'a mut Pixels,
    previous: &'a BandImage,
    homography: &'a Matrix3<f32>,
}

impl Kernel for Compare<'_> {
    type Output = usize;

    #[inline(always)]
    fn run(self) -> usize {
        let Self { pixels, previous, homography: h } = self;
        let (width, levels) = (previous.width(), previous.levels());
        let rows = levels.len() / width.max(1);
        let (right, bottom) = (width as f32 - BORDER, (rows as f32) - BORDER);
        let top = previous.top() as f32;
        let mut count = 0;
        for begin in (0..pixels.u.len()).step_by(CHUNK) {
            let range = begin..begin + CHUNK;
            let (u, v) = (&pixels.u[range.clone()], &pixels.v[range.clone()]);
            let level = &pixels.level[range.clone()];
            let residual = &mut pixels.residual[range];
            let (mut x, mut y) = ([0_f32; CHUNK], [0_f32; CHUNK]);
            for i in 0..CHUNK {
                let inverse = 1.0 / (h[(2, 0)] * u[i] + h[(2, 1)] * v[i] + h[(2, 2)]);
                x[i] = (h[(0, 0)] * u[i] + h[(0, 1)] * v[i] + h[(0, 2)]) * inverse;
                y[i] = (h[(1, 0)] * u[i] + h[(1, 1)] * v[i] + h[(1, 2)]) * inverse - top;
            }
            for i in 0..CHUNK {
                let inside = (x[i] > BORDER - 1.0) & (x[i] < right) & (y[i] > 0.0) & (y[i] < bottom);
                if !(inside & (u[i] >= 0.0)) {
                    residual[i] = NONE;
                    continue;
                }
                let (left, above) = (x[i] as u32 as usize, y[i] as u32 as usize);
                let (dx, dy) = (x[i] - left as f32, y[i] - above as f32);
                let at = above * width + left;
                let pair =
                    |at: usize| levels.get(at..at + 2).map_or((0.0, 0.0), |p| (p[0].into(), p[1].into()));
                let ((a, b), (c, d)) = (pair(at), pair(at + width));
                let (upper, lower): (f32, f32) = (a + dx * (b - a), c + dx * (d - c));
                residual[i] = (level[i] - (upper + dy * (lower - upper))) * (1.0 / BAND_UNIT);
                count += 1;
            }
        }
        count
    }
}

struct Sums<'a> {
    pixels: &'a Pixels,
    sigma: f32,
}

impl Kernel for Sums<'_> {
    type Output = (Slopes, CommonMode, usize);

    #[inline(always)]
    fn run(self) -> Self::Output {
        const LANES: usize = 8;
        let Self { pixels, sigma } = self;
        let bound = 1.0 / (9.0 * sigma * sigma);
        let (mut products, mut gradient) = ([[0_f32; LANES]; 15], [[0_f32; LANES]; 5]);
        let mut inliers = [0_u32; LANES];
        let [a, b, c, d, e] = pixels.slopes.each_ref().map(|slopes| slopes.as_chunks::<LANES>().0);
        for (chunk, residual) in pixels.residual.as_chunks::<LANES>().0.iter().enumerate() {
            let slopes = [&a[chunk], &b[chunk], &c[chunk], &d[chunk], &e[chunk]];
            let mut weight = [0_f32; LANES];
            for i in 0..LANES {
                let share = (1.0 - residual[i] * residual[i] * bound).max(0.0);
                inliers[i] += u32::from(share > 0.0);
                weight[i] = share * share;
            }
            let mut weighted = [[0_f32; LANES]; 5];
            for ((weighted, gradient), slope) in weighted.iter_mut().zip(&mut gradient).zip(slopes) {
                for i in 0..LANES {
                    weighted[i] = weight[i] * slope[i];
                    gradient[i] += weighted[i] * residual[i];
                }
            }
            let mut entry = 0;
            for (k, weighted) in weighted.iter().enumerate() {
                for slope in &slopes[k..] {
                    for i in 0..LANES {
                        products[entry][i] += weighted[i] * slope[i];
                    }
                    entry += 1;
                }
            }
        }
        let total = |lanes: &[f32; LANES]| lanes.iter().map(|&x| f64::from(x)).sum::<f64>();
        // Slopes are in units of the band-passed picture.
        let unit = 1.0 / f64::from(BAND_UNIT);
        let (mut sums, mut entry) = (Slopes::zeros(), 0);
        for k in 0..5 {
            for l in k..5 {
                sums[(k, l)] = total(&products[entry]) * unit * unit;
                sums[(l, k)] = sums[(k, l)];
                entry += 1;
            }
        }
        (sums, CommonMode::from_fn(|k, _| total(&gradient[k]) * unit), inliers.iter().sum::<u32>() as usize)
    }
}

/// Standard deviation by the median size of every fourth residual.
fn median_size(residual: &[f32], sorted: &mut Vec<f32>) -> f32 {
    sorted.clear();
    let step = if residual.len() > 2000 { 4 } else { 1 };
    sorted.extend(residual.iter().step_by(step).filter(|r| **r < NONE).map(|r| r.abs()));
    if sorted.is_empty() {
        return MIN_SIGMA;
    }
    let middle = sorted.len() / 2;
    1.4826 * *sorted.select_nth_unstable_by(middle, f32::total_cmp).1
}
