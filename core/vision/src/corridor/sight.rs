//! What one picture tells of the corridor: the robot's heading and its walls.

use crate::segments::{Segment, SegmentConfig, SegmentDetector};
use crate::vanishing_point::{
    Prediction, VanishingPoint, VanishingPointConfig, VanishingPointError, VanishingPointFinder,
};
use nalgebra::{Matrix2, Vector2, Vector3};
use yamabico_geometry::camera::Calibration;
use yamabico_geometry::camera::{Distortion, Mount, Pinhole};
use yamabico_geometry::image::ImageView;

use crate::corridor::floor_lines::{
    CorridorLine, ExpectedWall, FloorLineFinder, FloorLineRule, SeenWall, sides,
};
use crate::corridor::heading::{CameraAttitude, RobotHeading};
use crate::corridor::skirting::{FootSearch, foot_of_wall};
use crate::corridor::wall_distance::{CorridorView, tied_distance_sigma};

/// Distances to either side of an edge at which its brightness is read, pixels of an image 640 px wide.
const SIDE_OFFSET_AT_640_PX: f64 = 4.0;
/// Standard deviation of a floor line across itself, pixels.
const LINE_SIGMA_PX: f64 = 0.7;
/// No heading is trusted better than this, radians.
const MIN_HEADING_SIGMA_RAD: f64 = 0.001;
/// No distance is trusted better than this, meters.
const MIN_DISTANCE_SIGMA_M: f64 = 0.008;
/// Beyond this heading (rad) a floor line is nearly level in the picture and gives no distance.
const EDGE_ON_RAD: f64 = 1.05;

/// The camera that looks along the corridor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorridorCamera {
    /// Lens and image.
    pub pinhole: Pinhole,
    /// Where it sits on the robot.
    pub mount: Mount,
    /// Guessed: only the heading is used, and that as a rough direction.
    pub calibration: Calibration,
    /// How well tilt and roll hold while driving, radians.
    pub horizon_sigma_rad: f64,
}

/// What is expected before looking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expectation {
    /// Robot's heading from the corridor's axis, radians.
    pub heading: f64,
    /// Its standard deviation, radians.
    pub heading_sigma: f64,
    /// Left and right wall from the robot's center.
    pub walls: [Option<ExpectedWall>; 2],
}

/// What a picture told. Distances are from the robot's center, positive on the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Robot's heading from the corridor's axis, radians, positive to the left.
    pub heading: f64,
    /// Its standard deviation, radians.
    pub heading_sigma: f64,
    /// Downward tilt of the camera as the vanishing point shows it, radians.
    pub tilt: f64,
    /// The vanishing point, undistorted pixels.
    pub vanishing_point: Vector2<f64>,
    /// The left wall.
    pub left: Option<ExpectedWall>,
    /// The right wall.
    pub right: Option<ExpectedWall>,
}

/// Looks at pictures; keeps its buffers from one to the next.
#[derive(Clone, Debug)]
pub struct Sight {
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

impl Sight {
    /// Eyes behind this camera.
    #[must_use]
    pub fn new(camera: CorridorCamera, rule: FloorLineRule) -> Self {
        let body_from_camera = camera.mount.rotation_body_from_camera();
        let config = VanishingPointConfig {
            down_in_camera: body_from_camera.transpose() * Vector3::new(0.0, 0.0, -1.0),
            horizon_sigma_rad: match camera.calibration {
                Calibration::Measured => camera.horizon_sigma_rad,
                Calibration::Guessed => VanishingPointConfig::default().horizon_sigma_rad,
            },
            ..VanishingPointConfig::default()
        };
        Self {
            camera,
            rule,
            detector: SegmentDetector::new(SegmentConfig::default()),
            finder: VanishingPointFinder::new(config),
            floor_lines: FloorLineFinder::default(),
            undistorted: Vec::new(),
            sources: Vec::new(),
            along: Vec::new(),
            view: None,
        }
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &CorridorCamera {
        &self.camera
    }

    /// Every edge of the last picture, undistorted pixels, the longest first.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.undistorted
    }

    /// The edges of the last picture that run along the corridor, on its floor, its walls and its ceiling.
    pub fn along_corridor(&self) -> impl Iterator<Item = &Segment> {
        self.along.iter().map(|&index| &self.undistorted[index])
    }

    /// The last picture's camera as the corridor sees it; `None` where that picture showed no floor to measure.
    #[must_use]
    pub fn view(&self) -> Option<&CorridorView> {
        self.view.as_ref()
    }

