//! State of a joystick, and the deflection that it asks for.

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr;

use evdev::{AbsoluteAxisCode, KeyCode};

/// Minimum dead zone of a stick: a released one does not rest exactly at zero.
const DEAD_ZONE: f64 = 0.1;

/// An axis, by the kernel's name without `ABS_`, such as `rx`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Axis(pub u16);

/// A button, by the kernel's name without `BTN_`, such as `tl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Button(pub u16);

/// The axes of a joystick that drive: forward, left and turn left. A minus reverses one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMap(pub [(f64, Axis); 3]);

/// Position of an axis and its bounds, in the units of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AxisPosition {
    /// Position.
    pub value: i32,
    /// Minimum and maximum.
    pub bounds: [i32; 2],
    /// Width of the dead zone by the device, about the middle.
    pub flat: i32,
}

/// State of a joystick.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PadState {
    /// Its axes.
    pub axes: BTreeMap<Axis, AxisPosition>,
    /// The buttons that are held.
    pub held: BTreeSet<Button>,
}

/// Dead-man switch and sticks of a joystick that was just connected.
///
/// The button must be seen released before it counts: one that jams, or that is held while the joystick is connected, drives nothing.
/// An axis counts once it was seen at rest: until it is moved, the kernel may report a stick as fully deflected.
#[derive(Clone, Debug)]
pub struct DeadMan {
    axes: AxisMap,
    hold: Button,
    is_armed: bool,
    has_rested: [bool; 3],
}

impl FromStr for Axis {
    type Err = String;

    fn from_str(text: &str) -> Result<Axis, String> {
        let name = format!("ABS_{}", bare_name(text, "ABS_"));
        let named = name.parse::<AbsoluteAxisCode>().ok().map(|axis| Axis(axis.0));
        let unknown = || {
            format!(
                "`{text}` is no axis: use a name such as x, y, rx or hat0x; `--joystick --list` shows them"
            )
        };
        named.or_else(|| text.parse().ok().map(Axis)).ok_or_else(unknown)
    }
}

impl FromStr for Button {
    type Err = String;

    fn from_str(text: &str) -> Result<Button, String> {
        let name = format!("BTN_{}", bare_name(text, "BTN_"));
        let named = name.parse::<KeyCode>().ok().map(|button| Button(button.0));
        let unknown = || {
            format!(
                "`{text}` is no button: use a name such as tl, south or trigger; `--joystick --list` shows them"
            )
        };
        named.or_else(|| text.parse().ok().map(Button)).ok_or_else(unknown)
    }
}

fn bare_name(text: &str, prefix: &str) -> String {
    let upper = text.to_uppercase();
    upper.strip_prefix(prefix).map_or_else(|| upper.clone(), str::to_owned)
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        name(f, &format!("{:?}", AbsoluteAxisCode(self.0)), "ABS_", self.0)
    }
}

impl std::fmt::Display for Button {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        name(f, &format!("{:?}", KeyCode(self.0)), "BTN_", self.0)
    }
}

/// Writes the kernel's name without its prefix, or the number where there is none.
fn name(f: &mut std::fmt::Formatter<'_>, kernel: &str, prefix: &str, number: u16) -> std::fmt::Result {
    match kernel.strip_prefix(prefix) {
        Some(name) => f.write_str(&name.to_lowercase()),
        None => write!(f, "{number}"),
    }
}

impl FromStr for AxisMap {
    type Err = String;

    fn from_str(text: &str) -> Result<AxisMap, String> {
        let axis = |text: &str| {
            let (sign, name) = text.trim().strip_prefix('-').map_or((1.0, text.trim()), |name| (-1.0, name));
            name.parse().map(|axis| (sign, axis))
        };
        let axes = text.split(',').map(axis).collect::<Result<Vec<_>, _>>()?;
        let axes =
            axes.try_into().map_err(|_| "three axes are needed: forward, left, turn, such as -y,-x,-rx")?;
        Ok(AxisMap(axes))
    }
}

impl AxisPosition {
    /// Deflection from the middle of its bounds, -1 to 1; zero in the dead zone, and for bounds that are none.
    pub fn deflection(&self) -> f64 {
        let [min, max] = self.bounds.map(f64::from);
        let half = 0.5 * (max - min);
        if half <= 0.0 {
            return 0.0;
        }
        let share = ((f64::from(self.value) - 0.5 * (min + max)) / half).clamp(-1.0, 1.0);
        let dead_zone = (f64::from(self.flat) / half).clamp(DEAD_ZONE, 0.5);
        if share.abs() < dead_zone { 0.0 } else { share }
    }
}

impl PadState {
    /// Deflections of the axes and the held buttons, such as `x 0.00  y -0.52   held: tl`.
    pub fn line(&self) -> String {
        let axes = self.axes.iter().map(|(axis, position)| format!("{axis} {:.2}", position.deflection()));
        let held: Vec<String> = self.held.iter().map(Button::to_string).collect();
        let held = if held.is_empty() { String::new() } else { format!("   held: {}", held.join(", ")) };
        format!("{}{held}", axes.collect::<Vec<_>>().join("  "))
    }
}

impl DeadMan {
    /// Returns the switch for a joystick in this state.
    ///
    /// # Errors
    /// It lacks one of the axes.
    pub fn new(axes: AxisMap, hold: Button, state: &PadState) -> Result<DeadMan, String> {
        let missing = axes.0.iter().find(|(_, axis)| !state.axes.contains_key(axis));
        if let Some((_, axis)) = missing {
            let known: Vec<String> = state.axes.keys().map(Axis::to_string).collect();
            return Err(format!(
                "the joystick has no axis `{axis}`; it has {}: choose by --axes",
                known.join(", ")
            ));
        }
        Ok(DeadMan { axes, hold, is_armed: false, has_rested: [false; 3] })
    }

