//! Which threshold finds the edges of the map and no others: learned from pictures of an empty place.
//!
//! Ohya, Kosaka & Kak (1998), the learning of T0 and N0. Differs from \[1\]: edges match within a tolerance, T0 is taken from
//! the sensitive end of the thresholds that are equally good, and a threshold that is blind to the map is no threshold.

use yamabico_core::image::ImageView;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::vertical_edges::{EdgeDifference, Regions};

/// The thresholds of the first pass, gray levels.
pub const COARSE: [u8; 15] = [10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120, 130, 140, 150];
/// Step of the second pass around the best of the first, gray levels.
pub const FINE_STEP: u8 = 2;
/// Less of the map's edges seen than this share makes a threshold invalid.
pub const MIN_RECALL: f64 = 0.5;

/// What one threshold gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The threshold, gray levels.
    pub threshold: u8,
    /// Differing pixels of each region.
    pub differing: Vec<u32>,
    /// Of these, pixels that are seen and not expected.
    pub extra: Vec<u32>,
    /// Share of the expected pixels that is seen; `None` where nothing is expected.
    pub recall: Option<f64>,
}

impl Row {
    /// The largest count of any region.
    #[must_use]
    pub fn largest(&self) -> u32 {
        self.differing.iter().copied().max().unwrap_or(0)
    }
}

/// Whether a learned threshold can be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Validity {
    /// It sees the edges of the map.
    Valid,
    /// It sees less than [`MIN_RECALL`] of them: picture and map do not register, or the edges are fainter than the rest.
    LowRecall,
    /// The map has no vertical edge in view.
    NoModel,
}

/// What was learned at one place.
#[derive(Clone, Debug, PartialEq)]
pub struct Learned {
    /// The threshold that leaves the smallest difference, gray levels.
    pub t0: u8,
    /// That difference: the largest count of any region, pixels.
    pub n0: u32,
    /// The largest count of pixels seen and not expected of any region at T0.
    pub n0_extra: u32,
    /// Share of the expected pixels that is seen at T0; `None` where nothing is expected.
    pub recall: Option<f64>,
    /// Whether it can be used.
    pub validity: Validity,
}

/// The counts of each threshold for the thinned magnitudes `thinned` and the edges `expected` of the same size.
#[must_use]
pub fn sweep(
    thinned: ImageView,
    expected: &BitImage,
    thresholds: &[u8],
    tolerance_px: usize,
    regions: &Regions,
) -> Vec<Row> {
    let (mut seen, mut difference) = (BitImage::default(), EdgeDifference::default());
    let row = |&threshold: &u8| {
        seen.threshold(thinned, threshold);
        difference.compare(&seen, expected, tolerance_px, regions);
        Row {
            threshold,
            differing: difference.differing.clone(),
            extra: difference.extra.clone(),
            recall: difference.recall(),
        }
    };
    thresholds.iter().map(row).collect()
}

/// T0 and N0 of rows in the order of their thresholds: T0 lies a quarter into the longest run of thresholds with the smallest
/// N (the earliest of equally long runs). `None` without rows.
#[must_use]
pub fn learn(rows: &[Row]) -> Option<Learned> {
    let least = rows.iter().map(Row::largest).min()?;
    let mut longest = 0..0;
    let mut begin = 0;
    for (i, row) in rows.iter().enumerate() {
        if row.largest() != least {
            begin = i + 1;
        } else if i + 1 - begin > longest.len() {
            longest = begin..i + 1;
        }
    }
    let row = rows.get(longest.start + (longest.len() - 1) / 4)?;
    let validity = match row.recall {
        None => Validity::NoModel,
        Some(recall) if recall < MIN_RECALL => Validity::LowRecall,
        Some(_) => Validity::Valid,
    };
    Some(Learned {
        t0: row.threshold,
        n0: least,
        n0_extra: row.extra.iter().copied().max().unwrap_or(0),
        recall: row.recall,
        validity,
    })
}

/// Every threshold that a place is learned with, gray levels: those of both passes.
pub fn thresholds() -> impl Iterator<Item = u8> {
    (COARSE[0]..=COARSE[COARSE.len() - 1]).step_by(FINE_STEP.into())
}

/// What was learned from the rows of [`thresholds`]: first by [`COARSE`], then by the thresholds around its T0.
#[must_use]
pub fn learn_in_two_passes(rows: &[Row]) -> Option<Learned> {
    let coarse: Vec<Row> = rows.iter().filter(|row| COARSE.contains(&row.threshold)).cloned().collect();
    let t0 = learn(&coarse)?.t0;
    let step = COARSE[1] - COARSE[0];
    let near: Vec<Row> = rows.iter().filter(|row| row.threshold.abs_diff(t0) <= step).cloned().collect();
    learn(&near)
}

/// What a picture shows on the floor besides edges that the map has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FloorLook {
    /// The strongest upright step, gray levels.
    pub contrast: f64,
    /// The largest number of pixels of level edges of any region.
    pub level: u32,
}

/// One place, learned from all pictures that were taken there: for each threshold the largest count of any of them, and the mean
/// of their recalls.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaceLearner {
    rows: Vec<Row>,
    look: FloorLook,
    pictures: u32,
}

impl PlaceLearner {
    /// Takes the rows of a picture and what it shows on the floor. Every picture must have been swept with the same
    /// thresholds.
    pub fn take(&mut self, rows: &[Row], look: FloorLook) {
        self.pictures += 1;
        self.look.contrast = self.look.contrast.max(look.contrast);
        self.look.level = self.look.level.max(look.level);
        if self.rows.len() != rows.len() {
            self.rows = rows.to_vec();
            return;
        }
        for (worst, row) in self.rows.iter_mut().zip(rows) {
            let counts = worst.differing.iter_mut().zip(&row.differing);
            counts
                .chain(worst.extra.iter_mut().zip(&row.extra))
                .for_each(|(worst, &n)| *worst = n.max(*worst));
            let weight = 1.0 / f64::from(self.pictures);
            worst.recall = match (worst.recall, row.recall) {
                (Some(mean), Some(recall)) => Some(mean + weight * (recall - mean)),
                (a, b) => a.or(b),
            };
        }
    }

    /// How many pictures were taken.
    #[must_use]
    pub fn pictures(&self) -> u32 {
        self.pictures
    }

    /// The worst counts for each threshold.
    #[must_use]
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The most that any picture shows on the floor.
    #[must_use]
    pub fn look(&self) -> FloorLook {
        self.look
    }

    /// What was learned; `None` without a picture.
    #[must_use]
    pub fn learned(&self) -> Option<Learned> {
        learn_in_two_passes(&self.rows)
    }
}
