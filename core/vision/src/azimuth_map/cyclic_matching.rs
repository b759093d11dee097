use crate::azimuth_profile::EdgeSign;
use std::f64::consts::TAU;

use yamabico_geometry::angle_difference;

/// Edge predicted in the next frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictedEdge {
    /// Azimuth, rad.
    pub azimuth_rad: f64,
    /// Sign of the brightness change; `None` if unknown.
    pub sign: Option<EdgeSign>,
    /// Length in the image, pixels, > 0.
    pub length_px: f64,
    /// Maximum deviation of the observed azimuth, rad, > 0.
    pub gate_rad: f64,
}

/// Edge observed in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedEdge {
    /// Azimuth, rad.
    pub azimuth_rad: f64,
    /// Sign of the brightness change.
    pub sign: EdgeSign,
    /// Length in the image, pixels, > 0.
    pub length_px: f64,
}

/// Costs of matching predicted and observed edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchingRule {
    /// Cost of each unmatched edge, predicted or observed; a match at its gate costs 1.
    pub gap_cost: f64,
    /// Cost of a length ratio of e.
    pub length_cost: f64,
}

impl Default for MatchingRule {
    fn default() -> Self {
        Self { gap_cost: 0.75, length_cost: 0.5 }
    }
}

/// Assigns observed to predicted edges at minimum cost, preserving their cyclic order around the robot. Reuses its
/// buffers.
///
/// Differs from Yagi et al. (1995), section III: one cost combines similarity and the order of neighbors.
#[derive(Clone, Debug, Default)]
pub struct CyclicMatcher {
    expected: Vec<usize>,
    seen: Vec<usize>,
    costs: Vec<f64>,
    rows: [Vec<f64>; 2],
    steps: Vec<Step>,
    expected_of_seen: Vec<Option<usize>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Match,
    SkipExpected,
    SkipSeen,
}

impl CyclicMatcher {
    /// Returns the index of the predicted edge of each observed edge, or `None`, and the total cost.
    pub fn assign(
        &mut self,
        expected: &[PredictedEdge],
        seen: &[ObservedEdge],
        rule: &MatchingRule,
    ) -> (&[Option<usize>], f64) {
        sort_by_turn(&mut self.expected, expected.len(), |i| expected[i].azimuth_rad);
        sort_by_turn(&mut self.seen, seen.len(), |i| seen[i].azimuth_rad);
        self.costs.clear();
        for &e in &self.expected {
            let costs = self.seen.iter().map(|&s| cost(&expected[e], &seen[s], rule));
            self.costs.extend(costs);
        }
        let mut best = (f64::INFINITY, 0);
        for turn in 0..seen.len().max(1) {
            let cost = self.align(turn, rule.gap_cost, false);
            if cost < best.0 {
                best = (cost, turn);
            }
        }
        let (_, turn) = best;
        let cost = self.align(turn, rule.gap_cost, true);
        self.trace(turn);
        (&self.expected_of_seen, cost)
    }

    /// Minimum cost of an alignment that starts with the observed edge at index `turn`. Records the steps if
    /// `keeps_steps` is set.
    fn align(&mut self, turn: usize, gap_cost: f64, keeps_steps: bool) -> f64 {
        let (rows, columns) = (self.expected.len(), self.seen.len());
        let [before, here] = &mut self.rows;
        for row in [&mut *before, &mut *here] {
            row.clear();
            row.resize(columns + 1, 0.0);
        }
        for (j, cost) in before.iter_mut().enumerate() {
            *cost = j as f64 * gap_cost;
        }
        self.steps.clear();
        for i in 0..rows {
            let costs = &self.costs[i * columns..][..columns];
            here[0] = (i + 1) as f64 * gap_cost;
            let mut left = here[0];
            for j in 0..columns {
                let at = if j + turn < columns { j + turn } else { j + turn - columns };
                let matched = before[j] + costs[at];
                let skipped = before[j + 1] + gap_cost;
                let passed = left + gap_cost;
                left = matched.min(skipped).min(passed);
                here[j + 1] = left;
                if keeps_steps {
                    let step = if matched <= left {
                        Step::Match
                    } else if skipped <= left {
                        Step::SkipExpected
                    } else {
                        Step::SkipSeen
                    };
                    self.steps.push(step);
                }
            }
            std::mem::swap(before, here);
        }
        before[columns]
    }

