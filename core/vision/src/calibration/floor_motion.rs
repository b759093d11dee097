//! Height and pan of a camera from the motion of the floor between pictures whose distance odometry measures.
//!
//! A camera at height h that moves by d sees the floor move by d / h: pictures give the ratio, odometry gives d. The direction of the
//! motion in the picture gives the pan.

use nalgebra::{Isometry2, Matrix3, Point2, Point3, Vector2, Vector3};
use thiserror::Error;
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Mount, Pinhole};

use super::float_image::FloatImage;
use super::spread::block_jackknife;

/// Minimum number of pairs of pictures.
pub const MIN_PAIRS: usize = 6;
/// Number of pairs with which all heights are tried.
const MAX_SEARCHED: usize = 8;
/// Heights that are tried, m, each larger than the one before by this factor.
const HEIGHTS_M: [f64; 2] = [0.04, 2.5];
const HEIGHT_FACTOR: f64 = 1.04;
/// Pans that are tried, rad.
const MAX_PAN_RAD: f64 = 12.0 * std::f64::consts::PI / 180.0;
const PAN_STEPS: i32 = 4;
/// Part of the floor that is compared, in heights of the camera: ahead, and to each side.
const AHEAD: [f64; 2] = [1.2, 4.2];
const ASIDE: f64 = 0.8;
/// Side of a patch, in heights of the camera, and number of samples along it.
const PATCH: f64 = 0.25;
const SAMPLES: usize = 7;
/// Minimum standard deviation of the gray levels of a patch that counts.
const MIN_CONTRAST: f64 = 1.5;
/// Minimum number of patches in a pair.
const MIN_PATCHES: usize = 8;
/// Minimum mean correlation at the best height.
const MIN_CORRELATION: f64 = 0.3;
/// Correlation of another height, relative to the best, from which on the height is ambiguous; and the factor between two different heights.
const AMBIGUOUS: f64 = 0.93;
const DIFFERENT: f64 = 1.15;

/// Two pictures, smoothed, with the poses of the robot.
#[derive(Clone, Copy, Debug)]
pub struct FloorPair<'a> {
    /// Earlier and later picture.
    pub pictures: [&'a FloatImage; 2],
    /// Poses of the robot, odometry frame.
    pub poses: [Pose2; 2],
}

/// Height and pan of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorMotion {
    /// Height, m.
    pub height_m: f64,
    /// Standard deviation of the height, m.
    pub height_sigma_m: f64,
    /// Pan, rad, positive to the left.
    pub pan: f64,
    /// Standard deviation of the pan, rad.
    pub pan_sigma: f64,
    /// Mean correlation of the floor in the pairs, 0 to 1.
    pub correlation: f64,
    /// Number of pairs.
    pub pairs: usize,
}

/// Reason why the motion of the floor gives no height.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum FloorMotionError {
    /// Too few pairs.
    #[error(
        "only {found} pairs of pictures show textured floor at 0.1 to 0.5 m from each other: {MIN_PAIRS} are needed. Drive straight ahead for some meters"
    )]
    TooFew {
        /// Pairs.
        found: usize,
    },
    /// No height explains the motion.
    #[error(
        "the floor does not move as odometry says (correlation {correlation:.2}): it has no texture, or mirrors, or the tilt is wrong"
    )]
    NoMatch {
        /// Correlation at the best height.
        correlation: f64,
    },
    /// Several heights explain the motion, as on a regular pattern of tiles.
    #[error(
        "the floor moves as for a height of {first_m:.2} m and of {second_m:.2} m, as regular tiles do: drive more slowly, or state the width of the corridor"
    )]
    Ambiguous {
        /// Best height, m.
        first_m: f64,
        /// Another height, m.
        second_m: f64,
    },
}

