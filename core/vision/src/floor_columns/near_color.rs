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

/// Color that the floor in front of the robot had in the last pictures.
#[derive(Clone, Debug)]
pub struct NearColor {
    color: Option<Lab>,
    /// Pictures in a row whose lightness is another one.
    other_light: u32,
    sorted: Vec<f32>,
}

impl NearColor {
    /// Prepares for pictures of these cells; nothing is learned yet.
    pub fn new(cells: &CellImage) -> Self {
        let [columns, rows] = cells.size();
        Self { color: None, other_light: 0, sorted: Vec::with_capacity(columns * rows) }
    }

    /// Takes in a picture, and returns the color of the floor; follows the picture if `learns` is set: nothing stands there.
    pub fn update(&mut self, cells: &CellImage, learns: bool) -> Lab {
        let seen = self.median(cells);
        let color = *self.color.get_or_insert(seen);
        if !learns {
            self.other_light = 0;
            return color;
        }
        let off: Lab = std::array::from_fn(|channel| (seen[channel] - color[channel]).abs());
        self.other_light = if off[0] < SAME_LIGHTNESS { 0 } else { self.other_light.saturating_add(1) };
        let is_sudden = (1..=OTHER_LIGHT_PICTURES).contains(&self.other_light);
        let is_same = !is_sudden && off[1] < SAME_COLOR && off[2] < SAME_COLOR;
        let share = if is_same { LEARN } else { LEARN_OTHER };
        let color = std::array::from_fn(|channel| color[channel] + share * (seen[channel] - color[channel]));
        *self.color.insert(color)
    }

    /// Takes what a picture shows as floor, whatever was known before, and returns its color.
    pub fn relearn(&mut self, cells: &CellImage) -> Lab {
        self.other_light = 0;
        let seen = self.median(cells);
        *self.color.insert(seen)
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
