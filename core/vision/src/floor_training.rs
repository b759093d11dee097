//! Training of floor colors from labeled images.

use super::floor_color::{Color, ColorBox, ColorTable, FloorColors};
use super::floor_sample::FloorSample;

const CLASSES: usize = 32;
/// Weight of a class relative to each of its neighbors in smoothing.
const OWN_WEIGHT: u32 = 4;
/// Share of the floor pixels that thresholds exclude at either end of each channel.
const OUTLIERS: f64 = 0.01;
/// Margin added to either side of the thresholds, gray levels.
const TOLERANCE: u8 = 8;

/// Label of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// Floor: the robot may drive there.
    Floor,
    /// Anything else.
    Other,
}

/// Number of labeled pixels per color class.
#[derive(Clone, Debug)]
pub struct FloorTraining {
    floor: Vec<u32>,
    other: Vec<u32>,
    sample: FloorSample,
}

impl Default for FloorTraining {
    fn default() -> Self {
        let empty = || vec![0; CLASSES * CLASSES * CLASSES];
        Self { floor: empty(), other: empty(), sample: FloorSample::default() }
    }
}

/// Accuracy of a color model on labeled images.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ColorAccuracy {
    /// Share of floor pixels classified as floor, 0 to 1.
    pub recall: f64,
    /// Share of other pixels classified as floor, 0 to 1.
    pub false_alarms: f64,
}

impl FloorTraining {
    /// Adds a labeled pixel.
    pub fn add(&mut self, color: Color, label: Label) {
        let class = class(color.map(|level| usize::from(level >> 3)));
        match label {
            Label::Floor => {
                self.floor[class] += 1;
                self.sample.add(color);
            }
            Label::Other => self.other[class] += 1,
        }
    }

    /// Adds the pixels of another training set.
    pub fn merge(&mut self, training: &FloorTraining) {
        for (mine, theirs) in [(&mut self.floor, &training.floor), (&mut self.other, &training.other)] {
            mine.iter_mut().zip(theirs).for_each(|(mine, theirs)| *mine += theirs);
        }
        self.sample.merge(&training.sample);
    }

    /// Number of pixels labeled floor, and other.
    #[must_use]
    pub fn counts(&self) -> (u64, u64) {
        let sum = |counts: &[u32]| counts.iter().map(|&count| u64::from(count)).sum();
        (sum(&self.floor), sum(&self.other))
    }

    /// Builds a table: a class is floor if, smoothed over its neighbors, it is relatively more frequent among floor
    /// pixels than among others.
    #[must_use]
    pub fn table(&self) -> FloorColors {
        let (floor_total, other_total) = self.counts();
        let mut table = ColorTable::default();
        for red in 0..CLASSES {
            for green in 0..CLASSES {
                for blue in 0..CLASSES {
                    let floor = smoothed(&self.floor, [red, green, blue]);
                    let other = smoothed(&self.other, [red, green, blue]);
                    if floor > 0 && floor * other_total.max(1) > other * floor_total {
                        table.insert([red, green, blue].map(|class| (class << 3) as u8));
                    }
                }
            }
        }
        FloorColors::Table(table)
    }

    /// Computes thresholds around the floor colors; `None` without floor pixels.
    #[must_use]
    pub fn thresholds(&self) -> Option<FloorColors> {
        let seen: ColorBox = self.sample.quantile_range(OUTLIERS)?;
        Some(FloorColors::Box(seen.widened(TOLERANCE)))
    }

    /// Evaluates a color model on these pixels, with each class represented by its middle.
    #[must_use]
    pub fn evaluate(&self, colors: &FloorColors) -> ColorAccuracy {
        let mut recognized = [0_u64; 2];
        for red in 0..CLASSES {
            for green in 0..CLASSES {
                for blue in 0..CLASSES {
                    if colors.contains([red, green, blue].map(|class| (class << 3) as u8 + 4)) {
                        let class = class([red, green, blue]);
                        recognized[0] += u64::from(self.floor[class]);
                        recognized[1] += u64::from(self.other[class]);
                    }
                }
            }
        }
        let (floor, other) = self.counts();
        let share = |part: u64, whole: u64| part as f64 / whole.max(1) as f64;
        ColorAccuracy { recall: share(recognized[0], floor), false_alarms: share(recognized[1], other) }
    }
}

fn class([red, green, blue]: [usize; 3]) -> usize {
    (red * CLASSES + green) * CLASSES + blue
}

/// Weighted count of a class and its neighbors.
fn smoothed(counts: &[u32], at: [usize; 3]) -> u64 {
    let near = |i: usize| at[i].saturating_sub(1)..=(at[i] + 1).min(CLASSES - 1);
    let mut sum = u64::from((OWN_WEIGHT - 1) * counts[class(at)]);
    for red in near(0) {
        for green in near(1) {
            for blue in near(2) {
                sum += u64::from(counts[class([red, green, blue])]);
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn training() -> FloorTraining {
        let mut training = FloorTraining::default();
        for i in 0..200_u8 {
            training.add([40 + i / 10, 140 + i / 8, 60], Label::Floor);
            training.add([180, 170 + i / 10, 160 + i / 4], Label::Other);
            training.add([150, 40, 40], Label::Other);
        }
        training
    }

    #[test]
    fn frequent_floor_colors_are_floor() {
        let training = training();
        assert_eq!(training.counts(), (200, 400));
        let (table, thresholds) = (training.table(), training.thresholds().unwrap());
        for colors in [&table, &thresholds] {
            assert_eq!(training.evaluate(colors), ColorAccuracy { recall: 1.0, false_alarms: 0.0 });
            assert!(colors.contains([50, 150, 60]) && !colors.contains([150, 40, 40]));
            assert!(!colors.contains([0, 0, 0]) && !colors.contains([250, 20, 250]));
        }
    }

    #[test]
    fn training_sets_merge_and_an_empty_one_is_allowed() {
        let mut both = training();
        both.merge(&training());
        assert_eq!((both.counts(), both.table()), ((400, 800), training().table()));
        let nothing = FloorTraining::default();
        assert_eq!(nothing.thresholds(), None);
        assert_eq!(nothing.evaluate(&nothing.table()), ColorAccuracy::default());
    }
}
