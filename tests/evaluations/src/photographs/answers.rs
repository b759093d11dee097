//! Answers about a corridor in single photographs, alone and tracked, with their truth.

use nalgebra::Vector2;
use yamabico_core::camera::{Calibration, Intrinsics, Mount};
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_vision::corridor_evidence::{
    Coefficients, CorridorJudge, EvidenceTrack, Picture, RowPrior, Sighting,
};
use yamabico_vision::segments::{Segment, SegmentConfig, SegmentDetector};
use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};

use crate::report::{Cell, Table, number};
use crate::statistics::percentile;

/// Maximum error of a right heading, degrees.
pub const RIGHT_DEG: f64 = 3.0;
/// Standard deviation of the turn between two photographs without odometry, rad.
const TURN_SIGMA_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Answer about one photograph.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Name of the photograph.
    pub name: String,
    /// Probability of a corridor, by this photograph alone.
    pub probability: f64,
    /// Probability after tracking, to act by.
    pub acting: f64,
    /// Vanishing point, px; `None` if no lines meet.
    pub point: Option<Vector2<f64>>,
    /// Error of the heading, degrees; `None` if no corridor is in view.
    pub error_deg: Option<f64>,
    /// Error of the heading of the method that presumes the horizon, degrees; `None` if it found no vanishing point or no
    /// corridor is in view.
    pub presumed_deg: Option<f64>,
    /// True if the method that presumes the horizon found a vanishing point.
    pub presumed_found: bool,
}

impl Answer {
    /// Returns true if a corridor is in view.
    pub fn is_corridor(&self) -> bool {
        self.error_deg.is_some()
    }

    /// Returns true if a corridor is in view and the heading is right.
    pub fn is_right(&self) -> bool {
        self.error_deg.is_some_and(|error| error <= RIGHT_DEG)
    }
}

/// A camera with its calibration, and what was found in its photographs so far.
pub struct Looker {
    camera: Intrinsics,
    picture: Picture,
    start: RowPrior,
    track: EvidenceTrack,
    judge: CorridorJudge,
}

/// Answers found in one photograph.
pub struct Look {
    /// Answer by this photograph alone.
    pub sighting: Sighting,
    /// Probability after tracking, to act by.
    pub acting: f64,
    /// Segments, px.
    pub segments: Vec<Segment>,
    /// Segments that meet at the vanishing point.
    pub members: Vec<usize>,
    /// Vanishing point, px.
    pub point: Option<Vector2<f64>>,
    /// Vanishing point of the method that presumes the horizon, px.
    pub presumed: Option<Vector2<f64>>,
}

impl Looker {
    /// Starts with a camera on a level mount.
    pub fn new(camera: Intrinsics, calibration: Calibration) -> Self {
        let picture = Picture::of(&camera);
        let start = RowPrior::of_mount(&picture, &Mount::level(1.0), calibration, None);
        let judge = CorridorJudge::new(Coefficients::SEGMENTS_2, 0.5);
        Self { camera, picture, start, track: EvidenceTrack::new(start), judge }
    }

    /// Starts with a camera of unknown calibration: 90 degrees wide.
    pub fn guessed(image: ImageView<'_>) -> Self {
        Self::new(guessed_camera(image), Calibration::Guessed)
    }

    /// Judges the next photograph, alone and after the ones before. Presumed is the answer of the method that presumes the horizon.
    pub fn look(&mut self, image: ImageView<'_>) -> Look {
        let mut detector = SegmentDetector::new(SegmentConfig::for_evidence());
        let segments = detector.detect(image).unwrap_or_default().to_vec();
        self.track.predict(0.0, TURN_SIGMA_RAD, 0.0);
        let tracked = self.judge.look(&segments, &self.picture, &self.track.row_prior(), None);
        let seen = tracked.hypothesis.map(|hypothesis| (hypothesis.point, tracked.probability));
        self.track.update(&self.picture, seen);
        let acting = self.track.acting_probability(tracked.probability);

        let sighting = self.judge.look(&segments, &self.picture, &self.start, None);
        let mut members = Vec::new();
        if let Some(hypothesis) = &sighting.hypothesis {
            self.judge.members(hypothesis.point, &mut members);
        }
        let point = sighting.hypothesis.map(|hypothesis| hypothesis.point / self.picture.scale);
        let mut detector = SegmentDetector::new(SegmentConfig::default());
        let mut finder = VanishingPointFinder::new(VanishingPointConfig::default());
        let presumed = finder.find(detector.detect(image).unwrap_or_default(), &self.camera, None);
        let presumed = presumed.ok().map(|found| found.pixel);
        Look { sighting, acting, segments, members, point, presumed }
    }

