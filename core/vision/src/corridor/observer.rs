//! Estimation of the robot's heading and of the wall distances from one image.

use crate::segments::{Segment, SegmentConfig, SegmentDetector};
use crate::vanishing_point::{
    Prediction, VanishingPoint, VanishingPointConfig, VanishingPointError, VanishingPointFinder,
};
use nalgebra::{Matrix2, Vector2, Vector3};
use yamabico_geometry::camera::Calibration;
use yamabico_geometry::camera::{Distortion, Mount, Pinhole};
use yamabico_geometry::image::ImageView;

use crate::corridor::baseboard::{FootSearch, find_wall_foot};
use crate::corridor::floor_lines::{
    CorridorLine, DetectedWall, FloorLineFinder, FloorLineRule, WallEstimate, side_levels,
};
use crate::corridor::heading::{CameraAttitude, RobotHeading};
use crate::corridor::wall_distance::{CorridorView, lateral_distance_sigma};

/// Sampling offset to either side of an edge, pixels at an image width of 640 px.
const SIDE_OFFSET_AT_640_PX: f64 = 4.0;
/// Standard deviation of a floor line perpendicular to itself, px.
const LINE_SIGMA_PX: f64 = 0.7;
/// Lower bound of the heading's standard deviation, rad.
const MIN_HEADING_SIGMA_RAD: f64 = 0.001;
/// Lower bound of a wall distance's standard deviation, m.
const MIN_DISTANCE_SIGMA_M: f64 = 0.008;
/// Heading above which a floor line is nearly horizontal in the image and gives no distance, rad.
const MAX_WALL_HEADING_RAD: f64 = 1.05;

/// Camera that looks along the corridor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorridorCamera {
    /// Camera model.
    pub pinhole: Pinhole,
    /// Pose of the camera in the body frame.
    pub mount: Mount,
    /// Calibration status. With `Guessed` only a coarse heading is computed, and no wall distance.
    pub calibration: Calibration,
    /// Standard deviation of tilt and roll, rad: of a guessed calibration the error of the guess, else what the robot sways while driving.
    pub horizon_sigma_rad: f64,
}

/// Direction of the corridor's axis in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    /// Vanishing point, undistorted pixels.
    pub pixel: Vector2<f64>,
    /// Unit vector along the axis in the optical frame.
    pub direction: Vector3<f64>,
    /// Covariance of `pixel`, px^2; of a point at infinity: see [`VanishingPoint::covariance`].
    pub covariance: Matrix2<f64>,
    /// True if the point lies far outside the image.
    pub at_infinity: bool,
}

impl Axis {
    fn of(found: &VanishingPoint<'_>) -> Self {
        let VanishingPoint { pixel, direction, covariance, at_infinity, .. } = *found;
        Self { pixel, direction, covariance, at_infinity }
    }
}

/// Prediction of heading and walls, from previous frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorridorPrediction {
    /// Robot heading relative to the corridor axis, rad.
    pub heading: f64,
    /// Standard deviation of the heading, rad.
    pub heading_sigma: f64,
    /// Left and right wall, relative to the robot's center.
    pub walls: [Option<WallEstimate>; 2],
    /// Distances from the robot's center up to which no wall stands on the left and right, m; zero where nothing is known.
    pub floor_m: [f64; 2],
}

/// Heading and walls measured in one frame. Distances are relative to the robot's center, positive to the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorridorObservation {
    /// Robot heading relative to the corridor axis, rad, positive to the left.
    pub heading: f64,
    /// Standard deviation of the heading, rad.
    pub heading_sigma: f64,
    /// Downward tilt of the camera according to the vanishing point, rad.
    pub tilt: f64,
    /// Vanishing point, undistorted pixels.
    pub vanishing_point: Vector2<f64>,
    /// Left wall.
    pub left: Option<WallEstimate>,
    /// Right wall.
    pub right: Option<WallEstimate>,
}

/// Measures heading and walls frame by frame. Reuses its buffers.
#[derive(Clone, Debug)]
pub struct CorridorObserver {
    camera: CorridorCamera,
    rule: FloorLineRule,
    detector: SegmentDetector,
    finder: VanishingPointFinder,
    floor_lines: FloorLineFinder,
    undistorted: Vec<Segment>,
    sources: Vec<usize>,
    along: Vec<usize>,
    view: Option<CorridorView>,
}

impl CorridorObserver {
    /// Creates an observer for this camera.
    #[must_use]
    pub fn new(camera: CorridorCamera, rule: FloorLineRule) -> Self {
        Self::with_segments(camera, rule, SegmentConfig::default())
    }

