//! Ctrl-C and SIGTERM.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag::{register, register_conditional_shutdown};

use crate::output::Failure;

/// Returns a flag that Ctrl-C and SIGTERM set, so that the robot is stopped before the program ends. A second Ctrl-C ends the
/// program at once; the drive's watchdog then stops the robot.
///
/// # Errors
/// The signal handlers cannot be installed.
pub fn interrupt_flag() -> Result<Arc<AtomicBool>, Failure> {
    install().map_err(|error| Failure::device(format!("cannot handle Ctrl-C: {error}")))
}

fn install() -> std::io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        register_conditional_shutdown(signal, 130, Arc::clone(&flag))?;
        register(signal, Arc::clone(&flag))?;
    }
    // A recording that exceeds the file size limit ends; the run goes on.
    register(SIGXFSZ, Arc::default())?;
    Ok(flag)
}
