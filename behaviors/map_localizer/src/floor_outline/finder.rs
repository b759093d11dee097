use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::ops::Range;

use nalgebra::Vector2;
use yamabico_core::behavior::{ParameterError, Setup};
use yamabico_core::camera::{MirrorCamera, MirrorImage};
use yamabico_core::geometry::{Hypotenuse, Pose2, angle_difference};
use yamabico_core::message::{FrameHeader, Reason, View};
use yamabico_core::overlay::Overlay;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::floor_color::FloorColors;
use yamabico_vision::floor_color_file::ColorFile;
use yamabico_vision::map::{Wall, WireFrame};
use yamabico_vision::morphology::Morphology;
use yamabico_vision::polygon::sides;

use super::floor_fix::{FloorFix, FloorProblem, FloorSolution};
use super::localizer::{FloorLocalizer, FloorRule};
use super::outline::OutlineRule;
use super::plan_file::FloorPlanFile;
use crate::CAMERA;
use crate::belief::{Belief, Update};
use crate::config::Config;
use crate::fix::{Fix, NoiseFactors, PoseFinder};

/// Maximum change of a corner's distance on the floor per pixel, m/px.
const MAX_SLOPE_M_PER_PX: f64 = 0.7;
/// Distance from the mirror's rim within which corners are ignored, px.
const RIM_PX: f64 = 2.0;
/// Radius of the closing that fills lines and holes in the floor mask, px.
const CLOSING_PX: u32 = 1;
/// Radius of the opening that removes specks outside of the floor, px.
const OPENING_PX: u32 = 1;
/// Maximum tilt and roll of the mirror, rad.
const MAX_LEAN_RAD: f64 = 0.002;
/// Minimum standard deviations of position (m) and heading (rad) after a search.
const OUTLINE_SEARCH_SIGMA: [f64; 2] = [0.02, 0.01];
/// Gate on the squared Mahalanobis distance of a measured pose from the belief: 99.9 % quantile, three degrees of
/// freedom.
const POSE_GATE: f64 = 16.27;

/// Pose finder that matches the outline of the floor in the image of a mirror camera.
#[derive(Clone, Debug)]
pub struct FloorFinder {
    walls: WireFrame,
    robot_from_camera: Pose2,
    colors: FloorColors,
    size: [u32; 2],
    columns: Vec<Range<u32>>,
    mask: BitImage,
    body: BitImage,
    morphology: Morphology,
    localizer: FloorLocalizer,
    last: Option<FloorFix>,
}

impl FloorFinder {
    /// Creates a finder for the configured floor and the robot's mirror camera.
    ///
    /// # Errors
    /// The camera is of another kind, is not upright or does not see the floor; or the plan or the colors are missing
    /// or invalid.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, ParameterError> {
        let mirror = setup.mirror_camera(&CAMERA)?;
        let refused = |problem: &str| ParameterError::new("inputs.camera", problem);
        if mirror.mount.tilt.hypotenuse(mirror.mount.roll) > MAX_LEAN_RAD {
            return Err(refused(
                "method floor-outline requires an upright mirror camera, without tilt and roll",
            ));
        }
        let path = config.file("floor_plan", config.floor_plan.as_ref(), setup)?;
        let file =
            FloorPlanFile::read(&path).map_err(|problem| ParameterError::new("floor_plan", problem))?;
        let path = config.file("floor_colors", config.floor_colors.as_ref(), setup)?;
        let colors =
            ColorFile::read(&path).map_err(|problem| ParameterError::new("floor_colors", problem))?;
        let max_radius_px = max_radius_px(&mirror.camera, mirror.mount.z)
            .ok_or_else(|| refused("method floor-outline requires a mirror camera that sees the floor"))?;
        let rule = FloorRule::new(OutlineRule { height_m: mirror.mount.z, max_radius_px });
        let walls = sides(&file.corners()).map(|[from, to]| Wall { from, to }).collect();
        let image = mirror.camera.image();
        Ok(Self {
            walls: WireFrame::new(Vec::new(), walls),
            robot_from_camera: Pose2::new(mirror.mount.x, mirror.mount.y, mirror.mount.pan),
            colors,
            size: image.size(),
            columns: columns(image),
            mask: BitImage::default(),
            body: BitImage::default(),
            morphology: Morphology::default(),
            localizer: FloorLocalizer::new(file.plan()?, mirror.camera, rule),
            last: None,
        })
    }

    /// Returns the localizer that fits the outline to the plan.
    #[must_use]
    pub fn localizer(&self) -> &FloorLocalizer {
        &self.localizer
    }

    /// Returns the fix from the last image alone, in which the prior only selects between two solutions; `None` without
    /// one.
    #[must_use]
    pub fn last(&self) -> Option<&FloorFix> {
        self.last.as_ref()
    }
}

impl PoseFinder for FloorFinder {
    fn walls(&self) -> &WireFrame {
        &self.walls
    }

