//! Color of the floor in front of the robot, as it changes along the way.

use super::cells::CellImage;
use super::lab::Lab;
use super::rules::ColumnRules;

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

/// Shares of the cells between whose lightnesses the spread of the floor lies: single cells may be specks.
const SPREAD: [f64; 2] = [0.1, 0.9];

/// Color that the floor in front of the robot had in the last pictures.
#[derive(Clone, Debug)]
pub struct NearColor {
    color: Option<Lab>,
    /// Half the difference of the dark and the bright parts of the floor, lightness (0 to 255): much on a cloudy carpet.
    spread: f32,
    tolerates_spread: bool,
    /// Pictures in a row whose lightness is another one.
    other_light: u32,
    sorted: Vec<f32>,
}

impl NearColor {
    /// Prepares for pictures of these cells; nothing is learned yet.
    pub fn new(cells: &CellImage) -> Self {
        let [columns, rows] = cells.size();
        Self {
            color: None,
            spread: 0.0,
            tolerates_spread: true,
            other_light: 0,
            sorted: Vec::with_capacity(columns * rows),
        }
    }

    /// Sets whether the spread of the floor's lightness is tolerated, as it is at first.
    pub fn tolerate_spread(&mut self, tolerates: bool) {
        self.tolerates_spread = tolerates;
    }

    /// Largest difference of floor from the followed color: that of the rules, or the spread of the floor where that is cloudy.
    pub fn tolerance(&self, rules: &ColumnRules) -> Lab {
        let [lightness, a, b] = rules.tolerance;
        let is_cloudy = self.tolerates_spread && self.spread >= rules.min_spread;
        let spread = if is_cloudy { self.spread.min(rules.max_spread) } else { 0.0 };
        [lightness.max(spread), a, b]
    }

    /// Takes in a picture, and returns the color of the floor; follows the picture if `learns` is set: nothing stands there.
    pub fn update(&mut self, cells: &CellImage, learns: bool) -> Lab {
        let seen = self.median(cells);
        let spread = self.spread_of(cells);
        if self.color.is_none() {
            self.spread = spread;
        }
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
        self.spread += share * (spread - self.spread);
        let color = std::array::from_fn(|channel| color[channel] + share * (seen[channel] - color[channel]));
        *self.color.insert(color)
    }

    /// Takes what a picture shows as floor, whatever was known before, and returns its color.
    pub fn relearn(&mut self, cells: &CellImage) -> Lab {
        self.other_light = 0;
        self.spread = self.spread_of(cells);
        let seen = self.median(cells);
        *self.color.insert(seen)
    }

    /// Median color of the area in front of the robot.
    fn median(&mut self, cells: &CellImage) -> Lab {
        std::array::from_fn(|channel| self.quantile(cells, channel, 0.5))
    }

    /// Spread of the lightness in the area in front of the robot.
    fn spread_of(&mut self, cells: &CellImage) -> f32 {
        let [dark, bright] = SPREAD.map(|share| self.quantile(cells, 0, share));
        0.5 * (bright - dark)
    }

    /// Value of a channel that this share of the cells in front of the robot is below.
    fn quantile(&mut self, cells: &CellImage, channel: usize, share: f64) -> f32 {
        let [columns, rows] = cells.size();
        let from_row = (rows as f64 * NEAR_TOP) as usize;
        let [left, right] = NEAR_SIDES.map(|share| (columns as f64 * share) as usize);
        self.sorted.clear();
        for row in from_row..rows - 1 {
            self.sorted.extend(cells.row(row)[left..right].iter().map(|color| color[channel]));
        }
        let index = (share * self.sorted.len() as f64) as usize;
        *self.sorted.select_nth_unstable_by(index, f32::total_cmp).1
    }
}
