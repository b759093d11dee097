//! Histogram of edge length over azimuth in a mirror image, and its vertical edges.
//!
//! Yagi, Nishizawa & Yachida (1995), section II: vertical edges are radial in the image, so their points accumulate at
//! one azimuth. Differs from \[1\]: the two signs of brightness change are counted separately, bins are a quarter of a
//! degree wide, and the azimuth of an edge is the weighted mean of its points, more accurate than a bin.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use yamabico_geometry::wrap_angle;

/// Sign of the brightness change across an edge, in the direction of increasing azimuth (to the left).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum EdgeSign {
    /// From darker to brighter.
    Brighter,
    /// From brighter to darker.
    Darker,
}

impl EdgeSign {
    /// Both signs.
    pub const ALL: [Self; 2] = [Self::Brighter, Self::Darker];

    /// 1 for increasing brightness, else -1.
    #[must_use]
    pub fn value(self) -> i8 {
        match self {
            Self::Brighter => 1,
            Self::Darker => -1,
        }
    }
}

/// Point of a radial edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgePoint {
    /// Azimuth, rad.
    pub azimuth_rad: f64,
    /// Sign of the brightness change.
    pub sign: EdgeSign,
    /// Share of the edge's length, pixels, > 0.
    pub length_px: f64,
    /// Weight in the mean azimuth, > 0: the squared distance from the center, px^2, if all points are equally accurate.
    pub weight: f64,
}

/// Vertical edge of the environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AzimuthEdge {
    /// Azimuth, rad in [-pi, pi).
    pub azimuth_rad: f64,
    /// Sign of the brightness change.
    pub sign: EdgeSign,
    /// Length in the image, pixels.
    pub length_px: f64,
    /// Sum of the weights of its points.
    pub weight: f64,
    /// Number of adjacent bins that it fills.
    pub bins: usize,
}

impl AzimuthEdge {
    /// Standard deviation of the azimuth, rad, if weights are squared distances from the center (px^2), points have the
    /// standard deviation `point_sigma_px`, and three adjacent points are as informative as one; at least `min_rad`.
    #[must_use]
    pub fn sigma_rad(&self, point_sigma_px: f64, min_rad: f64) -> f64 {
        (point_sigma_px * (3.0 / self.weight.max(f64::MIN_POSITIVE)).sqrt()).max(min_rad)
    }

    /// Minimum distance of the edge from the center, pixels, if weights are squared distances from the center and the
    /// edge has no gaps. `None` if weight and length are inconsistent with that.
    #[must_use]
    pub fn inner_radius_px(&self) -> Option<f64> {
        let length = self.length_px;
        // From a to a + n the mean of the squares is a^2 + a n + n^2 / 3.
        let square = self.weight / length - length * length / 12.0;
        (square >= 0.0).then(|| square.sqrt() - 0.5 * length).filter(|radius| *radius >= 0.0)
    }
}

/// Parameters for extracting edges from the histogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileRule {
    /// Number of bins per turn, at least 8.
    pub bins: usize,
    /// Minimum edge length, pixels.
    pub min_length_px: f64,
    /// Width above which a run of filled bins is split, rad: at its deepest valley, if that is below half of the peaks
    /// on both sides.
    pub widest_rad: f64,
}

impl Default for ProfileRule {
    fn default() -> Self {
        Self { bins: 1440, min_length_px: 15.0, widest_rad: 1.5_f64.to_radians() }
    }
}

/// Azimuth histogram and its edges.
#[derive(Clone, Debug)]
pub struct AzimuthProfile {
    rule: ProfileRule,
    width_rad: f64,
    bins: [Vec<Bin>; 2],
    edges: Vec<AzimuthEdge>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Bin {
    length_px: f64,
    weight: f64,
    /// Weighted sum of the azimuths relative to the bin's center.
    moment: f64,
}

impl AzimuthProfile {
    /// Creates an empty profile.
    #[must_use]
    pub fn new(rule: ProfileRule) -> Self {
        let bins = rule.bins.max(8);
        let empty = || vec![Bin::default(); bins];
        Self {
            rule: ProfileRule { bins, ..rule },
            width_rad: TAU / bins as f64,
            bins: [empty(), empty()],
            edges: Vec::with_capacity(bins),
        }
    }

    /// Clears the histogram and the edges.
    pub fn clear(&mut self) {
        for bins in &mut self.bins {
            bins.fill(Bin::default());
        }
        self.edges.clear();
    }

