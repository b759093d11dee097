//! Learning of the edge thresholds from frames of the empty building: the threshold that finds the edges of the map,
//! but no others.
//!
//! Ohya, Kosaka & Kak (1998), the learning of T0 and N0. Differs from \[1\]: edges match within a tolerance, T0 is
//! chosen near the sensitive end of the equally good thresholds, and a threshold that misses the edges of the map is
//! rejected.

use crate::regions::Regions;
use crate::vertical_edges::EdgeDifference;
use yamabico_core::image::ImageView;
use yamabico_vision::bit_image::BitImage;

/// Thresholds of the first pass, gray levels.
pub const COARSE: [u8; 15] = [10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120, 130, 140, 150];
/// Step between the thresholds of the second pass, gray levels.
pub const FINE_STEP: u8 = 2;
/// Minimum fraction of the map's edges that a valid threshold detects.
pub const MIN_RECALL: f64 = 0.5;

/// Edge counts at one threshold.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeCounts {
    /// Threshold, gray levels.
    pub threshold: u8,
    /// Number of differing pixels in each region.
    pub differing: Vec<u32>,
    /// Number of pixels in each region that are observed but not expected.
    pub extra: Vec<u32>,
    /// Fraction of the expected pixels that is observed; `None` if nothing is expected.
    pub recall: Option<f64>,
}

impl EdgeCounts {
    /// Returns the maximum of `differing` over all regions.
    #[must_use]
    pub fn max_count(&self) -> u32 {
        self.differing.iter().copied().max().unwrap_or(0)
    }
}

/// Validity of a learned threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Validity {
    /// It detects the edges of the map.
    Valid,
    /// It detects less than [`MIN_RECALL`] of them: frame and map are misaligned, or the edges are fainter than other
    /// ones.
    LowRecall,
    /// The map has no vertical edge in view.
    NoModel,
}

/// Threshold learned at one place.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnedThreshold {
    /// Threshold T0 with the smallest difference, gray levels.
    pub t0: u8,
    /// Difference N0 at T0: the maximum count over all regions, px.
    pub n0: u32,
    /// Maximum number of pixels observed but not expected in any region at T0.
    pub n0_extra: u32,
    /// Fraction of the expected pixels that is observed at T0; `None` if nothing is expected.
    pub recall: Option<f64>,
    /// Validity of the threshold.
    pub validity: Validity,
}

/// Returns the edge counts at each threshold, for the thinned magnitudes `thinned` and the edges `expected` of the
/// same size.
#[must_use]
pub fn sweep(
    thinned: ImageView,
    expected: &BitImage,
    thresholds: &[u8],
    tolerance_px: usize,
    regions: &Regions,
) -> Vec<EdgeCounts> {
    let (mut seen, mut difference) = (BitImage::default(), EdgeDifference::default());
    let row = |&threshold: &u8| {
        seen.threshold(thinned, threshold);
        difference.compare(&seen, expected, tolerance_px, regions);
        EdgeCounts {
            threshold,
            differing: difference.differing.clone(),
            extra: difference.extra.clone(),
            recall: difference.recall(),
        }
    };
    thresholds.iter().map(row).collect()
}

/// Returns T0 and N0 for counts in the order of their thresholds. T0 is a quarter into the longest run of thresholds
/// with the smallest difference (the first of equally long runs). `None` without counts.
#[must_use]
pub fn learn(rows: &[EdgeCounts]) -> Option<LearnedThreshold> {
    let minimum = rows.iter().map(EdgeCounts::max_count).min()?;
    let mut longest = 0..0;
    let mut begin = 0;
    for (i, row) in rows.iter().enumerate() {
        if row.max_count() != minimum {
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
    Some(LearnedThreshold {
        t0: row.threshold,
        n0: minimum,
        n0_extra: row.extra.iter().copied().max().unwrap_or(0),
        recall: row.recall,
        validity,
    })
}

/// Returns all thresholds that a place is learned with, those of both passes, gray levels.
pub fn thresholds() -> impl Iterator<Item = u8> {
    (COARSE[0]..=COARSE[COARSE.len() - 1]).step_by(FINE_STEP.into())
}

/// Returns T0 and N0 for the counts at [`thresholds`]: from those of [`COARSE`], then from those around its T0.
#[must_use]
pub fn learn_in_two_passes(rows: &[EdgeCounts]) -> Option<LearnedThreshold> {
    let coarse: Vec<EdgeCounts> =
        rows.iter().filter(|row| COARSE.contains(&row.threshold)).cloned().collect();
    let t0 = learn(&coarse)?.t0;
    let step = COARSE[1] - COARSE[0];
    let near: Vec<EdgeCounts> =
        rows.iter().filter(|row| row.threshold.abs_diff(t0) <= step).cloned().collect();
    learn(&near)
}

/// Evidence on the floor that the map does not explain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FloorEvidence {
    /// Strength of the strongest vertical step, gray levels.
    pub contrast: f64,
    /// Maximum number of horizontal edge pixels in any region.
    pub level: u32,
}

/// Learner for one place: for each threshold the maximum of each count over all frames, and the mean recall.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaceLearner {
    rows: Vec<EdgeCounts>,
    evidence: FloorEvidence,
    frames: u32,
}

impl PlaceLearner {
    /// Adds the counts and the evidence of a frame. All frames must have counts at the same thresholds.
    pub fn add(&mut self, rows: &[EdgeCounts], evidence: FloorEvidence) {
        self.frames += 1;
        self.evidence.contrast = self.evidence.contrast.max(evidence.contrast);
        self.evidence.level = self.evidence.level.max(evidence.level);
        if self.rows.len() != rows.len() {
            self.rows = rows.to_vec();
            return;
        }
        for (max, row) in self.rows.iter_mut().zip(rows) {
            let counts = max.differing.iter_mut().zip(&row.differing);
            counts.chain(max.extra.iter_mut().zip(&row.extra)).for_each(|(max, &n)| *max = n.max(*max));
            let weight = 1.0 / f64::from(self.frames);
            max.recall = match (max.recall, row.recall) {
                (Some(mean), Some(recall)) => Some(mean + weight * (recall - mean)),
                (a, b) => a.or(b),
            };
        }
    }

    /// Returns the number of frames added.
    #[must_use]
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Returns the maximum counts at each threshold.
    #[must_use]
    pub fn rows(&self) -> &[EdgeCounts] {
        &self.rows
    }

    /// Returns the maximum evidence on the floor over all frames.
    #[must_use]
    pub fn evidence(&self) -> FloorEvidence {
        self.evidence
    }

    /// Returns the learned threshold; `None` without frames.
    #[must_use]
    pub fn learned(&self) -> Option<LearnedThreshold> {
        learn_in_two_passes(&self.rows)
    }
}
