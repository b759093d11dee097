//! A joystick for teleop.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use gilrs::{Axis, Button, Gamepad, Gilrs};

use super::{PERIOD, Session, line};

/// A stick that is let go does not stand exactly in its middle.
const MIDDLE: f32 = 0.1;

impl Session {
    /// Drives by the first joystick until Ctrl-C.
    pub(super) fn by_joystick(&mut self, flag: &AtomicBool) -> Result<(), String> {
        let mut gilrs = Gilrs::new().map_err(|error| format!("joysticks cannot be read: {error}"))?;
        if gilrs.gamepads().next().is_none() {
            return Err("there is no joystick: plug one in, or drive by keys".to_owned());
        }
        println!(
            "left stick: forward and sideways   right stick: turn   hold the left upper trigger to drive   Ctrl-C: end"
        );
        let mut told = String::new();
        while !flag.load(Ordering::Relaxed) {
            while gilrs.next_event().is_some() {}
            let held = gilrs.gamepads().find_map(|(_, pad)| stick(&pad));
            self.publish(held)?;
            let what = self.what()?;
            let line = line(held, 1.0, &what);
            if line != told {
                println!("{line}");
                told = line;
            }
            std::thread::sleep(PERIOD.max(Duration::from_millis(20)));
        }
        Ok(())
    }
}

/// Where the stick is held, while the trigger is.
fn stick(pad: &Gamepad<'_>) -> Option<[f64; 3]> {
    let share = |axis| {
        let value = pad.value(axis);
        if value.abs() < MIDDLE { 0.0 } else { f64::from(value.clamp(-1.0, 1.0)) }
    };
    let [forward, left, turn] =
        [share(Axis::LeftStickY), -share(Axis::LeftStickX), -share(Axis::RightStickX)];
    pad.is_pressed(Button::LeftTrigger).then_some([forward, left, turn])
}
