//! Segment detector: configuration, errors and processing steps.

use super::chains::Chains;
use super::edges::{EdgeMap, UNITS_PER_LEVEL};
use super::glare::is_glare;
use super::merge::{MergeRule, merge_collinear};
use super::split::{Piece, split_chain};
use super::{Polarity, Segment};
use thiserror::Error;
use yamabico_geometry::image::ImageView;

/// Parameters of the segment detector.
///
/// Thresholds are gray levels: a step of g levels between two adjacent pixels has the gradient g before, and 0.63 g
/// after the 5x5 smoothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentConfig {
    /// Minimum smoothed gradient along an edge, gray levels (lower hysteresis threshold).
    pub low_threshold: f64,
    /// Minimum smoothed gradient of at least one point of an edge, gray levels (upper hysteresis threshold).
    pub high_threshold: f64,
    /// Lower bound of `low_threshold` in low light, gray levels. Each frame without enough segments lowers both
    /// thresholds by a quarter.
    pub lowest_threshold: f64,
    /// Minimum segment length at an image width of 640 px, px. Scales with the width, down to `shortest_px`.
    pub min_length_at_640_px: f64,
    /// Minimum segment length at any image width, px.
    pub shortest_px: f64,
    /// Distance from the chord at which a chain is split, px.
    pub split_px: f64,
    /// Maximum angle between two segments to be merged, rad.
    pub merge_angle: f64,
    /// Maximum distance of the shorter segment's endpoints from the line of the longer one, px.
    pub merge_distance_px: f64,
    /// Maximum gap between two segments to be merged, px; `merge_gap_share` may allow more.
    pub merge_gap_px: f64,
    /// Maximum gap between two segments to be merged, as a share of the longer one.
    pub merge_gap_share: f64,
    /// Maximum number of segments; the longest are kept.
    pub max_segments: usize,
}

impl Default for SegmentConfig {
    fn default() -> Self {
        Self {
            low_threshold: 4.0,
            high_threshold: 8.0,
            lowest_threshold: 2.0,
            min_length_at_640_px: 20.0,
            shortest_px: 10.0,
            split_px: 1.2,
            merge_angle: 1_f64.to_radians(),
            merge_distance_px: 1.2,
            merge_gap_px: 10.0,
            merge_gap_share: 0.3,
            max_segments: 250,
        }
    }
}

impl SegmentConfig {
    /// Parameters for the evidence for a corridor: shorter segments, and more of them. Its coefficients belong to these.
    #[must_use]
    pub fn for_evidence() -> Self {
        Self { min_length_at_640_px: 15.0, max_segments: 600, ..Self::default() }
    }

    /// Minimum segment length in an image of this width, px.
    #[must_use]
    pub fn min_length_px(&self, width: usize) -> f64 {
        (self.min_length_at_640_px * width as f64 / 640.0).max(self.shortest_px)
    }
}

/// Reason why an image has no segments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SegmentError {
    /// Fewer than two segments: the image is blank, dark or blurred.
    #[error("the image has only {found} edge segments")]
    TooFewSegments {
        /// Number of segments.
        found: usize,
    },
    /// The image is wider than 65,535 px.
    #[error("the image is {width} px wide, but at most 65535 px are supported")]
    TooWide {
        /// Image width, px.
        width: usize,
    },
}

/// Detects segments. Keeps its buffers, and thresholds lowered in low light, between frames.
#[derive(Clone, Debug)]
pub struct SegmentDetector {
    config: SegmentConfig,
    /// Factor currently applied to the configured thresholds.
    sensitivity: f64,
    edges: EdgeMap,
    chains: Chains,
    stack: Vec<(u32, u32)>,
    pieces: Vec<Piece>,
    segments: Vec<Segment>,
}

/// Number of segments above which lowered thresholds rise again.
const RECOVERY_SEGMENTS: usize = 20;
/// Factor applied to the thresholds after a frame without segments.
const RELAXATION: f64 = 0.75;

impl SegmentDetector {
    /// Creates a detector with empty buffers.
    #[must_use]
    pub fn new(config: SegmentConfig) -> Self {
        Self {
            config,
            sensitivity: 1.0,
            edges: EdgeMap::default(),
            chains: Chains::default(),
            stack: Vec::new(),
            pieces: Vec::new(),
            segments: Vec::new(),
        }
    }

