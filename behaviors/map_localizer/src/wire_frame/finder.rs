use yamabico_core::behavior::{BuildError, Setup};
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
use crate::fix::{Fix, PoseFinder, Trust};

/// Finds the robot by the edges of a wire-frame map.
#[derive(Clone, Debug)]
pub struct WireFrameFinder {
    fixer: Fixer,
    relocalizer: Relocalizer,
    gray: GrayImage,
    sigma_px: f64,
    map_sigma_m: f64,
}

impl WireFrameFinder {
    /// One for the configuration's map and the robot's pinhole camera.
    ///
    /// # Errors
    /// Another kind of camera, no map, or one that cannot be read.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, BuildError> {
        let MountedPinhole { pinhole, mount, .. } = setup.pinhole(&CAMERA)?;
        let map = WireFrame::read(&config.file("map", config.map.as_ref(), setup)?)
            .map_err(|error| BuildError::new("map", error.to_string()))?;
        Ok(Self {
            relocalizer: Relocalizer::new(&map, &mount),
            fixer: Fixer::new(map, pinhole, mount),
            gray: GrayImage::default(),
            sigma_px: config.sigma_px,
            map_sigma_m: config.map_sigma_m,
        })
    }

    /// The expected edges, the segments and their pairs at the last picture.
    #[must_use]
    pub fn fixer(&self) -> &Fixer {
        &self.fixer
    }

    fn noise(&self, trust: Trust) -> LineNoise {
        LineNoise {
            sigma_px: self.sigma_px,
            map_sigma_m: self.map_sigma_m,
            scale: trust.scale,
            repetition: trust.repetition,
        }
    }
}

impl PoseFinder for WireFrameFinder {
    fn walls(&self) -> &WireFrame {
        self.fixer.map()
    }

    fn take(&mut self, frame: &View<'_, FrameHeader>) -> Result<(), Reason> {
        let image = frame.gray(self.fixer.pinhole().intrinsics().size(), &mut self.gray);
        self.fixer.take(image.ok_or(Reason::MalformedInput)?)
    }

    fn fix(&mut self, prior: &Belief, trust: Trust) -> Fix {
        self.fixer.fix(prior, &self.noise(trust))
    }

    fn search(&mut self, prior: &Belief, trust: Trust) -> Option<Belief> {
        let noise = self.noise(trust);
        self.relocalizer.find(&mut self.fixer, prior, &noise)
    }
}
