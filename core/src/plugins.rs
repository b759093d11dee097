//! The plugins that a configuration may name.

use std::sync::Arc;

use crate::behavior::BehaviorFactory;
use crate::driver::Driver;

/// The plugins that a configuration may name.
#[derive(Clone, Debug, Default)]
pub struct Plugins {
    /// Behaviors, for task files.
    pub behaviors: Vec<Arc<dyn BehaviorFactory>>,
    /// Drivers, for robot files.
    pub drivers: Vec<Arc<dyn Driver>>,
}

impl Plugins {
    /// The behavior of this name.
    #[must_use]
    pub fn behavior(&self, name: &str) -> Option<&Arc<dyn BehaviorFactory>> {
        self.behaviors.iter().find(|plugin| plugin.info().name == name)
    }

    /// The driver of this name.
    #[must_use]
    pub fn driver(&self, name: &str) -> Option<&Arc<dyn Driver>> {
        self.drivers.iter().find(|driver| driver.info().name == name)
    }
}
