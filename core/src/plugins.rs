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

    /// Makes the message types that these plugins declare known by their names.
    ///
    /// # Errors
    /// Two types have one name.
    pub fn register_messages(&self) -> Result<(), String> {
        let of_behaviors = self.behaviors.iter().flat_map(|behavior| {
            let info = behavior.info();
            info.inputs.iter().chain(&info.outputs).map(|slot| slot.message)
        });
        let of_drivers =
            self.drivers.iter().flat_map(|driver| driver.info().sensors.iter().map(|offer| offer.message));
        of_behaviors.chain(of_drivers).try_for_each(|message| message.register().map(drop))
    }

    /// Returns the driver with this name, if any.
    #[must_use]
    pub fn driver(&self, name: &str) -> Option<&Arc<dyn Driver>> {
        self.drivers.iter().find(|driver| driver.info().name == name)
    }
}