    /// Creates an observer with these parameters of the segment detector.
    #[must_use]
    pub fn with_segments(camera: CorridorCamera, rule: FloorLineRule, segments: SegmentConfig) -> Self {
        let body_from_camera = camera.mount.rotation_body_from_camera();
        let config = VanishingPointConfig {
            down_in_camera: body_from_camera.transpose() * Vector3::new(0.0, 0.0, -1.0),
            horizon_sigma_rad: camera.horizon_sigma_rad,
            ..VanishingPointConfig::default()
        };
        Self {
            camera,
            rule,
            detector: SegmentDetector::new(segments),
            finder: VanishingPointFinder::new(config),
            floor_lines: FloorLineFinder::default(),
            undistorted: Vec::new(),
            sources: Vec::new(),
            along: Vec::new(),
            view: None,
        }
    }

    /// Camera model, mount and calibration.
    #[must_use]
    pub fn camera(&self) -> &CorridorCamera {
        &self.camera
    }

    /// All segments of the last image, undistorted pixels, longest first.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.undistorted
    }

    /// Segments of the last image that run along the corridor: on floor, walls and ceiling.
    pub fn along_corridor(&self) -> impl Iterator<Item = &Segment> {
        self.along.iter().map(|&index| &self.undistorted[index])
    }

    /// View of the last image; `None` if the image allowed no measurement on the floor.
    #[must_use]
    pub fn view(&self) -> Option<&CorridorView> {
        self.view.as_ref()
    }

    /// Measures heading and walls in an image of this camera. A wall that is not visible is `None`, not an error.
    ///
    /// # Errors
    /// [`VanishingPointError`] if no heading can be determined.
    pub fn observe(
        &mut self,
        image: ImageView<'_>,
        expected: Option<CorridorPrediction>,
    ) -> Result<CorridorObservation, VanishingPointError> {
        self.find_segments(image)?;
        let prediction = self.prediction(expected);
        let intrinsics = self.camera.pinhole.intrinsics();
        let found = self.finder.find(&self.undistorted, intrinsics, prediction)?;
        self.along.extend_from_slice(found.inliers);
        let axis = Axis::of(&found);
        Ok(self.measure(image, &axis, expected))
    }

    /// Finds the segments of an image.
    pub(super) fn find_segments(&mut self, image: ImageView<'_>) -> Result<(), VanishingPointError> {
        self.view = None;
        self.along.clear();
        self.undistorted.clear();
        self.detector.detect(image).map_err(|_| VanishingPointError::TooFewSegments { found: 0 })?;
        self.undistort();
        Ok(())
    }

    /// Finds the axis of a corridor that ends far outside the last image.
    pub(super) fn find_far_axis(&mut self, expected: Option<CorridorPrediction>) -> Option<Axis> {
        let prediction = self.prediction(expected);
        let intrinsics = self.camera.pinhole.intrinsics();
        let found = self.finder.far_outside(&self.undistorted, intrinsics, prediction)?;
        self.along.clear();
        self.along.extend_from_slice(found.inliers);
        Some(Axis::of(&found))
    }

    /// Indices of the segments that run along the corridor.
    pub(super) fn along_mut(&mut self) -> &mut Vec<usize> {
        &mut self.along
    }

    /// Converts an expected heading to a direction in the optical frame.
    fn prediction(&self, expected: Option<CorridorPrediction>) -> Option<Prediction> {
        let camera_from_body = self.camera.mount.rotation_body_from_camera().transpose();
        expected.map(|expected| Prediction {
            direction: camera_from_body * Vector3::new(expected.heading.cos(), -expected.heading.sin(), 0.0),
            sigma_rad: expected.heading_sigma.max(0.01),
        })
    }

    /// Measures heading and walls in the last image, given the axis and the segments along it.
    pub(super) fn measure(
        &mut self,
        image: ImageView<'_>,
        found: &Axis,
        expected: Option<CorridorPrediction>,
    ) -> CorridorObservation {
        let intrinsics = self.camera.pinhole.intrinsics();
        let mount = &self.camera.mount;
        let (attitude, covariance) = level(found, &self.camera);
        let heading = match self.camera.calibration {
            Calibration::Measured => RobotHeading::from_axis(axis_of(attitude, mount.roll), mount).heading,
            Calibration::Guessed => attitude.heading - mount.pan,
        };
        let heading_sigma = if found.at_infinity {
            found.covariance[(0, 0)].sqrt() / intrinsics.fx
        } else {
            attitude.covariance(&covariance, intrinsics)[(0, 0)].sqrt()
        };
        let mut observation = CorridorObservation {
            heading,
            heading_sigma: heading_sigma.max(MIN_HEADING_SIGMA_RAD),
            tilt: attitude.tilt,
            vanishing_point: found.pixel,
            left: None,
            right: None,
        };
        let has_floor = self.camera.calibration == Calibration::Measured && mount.z > 0.0;
        if !has_floor || found.at_infinity || heading.abs() > MAX_WALL_HEADING_RAD {
            return observation;
        }

        let view = CorridorView::new(attitude, mount.roll, mount.z, *intrinsics);
        self.view = Some(view);
        let offset_m = mount.x * heading.sin() + mount.y * heading.cos();
        let from_camera =
            |wall: WallEstimate| WallEstimate { distance_m: wall.distance_m - offset_m, ..wall };
        let walls = expected.map_or([None; 2], |expected| expected.walls.map(|wall| wall.map(from_camera)));
        let side_px = (SIDE_OFFSET_AT_640_PX * f64::from(intrinsics.width) / 640.0).max(2.0);
        let raw = self.detector.segments();
        let lines = self.along.iter().map(|&inlier| {
            let (ideal, source) = (&self.undistorted[inlier], &raw[self.sources[inlier]]);
            CorridorLine {
                start: ideal.p0,
                end: ideal.p1,
                sides: side_levels(image, source.p0, source.p1, side_px),
            }
        });
        let [left_m, right_m] = expected.map_or([0.0; 2], |expected| expected.floor_m);
        let floor_m = [left_m - offset_m, right_m + offset_m];
        let detected = self.floor_lines.find(lines, &view, &self.rule, walls, floor_m);
        let pinhole = &self.camera.pinhole;
        let rule = &self.rule;
        let from_robot = |wall: DetectedWall| {
            let foot = FootSearch {
                found_m: wall.distance_m,
                ends: wall.ends,
                nearest_share: rule.baseboard_ratio,
                min_contrast: rule.min_contrast,
            };
            let distance_m = if wall.is_darker_at_the_wall {
                wall.distance_m
            } else {
                find_wall_foot(image, pinhole, &view, &foot).unwrap_or(wall.distance_m)
            };
            let sigma_m = lateral_distance_sigma(
                found.pixel,
                &covariance,
                wall.ends[0],
                LINE_SIGMA_PX,
                &view,
                mount.roll,
            )?;
            Some(WallEstimate {
                distance_m: distance_m + offset_m,
                sigma_m: sigma_m.max(MIN_DISTANCE_SIGMA_M),
            })
        };
        observation.left = detected.left.and_then(from_robot);
        observation.right = detected.right.and_then(from_robot);
        observation
    }

    fn undistort(&mut self) {
        self.undistorted.clear();
        self.sources.clear();
        let pinhole = &self.camera.pinhole;
        for (source, segment) in self.detector.segments().iter().enumerate() {
            let ideal = if *pinhole.distortion() == Distortion::NONE {
                Some(*segment)
            } else {
                undistorted(segment, pinhole)
            };
            if let Some(ideal) = ideal {
                self.undistorted.push(ideal);
                self.sources.push(source);
            }
        }
    }
}