    /// Adds a point; ignores one with an azimuth that is not finite.
    #[inline]
    pub fn add(&mut self, point: &EdgePoint) {
        if !point.azimuth_rad.is_finite() {
            return;
        }
        let turn = point.azimuth_rad.rem_euclid(TAU);
        let index = ((turn / self.width_rad) as usize).min(self.rule.bins - 1);
        let offset = turn - self.center(index);
        let bin = &mut self.bins[usize::from(point.sign == EdgeSign::Darker)][index];
        bin.length_px += point.length_px;
        bin.weight += point.weight;
        bin.moment += point.weight * offset;
    }

    /// Adds a point with an azimuth in [0, 2 pi].
    #[inline]
    pub(crate) fn add_wrapped(&mut self, turn: f32, sign: usize, length_px: f32, weight: f32) {
        let turn = f64::from(turn);
        let index = ((turn / self.width_rad) as usize).min(self.rule.bins - 1);
        let middle = self.center(index);
        let bin = &mut self.bins[sign & 1][index];
        bin.length_px += f64::from(length_px);
        bin.weight += f64::from(weight);
        bin.moment += f64::from(weight) * (turn - middle);
    }

    /// Extracts the edges, in order of azimuth.
    pub fn find(&mut self) -> &[AzimuthEdge] {
        self.edges.clear();
        let runs = Runs { rule: &self.rule, width_rad: self.width_rad };
        for (bins, sign) in self.bins.iter().zip(EdgeSign::ALL) {
            runs.find(bins, sign, &mut self.edges);
        }
        self.edges.sort_unstable_by(|a, b| a.azimuth_rad.total_cmp(&b.azimuth_rad));
        &self.edges
    }

    /// Edges of the last extraction, in order of azimuth.
    #[must_use]
    pub fn edges(&self) -> &[AzimuthEdge] {
        &self.edges
    }

    fn center(&self, bin: usize) -> f64 {
        (bin as f64 + 0.5) * self.width_rad
    }
}

/// Extraction of runs of filled bins around the turn.
struct Runs<'a> {
    rule: &'a ProfileRule,
    width_rad: f64,
}

impl Runs<'_> {
    fn find(&self, bins: &[Bin], sign: EdgeSign, edges: &mut Vec<AzimuthEdge>) {
        let count = bins.len();
        let is_filled = |index: usize| bins[index % count].length_px > 0.0;
        // Starting after an empty bin, no run is cut at the wrap-around.
        let Some(gap) = (0..count).find(|&index| !is_filled(index)) else {
            return self.cut(bins, 0..count, sign, edges);
        };
        let mut start = gap + 1;
        while start < gap + count {
            let Some(first) = (start..gap + count).find(|&index| is_filled(index)) else { return };
            let end = (first..gap + count).find(|&index| !is_filled(index)).unwrap_or(gap + count);
            self.cut(bins, first..end, sign, edges);
            start = end;
        }
    }

    /// Splits a wide run at its valleys and appends the parts.
    fn cut(&self, bins: &[Bin], run: std::ops::Range<usize>, sign: EdgeSign, edges: &mut Vec<AzimuthEdge>) {
        let mut start = run.start;
        while start < run.end {
            let rest = start..run.end;
            let end = if (rest.len() as f64) * self.width_rad > self.rule.widest_rad {
                first_valley(bins, rest).unwrap_or(run.end)
            } else {
                run.end
            };
            self.push_edge(bins, start..end, sign, edges);
            start = end;
        }
    }

    fn push_edge(
        &self,
        bins: &[Bin],
        run: std::ops::Range<usize>,
        sign: EdgeSign,
        edges: &mut Vec<AzimuthEdge>,
    ) {
        let (mut length_px, mut weight, mut moment) = (0.0, 0.0, 0.0);
        for index in run.clone() {
            let bin = &bins[index % bins.len()];
            length_px += bin.length_px;
            weight += bin.weight;
            moment += bin.moment + bin.weight * (index - run.start) as f64 * self.width_rad;
        }
        if length_px >= self.rule.min_length_px && weight > 0.0 {
            let first = (run.start as f64 + 0.5) * self.width_rad;
            edges.push(AzimuthEdge {
                azimuth_rad: wrap_angle(first + moment / weight),
                sign,
                length_px,
                weight,
                bins: run.len(),
            });
        }
    }
}