    /// Takes a state in. Returns the deflection while the button is held: forward, left and turn, each -1 to 1.
    pub fn take(&mut self, state: &PadState) -> Option<[f64; 3]> {
        let mut deflection = [0.0; 3];
        for (i, (sign, axis)) in self.axes.0.into_iter().enumerate() {
            let share = state.axes.get(&axis).map_or(0.0, AxisPosition::deflection);
            self.has_rested[i] |= share == 0.0;
            // No negative zero.
            deflection[i] = if self.has_rested[i] { 0.0 + sign * share } else { 0.0 };
        }
        let is_held = state.held.contains(&self.hold);
        self.is_armed |= !is_held;
        (is_held && self.is_armed).then_some(deflection)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(values: &[(&str, i32)], held: &[&str]) -> PadState {
        let position = |value| AxisPosition { value, bounds: [-32_768, 32_767], flat: 128 };
        PadState {
            axes: values.iter().map(|(axis, value)| (axis.parse().unwrap(), position(*value))).collect(),
            held: held.iter().map(|button| button.parse().unwrap()).collect(),
        }
    }

    fn dead_man() -> DeadMan {
        let rest = state(&[("x", 0), ("y", 0), ("rx", 0)], &[]);
        DeadMan::new("-y,-x,-rx".parse().unwrap(), "tl".parse().unwrap(), &rest).unwrap()
    }

    #[test]
    fn a_held_button_releases_the_sticks() {
        let mut dead_man = dead_man();
        let forward = [("x", 1500), ("y", -32_768), ("rx", 16_384)];
        assert_eq!(dead_man.take(&state(&[("x", 0), ("y", 0), ("rx", 0)], &[])), None);
        assert_eq!(dead_man.take(&state(&forward, &[])), None);
        let [forward_share, left, turn] = dead_man.take(&state(&forward, &["tl"])).unwrap();
        assert_eq!((forward_share, left), (1.0, 0.0));
        assert!((turn + 0.5).abs() < 1e-3, "{turn}");
        assert_eq!(dead_man.take(&state(&forward, &["tr"])), None);
    }

    #[test]
    fn a_button_that_is_held_from_the_beginning_drives_nothing() {
        let mut dead_man = dead_man();
        let rest = [("x", 0), ("y", 0), ("rx", 0)];
        for _ in 0..100 {
            assert_eq!(dead_man.take(&state(&rest, &["tl"])), None);
        }
        assert_eq!(dead_man.take(&state(&rest, &[])), None);
        assert_eq!(dead_man.take(&state(&rest, &["tl"])), Some([0.0; 3]));
    }

    #[test]
    fn a_stick_counts_once_it_was_at_rest() {
        // The kernel reports zero until a stick moves, which for bounds of 0 to 255 is fully deflected.
        let byte = |value| AxisPosition { value, bounds: [0, 255], flat: 15 };
        let at = |value: i32, held: &[&str]| PadState {
            axes: [("x", 0), ("y", value), ("rx", 0)]
                .map(|(axis, value)| (axis.parse().unwrap(), byte(value)))
                .into(),
            held: held.iter().map(|button| button.parse().unwrap()).collect(),
        };
        let mut dead_man = DeadMan::new("-y,-x,-rx".parse().unwrap(), Button(310), &at(0, &[])).unwrap();
        assert_eq!(dead_man.take(&at(0, &[])), None);
        assert_eq!(dead_man.take(&at(0, &["tl"])), Some([0.0; 3]), "not full speed");
        assert_eq!(dead_man.take(&at(128, &["tl"])), Some([0.0; 3]));
        assert_eq!(dead_man.take(&at(0, &["tl"])).unwrap()[0], 1.0);
    }

    #[test]
    fn names_are_those_of_the_kernel_and_unknown_ones_are_refused() {
        for (text, axis) in [("x", 0), ("ABS_RX", 3), ("rz", 5), ("hat0y", 17), ("40", 40)] {
            assert_eq!(text.parse(), Ok(Axis(axis)), "{text}");
        }
        for (text, button) in [("tl", 310), ("BTN_TRIGGER", 288), ("south", 304), ("300", 300)] {
            assert_eq!(text.parse(), Ok(Button(button)), "{text}");
        }
        assert_eq!(
            (Axis(3).to_string(), Axis(62).to_string(), Button(310).to_string()),
            ("rx".into(), "62".into(), "tl".into())
        );
        assert_eq!("y, -x,3".parse(), Ok(AxisMap([(1.0, Axis(1)), (-1.0, Axis(0)), (1.0, Axis(3))])));
        assert!("x,y".parse::<AxisMap>().unwrap_err().contains("three axes"));
        assert!("x,why,y".parse::<AxisMap>().unwrap_err().contains("`why`"));
        assert!("knob".parse::<Button>().unwrap_err().contains("`knob`"));
        let missing =
            DeadMan::new("-y,-x,-rx".parse().unwrap(), Button(310), &state(&[("x", 0), ("y", 0)], &[]));
        assert!(missing.unwrap_err().contains("no axis `rx`; it has x, y"));
    }

    #[test]
    fn bounds_that_are_none_do_no_harm() {
        for bounds in [[0, 0], [10, -10], [i32::MIN, i32::MAX]] {
            let position = AxisPosition { value: i32::MAX, bounds, flat: i32::MAX };
            assert!((-1.0..=1.0).contains(&position.deflection()), "{bounds:?}");
        }
        let line = state(&[("x", -32_768), ("y", 0)], &["tl", "south"]).line();
        assert_eq!(line, "x -1.00  y 0.00   held: south, tl");
    }
}
