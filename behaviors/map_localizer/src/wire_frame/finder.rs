use yamabico_core::behavior::{ParameterError, Setup};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{FrameHeader, Reason, View};
use yamabico_core::sensor::MountedPinhole;
use yamabico_vision::map::WireFrame;

use super::fixer::Fixer;
use super::matching::LineNoise;
use super::relocalize::Relocalizer;
use crate::CAMERA;
use crate::belief::Belief;
use crate::config::Config;
use crate::fix::{Fix, NoiseFactors, PoseFinder};

/// Pose finder that matches the edges of a wire-frame map with the segments of an image.
#[derive(Clone, Debug)]
pub struct WireFrameFinder {
    fixer: Fixer,
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
            relocalizer: Relocalizer::new(&map, &mount),
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
        self.fixer.fix(prior, &self.line_noise(noise))
    }

    fn search(&mut self, prior: &Belief, noise: NoiseFactors) -> Option<Belief> {
        let noise = self.line_noise(noise);
        self.relocalizer.find(&mut self.fixer, prior, &noise)
    }
}
