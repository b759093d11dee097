//! Judges whether a camera sees a corridor, and measures heading and walls only where it does.

use super::observer::{Axis, CorridorCamera, CorridorObservation, CorridorObserver, CorridorPrediction};
use crate::corridor::floor_lines::WallEstimate;
use crate::corridor_evidence::judge::PredictedHeading;
use crate::corridor_evidence::probability::{log_odds, probability as logistic};
use crate::corridor_evidence::support::Support;
use crate::corridor_evidence::{
    Coefficients, CorridorJudge, EvidenceTrack, FootLine, Hypothesis, Picture, RowPrior, Sighting, WallAhead,
};
use crate::vanishing_point::VanishingPointError;
use nalgebra::Vector2;
use yamabico_geometry::camera::Calibration;
use yamabico_geometry::image::ImageView;

/// Share of images that show a corridor, before any is seen.
const PRIOR: f64 = 0.5;
/// Probability from which on a vanishing point is believed.
const BELIEVED: f64 = 0.5;
/// Probability of a point in view from which on no point far outside is believed.
const IN_VIEW: f64 = 0.3;
/// Difference between a heading and its prediction that is never too large, rad.
const HEADING_GATE_RAD: f64 = 0.045;
/// Distance between a wall and its prediction up to which they agree, m.
const SAME_WALL_M: f64 = 0.15;
/// Log-odds of a corridor from a wall where it is predicted. By chance, a line on the floor between 0.2 and 5 m aside falls there once
/// in sixteen times, ln 16 = 2.8; less, since images are not independent.
const EVIDENCE_OF_WALL: f64 = 2.0;
/// Lower bound of a predicted heading's standard deviation, rad.
const MIN_PREDICTION_SIGMA_RAD: f64 = 0.01;
/// Length of lines along the corridor beyond a foot line, px of an image 640 px wide, above which it is not the foot of a wall but a
/// joint or a threshold.
const BEYOND_PX: f64 = 48.0;
/// Part of the depth of a foot line in which those lines are counted.
const BEYOND_DEPTH: std::ops::Range<f64> = 0.08..0.6;
/// Number of consecutive images whose horizon contradicts a measured mount before that is reported.
const WRONG_MOUNT_IMAGES: u32 = 10;

/// Corridor, or none, in one image.
#[derive(Clone, Copy, Debug)]
pub struct Judgment {
    /// Probability of a corridor with this heading, by this image alone, 0 to 1.
    pub probability: f64,
    /// Probability to act by: of the track, and at most 0.4 above that of the image.
    pub acting_probability: f64,
    /// Heading and walls.
    ///
    /// # Errors
    /// [`VanishingPointError`] if there is no point that is believed.
    pub observation: Result<CorridorObservation, VanishingPointError>,
    /// True if the observation is the direction of a corridor that ends far outside the image: it allows a turn in place, no more.
    pub is_far: bool,
    /// Wall across the way.
    pub wall_ahead: Option<WallAhead>,
    /// Row of the horizon and its standard deviation, px of the camera.
    pub horizon_px: [f64; 2],
    /// Lean of plumb lines in the image, rad; `None` if too few are in view.
    pub roll: Option<f64>,
    /// True if the horizon contradicts a measured mount: mount or calibration is wrong.
    pub is_mount_wrong: bool,
}

/// Judges frame after frame. Reuses its buffers.
#[derive(Clone, Debug)]
pub struct EvidenceObserver {
    observer: CorridorObserver,
    judge: CorridorJudge,
    picture: Picture,
    mount_prior: RowPrior,
    track: EvidenceTrack,
    contradictions: u32,
}

impl EvidenceObserver {
    /// Adds judgment to an observer. `stated_sigma_rad` is the standard deviation of the camera's tilt where it is stated; without it,
    /// a measured mount counts for 8 degrees, and a guessed calibration says nothing about the horizon.
    #[must_use]
    pub fn new(observer: CorridorObserver, stated_sigma_rad: Option<f64>) -> Self {
        let CorridorCamera { pinhole, mount, calibration, .. } = observer.camera();
        let picture = Picture::of(pinhole.intrinsics());
        let mount_prior = RowPrior::of_mount(&picture, mount, *calibration, stated_sigma_rad);
        Self {
            judge: CorridorJudge::new(Coefficients::SEGMENTS_2, PRIOR),
            picture,
            mount_prior,
            track: EvidenceTrack::new(mount_prior),
            contradictions: 0,
            observer,
        }
    }

    /// The observer that measures.
    #[must_use]
    pub fn observer(&self) -> &CorridorObserver {
        &self.observer
    }

    /// Evidence over time.
    #[must_use]
    pub fn track(&self) -> &EvidenceTrack {
        &self.track
    }

    /// Forgets the heading and the evidence, and keeps the horizon.
    pub fn forget_heading(&mut self) {
        self.track.forget_heading();
    }

    /// Propagates to the next frame, over a turn (rad, positive to the left) with its standard deviation and a distance driven, m.
    pub fn predict(&mut self, turn: f64, turn_sigma: f64, meters: f64) {
        self.track.predict(turn, turn_sigma, meters);
    }