/// Estimates height and pan of a camera with known tilt, roll and position (x, y) on the robot.
///
/// # Errors
/// [`FloorMotionError`].
pub fn fit_floor_motion(
    pinhole: &Pinhole,
    mount: &Mount,
    pairs: &[FloorPair<'_>],
) -> Result<FloorMotion, FloorMotionError> {
    let level = Level::of(mount);
    let patches: Vec<PairPatches<'_>> =
        pairs.iter().filter_map(|pair| PairPatches::of(pinhole, &level, pair)).collect();
    if patches.len() < MIN_PAIRS {
        return Err(FloorMotionError::TooFew { found: patches.len() });
    }
    let score = |pairs: &[PairPatches<'_>], height: f64, pan: f64| -> f64 {
        let sum: f64 = pairs.iter().map(|pair| pair.correlation(pinhole, &level, mount, height, pan)).sum();
        sum / pairs.len() as f64
    };
    // The search over all heights takes the most time; a few pairs are enough for it.
    let few: Vec<PairPatches<'_>> =
        patches.iter().step_by(patches.len().div_ceil(MAX_SEARCHED)).cloned().collect();
    let mut tried: Vec<(f64, f64, f64)> = Vec::new();
    let mut height = HEIGHTS_M[0];
    while height <= HEIGHTS_M[1] {
        let of_pan = |step: i32| {
            let pan = f64::from(step) * MAX_PAN_RAD / f64::from(PAN_STEPS);
            (score(&few, height, pan), height, pan)
        };
        tried.extend((-PAN_STEPS..=PAN_STEPS).map(of_pan).max_by(|a, b| a.0.total_cmp(&b.0)));
        height *= HEIGHT_FACTOR;
    }
    let best = tried.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
    let refine =
        |pairs: &[PairPatches<'_>]| refined(&|height, pan| score(pairs, height, pan), best.1, best.2);
    let (correlation, height_m, pan) = refine(&patches);
    if correlation < MIN_CORRELATION {
        return Err(FloorMotionError::NoMatch { correlation });
    }
    let is_other = |height: f64| (height / height_m).max(height_m / height) > DIFFERENT;
    let others = tried.iter().filter(|(score, height, _)| is_other(*height) && *score > AMBIGUOUS * best.0);
    if let Some(other) = others.max_by(|a, b| a.0.total_cmp(&b.0)) {
        return Err(FloorMotionError::Ambiguous { first_m: height_m, second_m: other.1 });
    }
    let parts = |pairs: &[PairPatches<'_>]| {
        let (_, height, pan) = refine(pairs);
        Some([height, pan])
    };
    let [height_sigma_m, pan_sigma] = block_jackknife(&patches, parts).unwrap_or([f64::NAN; 2]);
    Ok(FloorMotion { height_m, height_sigma_m, pan, pan_sigma, correlation, pairs: patches.len() })
}

/// Maximizes a score by parabolas along height and pan in turn; returns score, height and pan.
fn refined(score: &dyn Fn(f64, f64) -> f64, mut height: f64, mut pan: f64) -> (f64, f64, f64) {
    let (mut by, mut turn) = (HEIGHT_FACTOR, MAX_PAN_RAD / f64::from(PAN_STEPS));
    let mut best = score(height, pan);
    for _ in 0..7 {
        let moved = parabola([score(height / by, pan), best, score(height * by, pan)]);
        let next = height * by.powf(moved);
        let at_next = score(next, pan);
        if at_next >= best {
            (height, best) = (next, at_next);
        }
        let moved = parabola([score(height, pan - turn), best, score(height, pan + turn)]);
        let next = pan + turn * moved;
        let at_next = score(height, next);
        if at_next >= best {
            (pan, best) = (next, at_next);
        }
        by = by.powf(0.6);
        turn *= 0.6;
    }
    (best, height, pan)
}

/// Position of the highest point of the parabola through three values one step apart, in steps from the middle one, -1 to 1.
pub(super) fn parabola([before, here, after]: [f64; 3]) -> f64 {
    let bend = before + after - 2.0 * here;
    if bend < -1e-12 {
        (0.5 * (before - after) / bend).clamp(-1.0, 1.0)
    } else if after > before {
        1.0
    } else {
        -1.0
    }
}

/// Attitude of the camera without its pan: axes x forward, y left, z up.
struct Level {
    level_from_camera: Matrix3<f64>,
}

impl Level {
    fn of(mount: &Mount) -> Self {
        Self { level_from_camera: Mount { pan: 0.0, ..*mount }.rotation_body_from_camera() }
    }

    /// Pixel of a floor point, in heights of the camera; `None` behind the camera.
    fn pixel(&self, pinhole: &Pinhole, point: Point2<f64>) -> Option<Vector2<f64>> {
        let seen = self.level_from_camera.transpose() * Vector3::new(point.x, point.y, -1.0);
        // Scaled so that the near plane of the camera does not matter.
        pinhole.project(&Point3::from(seen * 100.0)).ok()
    }
}

/// Patches of the floor in the earlier picture of a pair.
#[derive(Clone)]
struct PairPatches<'a> {
    later: &'a FloatImage,
    /// Motion of the robot, in its earlier frame.
    motion: Pose2,
    patches: Vec<Patch>,
}

/// Floor points, in heights of the camera, with their gray levels, of which the mean is zero and the sum of squares one.
#[derive(Clone)]
struct Patch {
    points: Vec<Point2<f64>>,
    levels: Vec<f64>,
}

impl<'a> PairPatches<'a> {
    fn of(pinhole: &Pinhole, level: &Level, pair: &FloorPair<'a>) -> Option<Self> {
        let mut patches = Vec::new();
        let count = |length: f64| (length / PATCH).round() as usize;
        for row in 0..count(AHEAD[1] - AHEAD[0]) {
            for column in 0..count(2.0 * ASIDE) {
                let corner = Point2::new(AHEAD[0] + PATCH * row as f64, -ASIDE + PATCH * column as f64);
                let step = PATCH / SAMPLES as f64;
                let points: Vec<Point2<f64>> = (0..SAMPLES * SAMPLES)
                    .map(|i| corner + Vector2::new((i % SAMPLES) as f64, (i / SAMPLES) as f64) * step)
                    .collect();
                let sample = |point: &Point2<f64>| pair.pictures[0].sample(level.pixel(pinhole, *point)?);
                let levels: Option<Vec<f64>> = points.iter().map(sample).collect();
                patches.extend(levels.and_then(normalized).map(|levels| Patch { points, levels }));
            }
        }
        let motion = pair.poses[0].relative(&pair.poses[1]);
        (patches.len() >= MIN_PATCHES).then_some(Self { later: pair.pictures[1], motion, patches })
    }

    /// Mean correlation of the patches with the later picture, for a camera at this height and pan.
    fn correlation(&self, pinhole: &Pinhole, level: &Level, mount: &Mount, height: f64, pan: f64) -> f64 {
        let on_robot = Isometry2::new(Vector2::new(mount.x, mount.y), pan);
        let moved = Isometry2::new(Vector2::new(self.motion.x, self.motion.y), self.motion.theta);
        let later_from_earlier = on_robot.inverse() * moved.inverse() * on_robot;
        let (turn, shift) = (later_from_earlier.rotation, later_from_earlier.translation.vector / height);
        let (mut sum, mut seen) = (0.0, 0);
        for patch in &self.patches {
            let sample = |point: &Point2<f64>| self.later.sample(level.pixel(pinhole, turn * point + shift)?);
            let levels: Option<Vec<f64>> = patch.points.iter().map(sample).collect();
            let Some(levels) = levels else { continue };
            seen += 1;
            if let Some(levels) = normalized(levels) {
                sum += levels.iter().zip(&patch.levels).map(|(a, b)| a * b).sum::<f64>();
            }
        }
        // Patches that leave the view say nothing; too few of them say too little.
        if 3 * seen < self.patches.len() { 0.0 } else { sum / seen as f64 }
    }
}

/// Shifts and scales gray levels to a mean of zero and a sum of squares of one; `None` if they are nearly equal.
fn normalized(mut levels: Vec<f64>) -> Option<Vec<f64>> {
    let count = levels.len() as f64;
    let mean = levels.iter().sum::<f64>() / count;
    levels.iter_mut().for_each(|level| *level -= mean);
    let norm = levels.iter().map(|level| level * level).sum::<f64>().sqrt();
    if norm < MIN_CONTRAST * count.sqrt() {
        return None;
    }
    levels.iter_mut().for_each(|level| *level /= norm);
    Some(levels)
}