/// Returns the segment in undistorted pixels; `None` if an endpoint is outside the domain of the lens model.
fn undistorted(segment: &Segment, pinhole: &Pinhole) -> Option<Segment> {
    let (p0, p1) = (pinhole.undistort_pixel(segment.p0)?, pinhole.undistort_pixel(segment.p1)?);
    let straight = Segment::between(p0, p1, 1.0)?;
    Some(Segment { p0, p1, normal: straight.normal, rho: straight.rho, length: straight.length, ..*segment })
}

/// Fuses the vanishing point with the tilt of the mount: the corridor is horizontal, so its vanishing point lies on the
/// horizon within `horizon_sigma_rad`. Returns the attitude and the covariance of the corrected pixel.
fn level(found: &Axis, camera: &CorridorCamera) -> (CameraAttitude, Matrix2<f64>) {
    let intrinsics = camera.pinhole.intrinsics();
    let roll = camera.mount.roll;
    if found.at_infinity || camera.calibration == Calibration::Guessed {
        return (CameraAttitude::from_axis(found.direction, roll), found.covariance);
    }
    let elevation = |pixel: Vector2<f64>| {
        let ray = intrinsics.normalized_from_pixel(pixel).push(1.0);
        RobotHeading::from_axis(ray, &camera.mount).elevation
    };
    const STEP_PX: f64 = 0.5;
    let slope = Vector2::new(
        elevation(found.pixel + Vector2::new(STEP_PX, 0.0))
            - elevation(found.pixel - Vector2::new(STEP_PX, 0.0)),
        elevation(found.pixel + Vector2::new(0.0, STEP_PX))
            - elevation(found.pixel - Vector2::new(0.0, STEP_PX)),
    ) / (2.0 * STEP_PX);
    let spread = found.covariance * slope;
    let gain = spread / (slope.dot(&spread) + camera.horizon_sigma_rad.powi(2));
    let pixel = found.pixel - gain * elevation(found.pixel);
    let covariance = found.covariance - gain * spread.transpose();
    (CameraAttitude::from_vanishing_point(intrinsics.normalized_from_pixel(pixel), roll), covariance)
}

/// Corridor axis in the optical frame of a camera with this attitude and roll (rad).
fn axis_of(attitude: CameraAttitude, roll: f64) -> Vector3<f64> {
    let mount = Mount { pan: attitude.heading, tilt: attitude.tilt, roll, ..Mount::default() };
    mount.rotation_body_from_camera().transpose() * Vector3::x()
}
