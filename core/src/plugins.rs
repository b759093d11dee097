//! The behaviors and drivers that task and robot files can name.

use std::sync::Arc;

use crate::behavior::BehaviorFactory;
use crate::driver::Driver;

/// The behaviors and drivers that task and robot files can name.
#[derive(Clone, Debug, Default)]
pub struct Plugins {
    /// Behaviors, named in task files.
    pub behaviors: Vec<Arc<dyn BehaviorFactory>>,
    /// Drivers, named in robot files.
    pub drivers: Vec<Arc<dyn Driver>>,
}

impl Plugins {
    /// Returns the behavior with this name, if any.
    #[must_use]
    pub fn behavior(&self, name: &str) -> Option<&Arc<dyn BehaviorFactory>> {
        self.behaviors.iter().find(|plugin| plugin.info().name == name)
    }

    /// Returns the driver with this name, if any.
    #[must_use]
    pub fn driver(&self, name: &str) -> Option<&Arc<dyn Driver>> {
        self.drivers.iter().find(|driver| driver.info().name == name)
    }
}
