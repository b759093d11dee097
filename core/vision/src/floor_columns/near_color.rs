//! Color of the floor in front of the robot, as it changes along the way.

use super::cells::CellImage;
use super::lab::Lab;

/// Area whose color starts each column: shares of the picture's height and width.
const NEAR_TOP: f64 = 0.86;
const NEAR_SIDES: [f64; 2] = [0.36, 0.64];
/// Shares by which the color follows what is seen, for a change of lightness alone and for another color.
const LEARN: f32 = 0.3;
const LEARN_OTHER: f32 = 0.02;
/// Change of color up to which it is still the same floor.
const SAME_COLOR: f32 = 8.0;
/// Change of lightness up to which it is surely the same floor, and pictures in a row after which a larger one is another
/// light: the legs of a person who steps before the robot are in the picture before a sensor detects them.
const SAME_LIGHTNESS: f32 = 24.0;
const OTHER_LIGHT_PICTURES: u32 = 5;

/// Share by which the usual color follows what is the same floor, and pictures in a row after which another floor is the usual one: a
/// sheet of paper is soon behind the robot, unless it stands there.
const LEARN_USUAL: f32 = 0.1;
const OTHER_FLOOR_PICTURES: u32 = 300;

/// Colors of the floor in front of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorColors {
    /// Color in the last pictures.
    pub now: Lab,
    /// Color for most of the time.
    pub usual: Lab,
}

/// Color that the floor in front of the robot had in the last pictures.
#[derive(Clone, Debug)]
pub struct NearColor {
    colors: Option<FloorColors>,
    /// Pictures in a row of a floor that is not the usual one.
    unusual: u32,
    /// Pictures in a row whose lightness is another one.
    other_light: u32,
    sorted: Vec<f32>,
}

impl NearColor {
    /// Prepares for pictures of these cells; nothing is learned yet.
    pub fn new(cells: &CellImage) -> Self {
        let [columns, rows] = cells.size();
        Self { colors: None, unusual: 0, other_light: 0, sorted: Vec::with_capacity(columns * rows) }
    }

    /// Takes in a picture, and returns the colors of the floor; follows the picture if `learns` is set: nothing stands there.
    pub fn update(&mut self, cells: &CellImage, learns: bool) -> FloorColors {
        let seen = self.median(cells);
        let FloorColors { now, usual } = self.colors.unwrap_or(FloorColors { now: seen, usual: seen });
        let colors = if learns {
            let off = difference(seen, now);
            self.other_light = if off[0] < SAME_LIGHTNESS { 0 } else { self.other_light.saturating_add(1) };
            let is_sudden = (1..=OTHER_LIGHT_PICTURES).contains(&self.other_light);
            let is_same = !is_sudden && off[1] < SAME_COLOR && off[2] < SAME_COLOR;
            let share = if is_same { LEARN } else { LEARN_OTHER };
            FloorColors { now: blend(now, seen, share), usual: self.usual(usual, seen) }
        } else {
            self.other_light = 0;
            FloorColors { now, usual }
        };
        *self.colors.insert(colors)
    }

    /// Takes what a picture shows as floor, whatever was known before, and returns its colors.
    pub fn relearn(&mut self, cells: &CellImage) -> FloorColors {
        self.other_light = 0;
        let now = self.median(cells);
        let usual = self.colors.map_or(now, |colors| colors.usual);
        *self.colors.insert(FloorColors { now, usual })
    }

    /// Usual color after a picture of the color `seen`.
    fn usual(&mut self, usual: Lab, seen: Lab) -> Lab {
        let off = difference(seen, usual);
        let is_usual = off[0] < SAME_LIGHTNESS && off[1] < SAME_COLOR && off[2] < SAME_COLOR;
        self.unusual = if is_usual { 0 } else { self.unusual + 1 };
        if is_usual {
            blend(usual, seen, LEARN_USUAL)
        } else if self.unusual > OTHER_FLOOR_PICTURES {
            self.unusual = 0;
            seen
        } else {
            usual
        }
    }

    /// Median color of the area in front of the robot.
    fn median(&mut self, cells: &CellImage) -> Lab {
        let [columns, rows] = cells.size();
        let from_row = (rows as f64 * NEAR_TOP) as usize;
        let [left, right] = NEAR_SIDES.map(|share| (columns as f64 * share) as usize);
        std::array::from_fn(|channel| {
            self.sorted.clear();
            for row in from_row..rows - 1 {
                self.sorted.extend(cells.row(row)[left..right].iter().map(|color| color[channel]));
            }
            let middle = self.sorted.len() / 2;
            *self.sorted.select_nth_unstable_by(middle, f32::total_cmp).1
        })
    }
}

/// Absolute difference in each channel.
fn difference(a: Lab, b: Lab) -> Lab {
    std::array::from_fn(|channel| (a[channel] - b[channel]).abs())
}

/// Color that has come the share `share` of the way from one to another.
fn blend(from: Lab, to: Lab, share: f32) -> Lab {
    std::array::from_fn(|channel| from[channel] + share * (to[channel] - from[channel]))
}
