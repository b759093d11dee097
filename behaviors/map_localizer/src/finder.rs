//! The ways to find the robot, by the configuration.

use yamabico_core::behavior::{BuildError, Setup};

use crate::azimuth::AzimuthFinder;
use crate::config::{Config, Method};
use crate::dead_reckoning::DeadReckoning;
use crate::fix::PoseFinder;
use crate::floor_outline::FloorFinder;
use crate::wire_frame::WireFrameFinder;

/// What finds the robot in pictures.
#[derive(Clone, Debug)]
pub enum Finder {
    /// By the edges of a wire-frame map.
    Wireframe(Box<WireFrameFinder>),
    /// By the azimuths of vertical edges.
    Azimuth(Box<AzimuthFinder>),
    /// By the outline of the floor.
    FloorOutline(Box<FloorFinder>),
    /// By the wheels alone.
    DeadReckoning(DeadReckoning),
}

impl Finder {
    /// The one that the configuration asks for.
    ///
    /// # Errors
    /// A camera of another kind, or a file that is missing or cannot be read.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, BuildError> {
        Ok(match config.method {
            Method::Wireframe => Self::Wireframe(Box::new(WireFrameFinder::new(config, setup)?)),
            Method::Azimuth => Self::Azimuth(Box::new(AzimuthFinder::new(config, setup)?)),
            Method::FloorOutline => Self::FloorOutline(Box::new(FloorFinder::new(config, setup)?)),
            Method::DeadReckoning => Self::DeadReckoning(DeadReckoning::default()),
        })
    }

    /// What all of them do.
    #[must_use]
    pub fn method(&self) -> &dyn PoseFinder {
        match self {
            Self::Wireframe(finder) => &**finder,
            Self::Azimuth(finder) => &**finder,
            Self::FloorOutline(finder) => &**finder,
            Self::DeadReckoning(finder) => finder,
        }
    }

    /// What all of them do, with a picture.
    pub fn method_mut(&mut self) -> &mut dyn PoseFinder {
        match self {
            Self::Wireframe(finder) => &mut **finder,
            Self::Azimuth(finder) => &mut **finder,
            Self::FloorOutline(finder) => &mut **finder,
            Self::DeadReckoning(finder) => finder,
        }
    }
}
