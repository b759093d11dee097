//! Driving with a joystick.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use gilrs::{Axis, Button, Gamepad, Gilrs};

use super::{PERIOD, Session, line};
use crate::output::say;

/// Dead zone of a stick: a released stick does not rest exactly at zero.
const DEAD_ZONE: f32 = 0.1;
const HELP: &str = "left stick: forward and sideways   right stick: turn   hold the left upper trigger to drive   Ctrl-C: end";

impl Session {
    /// Drives with the first joystick until Ctrl-C.
    pub(super) fn by_joystick(&mut self, interrupt: &AtomicBool) -> Result<(), String> {
        let mut gilrs = Gilrs::new().map_err(|error| format!("cannot read joysticks: {error}"))?;
        if gilrs.gamepads().next().is_none() {
            return Err("no joystick is connected: connect one, or drive with the keyboard".to_owned());
        }
        say(HELP);
        let mut printed = String::new();
        while !interrupt.load(Ordering::Relaxed) {
            while gilrs.next_event().is_some() {}
            let deflection = gilrs.gamepads().find_map(|(_, pad)| deflection(&pad));
            self.publish(deflection)?;
            let state = self.robot_state()?;
            let line = line(deflection, 1.0, &state);
            if line != printed {
                say(&line);
                printed = line;
            }
            std::thread::sleep(PERIOD.max(Duration::from_millis(20)));
        }
        Ok(())
    }
}

/// Deflection of the sticks while the trigger is held: forward, left and turn, each -1 to 1.
fn deflection(pad: &Gamepad<'_>) -> Option<[f64; 3]> {
    let axis = |axis| {
        let value = pad.value(axis);
        if value.abs() < DEAD_ZONE { 0.0 } else { f64::from(value.clamp(-1.0, 1.0)) }
    };
    let [forward, left, turn] = [axis(Axis::LeftStickY), -axis(Axis::LeftStickX), -axis(Axis::RightStickX)];
    pad.is_pressed(Button::LeftTrigger).then_some([forward, left, turn])
}
