//! Choice of the localization method by the configuration.

use yamabico_core::behavior::{ParameterError, Setup};

use crate::azimuth::AzimuthFinder;
use crate::config::{Config, Method};
use crate::dead_reckoning::DeadReckoning;
use crate::fix::PoseFinder;
use crate::floor_outline::FloorFinder;
use crate::wire_frame::WireFrameFinder;

/// Pose finder of the configured method.
#[derive(Clone, Debug)]
pub enum Finder {
    /// Matches the edges of a wire-frame map.
    Wireframe(Box<WireFrameFinder>),
    /// Matches the azimuths of vertical edges.
    Azimuth(Box<AzimuthFinder>),
    /// Matches the outline of the floor.
    FloorOutline(Box<FloorFinder>),
    /// Uses odometry alone.
    DeadReckoning(DeadReckoning),
}

impl Finder {
    /// Creates the finder of the configured method.
    ///
    /// # Errors
    /// The camera is of another kind, or a file is missing or invalid.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, ParameterError> {
        Ok(match config.method {
            Method::Wireframe => Self::Wireframe(Box::new(WireFrameFinder::new(config, setup)?)),
            Method::Azimuth => Self::Azimuth(Box::new(AzimuthFinder::new(config, setup)?)),
            Method::FloorOutline => Self::FloorOutline(Box::new(FloorFinder::new(config, setup)?)),
            Method::DeadReckoning => Self::DeadReckoning(DeadReckoning::default()),
        })
    }

    /// Returns the finder behind its trait.
    #[must_use]
    pub fn method(&self) -> &dyn PoseFinder {
        match self {
            Self::Wireframe(finder) => &**finder,
            Self::Azimuth(finder) => &**finder,
            Self::FloorOutline(finder) => &**finder,
            Self::DeadReckoning(finder) => finder,
        }
    }

    /// Returns the finder behind its trait, mutable.
    pub fn method_mut(&mut self) -> &mut dyn PoseFinder {
        match self {
            Self::Wireframe(finder) => &mut **finder,
            Self::Azimuth(finder) => &mut **finder,
            Self::FloorOutline(finder) => &mut **finder,
            Self::DeadReckoning(finder) => finder,
        }
    }
}