    /// Configuration of the detector.
    #[must_use]
    pub fn config(&self) -> &SegmentConfig {
        &self.config
    }

    /// Returns true if frames without segments have lowered the thresholds, so that segments are less reliable.
    #[must_use]
    pub fn is_degraded(&self) -> bool {
        self.sensitivity < 1.0
    }

    /// Restores the configured thresholds.
    pub fn reset(&mut self) {
        self.sensitivity = 1.0;
    }

    /// Detects the longest segments of `image`, at most `max_segments`, longest first.
    ///
    /// # Errors
    /// [`SegmentError::TooFewSegments`] for fewer than two segments; the thresholds are then lowered for the next
    /// frame. [`SegmentError::TooWide`] for an image wider than 65,535 px.
    pub fn detect(&mut self, image: ImageView) -> Result<&[Segment], SegmentError> {
        if image.width() > usize::from(u16::MAX) {
            return Err(SegmentError::TooWide { width: image.width() });
        }
        let min_length = self.config.min_length_px(image.width());
        self.find_chains(image, min_length);
        self.cut_into_pieces(min_length);
        self.keep_longest(image);
        self.adapt_thresholds();
        match self.segments.len() {
            found @ 0..=1 => Err(SegmentError::TooFewSegments { found }),
            _ => Ok(&self.segments),
        }
    }

    /// Segments of the last image, longest first, including a single one that `detect` rejected as too few.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    fn find_chains(&mut self, image: ImageView, min_length: f64) {
        let scale = self.sensitivity as f32 * UNITS_PER_LEVEL;
        let (low, high) =
            (self.config.low_threshold as f32 * scale, self.config.high_threshold as f32 * scale);
        self.edges.find(image, low, high);
        let min_points = (min_length * std::f64::consts::FRAC_1_SQRT_2) as usize;
        self.chains.follow(&mut self.edges, min_points.max(3));
    }

    fn cut_into_pieces(&mut self, min_length: f64) {
        self.pieces.clear();
        let mut begin = 0;
        for &end in &self.chains.ends {
            let chain = &self.chains.points[begin..end as usize];
            split_chain(chain, self.config.split_px as f32, min_length, &mut self.stack, &mut self.pieces);
            begin = end as usize;
        }
        let rule = MergeRule {
            angle: self.config.merge_angle,
            distance: self.config.merge_distance_px,
            gap: self.config.merge_gap_px,
            gap_share: self.config.merge_gap_share,
        };
        merge_collinear(&mut self.pieces, rule);
    }

    fn keep_longest(&mut self, image: ImageView) {
        self.segments.clear();
        let of_scene = self.pieces.iter().map(segment_from).filter(|segment| !is_glare(image, segment));
        self.segments.extend(of_scene);
        self.segments.sort_unstable_by(|a, b| b.length.total_cmp(&a.length));
        self.segments.truncate(self.config.max_segments);
    }

    fn adapt_thresholds(&mut self) {
        let lowest = (self.config.lowest_threshold / self.config.low_threshold).min(1.0);
        if self.segments.len() < 2 {
            self.sensitivity = (self.sensitivity * RELAXATION).max(lowest);
        } else if self.segments.len() >= RECOVERY_SEGMENTS {
            self.sensitivity = (self.sensitivity / RELAXATION).min(1.0);
        }
    }
}

fn segment_from(piece: &Piece) -> Segment {
    let line = piece.line;
    let slope = piece.gradient.dot(&line.normal) / (piece.moments.count * f64::from(UNITS_PER_LEVEL));
    Segment {
        p0: line.point_at(piece.from),
        p1: line.point_at(piece.to),
        normal: line.normal,
        rho: line.rho,
        length: piece.length(),
        sigma_mid: line.sigma_mid,
        sigma_angle: line.sigma_angle,
        mean_gradient: slope.abs(),
        polarity: if slope >= 0.0 { Polarity::BrighterAlongNormal } else { Polarity::DarkerAlongNormal },
    }
}