/// First valley within a run: a bin below half of the highest bin before it, and below half of the next bin that rises
/// again. The run is to be split before it.
fn first_valley(bins: &[Bin], run: std::ops::Range<usize>) -> Option<usize> {
    let length = |index: usize| bins[index % bins.len()].length_px;
    let (mut peak, mut lowest, mut valley) = (0.0_f64, f64::INFINITY, run.start);
    for index in run {
        let here = length(index);
        if here > peak && lowest.is_infinite() {
            peak = here;
        } else if here < 0.5 * peak && here < lowest {
            (lowest, valley) = (here, index);
        } else if lowest.is_finite() && here > 2.0 * lowest {
            return Some(valley);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(azimuth_rad: f64, sign: EdgeSign, length_px: f64) -> EdgePoint {
        EdgePoint { azimuth_rad, sign, length_px, weight: length_px }
    }

    #[test]
    fn an_edge_behind_the_robot_is_one_edge() {
        let mut profile = AzimuthProfile::new(ProfileRule::default());
        for i in 0..40 {
            let azimuth = std::f64::consts::PI + 0.001 * (f64::from(i) - 19.5);
            profile.add(&point(wrap_angle(azimuth), EdgeSign::Brighter, 1.0));
        }
        let edges = profile.find();
        assert_eq!(edges.len(), 1);
        assert!(wrap_angle(edges[0].azimuth_rad - std::f64::consts::PI).abs() < 1e-12);
        profile.clear();
        for i in 0..40 {
            profile.add(&point(0.001 * (f64::from(i) - 19.5), EdgeSign::Darker, 1.0));
        }
        let edges = profile.find();
        assert_eq!((edges.len(), edges[0].sign), (1, EdgeSign::Darker));
        assert!(edges[0].azimuth_rad.abs() < 1e-12);
    }

    #[test]
    fn a_wide_run_is_cut_at_its_valley() {
        let width = TAU / 1440.0;
        let lengths = [30.0, 40.0, 20.0, 5.0, 2.0, 6.0, 25.0, 50.0, 30.0];
        let mut profile = AzimuthProfile::new(ProfileRule::default());
        for (i, &length) in lengths.iter().enumerate() {
            profile.add(&point((100.5 + i as f64) * width, EdgeSign::Brighter, length));
        }
        let edges = profile.find();
        assert_eq!(edges.len(), 2);
        assert_eq!((edges[0].bins, edges[1].bins), (4, 5));
        assert!((edges[0].azimuth_rad - 101.5 * width).abs() < width);
        assert!((edges[1].azimuth_rad - 107.5 * width).abs() < width);
        // Narrow runs stay whole regardless of their shape.
        profile.clear();
        for (i, length) in [30.0, 2.0, 30.0].into_iter().enumerate() {
            profile.add(&point((100.5 + i as f64) * width, EdgeSign::Brighter, length));
        }
        assert_eq!(profile.find().len(), 1);
    }

    #[test]
    fn dense_texture_and_nan_are_handled() {
        let mut profile = AzimuthProfile::new(ProfileRule { bins: 16, ..ProfileRule::default() });
        for i in 0..160 {
            profile.add(&point(f64::from(i) * TAU / 160.0, EdgeSign::Brighter, 1.0));
        }
        profile.add(&point(f64::NAN, EdgeSign::Brighter, 100.0));
        let edges = profile.find();
        assert_eq!((edges.len(), edges[0].bins), (1, 16));
        assert!((edges[0].length_px - 160.0).abs() < 1e-9);
    }

    proptest! {
        /// Rotating all points by whole bins rotates the edges and changes nothing else.
        #[test]
        fn edges_turn_with_the_points(
            points in prop::collection::vec((0.0..TAU, 1.0..30.0), 1..40), turn in 0_usize..1440,
        ) {
            let by = turn as f64 * TAU / 1440.0;
            let run = |by: f64| {
                let mut profile = AzimuthProfile::new(ProfileRule::default());
                for &(azimuth, length) in &points {
                    profile.add(&point(azimuth + by, EdgeSign::Brighter, length));
                }
                profile.find().to_vec()
            };
            // Excludes points that rounding may move to another bin.
            prop_assume!(points.iter().all(|(a, _)| {
                let share = (a / TAU * 1440.0).fract();
                (1e-6..1.0 - 1e-6).contains(&share)
            }));
            let (still, turned) = (run(0.0), run(by));
            prop_assert_eq!(still.len(), turned.len());
            for edge in &still {
                let twin = turned.iter().find(|t| wrap_angle(t.azimuth_rad - edge.azimuth_rad - by).abs() < 1e-9);
                prop_assert!(twin.is_some_and(|twin| (twin.length_px - edge.length_px).abs() < 1e-9));
            }
        }
    }
}
