//! Recent pictures with their poses, spaced along the way, for baselines of chosen lengths.

use yamabico_geometry::image::ImageView;
use yamabico_geometry::{Hypotenuse, Pose2, Twist};

use super::band_pass::{BandImage, BandPass};
use super::quad_image::QuadImage;
use super::wheel_lag::WheelLag;

/// Number of pictures kept.
const LOOKS: usize = 24;
/// Way after which a picture is kept, m.
const SPACING_M: f64 = 0.03;
/// Turn after which a picture is kept, rad.
const SPACING_RAD: f64 = 0.05;
/// Acceleration above which the robot nods: its pictures are aligned, but no points are judged by them, m/s^2.
const MAX_ACCELERATION: f64 = 0.9;

/// Sigmas of the two scales of band-passed images at a width of 256 px, px; they grow with the root of the width.
pub const SCALES_PX: [f64; 2] = [2.0, 0.9];

/// A picture prepared for comparisons.
#[derive(Clone, Debug)]
pub struct Look {
    /// Odometry at the capture.
    pub odometry: Pose2,
    /// Time of the capture, s.
    pub at_s: f64,
    /// Mean velocity since the picture before.
    pub twist: Twist,
    /// True if the robot did not nod.
    pub is_steady: bool,
    /// Pose in the same frame, corrected by vision step by step.
    pub corrected: Pose2,
    /// Gray levels.
    pub image: QuadImage,
    /// Band-passed images, coarse and fine.
    pub bands: [BandImage; 2],
}

impl Look {
    /// Odometry without its lag.
    #[must_use]
    pub fn led(&self, lag: &WheelLag) -> Pose2 {
        lag.lead(&self.odometry, &self.twist)
    }
}

/// Ring of recent pictures. Allocates when it is created and no more.
#[derive(Clone, Debug)]
pub struct LookHistory {
    filters: [BandPass; 2],
    /// Oldest first; the last is the newest picture.
    looks: Vec<Look>,
    /// Number of valid looks, at the end of `looks`.
    valid: usize,
}

impl LookHistory {
    /// Creates a history of pictures of this size, band-passed from row `top` on.
    #[must_use]
    pub fn new(width: usize, height: usize, top: usize) -> Self {
        let look = Look {
            odometry: Pose2::IDENTITY,
            at_s: 0.0,
            twist: Twist::default(),
            is_steady: true,
            corrected: Pose2::IDENTITY,
            image: QuadImage::new(width, height),
            bands: [BandImage::new(width, height, top), BandImage::new(width, height, top)],
        };
        let scale = (width as f64 / 256.0).sqrt();
        Self {
            filters: SCALES_PX.map(|sigma| BandPass::new((sigma * scale) as f32)),
            looks: vec![look; LOOKS],
            valid: 0,
        }
    }

    /// Forgets all pictures.
    pub fn clear(&mut self) {
        self.valid = 0;
    }

    /// Adds the newest picture, taken at `odometry` and `at_s` (s). The one before it is dropped unless it is far enough
    /// from its predecessor.
    pub fn push(&mut self, image: ImageView, odometry: Pose2, at_s: f64, lag: &WheelLag) {
        let (mut twist, mut is_steady, mut corrected) = (Twist::default(), true, odometry);
        if let Some(last) = self.newest() {
            let dt_s = at_s - last.at_s;
            twist = last.twist;
            if dt_s > 0.0 {
                twist = Twist::logarithm(&last.odometry.relative(&odometry), dt_s);
                is_steady = (twist.linear - last.twist.linear).abs() < MAX_ACCELERATION * dt_s;
            }
            let motion = last.led(lag).relative(&lag.lead(&odometry, &twist));
            corrected = last.corrected * motion;
        }
        if let (false, Some(last)) = (is_steady, self.looks.last_mut()) {
            // Wheels tell of braking after it began.
            last.is_steady = false;
        }
        if self.valid == 0 || self.is_spaced() {
            self.looks.rotate_left(1);
            self.valid = (self.valid + 1).min(LOOKS);
        }
        let Some(look) = self.looks.last_mut() else { return };
        (look.odometry, look.corrected, look.at_s) = (odometry, corrected, at_s);
        (look.twist, look.is_steady) = (twist, is_steady);
        look.image.copy(image);
        for (filter, band) in self.filters.iter_mut().zip(&mut look.bands) {
            filter.filter(image, band);
        }
    }

    /// True if the newest picture is far enough from the one before to be kept.
    fn is_spaced(&self) -> bool {
        let [.., before, newest] = self.valid_looks() else { return true };
        let motion = before.odometry.relative(&newest.odometry);
        motion.x.hypotenuse(motion.y) >= SPACING_M || motion.theta.abs() >= SPACING_RAD
    }

    fn valid_looks(&self) -> &[Look] {
        &self.looks[LOOKS - self.valid..]
    }

    /// Newest picture.
    #[must_use]
    pub fn newest(&self) -> Option<&Look> {
        self.valid_looks().last()
    }

    /// Number of the newest older picture without nodding from which the robot has moved by `way_m` or more, by corrected
    /// poses.
    #[must_use]
    pub fn at_baseline(&self, way_m: f64) -> Option<usize> {
        let (newest, older) = self.valid_looks().split_last()?;
        older.iter().rposition(|look| {
            let motion = look.corrected.relative(&newest.corrected);
            look.is_steady && motion.x.hypotenuse(motion.y) >= way_m
        })
    }

    /// Number of the newest older picture.
    #[must_use]
    pub fn before_newest(&self) -> Option<usize> {
        self.valid.checked_sub(2)
    }

    /// Picture with a number of [`LookHistory::at_baseline`], which holds until the next picture.
    #[must_use]
    pub fn look(&self, number: usize) -> &Look {
        &self.valid_looks()[number]
    }

    /// Replaces the corrected pose of the newest picture.
    pub fn correct(&mut self, corrected: Pose2) {
        if let (Some(look), true) = (self.looks.last_mut(), self.valid > 0) {
            look.corrected = corrected;
        }
    }
}