    /// Judges the next image of the camera.
    pub fn observe(&mut self, image: ImageView<'_>, expected: Option<CorridorPrediction>) -> Judgment {
        let failure = self.observer.find_segments(image).err();
        let predicted = expected.map(|expected| PredictedHeading {
            heading: expected.heading + self.observer.camera().mount.pan,
            sigma: expected.heading_sigma.max(MIN_PREDICTION_SIGMA_RAD),
        });
        let mut prior = self.track.row_prior();
        let segments = self.observer.segments();
        let plumb = self.judge.take(segments, &self.picture, &prior);
        let calibration = self.observer.camera().calibration;
        if let Some(plumb) = plumb.filter(|_| calibration == Calibration::Measured && !prior.is_tracked) {
            let variance = plumb.row_variance(&self.picture, calibration);
            prior = prior.fused(plumb.row(&self.picture), variance);
        }
        if let Some(roll) = plumb.and_then(|plumb| plumb.known_roll()) {
            self.track.set_roll(roll);
        }
        let sighting = self.judge.choose(segments, &self.picture, &prior, predicted, plumb);
        let wall_ahead = self.wall_ahead(&sighting);
        let candidate = sighting
            .hypothesis
            .filter(|hypothesis| sighting.probability >= BELIEVED || self.is_expected(hypothesis, predicted));
        let measured = candidate.map(|hypothesis| {
            self.judge.members(hypothesis.point, self.observer.along_mut());
            self.observer.measure(image, &self.axis(&hypothesis), expected)
        });
        let walls = measured.map_or(0, |measured| expected_walls(&measured, expected));
        let probability = corroborated(sighting.probability, walls);
        self.update_track(sighting.hypothesis.map(|hypothesis| hypothesis.point), probability);
        let seen = measured.filter(|_| probability >= BELIEVED);
        let may_be_far =
            probability < IN_VIEW && (wall_ahead.is_some() || self.track.probability() < BELIEVED);
        let far = if may_be_far { self.observer.find_far_axis(expected) } else { None };
        let far = far.map(|axis| self.observer.measure(image, &axis, expected));
        let is_far = seen.is_none() && far.is_some();
        let observation = seen.or(far).ok_or(failure.unwrap_or(VanishingPointError::NoVanishingPoint));
        let (row, sigma) = self.track.row();
        Judgment {
            probability,
            acting_probability: self.track.acting_probability(probability),
            observation,
            is_far,
            wall_ahead,
            horizon_px: [row / self.picture.scale, sigma / self.picture.scale],
            roll: sighting.plumb.map(|plumb| plumb.roll()),
            is_mount_wrong: self.contradictions >= WRONG_MOUNT_IMAGES,
        }
    }

    fn update_track(&mut self, point: Option<Vector2<f64>>, probability: f64) {
        self.track.update(&self.picture, point.map(|point| (point, probability)));
        if probability >= BELIEVED && self.observer.camera().calibration == Calibration::Measured {
            let off = self.track.row().0 - self.mount_prior.row;
            let is_off = off * off > 9.0 * self.mount_prior.variance;
            self.contradictions = if is_off { self.contradictions + 1 } else { 0 };
        }
    }

    /// Returns true if a hypothesis lies in the predicted direction.
    fn is_expected(&self, hypothesis: &Hypothesis, predicted: Option<PredictedHeading>) -> bool {
        predicted.is_some_and(|predicted| {
            let off = self.picture.heading_of(hypothesis.point.x) - predicted.heading;
            off.abs() <= (3.0 * predicted.sigma).max(HEADING_GATE_RAD)
        })
    }

    /// Axis of a hypothesis, in pixels of the camera.
    fn axis(&self, hypothesis: &Hypothesis) -> Axis {
        let scale = self.picture.scale;
        let pixel = hypothesis.point / scale;
        let intrinsics = self.observer.camera().pinhole.intrinsics();
        let direction = intrinsics.normalized_from_pixel(pixel).push(1.0).normalize();
        Axis { pixel, direction, covariance: hypothesis.covariance / (scale * scale), at_infinity: false }
    }

    /// Returns the wall across the way, below the tracked horizon.
    fn wall_ahead(&mut self, sighting: &Sighting) -> Option<WallAhead> {
        let (row, _) = self.track.row();
        let foot = self.judge.foot_line(self.observer.segments(), &self.picture, row)?;
        let wall = WallAhead::of(&foot, row, &self.picture)?;
        let goes_on =
            sighting.hypothesis.is_some_and(|at| self.length_beyond(at.point, row, &foot) > BEYOND_PX);
        (!goes_on).then_some(wall)
    }

    /// Returns the length of the lines on the floor that point at `point`, between the horizon and a foot line. A wall hides them.
    fn length_beyond(&self, point: Vector2<f64>, row: f64, foot: &FootLine) -> f64 {
        let depth = foot.row - row;
        let is_beyond = |v: f64| BEYOND_DEPTH.contains(&((v - row) / depth));
        let voters = self.judge.lines().voters().iter();
        voters
            .filter(|line| is_beyond(line.midpoint.y))
            .map(|line| line.length * Support::of(line, point).kappa())
            .sum()
    }
}

/// Returns how many of the two walls were measured where they were expected.
fn expected_walls(seen: &CorridorObservation, expected: Option<CorridorPrediction>) -> usize {
    let Some(expected) = expected else { return 0 };
    let pairs = [seen.left, seen.right].into_iter().zip(expected.walls);
    let is_there = |(seen, expected): &(Option<WallEstimate>, Option<WallEstimate>)| {
        seen.zip(*expected)
            .is_some_and(|(seen, expected)| (seen.distance_m - expected.distance_m).abs() < SAME_WALL_M)
    };
    pairs.filter(is_there).count()
}

/// Raises the probability of an image by the walls that it shows where the images before predict them. Its lines alone say little near
/// the end of a corridor, where most of them are hidden.
fn corroborated(probability: f64, walls: usize) -> f64 {
    let odds = log_odds(probability.clamp(1e-6, 1.0 - 1e-6)) + EVIDENCE_OF_WALL * walls as f64;
    if walls == 0 { probability } else { logistic(odds) }
}
