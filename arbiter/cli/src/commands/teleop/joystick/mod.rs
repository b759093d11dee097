//! Driving with a joystick or gamepad, while a button is held.

mod connection;
mod kernel;
mod pad;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::{PERIOD, Session, line};
use crate::output::{printable, say};
use connection::{Connection, Contact, Joystick};
pub use pad::{AxisMap, Button};

/// Choice of a joystick, and of its axes and button.
#[derive(Clone, Debug)]
pub struct JoystickChoice {
    /// Device file; without it, the first joystick.
    pub device: Option<PathBuf>,
    /// Axes that drive.
    pub axes: AxisMap,
    /// Button that is held to drive.
    pub hold: Button,
}

impl Session {
    /// Drives with a joystick until Ctrl-C. One that is unplugged is waited for, while the robot gets no stick.
    pub(super) fn by_joystick(
        &mut self,
        choice: &JoystickChoice,
        interrupt: &AtomicBool,
    ) -> Result<(), String> {
        let device = choice.device.as_deref();
        let mut connection = Connection::open(|| kernel::open(device), choice.axes, choice.hold)?;
        say(&format!(
            "hold button `{}` to drive: --hold and --axes choose others, `--joystick --list` shows them   Ctrl-C: end",
            choice.hold
        ));
        let mut printed = String::new();
        while !interrupt.load(Ordering::Relaxed) {
            let (deflection, pad) = match connection.poll(Instant::now()) {
                Contact::Connected(deflection, state) => (deflection, state.line()),
                Contact::Lost => (None, "the joystick was unplugged: connect it again".to_owned()),
            };
            self.publish(deflection)?;
            let state = self.robot_state()?;
            let line = format!("{}   {pad}", line(deflection, 1.0, &state));
            if line != printed {
                say(&line);
                printed = line;
            }
            std::thread::sleep(PERIOD);
        }
        Ok(())
    }
}

/// Lists the joysticks, and shows axes and buttons of the chosen one as they move, until Ctrl-C.
pub fn list(choice: &JoystickChoice, interrupt: &AtomicBool) -> Result<(), String> {
    for found in kernel::joysticks() {
        say(&format!("{}   {}", found.path.display(), printable(&found.name)));
    }
    let mut joystick = kernel::open(choice.device.as_deref())?;
    say("axes in -1 to 1, and held buttons, as they move   Ctrl-C: end");
    let mut printed = String::new();
    while !interrupt.load(Ordering::Relaxed) {
        let state = joystick.state().map_err(|error| format!("the joystick was unplugged: {error}"))?;
        let line = state.line();
        if line != printed {
            say(&line);
            printed = line;
        }
        std::thread::sleep(2 * PERIOD);
    }
    Ok(())
}