    fn observe(&mut self, frame: &View<'_, FrameHeader>) -> Result<(), Reason> {
        self.last = None;
        let image = frame.rgb(self.size).ok_or(Reason::MalformedInput)?;
        self.colors.mark(image, &self.columns, &mut self.mask);
        self.morphology.close(&mut self.mask, CLOSING_PX);
        // Specks outside of the floor would widen its hull. The larger dilation preserves the floor's corners.
        self.body.copy_from(&self.mask);
        self.morphology.erode(&mut self.body, OPENING_PX);
        self.morphology.dilate(&mut self.body, 2 * OPENING_PX);
        self.mask.intersect(&self.body);
        Ok(())
    }

    fn fix(&mut self, prior: &Belief, noise: NoiseFactors) -> Fix {
        let predicted = prior.of_mounted(&self.robot_from_camera);
        let fix = match self.localizer.locate(&self.mask, Some(&predicted)) {
            Ok(fix) => fix,
            Err(problem) => return Fix::none(prior, reason(&problem)),
        };
        self.last = Some(fix);
        let mut result = Fix { expected: fix.corners, ..Fix::none(prior, Reason::Ambiguous) };
        if fix.solution != FloorSolution::Unique {
            return result;
        }
        let scaled = |factor: f64| Belief { covariance: fix.belief.covariance * factor, ..fix.belief };
        let mut gated = predicted;
        let Update::Applied(distance) = gated.update_pose(&scaled(noise.scale), POSE_GATE) else {
            result.verdict = Err(Reason::Gated);
            return result;
        };
        let mut after = predicted;
        after.update_pose(&scaled(noise.scale * noise.correlation), f64::INFINITY);
        result.posterior = after.of_mounted(&self.robot_from_camera.inverse());
        result.verdict = Ok(());
        result.lines = fix.corners;
        result.nis = fix.corners as f64 * distance / 3.0;
        result
    }

    fn draw(&self, overlay: &mut Overlay) {
        let camera = self.last.as_ref().map(|fix| fix.belief.pose);
        super::overlay::draw(overlay, &self.localizer, &self.walls, camera.as_ref());
    }

    fn search(&mut self, prior: &Belief, _: NoiseFactors) -> Option<Belief> {
        let fix = self.localizer.locate(&self.mask, None).ok()?;
        let heading = prior.of_mounted(&self.robot_from_camera).pose.theta;
        let off = angle_difference(fix.belief.pose.theta, heading).abs();
        let pose = match fix.solution {
            FloorSolution::Unique => fix.belief.pose,
            // Far from both headings, the prior does not select one.
            FloorSolution::Ambiguous { .. } if (off - FRAC_PI_2).abs() < FRAC_PI_4 => return None,
            FloorSolution::Ambiguous { .. } if off < FRAC_PI_2 => fix.belief.pose,
            FloorSolution::Ambiguous { other } => other,
        };
        let mut found = Belief { pose, ..fix.belief }.of_mounted(&self.robot_from_camera.inverse());
        let [position, heading] = OUTLINE_SEARCH_SIGMA;
        found.raise_variances([position * position, position * position, heading * heading]);
        Some(found)
    }
}

fn reason(problem: &FloorProblem) -> Reason {
    match problem {
        FloorProblem::ImageSizeError => Reason::MalformedInput,
        FloorProblem::TooFewCorners { .. } => Reason::TooFewSegments,
        FloorProblem::Singular => Reason::Degenerate,
        FloorProblem::Residual { .. } => Reason::MisRegistered,
        FloorProblem::Area { .. } => Reason::FloorModelBroken,
        FloorProblem::Gap { .. } => Reason::OneSided,
        FloorProblem::Jump { .. } => Reason::Gated,
    }
}

/// Returns the range of columns within the mirror's rim for each row.
fn columns(image: &MirrorImage) -> Vec<Range<u32>> {
    let is_inside = |u: u32, v: u32| {
        image.mirror_from_pixel(Vector2::new(f64::from(u), f64::from(v))).norm() < image.rim_radius_px()
    };
    let row = |v: u32| {
        let first = (0..image.width).find(|&u| is_inside(u, v)).unwrap_or(0);
        let end = (first..image.width).rev().find(|&u| is_inside(u, v)).map_or(first, |last| last + 1);
        first..end
    };
    (0..image.height).map(row).collect()
}

/// Returns the maximum radius in the image (px) at which the floor is seen precisely enough by a mirror at this height
/// (m);
/// `None` if it does not see the floor.
fn max_radius_px(camera: &MirrorCamera, height_m: f64) -> Option<f64> {
    let rim = camera.image().rim_radius_px() - RIM_PX;
    let steps = (2.0 * rim) as u32;
    let radii = (1..=steps).rev().map(|step| 0.5 * f64::from(step));
    let is_precise = |radius: &f64| {
        camera.floor_slope_m_per_px(*radius, height_m).is_some_and(|slope| slope <= MAX_SLOPE_M_PER_PX)
    };
    radii.into_iter().find(is_precise)
}