    /// Heading and walls in a picture of this camera.
    ///
    /// # Errors
    /// Why there is no heading; no wall is no error.
    pub fn look(
        &mut self,
        image: ImageView<'_>,
        expected: Option<Expectation>,
    ) -> Result<Sighting, VanishingPointError> {
        self.view = None;
        self.along.clear();
        self.undistorted.clear();
        self.detector.detect(image).map_err(|_| VanishingPointError::TooFewSegments { found: 0 })?;
        self.undistort();
        let intrinsics = self.camera.pinhole.intrinsics();
        let mount = &self.camera.mount;
        let prediction = expected.map(|expected| Prediction {
            direction: mount.rotation_body_from_camera().transpose()
                * Vector3::new(expected.heading.cos(), -expected.heading.sin(), 0.0),
            sigma_rad: expected.heading_sigma.max(0.01),
        });
        let found = self.finder.find(&self.undistorted, intrinsics, prediction)?;
        self.along.extend_from_slice(found.inliers);
        let (attitude, covariance) = level(&found, &self.camera);
        let heading = match self.camera.calibration {
            Calibration::Measured => RobotHeading::from_axis(axis_of(attitude, mount.roll), mount).heading,
            Calibration::Guessed => attitude.heading - mount.pan,
        };
        let heading_sigma = if found.at_infinity {
            found.covariance[(0, 0)].sqrt() / intrinsics.fx
        } else {
            attitude.covariance(&covariance, intrinsics)[(0, 0)].sqrt()
        };
        let mut sighting = Sighting {
            heading,
            heading_sigma: heading_sigma.max(MIN_HEADING_SIGMA_RAD),
            tilt: attitude.tilt,
            vanishing_point: found.pixel,
            left: None,
            right: None,
        };
        let has_floor = self.camera.calibration == Calibration::Measured && mount.z > 0.0;
        if !has_floor || found.at_infinity || heading.abs() > EDGE_ON_RAD {
            return Ok(sighting);
        }

        let view = CorridorView::new(attitude, mount.roll, mount.z, *intrinsics);
        self.view = Some(view);
        let offset_m = mount.x * heading.sin() + mount.y * heading.cos();
        let from_camera =
            |wall: ExpectedWall| ExpectedWall { distance_m: wall.distance_m - offset_m, ..wall };
        let walls = expected.map_or([None; 2], |expected| expected.walls.map(|wall| wall.map(from_camera)));
        let side_px = (SIDE_OFFSET_AT_640_PX * f64::from(intrinsics.width) / 640.0).max(2.0);
        let raw = self.detector.segments();
        let lines = found.inliers.iter().map(|&inlier| {
            let (ideal, source) = (&self.undistorted[inlier], &raw[self.sources[inlier]]);
            CorridorLine {
                start: ideal.p0,
                end: ideal.p1,
                sides: sides(image, source.p0, source.p1, side_px),
            }
        });
        let seen = self.floor_lines.find(lines, &view, &self.rule, walls);
        let pinhole = &self.camera.pinhole;
        let rule = &self.rule;
        let from_robot = |wall: SeenWall| {
            let foot = FootSearch {
                found_m: wall.distance_m,
                ends: wall.ends,
                nearest_share: rule.skirting_ratio,
                min_contrast: rule.min_contrast,
            };
            let distance_m = if wall.is_darker_at_the_wall {
                wall.distance_m
            } else {
                foot_of_wall(image, pinhole, &view, &foot).unwrap_or(wall.distance_m)
            };
            let sigma_m = tied_distance_sigma(
                found.pixel,
                &covariance,
                wall.ends[0],
                LINE_SIGMA_PX,
                &view,
                mount.roll,
            )?;
            Some(ExpectedWall {
                distance_m: distance_m + offset_m,
                sigma_m: sigma_m.max(MIN_DISTANCE_SIGMA_M),
            })
        };
        sighting.left = seen.left.and_then(from_robot);
        sighting.right = seen.right.and_then(from_robot);
        Ok(sighting)
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

/// The segment as a camera without distortion would see it; `None` where the lens model ends.
fn undistorted(segment: &Segment, pinhole: &Pinhole) -> Option<Segment> {
    let (p0, p1) = (pinhole.undistort_pixel(segment.p0)?, pinhole.undistort_pixel(segment.p1)?);
    let straight = Segment::between(p0, p1, 1.0)?;
    Some(Segment { p0, p1, normal: straight.normal, rho: straight.rho, length: straight.length, ..*segment })
}

/// The attitude from the vanishing point and its covariance, with the mount's tilt as a second witness: the corridor is
/// level, so the point lies on the horizon, as surely as the mount holds its tilt.
fn level(found: &VanishingPoint<'_>, camera: &CorridorCamera) -> (CameraAttitude, Matrix2<f64>) {
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

/// The corridor's axis in the optical frame of a camera with this attitude and roll.
fn axis_of(attitude: CameraAttitude, roll: f64) -> Vector3<f64> {
    let mount = Mount { pan: attitude.heading, tilt: attitude.tilt, roll, ..Mount::default() };
    mount.rotation_body_from_camera().transpose() * Vector3::x()
}
