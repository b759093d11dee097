//! How much edge a mirror camera sees in each direction: a histogram over azimuth, and the vertical edges in it.
//!
//! Yagi, Nishizawa & Yachida (1995), section II: vertical edges are radial in the picture, so that their points are
//! counted over azimuth. Differs from \[1\]: dark to bright and bright to dark are counted apart, bins are a quarter of a
//! degree, and the azimuth of an edge is the weighted mean of its points, finer than a bin.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use yamabico_geometry::wrap_angle;

/// How the picture changes across an edge, on the way of growing azimuth (to the left).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum EdgeSign {
    /// Darker to brighter.
    Brighter,
    /// Brighter to darker.
    Darker,
}

impl EdgeSign {
    /// Both of them.
    pub const ALL: [Self; 2] = [Self::Brighter, Self::Darker];

    /// 1 for growing brightness, else -1.
    #[must_use]
    pub fn value(self) -> i8 {
        match self {
            Self::Brighter => 1,
            Self::Darker => -1,
        }
    }
}

/// One point of a radial edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgePoint {
    /// Azimuth, radians.
    pub azimuth_rad: f64,
    /// How the picture changes across the edge.
    pub sign: EdgeSign,
    /// How much of the edge's length it stands for, pixels, > 0.
    pub length_px: f64,
    /// How much it counts in the mean azimuth, > 0: the square of its distance from the center, pixels, where all
    /// points are equally sharp.
    pub weight: f64,
}

/// One vertical edge of the surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AzimuthEdge {
    /// Azimuth, radians in [-pi, pi).
    pub azimuth_rad: f64,
    /// How the picture changes across it.
    pub sign: EdgeSign,
    /// Its length in the picture, pixels.
    pub length_px: f64,
    /// Sum of the weights of its points.
    pub weight: f64,
    /// Neighboring bins that it fills.
    pub bins: usize,
}

impl AzimuthEdge {
    /// Standard deviation of the azimuth, radians, where weights are squared distances from the center (pixels) and
    /// points are `point_sigma_px` sharp, three neighboring ones telling as much as one; not below `min_rad`.
    #[must_use]
    pub fn sigma_rad(&self, point_sigma_px: f64, min_rad: f64) -> f64 {
        (point_sigma_px * (3.0 / self.weight.max(f64::MIN_POSITIVE)).sqrt()).max(min_rad)
    }

    /// Nearest distance of the edge from the center, pixels, where weights are squared distances from the center and the
    /// edge has no gaps. `None` where weight and length do not belong to such an edge.
    #[must_use]
    pub fn inner_radius_px(&self) -> Option<f64> {
        let length = self.length_px;
        // From a to a + n the mean of the squares is a^2 + a n + n^2 / 3.
        let square = self.weight / length - length * length / 12.0;
        (square >= 0.0).then(|| square.sqrt() - 0.5 * length).filter(|radius| *radius >= 0.0)
    }
}

/// What counts as one edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileRule {
    /// Bins of a turn, at least 8.
    pub bins: usize,
    /// Shortest edge, pixels.
    pub min_length_px: f64,
    /// Runs of filled bins wider than this (radians) are cut at their deepest valley, if there is one of less than half of
    /// the peaks on both of its sides.
    pub widest_rad: f64,
}

impl Default for ProfileRule {
    fn default() -> Self {
        Self { bins: 1440, min_length_px: 15.0, widest_rad: 1.5_f64.to_radians() }
    }
}

/// The histogram, and the edges that it holds.
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
    /// Weighted sum of the azimuths, from the bin's middle.
    moment: f64,
}

impl AzimuthProfile {
    /// An empty profile.
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

    /// Empties it.
    pub fn clear(&mut self) {
        for bins in &mut self.bins {
            bins.fill(Bin::default());
        }
        self.edges.clear();
    }

    /// Counts a point; one without a finite azimuth is left out.
    #[inline]
    pub fn add(&mut self, point: &EdgePoint) {
        if !point.azimuth_rad.is_finite() {
            return;
        }
        let turn = point.azimuth_rad.rem_euclid(TAU);
        let index = ((turn / self.width_rad) as usize).min(self.rule.bins - 1);
        let offset = turn - self.middle(index);
        let bin = &mut self.bins[usize::from(point.sign == EdgeSign::Darker)][index];
        bin.length_px += point.length_px;
        bin.weight += point.weight;
        bin.moment += point.weight * offset;
    }

    /// Counts a point whose azimuth lies in [0, 2 pi].
    #[inline]
    pub(crate) fn add_in_turn(&mut self, turn: f32, sign: usize, length_px: f32, weight: f32) {
        let turn = f64::from(turn);
        let index = ((turn / self.width_rad) as usize).min(self.rule.bins - 1);
        let middle = self.middle(index);
        let bin = &mut self.bins[sign & 1][index];
        bin.length_px += f64::from(length_px);
        bin.weight += f64::from(weight);
        bin.moment += f64::from(weight) * (turn - middle);
    }

    /// Finds the edges, by growing azimuth.
    pub fn find(&mut self) -> &[AzimuthEdge] {
        self.edges.clear();
        let runs = Runs { rule: &self.rule, width_rad: self.width_rad };
        for (bins, sign) in self.bins.iter().zip(EdgeSign::ALL) {
            runs.find(bins, sign, &mut self.edges);
        }
        self.edges.sort_unstable_by(|a, b| a.azimuth_rad.total_cmp(&b.azimuth_rad));
        &self.edges
    }

    /// The edges found last, by growing azimuth.
    #[must_use]
    pub fn edges(&self) -> &[AzimuthEdge] {
        &self.edges
    }

    fn middle(&self, bin: usize) -> f64 {
        (bin as f64 + 0.5) * self.width_rad
    }
}

/// Runs of filled bins around the turn.
struct Runs<'a> {
    rule: &'a ProfileRule,
    width_rad: f64,
}

impl Runs<'_> {
    fn find(&self, bins: &[Bin], sign: EdgeSign, edges: &mut Vec<AzimuthEdge>) {
        let count = bins.len();
        let is_filled = |index: usize| bins[index % count].length_px > 0.0;
        // Beginning behind an empty bin, no run is cut where the turn closes.
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

    /// Cuts a wide run at its valleys and writes down the parts.
    fn cut(&self, bins: &[Bin], run: std::ops::Range<usize>, sign: EdgeSign, edges: &mut Vec<AzimuthEdge>) {
        let mut start = run.start;
        while start < run.end {
            let rest = start..run.end;
            let end = if (rest.len() as f64) * self.width_rad > self.rule.widest_rad {
                first_valley(bins, rest).unwrap_or(run.end)
            } else {
                run.end
            };
            self.take(bins, start..end, sign, edges);
            start = end;
        }
    }

    fn take(&self, bins: &[Bin], run: std::ops::Range<usize>, sign: EdgeSign, edges: &mut Vec<AzimuthEdge>) {
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

/// The bin, within a run, of the first valley that lies below half of the highest bins before it and up to the next valley
/// behind it; the run is to be cut before this bin.
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
        // Narrow runs stay whole whatever their shape.
        profile.clear();
        for (i, length) in [30.0, 2.0, 30.0].into_iter().enumerate() {
            profile.add(&point((100.5 + i as f64) * width, EdgeSign::Brighter, length));
        }
        assert_eq!(profile.find().len(), 1);
    }

    #[test]
    fn texture_all_around_and_no_number_do_no_harm() {
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
        /// Turning everything by whole bins turns the edges, and nothing else.
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
            // A point that rounding puts over the border of a bin proves nothing.
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
