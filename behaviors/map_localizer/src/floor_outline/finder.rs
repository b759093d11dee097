use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::ops::Range;

use nalgebra::Vector2;
use yamabico_core::behavior::{BuildError, Setup};
use yamabico_core::camera::{MirrorCamera, MirrorImage};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{FrameHeader, Reason, View};
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::floor_color::FloorColors;
use yamabico_vision::floor_color_file::ColorFile;
use yamabico_vision::map::{Wall, WireFrame};
use yamabico_vision::morphology::Morphology;
use yamabico_vision::polygon::sides;

use super::localizer::{FloorFix, FloorLocalizer, FloorProblem, FloorRule, FloorSolution};
use super::outline::OutlineRule;
use super::plan_file::FloorPlanFile;
use crate::CAMERA;
use crate::belief::{Belief, Update};
use crate::config::Config;
use crate::fix::{Fix, PoseFinder, Trust};

/// Corners whose place on the floor changes by more than this with a pixel tell nothing, meters.
const MAX_SLOPE_M: f64 = 0.7;
/// Corners this near to the rim of the mirror are those of the rim, pixels.
const RIM_PX: f64 = 2.0;
/// Specks in the floor up to twice so many pixels wide are closed, as lines are.
const CLOSED_PX: u32 = 1;
/// Specks beside the floor up to twice so many pixels wide are none.
const SPECK_PX: u32 = 1;
/// A mirror that leans by more is not upright, rad.
const UPRIGHT_RAD: f64 = 0.002;
/// Least standard deviations of a robot that was found again: meters, radians.
const FOUND_SIGMA: [f64; 2] = [0.02, 0.01];
/// Squared distance of a measured pose from the belief that is allowed, three degrees of freedom.
const GATE: f64 = 16.27;

/// Finds the robot by the outline of the floor around it.
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
    /// One for the configuration's floor and the robot's mirror camera.
    ///
    /// # Errors
    /// Another kind of camera, one that leans or does not see the floor, no plan or no colors, or files that cannot be read.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, BuildError> {
        let mirror = setup.mirror_camera(&CAMERA)?;
        let refused = |problem: &str| BuildError::new("inputs.camera", problem);
        if mirror.mount.tilt.hypot(mirror.mount.roll) > UPRIGHT_RAD {
            return Err(refused("floor-outline needs a mirror that stands upright: no tilt and no roll"));
        }
        let path = config.file("floor_plan", config.floor_plan.as_ref(), setup)?;
        let file = FloorPlanFile::read(&path).map_err(|problem| BuildError::new("floor_plan", problem))?;
        let path = config.file("floor_colors", config.floor_colors.as_ref(), setup)?;
        let colors = ColorFile::read(&path).map_err(|problem| BuildError::new("floor_colors", problem))?;
        let max_radius_px = max_radius_px(&mirror.camera, mirror.mount.z)
            .ok_or_else(|| refused("floor-outline needs a mirror that shows the floor"))?;
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

    /// The floor in the last picture.
    #[must_use]
    pub fn mask(&self) -> &BitImage {
        &self.mask
    }

    /// What fits its outline to the plan.
    #[must_use]
    pub fn localizer(&self) -> &FloorLocalizer {
        &self.localizer
    }

    /// The pose of the last picture alone, in which the belief before it only chose between two; `None` where there was none.
    #[must_use]
    pub fn last(&self) -> Option<&FloorFix> {
        self.last.as_ref()
    }
}

impl PoseFinder for FloorFinder {
    fn walls(&self) -> &WireFrame {
        &self.walls
    }

    fn take(&mut self, frame: &View<'_, FrameHeader>) -> Result<(), Reason> {
        self.last = None;
        let picture = frame.rgb(self.size).ok_or(Reason::MalformedInput)?;
        self.colors.mark(picture, &self.columns, &mut self.mask);
        self.morphology.close(&mut self.mask, CLOSED_PX);
        // Specks beyond the floor would widen its hull; what is left keeps its corners.
        self.body.copy_from(&self.mask);
        self.morphology.erode(&mut self.body, SPECK_PX);
        self.morphology.dilate(&mut self.body, 2 * SPECK_PX);
        self.mask.keep(&self.body);
        Ok(())
    }

    fn fix(&mut self, prior: &Belief, trust: Trust) -> Fix {
        let predicted = prior.carried(&self.robot_from_camera);
        let fix = match self.localizer.locate(&self.mask, Some(&predicted)) {
            Ok(fix) => fix,
            Err(problem) => return Fix::none(prior, reason(&problem)),
        };
        self.last = Some(fix);
        let mut told = Fix { expected: fix.corners, ..Fix::none(prior, Reason::Ambiguous) };
        if fix.solution != FloorSolution::Sure {
            return told;
        }
        let scaled = |factor: f64| Belief { covariance: fix.belief.covariance * factor, ..fix.belief };
        let mut once = predicted;
        let Update::Applied(distance) = once.update_pose(&scaled(trust.scale), GATE) else {
            told.verdict = Err(Reason::Gated);
            return told;
        };
        let mut after = predicted;
        after.update_pose(&scaled(trust.scale * trust.repetition), f64::INFINITY);
        told.posterior = after.carried(&self.robot_from_camera.inverse());
        told.verdict = Ok(());
        told.lines = fix.corners;
        told.surprise = fix.corners as f64 * distance / 3.0;
        told
    }

    fn search(&mut self, prior: &Belief, _: Trust) -> Option<Belief> {
        let fix = self.localizer.locate(&self.mask, None).ok()?;
        let heading = prior.carried(&self.robot_from_camera).pose.theta;
        let off = angle_difference(fix.belief.pose.theta, heading).abs();
        let pose = match fix.solution {
            FloorSolution::Sure => fix.belief.pose,
            // Far from both headings, none is the likelier one.
            FloorSolution::Either { .. } if (off - FRAC_PI_2).abs() < FRAC_PI_4 => return None,
            FloorSolution::Either { .. } if off < FRAC_PI_2 => fix.belief.pose,
            FloorSolution::Either { other } => other,
        };
        let mut found = Belief { pose, ..fix.belief }.carried(&self.robot_from_camera.inverse());
        let [place, heading] = FOUND_SIGMA;
        found.floor([place * place, place * place, heading * heading]);
        Some(found)
    }
}

fn reason(problem: &FloorProblem) -> Reason {
    match problem {
        FloorProblem::WrongSize => Reason::MalformedInput,
        FloorProblem::TooFewCorners { .. } => Reason::TooFewSegments,
        FloorProblem::Singular => Reason::Degenerate,
        FloorProblem::Residual { .. } => Reason::MisRegistered,
        FloorProblem::Area { .. } => Reason::FloorModelBroken,
        FloorProblem::Gap { .. } => Reason::OneSided,
        FloorProblem::Jump { .. } => Reason::Gated,
    }
}

/// The columns of each row that lie within the mirror's rim.
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

/// The largest radius (pixels) at which the mirror, so high above the floor (m), still tells where the floor ends; `None` where
/// it shows no floor.
fn max_radius_px(camera: &MirrorCamera, height_m: f64) -> Option<f64> {
    let rim = camera.image().rim_radius_px() - RIM_PX;
    let steps = (2.0 * rim) as u32;
    let radii = (1..=steps).rev().map(|step| 0.5 * f64::from(step));
    let tells = |radius: &f64| {
        camera.floor_slope_m_per_px(*radius, height_m).is_some_and(|slope| slope <= MAX_SLOPE_M)
    };
    radii.into_iter().find(tells)
}