    /// Angle between the columns of two points, degrees.
    pub fn apart_deg(&self, a: Vector2<f64>, b: Vector2<f64>) -> f64 {
        let heading = |point: Vector2<f64>| ((point.x - self.camera.cx) / self.camera.fx).atan();
        (heading(a) - heading(b)).abs().to_degrees()
    }

    /// Answers about a photograph with the vanishing point at `truth`, or without a corridor.
    pub fn answer(
        &mut self,
        name: &str,
        image: &GrayImage,
        truth: Option<Vector2<f64>>,
    ) -> Result<(Answer, Look), String> {
        let view = image.view().map_err(|error| format!("{name}: {error}"))?;
        let look = self.look(view);
        let error = |point: Option<Vector2<f64>>| Some(self.apart_deg(point?, truth?));
        let answer = Answer {
            name: name.to_owned(),
            probability: look.sighting.probability,
            acting: look.acting,
            point: look.point,
            error_deg: truth.map(|_| error(look.point).unwrap_or(90.0)),
            presumed_deg: error(look.presumed),
            presumed_found: look.presumed.is_some(),
        };
        Ok((answer, look))
    }
}

/// Camera of unknown calibration: 90 degrees wide.
fn guessed_camera(image: ImageView<'_>) -> Intrinsics {
    let (width, height) = (image.width() as f64, image.height() as f64);
    Intrinsics {
        fx: 0.5 * width,
        fy: 0.5 * width,
        cx: 0.5 * (width - 1.0),
        cy: 0.5 * (height - 1.0),
        width: image.width() as u32,
        height: image.height() as u32,
    }
}

/// Table of answers by set: how many are right, and how many are sure.
pub struct Summary(pub Table);

impl Summary {
    /// An empty table.
    pub fn new(title: &str) -> Self {
        Self(Table::new(
            title,
            &[
                "photographs",
                "corridor",
                "within 3 deg",
                "median, deg",
                "p >= 0.5",
                "of them right",
                "p >= 0.9",
                "of them right",
                "tracked p >= 0.5",
                "none in view",
                "p > 0.5 (wrong)",
                "tracked p > 0.5 (wrong)",
                "presumed horizon: within 3 deg",
                "presumed horizon: answers where none",
            ],
        ))
    }

    /// Adds a row.
    pub fn row(&mut self, name: &str, answers: &[&Answer]) {
        let count = |holds: &dyn Fn(&Answer) -> bool| {
            Cell::from(answers.iter().filter(|answer| holds(answer)).count())
        };
        let errors: Vec<f64> = answers.iter().filter_map(|answer| answer.error_deg).collect();
        self.0.row([
            name.into(),
            errors.len().into(),
            count(&Answer::is_right),
            number(percentile(&errors, 0.5), 2),
            count(&|a| a.is_corridor() && a.probability >= 0.5),
            count(&|a| a.is_right() && a.probability >= 0.5),
            count(&|a| a.is_corridor() && a.probability >= 0.9),
            count(&|a| a.is_right() && a.probability >= 0.9),
            count(&|a| a.is_corridor() && a.acting >= 0.5),
            count(&|a| !a.is_corridor()),
            count(&|a| !a.is_corridor() && a.probability > 0.5),
            count(&|a| !a.is_corridor() && a.acting > 0.5),
            count(&|a| a.presumed_deg.is_some_and(|error| error <= RIGHT_DEG)),
            count(&|a| !a.is_corridor() && a.presumed_found),
        ]);
    }
}
