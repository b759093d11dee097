//! The corridor in one frame, by one of two methods.

use yamabico_core::camera::Calibration;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::image::ImageView;
use yamabico_core::message::Reason;
use yamabico_vision::corridor::evidence::EvidenceObserver;
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::observer::{
    CorridorCamera, CorridorObservation, CorridorObserver, CorridorPrediction,
};
use yamabico_vision::segments::SegmentConfig;
use yamabico_vision::vanishing_point::VanishingPointError;

use crate::ahead::SeenWall;
use crate::config::Method;
use crate::corridor_track::{VARIANCE_PER_METER, VARIANCE_PER_TURN};

/// Standard deviations of tilt and roll where none is given, rad: of a measured calibration, and of a guessed one.
const HORIZON_SIGMA_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
const GUESSED_SIGMA_RAD: f64 = 8.0 * std::f64::consts::PI / 180.0;
/// Standard deviation of the turn between two frames without odometry, rad.
const BLIND_TURN_SIGMA_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// Height assumed of a camera whose height is unknown, m.
const ASSUMED_HEIGHT_M: f64 = 0.3;

/// Corridor, or none, in one frame.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Heading and walls, or the reason why there is none.
    pub observation: Result<CorridorObservation, Reason>,
    /// Probability of a corridor, to act by; `None` from the method that does not judge.
    pub probability: Option<f64>,
    /// True if the corridor's axis is known only as a direction far outside the image.
    pub is_far: bool,
    /// Wall across the way.
    pub wall: Option<SeenWall>,
    /// True if the horizon contradicts the mount.
    pub is_mount_wrong: bool,
}

/// Method with its state.
#[derive(Clone, Debug)]
pub enum Sight {
    /// Judges the evidence for a corridor.
    Evidence(Box<EvidenceObserver>),
    /// Presumes the horizon, and believes the best vanishing point.
    PresumedHorizon(Box<CorridorObserver>),
}

impl Sight {
    /// Creates the method for this camera, whose tilt has the standard deviation `horizon_sigma_rad` where one is given.
    #[must_use]
    pub fn new(
        method: Method,
        camera: CorridorCamera,
        horizon_sigma_rad: Option<f64>,
        rule: FloorLineRule,
    ) -> Self {
        match method {
            Method::Evidence => {
                let observer = CorridorObserver::with_segments(camera, rule, SegmentConfig::for_evidence());
                Self::Evidence(Box::new(EvidenceObserver::new(observer, horizon_sigma_rad)))
            }
            Method::PresumedHorizon => Self::PresumedHorizon(Box::new(CorridorObserver::new(camera, rule))),
        }
    }

    /// Standard deviation of tilt and roll for the distances of walls and for the presumed horizon, rad.
    #[must_use]
    pub fn horizon_sigma(given_rad: Option<f64>, calibration: Calibration) -> f64 {
        given_rad.unwrap_or(match calibration {
            Calibration::Measured => HORIZON_SIGMA_RAD,
            Calibration::Guessed => GUESSED_SIGMA_RAD,
        })
    }

    /// Observer that measures.
    #[must_use]
    pub fn observer(&self) -> &CorridorObserver {
        match self {
            Self::Evidence(evidence) => evidence.observer(),
            Self::PresumedHorizon(observer) => observer,
        }
    }

    /// Camera model, mount and calibration.
    #[must_use]
    pub fn camera(&self) -> &CorridorCamera {
        self.observer().camera()
    }

    /// Height of the camera above the floor, m: assumed where it is unknown.
    #[must_use]
    pub fn height_m(&self) -> f64 {
        let height_m = self.camera().mount.z;
        if self.knows_distances() { height_m } else { ASSUMED_HEIGHT_M }
    }

    /// True if the camera measures distances on the floor.
    #[must_use]
    pub fn knows_distances(&self) -> bool {
        let camera = self.camera();
        camera.calibration == Calibration::Measured && camera.mount.z > 0.0
    }

    /// Distance of the nearest floor in view ahead, m.
    #[must_use]
    pub fn nearest_floor_m(&self) -> f64 {
        let camera = self.camera();
        let intrinsics = camera.pinhole.intrinsics();
        let below = (f64::from(intrinsics.height) - 1.0 - intrinsics.cy) / intrinsics.fy;
        self.height_m() / (below.atan() + camera.mount.tilt).tan().max(0.05)
    }

    /// Propagates from the pose at the last frame to that at the next, `None` without odometry.
    pub fn predict(&mut self, poses: Option<(Pose2, Pose2)>) {
        let Self::Evidence(evidence) = self else { return };
        match poses {
            Some((from, to)) => {
                let (turn, meters) = (angle_difference(to.theta, from.theta), from.distance(&to));
                let variance = VARIANCE_PER_TURN * turn.abs() + VARIANCE_PER_METER * meters;
                evidence.predict(turn, variance.sqrt(), meters);
            }
            None => evidence.predict(0.0, BLIND_TURN_SIGMA_RAD, 0.0),
        }
    }

    /// Forgets the corridor, and keeps the horizon.
    pub fn forget(&mut self) {
        if let Self::Evidence(evidence) = self {
            evidence.forget_heading();
        }
    }

    /// Looks at the next image of the camera.
    pub fn look(&mut self, image: ImageView<'_>, expected: Option<CorridorPrediction>) -> Seen {
        let height_m = self.height_m();
        match self {
            Self::Evidence(evidence) => {
                let judgment = evidence.observe(image, expected);
                Seen {
                    observation: judgment.observation.map_err(heading_failure),
                    probability: Some(judgment.acting_probability),
                    is_far: judgment.is_far,
                    wall: judgment.wall_ahead.map(|wall| SeenWall {
                        range_m: wall.range_heights * height_m,
                        depth_px: wall.depth_px,
                    }),
                    is_mount_wrong: judgment.is_mount_wrong,
                }
            }
            Self::PresumedHorizon(observer) => Seen {
                observation: observer.observe(image, expected).map_err(heading_failure),
                probability: None,
                is_far: false,
                wall: None,
                is_mount_wrong: false,
            },
        }
    }
}

/// Converts the reason for a missing vanishing point to the reason of a proposal.
fn heading_failure(error: VanishingPointError) -> Reason {
    match error {
        VanishingPointError::TooFewSegments { .. } => Reason::TooFewSegments,
        VanishingPointError::NoVanishingPoint => Reason::NoVanishingPoint,
        VanishingPointError::Degenerate => Reason::Degenerate,
        VanishingPointError::Ambiguous => Reason::Ambiguous,
    }
}
