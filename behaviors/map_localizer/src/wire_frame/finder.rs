use yamabico_core::behavior::{ParameterError, Setup};
use yamabico_core::geometry::angle_difference;
use yamabico_core::image::GrayImage;
use yamabico_core::message::{FrameHeader, Reason, View};
use yamabico_core::overlay::Overlay;
use yamabico_core::sensor::MountedPinhole;
use yamabico_vision::map::WireFrame;

use super::axis_heading::{AxisHeading, SeenHeading};
use super::fixer::Fixer;
use super::matching::LineNoise;
use super::recovery::Recovery;
use super::relocalize::Relocalizer;
use crate::CAMERA;
use crate::belief::Belief;
use crate::config::Config;
use crate::fix::{Fix, NoiseFactors, PoseFinder};
use crate::slip::{Angle, SLIP_GATES};

/// Maximum angle by which wheels slip between two fixes, rad: braking hard turns a robot by less than half of it. What differs
/// more is the vanishing point of something else, such as of tiles that lie diagonally.
const MAX_SLIP_RAD: f64 = 0.3;

/// Pose finder that matches the edges of a wire-frame map with the segments of an image.
#[derive(Clone, Debug)]
pub struct WireFrameFinder {
    fixer: Fixer,
    axis: AxisHeading,
    recovery: Recovery,
    relocalizer: Relocalizer,
    gray: GrayImage,
    sigma_px: f64,
    map_sigma_m: f64,
}

impl WireFrameFinder {
    /// Creates a finder for the configured map and the robot's pinhole camera.
    ///
    /// # Errors
    /// The camera is of another kind, or the map is missing or invalid.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, ParameterError> {
        let MountedPinhole { pinhole, mount, .. } = setup.pinhole(&CAMERA)?;
        let map = WireFrame::read(&config.file("map", config.map.as_ref(), setup)?)
            .map_err(|error| ParameterError::new("map", error.to_string()))?;
        Ok(Self {
            axis: AxisHeading::new(&map, &mount),
            recovery: Recovery::default(),
            relocalizer: Relocalizer::default(),
            fixer: Fixer::new(map, pinhole, mount),
            gray: GrayImage::default(),
            sigma_px: config.sigma_px,
            map_sigma_m: config.map_sigma_m,
        })
    }

    /// Returns the expected edges, the segments and their pairs of the last image.
    #[must_use]
    pub fn fixer(&self) -> &Fixer {
        &self.fixer
    }

    fn line_noise(&self, noise: NoiseFactors) -> LineNoise {
        LineNoise {
            sigma_px: self.sigma_px,
            map_sigma_m: self.map_sigma_m,
            scale: noise.scale,
            correlation: noise.correlation,
        }
    }

    /// Observes the heading by the vanishing point of the last image, of the possible ones the nearest to the prior's.
    fn seen_heading(&mut self, prior: &Belief) -> Option<SeenHeading> {
        let Self { axis, fixer, .. } = self;
        axis.observe(fixer.segments(), fixer.pinhole(), fixer.mount(), prior.pose.theta)
    }

    /// Returns the prior turned to the heading that the vanishing point shows, if that contradicts the odometry: the
    /// wheels have slipped. Its variance is inflated by the square of the slip.
    fn after_slip(&mut self, prior: &Belief) -> Option<Belief> {
        let seen = self.seen_heading(prior).filter(|seen| seen.is_supported)?;
        let odometry = Angle { rad: prior.pose.theta, variance: prior.covariance[(2, 2)] };
        let slip = angle_difference(seen.heading.rad, prior.pose.theta);
        let has_slipped = SLIP_GATES.compare_yaw(&odometry, &seen.heading).has_slipped;
        (has_slipped && slip.abs() <= MAX_SLIP_RAD).then(|| {
            let mut turned = *prior;
            turned.covariance[(2, 2)] += slip * slip;
            turned.update_heading(seen.heading.rad, seen.heading.variance.sqrt(), f64::INFINITY);
            turned
        })
    }
}

impl PoseFinder for WireFrameFinder {
    fn walls(&self) -> &WireFrame {
        self.fixer.map()
    }

    fn observe(&mut self, frame: &View<'_, FrameHeader>) -> Result<(), Reason> {
        let image = frame.gray(self.fixer.pinhole().intrinsics().size(), &mut self.gray);
        self.fixer.observe(image.ok_or(Reason::MalformedInput)?)
    }

    fn fix(&mut self, prior: &Belief, noise: NoiseFactors) -> Fix {
        let noise = self.line_noise(noise);
        let Some(turned) = self.after_slip(prior) else { return self.fixer.fix(prior, &noise) };
        let straight = self.fixer.fix(prior, &noise);
        let fix = self.fixer.fix(&turned, &noise);
        if fix.is_better_than(&straight) { fix } else { self.fixer.fix(prior, &noise) }
    }

    fn draw(&self, overlay: &mut Overlay) {
        super::overlay::draw(overlay, &self.fixer);
    }

    fn can_recover(&self) -> bool {
        true
    }

    fn recover(&mut self, prior: &Belief, noise: NoiseFactors) -> Option<Fix> {
        let noise = self.line_noise(noise);
        let seen = self.seen_heading(prior);
        self.recovery.find(&mut self.fixer, seen.as_ref(), prior, &noise)
    }

    fn search(&mut self, prior: &Belief, noise: NoiseFactors) -> Option<Belief> {
        let noise = self.line_noise(noise);
        self.relocalizer.find(&mut self.fixer, &mut self.axis, prior, &noise)
    }
}
