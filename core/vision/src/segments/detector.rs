//! The detector: configuration, failures and the order of the steps.

use super::chains::Chains;
use super::edges::{EdgeMap, UNITS_PER_LEVEL};
use super::glare::is_glare;
use super::merge::{MergeRule, merge_collinear};
use super::split::{Piece, split_chain};
use super::{Polarity, Segment};
use thiserror::Error;
use yamabico_geometry::image::ImageView;

/// What counts as a segment. Thresholds are gray levels: a step of g levels between two pixels has gradient g before, and
/// 0.63 g after the 5x5 smoothing that comes first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentConfig {
    /// An edge is followed while its (smoothed) gradient is at least this, gray levels.
    pub low_threshold: f64,
    /// An edge needs at least one point of this (smoothed) gradient, gray levels.
    pub high_threshold: f64,
    /// Both thresholds fall by a quarter for each frame without enough segments, until the low one is here, gray levels.
    pub lowest_threshold: f64,
    /// Shortest segment in an image 640 px wide, px; scales with the width, but not below `shortest_px`.
    pub min_length_at_640_px: f64,
    /// Shortest segment in any image, px.
    pub shortest_px: f64,
    /// A chain is cut where it leaves its chord by more, px.
    pub split_px: f64,
    /// Segments are merged when their directions differ by less, rad.
    pub merge_angle: f64,
    /// ... and the ends of the shorter lie nearer to the longer one's line, px.
    pub merge_distance_px: f64,
    /// ... and the gap is shorter, px, or shorter than `merge_gap_share` of the longer one.
    pub merge_gap_px: f64,
    /// Gap that is allowed as a share of the longer segment.
    pub merge_gap_share: f64,
    /// So many of the longest segments are kept.
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
    /// Shortest segment that is kept in an image of this width, px.
    #[must_use]
    pub fn min_length_px(&self, width: usize) -> f64 {
        (self.min_length_at_640_px * width as f64 / 640.0).max(self.shortest_px)
    }
}

/// Why an image gave no segments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SegmentError {
    /// Fewer than two segments: the picture is blank, dark or blurred.
    #[error("only {found} edge segments in the image")]
    TooFewSegments {
        /// How many there were.
        found: usize,
    },
    /// The image is wider than columns are counted (65,535 px).
    #[error("an image {width} px wide is not supported")]
    TooWide {
        /// Its width, px.
        width: usize,
    },
}

/// Finds segments; keeps its buffers and, in bad light, its lowered thresholds from frame to frame.
#[derive(Clone, Debug)]
pub struct SegmentDetector {
    config: SegmentConfig,
    /// Share of the configured thresholds that is in use.
    sensitivity: f64,
    edges: EdgeMap,
    chains: Chains,
    stack: Vec<(u32, u32)>,
    pieces: Vec<Piece>,
    segments: Vec<Segment>,
}

/// Thresholds rise again when a frame has so many segments.
const PLENTY: usize = 20;
/// A frame without segments lowers the thresholds by this factor.
const RELAXATION: f64 = 0.75;

impl SegmentDetector {
    /// A detector with empty buffers.
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

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &SegmentConfig {
        &self.config
    }

    /// Whether frames without segments have lowered the thresholds: what is found is of less quality.
    #[must_use]
    pub fn is_degraded(&self) -> bool {
        self.sensitivity < 1.0
    }

    /// Goes back to the configured thresholds.
    pub fn reset(&mut self) {
        self.sensitivity = 1.0;
    }

    /// The longest segments of `image`, longest first, at most `max_segments`.
    ///
    /// # Errors
    /// [`SegmentError::TooFewSegments`] below two; the thresholds are lower for the next frame.
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

    /// The segments of the last image, longest first: also the single one of an image with too few.
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
        } else if self.segments.len() >= PLENTY {
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
