//! Color of the floor in front of the robot, as it changes along the way.

use super::lab::Lab;

/// Shares by which the color follows what is seen, for a change of lightness alone and for another color.
const LEARN: f32 = 0.3;
const LEARN_OTHER: f32 = 0.02;
/// Change of color up to which it is still the same floor.
const SAME_COLOR: f32 = 8.0;
/// Change of lightness up to which it is surely the same floor, and pictures in a row after which a larger one is another
/// light: the legs of a person who steps before the robot are in the picture before any sensor tells them from the floor.
const SAME_LIGHTNESS: f32 = 24.0;
const OTHER_LIGHT_PICTURES: u32 = 5;

/// The color that the floor in front of the robot had in the last pictures.
#[derive(Clone, Copy, Debug, Default)]
pub struct NearColor {
    color: Option<Lab>,
    /// Pictures in a row whose lightness is another one.
    other_light: u32,
}

impl From<Lab> for NearColor {
    fn from(color: Lab) -> Self {
        Self { color: Some(color), other_light: 0 }
    }
}

impl NearColor {
    /// Learns from what is `seen` where nothing stands. Returns the color of the floor.
    pub fn learn(&mut self, seen: Lab) -> Lab {
        let color = *self.color.get_or_insert(seen);
        let off: Lab = std::array::from_fn(|channel| (seen[channel] - color[channel]).abs());
        self.other_light = if off[0] < SAME_LIGHTNESS { 0 } else { self.other_light.saturating_add(1) };
        let is_sudden = (1..=OTHER_LIGHT_PICTURES).contains(&self.other_light);
        let is_same = !is_sudden && off[1] < SAME_COLOR && off[2] < SAME_COLOR;
        let share = if is_same { LEARN } else { LEARN_OTHER };
        let color = std::array::from_fn(|channel| color[channel] + share * (seen[channel] - color[channel]));
        *self.color.insert(color)
    }

    /// Returns the color of the floor; what is `seen` if nothing was learned yet.
    pub fn keep(&mut self, seen: Lab) -> Lab {
        self.other_light = 0;
        *self.color.get_or_insert(seen)
    }
}
