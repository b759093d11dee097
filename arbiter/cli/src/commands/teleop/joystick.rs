//! Driving with a joystick, by the kernel's joystick interface (`/dev/input/js0`): it needs no library.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use yamabico_core::device_file;

use super::{PERIOD, Session, line};
use crate::output::say;

/// Dead zone of a stick: a released stick does not rest exactly at zero.
const DEAD_ZONE: f64 = 0.1;
/// Length of an event: time, value, kind and number (`struct js_event` of `linux/joystick.h`).
const EVENT_LEN: usize = 8;
/// Kinds of events; the other bit marks the state at the beginning.
const BUTTON: u8 = 1;
const AXIS: u8 = 2;

/// The axes of a joystick that drive: forward, left and turn left. A minus reverses one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMap([(f64, u8); 3]);

/// State of a joystick.
#[derive(Clone, Debug, Default)]
struct Pad {
    axes: BTreeMap<u8, f64>,
    buttons: BTreeMap<u8, bool>,
}

/// Choice of a joystick, and of its axes and button.
#[derive(Clone, Debug)]
pub struct JoystickChoice {
    /// Device file; without it, the first joystick.
    pub device: Option<PathBuf>,
    /// Axes that drive.
    pub axes: AxisMap,
    /// Number of the button that is held to drive.
    pub hold: u8,
}

impl FromStr for AxisMap {
    type Err = String;

    fn from_str(text: &str) -> Result<AxisMap, String> {
        let axis = |text: &str| {
            let (sign, number) =
                text.trim().strip_prefix('-').map_or((1.0, text.trim()), |number| (-1.0, number));
            number
                .parse()
                .map(|number| (sign, number))
                .map_err(|_| format!("`{text}` is not the number of an axis"))
        };
        let axes = text.split(',').map(axis).collect::<Result<Vec<_>, _>>()?;
        let axes =
            axes.try_into().map_err(|_| "three axes are needed: forward, left, turn, such as -1,-0,-3")?;
        Ok(AxisMap(axes))
    }
}

impl Session {
    /// Drives with a joystick until Ctrl-C.
    pub(super) fn by_joystick(
        &mut self,
        choice: &JoystickChoice,
        interrupt: &AtomicBool,
    ) -> Result<(), String> {
        let path = choice.device.clone().or_else(|| joysticks().into_iter().next()).ok_or(
            "no joystick is connected: connect one (it appears as /dev/input/js0; else `sudo modprobe joydev`), or drive with \
             the keyboard",
        )?;
        let file = File::open(&path).map_err(|error| device_file::refusal(&path, &error))?;
        let (events, mut pad) = (listen(file), Pad::default());
        say(&format!(
            "{}: hold button {} to drive; axes are forward, left and turn: --axes and --hold choose others   Ctrl-C: end",
            name(&path),
            choice.hold
        ));
        let mut printed = String::new();
        while !interrupt.load(Ordering::Relaxed) {
            loop {
                match events.try_recv() {
                    Ok(event) => pad.take(event),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => {
                        return Err(format!("{} was unplugged", path.display()));
                    }
                }
            }
            let deflection = pad.deflection(&choice.axes, choice.hold);
            self.publish(deflection)?;
            let state = self.robot_state()?;
            let line = format!("{}   {}", line(deflection, 1.0, &state), pad.pressed());
            if line != printed {
                say(&line);
                printed = line;
            }
            std::thread::sleep(PERIOD);
        }
        Ok(())
    }
}

/// Returns the device files of all joysticks.
fn joysticks() -> Vec<PathBuf> {
    let entries = std::fs::read_dir("/dev/input").into_iter().flatten().flatten();
    let is_joystick = |path: &PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        name.strip_prefix("js").is_some_and(|number| number.parse::<u32>().is_ok())
    };
    let mut found: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_joystick).collect();
    found.sort();
    found
}

/// Returns the name that a joystick gives itself, or that of its file.
fn name(path: &Path) -> String {
    let file = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let own_name = std::fs::read_to_string(format!("/sys/class/input/{file}/device/name"));
    own_name.map_or_else(|_| path.display().to_string(), |name| name.trim().to_owned())
}

/// Reads events on a thread of its own, until the joystick is unplugged.
fn listen(mut file: impl Read + Send + 'static) -> Receiver<[u8; EVENT_LEN]> {
    let (sender, events) = channel();
    std::thread::spawn(move || {
        let mut event = [0; EVENT_LEN];
        while file.read_exact(&mut event).is_ok() && sender.send(event).is_ok() {}
    });
    events
}

impl Pad {
    fn take(&mut self, event: [u8; EVENT_LEN]) {
        let [_, _, _, _, low, high, kind, number] = event;
        let value = i16::from_le_bytes([low, high]);
        if kind & BUTTON != 0 {
            self.buttons.insert(number, value != 0);
        } else if kind & AXIS != 0 {
            self.axes.insert(number, (f64::from(value) / 32_767.0).clamp(-1.0, 1.0));
        }
    }

    /// Deflection of the sticks while the button `hold` is held: forward, left and turn, each -1 to 1.
    fn deflection(&self, axes: &AxisMap, hold: u8) -> Option<[f64; 3]> {
        let deflection = axes.0.map(|(sign, number)| {
            let value = self.axes.get(&number).copied().unwrap_or(0.0);
            if value.abs() < DEAD_ZONE { 0.0 } else { sign * value }
        });
        self.buttons.get(&hold).copied().unwrap_or(false).then_some(deflection)
    }

    /// The axes and buttons that are not at rest, so that their numbers can be seen.
    fn pressed(&self) -> String {
        let axes = self
            .axes
            .iter()
            .filter(|(_, value)| value.abs() > 0.5)
            .map(|(number, _)| format!("axis {number}"));
        let buttons =
            self.buttons.iter().filter(|(_, held)| **held).map(|(number, _)| format!("button {number}"));
        axes.chain(buttons).collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(value: i16, kind: u8, number: u8) -> [u8; EVENT_LEN] {
        let [low, high] = value.to_le_bytes();
        [1, 2, 3, 4, low, high, kind, number]
    }

    #[test]
    fn a_held_button_releases_the_sticks() {
        let axes: AxisMap = "-1,-0,-3".parse().unwrap();
        // The state at the beginning has the bit 0x80.
        let stream =
            [event(0, 0x81, 4), event(-32_767, 2, 1), event(2000, 2, 0), event(16_384, 2, 3), event(1, 1, 4)];
        let events = listen(std::io::Cursor::new(stream.concat()));
        let mut pad = Pad::default();
        let deflections: Vec<_> = events
            .iter()
            .map(|event| {
                pad.take(event);
                pad.deflection(&axes, 4)
            })
            .collect();
        assert_eq!(deflections[..4], [None; 4]);
        let [forward, left, turn] = deflections[4].unwrap();
        assert!((forward, left) == (1.0, 0.0) && (turn + 0.5).abs() < 1e-4, "{forward} {left} {turn}");
        assert_eq!(pad.pressed(), "axis 1, axis 3, button 4");
        pad.take(event(0, 1, 4));
        assert_eq!(pad.deflection(&axes, 4), None);
        assert!(events.recv().is_err(), "unplugged");
    }

    #[test]
    fn axes_have_numbers_and_signs() {
        assert_eq!("1, -0,3".parse(), Ok(AxisMap([(1.0, 1), (-1.0, 0), (1.0, 3)])));
        assert!("1,2".parse::<AxisMap>().unwrap_err().contains("three axes"));
        assert!("1,x,2".parse::<AxisMap>().unwrap_err().contains("`x`"));
    }
}
