//! Joysticks of the kernel, as event devices (`/dev/input/event*`).

use std::fs::{File, read_dir, read_to_string};
use std::io;
use std::path::{Path, PathBuf};

use evdev::Device;
use yamabico_core::device_file;

use super::connection::Joystick;
use super::pad::{Axis, AxisPosition, Button, PadState};

/// Folder with the properties of input devices, which everybody may read.
const CLASS: &str = "/sys/class/input";
/// Codes of the buttons of joysticks and gamepads.
const JOYSTICK_BUTTONS: std::ops::Range<usize> = 0x120..0x140;

/// A joystick that is connected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Device file.
    pub path: PathBuf,
    /// Name that it gives itself.
    pub name: String,
}

/// An open event device.
pub struct KernelJoystick(Device);

/// Lists the joysticks that are connected, also those that this user may not open.
pub fn joysticks() -> Vec<Found> {
    joysticks_in(Path::new(CLASS))
}

/// Opens the joystick `device`, or the first one.
///
/// # Errors
/// There is none, or it cannot be opened; with the remedy.
pub fn open(device: Option<&Path>) -> Result<KernelJoystick, String> {
    let first = || joysticks().into_iter().next().map(|found| found.path);
    let path = device.map(Path::to_owned).or_else(first).ok_or(
        "no joystick is connected: connect one (`cat /proc/bus/input/devices` lists all input devices), or drive with the keyboard",
    )?;
    let file = File::open(&path).map_err(|error| device_file::refusal(&path, &error))?;
    let device = Device::from_fd(file.into()).map_err(|error| {
        let name = path.display();
        format!("{name} is no event device ({error}): name a file such as /dev/input/event5; `--joystick --list` shows them")
    })?;
    Ok(KernelJoystick(device))
}

impl Joystick for KernelJoystick {
    /// Reads the state itself: of events, some would be lost where the kernel's queue overflows.
    fn state(&mut self) -> io::Result<PadState> {
        let axes = self.0.get_absinfo()?.map(|(axis, info)| {
            let bounds = [info.minimum(), info.maximum()];
            (Axis(axis.0), AxisPosition { value: info.value(), bounds, flat: info.flat() })
        });
        let axes = axes.collect();
        let held = self.0.get_key_state()?.iter().map(|button| Button(button.0)).collect();
        Ok(PadState { axes, held })
    }
}

fn joysticks_in(class: &Path) -> Vec<Found> {
    let entries = read_dir(class).into_iter().flatten().flatten();
    let mut found: Vec<(u32, Found)> = entries
        .filter_map(|entry| {
            let file = entry.file_name().to_string_lossy().into_owned();
            let number = file.strip_prefix("event")?.parse().ok()?;
            let text =
                |name: &str| read_to_string(entry.path().join("device").join(name)).unwrap_or_default();
            let (axes, buttons) = (bits(&text("capabilities/abs")), bits(&text("capabilities/key")));
            let has_sticks = [0, 1].iter().all(|axis| axes.contains(axis));
            let is_joystick = has_sticks && buttons.iter().any(|button| JOYSTICK_BUTTONS.contains(button));
            let path = Path::new("/dev/input").join(file);
            is_joystick.then(|| (number, Found { path, name: text("name").trim().to_owned() }))
        })
        .collect();
    found.sort_by_key(|(number, _)| *number);
    found.into_iter().map(|(_, found)| found).collect()
}

/// Numbers of the bits that are set in a bitmap of the kernel: hexadecimal words, the most significant first.
fn bits(text: &str) -> Vec<usize> {
    let size = usize::BITS as usize;
    let words = text.split_whitespace().rev().map(|word| usize::from_str_radix(word, 16).unwrap_or(0));
    let bits = |(i, word): (usize, usize)| {
        (0..size).filter(move |bit| word >> bit & 1 == 1).map(move |bit| i * size + bit)
    };
    words.enumerate().flat_map(bits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joysticks_are_known_by_their_sticks_and_buttons() {
        let class = std::env::temp_dir().join(format!("yamabico-input-{}", std::process::id()));
        // Bitmaps as the kernel writes them.
        let devices = [
            ("event10", "Second Pad", "3003f", "ffff000000000000 0 0 0 0"),
            ("event3", "Gamepad", "3003f", "7cdb000000000000 0 0 0 0"),
            ("event4", "Gamepad Motion Sensors", "3f", "0"),
            ("event5", "Touchpad", "260800000000003", "e520 10000 0 0 0 0"),
            ("event6", "Keyboard", "0", "fffffffffffffffe"),
            ("js0", "Gamepad", "3003f", "7cdb000000000000 0 0 0 0"),
            ("event7", "damaged", "no number", "\n"),
        ];
        for (file, name, axes, buttons) in devices {
            let folder = class.join(file).join("device/capabilities");
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(folder.join("abs"), format!("{axes}\n")).unwrap();
            std::fs::write(folder.join("key"), format!("{buttons}\n")).unwrap();
            std::fs::write(class.join(file).join("device/name"), format!("{name}\n")).unwrap();
        }
        let found = joysticks_in(&class);
        std::fs::remove_dir_all(&class).unwrap();
        let found: Vec<_> =
            found.iter().map(|found| (found.path.to_str().unwrap(), found.name.as_str())).collect();
        assert_eq!(found, [("/dev/input/event3", "Gamepad"), ("/dev/input/event10", "Second Pad")]);
        assert!(joysticks_in(Path::new("/nonexistent")).is_empty());
    }

    #[test]
    fn errors_name_the_remedy() {
        let error = |path: &str| open(Some(Path::new(path))).err().unwrap();
        assert!(error("/dev/null").contains("--joystick --list"), "{}", error("/dev/null"));
        assert!(error("/dev/input/event999").contains("does not exist"), "{}", error("/dev/input/event999"));
    }
}