    fn trace(&mut self, turn: usize) {
        let columns = self.seen.len();
        self.expected_of_seen.clear();
        self.expected_of_seen.resize(columns, None);
        let (mut i, mut j) = (self.expected.len(), columns);
        while i > 0 && j > 0 {
            match self.steps[(i - 1) * columns + j - 1] {
                Step::Match => {
                    let seen = self.seen[(j - 1 + turn) % columns];
                    self.expected_of_seen[seen] = Some(self.expected[i - 1]);
                    (i, j) = (i - 1, j - 1);
                }
                Step::SkipExpected => i -= 1,
                Step::SkipSeen => j -= 1,
            }
        }
    }
}

fn sort_by_turn(order: &mut Vec<usize>, count: usize, azimuth_rad: impl Fn(usize) -> f64) {
    order.clear();
    order.extend(0..count);
    let turn = |i: usize| azimuth_rad(i).rem_euclid(TAU);
    order.sort_unstable_by(|&a, &b| turn(a).total_cmp(&turn(b)).then(a.cmp(&b)));
}

/// Cost of a match; infinite for different edges.
fn cost(expected: &PredictedEdge, seen: &ObservedEdge, rule: &MatchingRule) -> f64 {
    let off = angle_difference(seen.azimuth_rad, expected.azimuth_rad);
    let is_other = expected.sign.is_some_and(|sign| sign != seen.sign);
    // Tolerance for rounding: an edge exactly at the gate is inside.
    let is_near = off.abs() <= expected.gate_rad * (1.0 + 1e-9);
    let ratio = (seen.length_px / expected.length_px).ln();
    let cost = (off / expected.gate_rad).powi(2) + rule.length_cost * ratio * ratio;
    if is_other || !is_near || cost.is_nan() { f64::INFINITY } else { cost }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expected(azimuth_rad: f64) -> PredictedEdge {
        PredictedEdge { azimuth_rad, sign: Some(EdgeSign::Brighter), length_px: 50.0, gate_rad: 0.1 }
    }

    fn seen(azimuth_rad: f64) -> ObservedEdge {
        ObservedEdge { azimuth_rad, sign: EdgeSign::Brighter, length_px: 50.0 }
    }

    #[test]
    fn order_is_preserved() {
        let mut matcher = CyclicMatcher::default();
        let edges = [expected(1.0), expected(1.05)];
        // The first edge has moved past the previous position of the second.
        let (assignment, _) = matcher.assign(&edges, &[seen(1.06), seen(1.11)], &MatchingRule::default());
        assert_eq!(assignment, [Some(0), Some(1)]);
    }

    #[test]
    fn matching_wraps_around() {
        let mut matcher = CyclicMatcher::default();
        let edges = [expected(0.02), expected(3.0), expected(-0.05)];
        let observed = [seen(3.03), seen(-0.01), seen(-0.08)];
        let (assignment, _) = matcher.assign(&edges, &observed, &MatchingRule::default());
        assert_eq!(assignment, [Some(1), Some(0), Some(2)]);
    }

    #[test]
    fn empty_and_nan_inputs_are_unmatched() {
        let mut matcher = CyclicMatcher::default();
        let rule = MatchingRule::default();
        assert_eq!(matcher.assign(&[], &[], &rule), (&[][..], 0.0));
        assert_eq!(matcher.assign(&[expected(0.0)], &[], &rule), (&[][..], 0.75));
        assert_eq!(matcher.assign(&[], &[seen(0.0)], &rule).0, [None]);
        assert_eq!(matcher.assign(&[expected(f64::NAN)], &[seen(0.0)], &rule), (&[None][..], 1.5));
        let darker = ObservedEdge { sign: EdgeSign::Darker, ..seen(0.0) };
        assert_eq!(matcher.assign(&[expected(0.0)], &[darker], &rule).0, [None]);
    }
}
