use super::cyclic_matching::{CyclicMatcher, ObservedEdge, PredictedEdge};
use super::locus::{Locus, LocusRule, LocusState};
use super::relink::relink;
use super::triangulation::Sighting;
use yamabico_geometry::{Pose2, wrap_angle};

/// Tracks all edges around the robot. Reuses its buffers: does not allocate once it has tracked as many edges for as
/// long.
///
/// Yagi et al. (1995), section III.
#[derive(Clone, Debug)]
pub struct LocusTracker {
    rule: LocusRule,
    loci: Vec<Locus>,
    spare: Vec<Vec<Sighting>>,
    matcher: CyclicMatcher,
    expected: Vec<PredictedEdge>,
    /// Locus index of each predicted edge.
    followed: Vec<usize>,
    locus_of_observed: Vec<Option<usize>>,
    last: Option<Pose2>,
    next_number: u32,
}

impl LocusTracker {
    /// Creates a tracker without loci.
    #[must_use]
    pub fn new(rule: LocusRule) -> Self {
        Self {
            rule,
            loci: Vec::new(),
            spare: Vec::new(),
            matcher: CyclicMatcher::default(),
            expected: Vec::new(),
            followed: Vec::new(),
            locus_of_observed: Vec::new(),
            last: None,
            next_number: 0,
        }
    }

    /// All loci, unordered.
    #[must_use]
    pub fn loci(&self) -> &[Locus] {
        &self.loci
    }

    /// Locus with this number.
    #[must_use]
    pub fn locus(&self, number: u32) -> Option<&Locus> {
        self.loci.iter().find(|locus| locus.number == number)
    }

    /// Index in [`LocusTracker::loci`] of the locus of each edge of the last frame.
    #[must_use]
    pub fn locus_of_observed(&self) -> &[Option<usize>] {
        &self.locus_of_observed
    }

    /// Drops all loci.
    pub fn clear(&mut self) {
        for Locus { mut sightings, .. } in self.loci.drain(..) {
            sightings.clear();
            self.spare.push(sightings);
        }
        self.locus_of_observed.clear();
        self.last = None;
    }

    /// Updates the loci with the edges of a frame taken at pose `sensor` (map from sensor). Azimuths are in the sensor
    /// frame. A pose that is not finite leaves the loci unchanged.
    pub fn update(&mut self, seen: &[ObservedEdge], sensor: &Pose2) {
        self.locus_of_observed.clear();
        self.locus_of_observed.resize(seen.len(), None);
        if !sensor.is_finite() {
            return;
        }
        let step = self.last.map_or(Pose2::IDENTITY, |last| last.relative(sensor));
        self.last = Some(*sensor);
        self.predict(&step, sensor);
        let (assignment, _) = self.matcher.assign(&self.expected, seen, &self.rule.matching);
        for (index, expected) in self.locus_of_observed.iter_mut().zip(assignment) {
            *index = expected.map(|expected| self.followed[expected]);
        }
        for locus in &mut self.loci {
            locus.missed += 1;
        }
        for (edge, index) in seen.iter().zip(&mut self.locus_of_observed) {
            let sighting = Sighting { sensor: *sensor, azimuth_rad: edge.azimuth_rad };
            match *index {
                Some(index) => self.loci[index].extend(edge, sighting, &self.rule),
                None if self.loci.len() < self.rule.max_loci && edge.azimuth_rad.is_finite() => {
                    let sightings = self.spare.pop().unwrap_or_default();
                    let locus = Locus::begin(self.next_number, edge, sighting, sightings, &self.rule);
                    *index = Some(self.loci.len());
                    self.loci.push(locus);
                    self.next_number += 1;
                }
                None => {}
            }
        }
        self.relink();
        self.drop_lost();
    }

    fn predict(&mut self, step: &Pose2, sensor: &Pose2) {
        self.expected.clear();
        self.followed.clear();
        for (index, locus) in self.loci.iter_mut().enumerate() {
            locus.azimuth_rad = wrap_angle(locus.azimuth_rad - step.theta);
            if locus.state == LocusState::Dormant {
                continue;
            }
            let (azimuth_rad, gate) = locus.predict(step, sensor, &self.rule);
            self.followed.push(index);
            self.expected.push(PredictedEdge {
                azimuth_rad,
                sign: Some(locus.sign),
                length_px: locus.length_px,
                gate_rad: gate + f64::from(locus.missed) * self.rule.gate_growth_rad,
            });
        }
    }

    /// Joins newly located loci with dormant ones at the same position.
    fn relink(&mut self) {
        for index in 0..self.loci.len() {
            let Some(newer) = self.loci[index].located().filter(|_| self.loci[index].missed == 0) else {
                continue;
            };
            let twin = self.loci.iter().position(|old| {
                let older = old.located().filter(|_| old.state == LocusState::Dormant);
                older.is_some_and(|older| relink(&older, &newer, &self.rule.relinking).is_some())
            });
            if let Some(twin) = twin {
                self.join(twin, index);
            }
        }
    }

    /// Moves the sightings of the newer locus to the older one. The newer locus is marked to be dropped.
    fn join(&mut self, old: usize, new: usize) {
        let mut sightings = std::mem::take(&mut self.loci[new].sightings);
        let newer = self.loci[new].clone();
        let older = &mut self.loci[old];
        for &sighting in &sightings {
            older.keep(sighting, self.rule.max_sightings);
        }
        sightings.clear();
        self.loci[new].sightings = sightings;
        self.loci[new].missed = u32::MAX;
        let older = &mut self.loci[old];
        older.length_px = newer.length_px;
        older.azimuth_rad = newer.azimuth_rad;
        older.seen += newer.seen;
        older.missed = 0;
        older.state = LocusState::Confirmed;
        older.locate(&self.rule);
        for index in self.locus_of_observed.iter_mut().filter(|index| **index == Some(new)) {
            *index = Some(old);
        }
    }

