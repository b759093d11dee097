//! The plugins that a configuration may name.

use crate::behavior::BehaviorPlugin;
use crate::sensor::{DrivePlugin, DriverPlugin, SensorPlugin};

/// The plugins that a configuration may name.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plugins<'a> {
    /// For task files.
    pub behaviors: &'a [BehaviorPlugin],
    /// For robot files.
    pub drivers: &'a [DriverPlugin],
}

impl Plugins<'_> {
    /// The behaviour of this name.
    pub fn behavior(&self, name: &str) -> Option<&BehaviorPlugin> {
        self.behaviors.iter().find(|plugin| plugin.name == name)
    }

    /// The driver of this name.
    pub fn driver(&self, name: &str) -> Option<&DriverPlugin> {
        self.drivers.iter().find(|plugin| plugin.name == name)
    }
}

impl DriverPlugin {
    /// The kind of sensor of this name.
    pub fn sensor(&self, kind: &str) -> Option<&'static SensorPlugin> {
        self.sensors.iter().find(|plugin| plugin.kind == kind)
    }

    /// The kind of drive of this name.
    pub fn drive(&self, kind: &str) -> Option<&'static DrivePlugin> {
        self.drives.iter().find(|plugin| plugin.kind == kind)
    }
}
