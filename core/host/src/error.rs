//! Errors of hosting a plugin.

use crate::bus::BusError;
use yamabico_core::behavior::ParameterError;

/// Failure to set up a behavior or a device.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// The behavior's constructor rejects its parameters.
    #[error(transparent)]
    Build(#[from] ParameterError),
    /// The device cannot be opened.
    #[error("cannot open device `{device}`: {reason}")]
    Device {
        /// Name in the robot file.
        device: String,
        /// Reason given by its driver.
        reason: ParameterError,
    },
    /// A topic cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The plugin's process cannot be started, or did not become ready.
    #[error("the process of `{name}` did not become ready: {reason}")]
    Process {
        /// Name of the plugin.
        name: String,
        /// Cause and remedy.
        reason: String,
    },
    /// The plugin's thread cannot be started.
    #[error("cannot start the thread of `{name}`: {source}; end other programs or raise `ulimit -u`")]
    Thread {
        /// Name of the plugin.
        name: String,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
}