    fn drop_lost(&mut self) {
        let rule = &self.rule;
        for locus in &mut self.loci {
            locus.state = match locus.state {
                LocusState::Dormant => LocusState::Dormant,
                _ if locus.missed > rule.dormant_after && locus.position.is_some() => LocusState::Dormant,
                _ if locus.seen < rule.confirmed_after => LocusState::Tentative,
                _ if locus.missed > 0 => LocusState::Occluded,
                _ => LocusState::Confirmed,
            };
        }
        for index in (0..self.loci.len()).rev() {
            let locus = &self.loci[index];
            let waits = locus.state == LocusState::Dormant && locus.missed < rule.forgotten_after;
            if locus.missed <= rule.dormant_after || waits {
                continue;
            }
            let mut sightings = self.loci.swap_remove(index).sightings;
            sightings.clear();
            self.spare.push(sightings);
            let moved = self.loci.len();
            for seen in &mut self.locus_of_observed {
                if *seen == Some(moved) {
                    *seen = Some(index);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::azimuth_profile::EdgeSign;
    use nalgebra::Point2;
    use yamabico_geometry::wrap_angle;

    fn look(edges: &[(Point2<f64>, EdgeSign)], sensor: &Pose2) -> Vec<ObservedEdge> {
        edges
            .iter()
            .map(|(edge, sign)| {
                let away = edge - sensor.position();
                let azimuth_rad = wrap_angle(away.y.atan2(away.x) - sensor.theta);
                ObservedEdge { azimuth_rad, sign: *sign, length_px: 60.0 }
            })
            .collect()
    }

    fn room() -> Vec<(Point2<f64>, EdgeSign)> {
        [(2.0, 1.5), (1.2, 2.0), (-0.5, 1.8), (-2.0, 0.4), (-1.6, -1.9), (0.3, -2.2), (1.7, -1.4)]
            .iter()
            .enumerate()
            .map(|(i, &(x, y))| (Point2::new(x, y), EdgeSign::ALL[i % 2]))
            .collect()
    }

    fn path(frame: usize) -> Pose2 {
        Pose2::new(-0.6 + 0.04 * frame as f64, 0.1 * (0.2 * frame as f64).sin(), 0.02 * frame as f64)
    }

    #[test]
    fn all_edges_are_located_and_keep_their_numbers() {
        let edges = room();
        let mut tracker = LocusTracker::new(LocusRule::default());
        for frame in 0..30 {
            tracker.update(&look(&edges, &path(frame)), &path(frame));
        }
        assert_eq!(tracker.loci().len(), edges.len());
        for (number, (edge, sign)) in edges.iter().enumerate() {
            let index = tracker.locus_of_observed()[number].unwrap();
            let locus = &tracker.loci()[index];
            assert_eq!((locus.seen, locus.state, locus.sign), (30, LocusState::Confirmed, *sign));
            assert!((locus.position.unwrap().position - edge).norm() < 1e-6);
        }
    }

    #[test]
    fn a_hidden_edge_keeps_its_number() {
        let edges = room();
        let mut tracker = LocusTracker::new(LocusRule::default());
        let mut number = None;
        for frame in 0..60 {
            let is_hidden = (25..38).contains(&frame);
            let seen = look(&edges[usize::from(is_hidden)..], &path(frame));
            tracker.update(&seen, &path(frame));
            if frame == 24 {
                number = tracker.locus_of_observed()[0].map(|index| tracker.loci()[index].number);
            }
            if frame == 36 {
                let state = number.and_then(|number| tracker.locus(number)).map(|locus| locus.state);
                assert_eq!(state, Some(LocusState::Dormant));
            }
        }
        assert!(number.is_some());
        assert_eq!(tracker.locus_of_observed()[0].map(|index| tracker.loci()[index].number), number);
        assert_eq!(tracker.loci().len(), edges.len());
    }

    #[test]
    fn single_observations_are_dropped_and_nan_is_ignored() {
        let mut tracker = LocusTracker::new(LocusRule::default());
        tracker.update(&look(&room(), &Pose2::IDENTITY), &Pose2::IDENTITY);
        tracker.update(&[], &Pose2::new(f64::NAN, 0.0, 0.0));
        assert_eq!(tracker.loci().len(), 7);
        let broken = ObservedEdge { azimuth_rad: f64::NAN, sign: EdgeSign::Darker, length_px: 1.0 };
        for _ in 0..7 {
            tracker.update(&[broken], &Pose2::IDENTITY);
        }
        assert!(tracker.loci().is_empty());
    }

    #[test]
    fn long_loci_are_thinned_out() {
        let rule = LocusRule { max_sightings: 16, ..LocusRule::default() };
        let mut tracker = LocusTracker::new(rule);
        let edges = room();
        for frame in 0..200 {
            let sensor = Pose2::new(-0.6 + 0.006 * f64::from(frame), 0.0, 0.0);
            tracker.update(&look(&edges, &sensor), &sensor);
        }
        assert_eq!(tracker.loci().len(), edges.len());
        assert!(tracker.loci().iter().all(|locus| locus.sightings.len() <= 16 && locus.seen == 200));
    }
}
