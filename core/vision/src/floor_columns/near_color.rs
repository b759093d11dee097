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

/// Spread of the lightness (0 to 255) above which a picture shows more than one light.
const ONE_LIGHT_SPREAD: f32 = 16.0;

/// Color that the floor in front of the robot had in the last pictures, and in the light before.
#[derive(Clone, Debug)]
pub struct NearColor {
    color: Option<Lab>,
    /// Color after the last picture that showed one light alone, and the one that it had replaced at once: in a patch of sunlight, the color
    /// of the floor before it.
    steady: Option<Lab>,
    earlier: Option<Lab>,
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
            steady: None,
            earlier: None,
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

    /// Takes in a picture, and returns the colors of the floor, now and in the light before; follows the picture if `learns` is set: nothing
    /// stands there.
    pub fn update(&mut self, cells: &CellImage, learns: bool) -> [Lab; 2] {
        let seen = self.median(cells);
        let spread = self.spread_of(cells);
        if self.color.is_none() {
            self.spread = spread;
        }
        let mut color = *self.color.get_or_insert(seen);
        if self.earlier.is_some_and(|earlier| is_other_light(seen, color) && is_same_light(seen, earlier)) {
            std::mem::swap(&mut self.earlier, &mut self.steady);
            color = seen;
        }
        if !learns {
            self.other_light = 0;
            return self.take(color);
        }
        let off = difference(seen, color);
        self.other_light = if off[0] < SAME_LIGHTNESS { 0 } else { self.other_light.saturating_add(1) };
        let is_sudden = (1..=OTHER_LIGHT_PICTURES).contains(&self.other_light);
        let is_same = !is_sudden && off[1] < SAME_COLOR && off[2] < SAME_COLOR;
        let share = if is_same { LEARN } else { LEARN_OTHER };
        self.spread += share * (spread - self.spread);
        let color = std::array::from_fn(|channel| color[channel] + share * (seen[channel] - color[channel]));
        self.remember(color, spread);
        self.take(color)
    }

    /// Takes what a picture shows as floor, whatever was known before, and returns its color and that of the light before.
    pub fn relearn(&mut self, cells: &CellImage) -> [Lab; 2] {
        self.other_light = 0;
        self.spread = self.spread_of(cells);
        let seen = self.median(cells);
        self.remember(seen, self.spread);
        self.take(seen)
    }

    /// Takes a color as that of the floor, and returns it with that of the light before, or twice.
    fn take(&mut self, color: Lab) -> [Lab; 2] {
        self.color = Some(color);
        [color, self.earlier.unwrap_or(color)]
    }

    /// Keeps the color of a floor of this spread, if it shows one light.
    fn remember(&mut self, color: Lab, spread: f32) {
        if spread > ONE_LIGHT_SPREAD {
            return;
        }
        let before = self.steady.replace(color);
        self.earlier = before.filter(|&before| is_other_light(color, before)).or(self.earlier);
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

/// True if the lightnesses of two colors are so far apart that they are not surely the same floor.
fn is_other_light(seen: Lab, color: Lab) -> bool {
    difference(seen, color)[0] >= SAME_LIGHTNESS
}

/// True if two colors may be the same floor in the same light.
fn is_same_light(seen: Lab, color: Lab) -> bool {
    let [lightness, a, b] = difference(seen, color);
    lightness < 0.5 * SAME_LIGHTNESS && a < SAME_COLOR && b < SAME_COLOR
}

/// Difference of two colors in each channel.
fn difference(seen: Lab, color: Lab) -> Lab {
    std::array::from_fn(|channel| (seen[channel] - color[channel]).abs())
}
