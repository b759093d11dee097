use super::cyclic_matching::{CyclicMatcher, ExpectedEdge, SeenEdge};
use super::locus::{Locus, LocusRule, LocusState};
use super::relink::relink;
use super::triangulation::Sighting;
use yamabico_geometry::{Pose2, wrap_angle};

/// Follows all edges around the robot. Keeps its buffers: nothing is allocated once it has followed as many edges for as long.
///
/// Yagi et al. (1995), section III.
#[derive(Clone, Debug)]
pub struct LocusTracker {
    rule: LocusRule,
    loci: Vec<Locus>,
    spare: Vec<Vec<Sighting>>,
    matcher: CyclicMatcher,
    expected: Vec<ExpectedEdge>,
    /// Which locus each of the expected edges is.
    followed: Vec<usize>,
    locus_of_seen: Vec<Option<usize>>,
    last: Option<Pose2>,
    next_number: u32,
}

impl LocusTracker {
    /// Follows nothing yet.
    #[must_use]
    pub fn new(rule: LocusRule) -> Self {
        Self {
            rule,
            loci: Vec::new(),
            spare: Vec::new(),
            matcher: CyclicMatcher::default(),
            expected: Vec::new(),
            followed: Vec::new(),
            locus_of_seen: Vec::new(),
            last: None,
            next_number: 0,
        }
    }

    /// All loci, in no order.
    #[must_use]
    pub fn loci(&self) -> &[Locus] {
        &self.loci
    }

    /// The locus with a number.
    #[must_use]
    pub fn locus(&self, number: u32) -> Option<&Locus> {
        self.loci.iter().find(|locus| locus.number == number)
    }

    /// The place in [`LocusTracker::loci`] of the locus of each edge of the last picture.
    #[must_use]
    pub fn locus_of_seen(&self) -> &[Option<usize>] {
        &self.locus_of_seen
    }

    /// Takes the edges of a picture, azimuths in the sensor's frame, taken where `sensor` (map from sensor) tells. A pose that is
    /// not finite leaves everything as it is.
    pub fn take(&mut self, seen: &[SeenEdge], sensor: &Pose2) {
        self.locus_of_seen.clear();
        self.locus_of_seen.resize(seen.len(), None);
        if !sensor.is_finite() {
            return;
        }
        let step = self.last.map_or(Pose2::IDENTITY, |last| last.relative(sensor));
        self.last = Some(*sensor);
        self.predict(&step, sensor);
        let (assignment, _) = self.matcher.assign(&self.expected, seen, &self.rule.matching);
        for (place, expected) in self.locus_of_seen.iter_mut().zip(assignment) {
            *place = expected.map(|expected| self.followed[expected]);
        }
        for locus in &mut self.loci {
            locus.missed += 1;
        }
        for (edge, place) in seen.iter().zip(&mut self.locus_of_seen) {
            let sighting = Sighting { sensor: *sensor, azimuth_rad: edge.azimuth_rad };
            match *place {
                Some(place) => self.loci[place].extend(edge, sighting, &self.rule),
                None if self.loci.len() < self.rule.max_loci && edge.azimuth_rad.is_finite() => {
                    let sightings = self.spare.pop().unwrap_or_default();
                    let locus = Locus::begin(self.next_number, edge, sighting, sightings, &self.rule);
                    *place = Some(self.loci.len());
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
        for (place, locus) in self.loci.iter_mut().enumerate() {
            locus.azimuth_rad = wrap_angle(locus.azimuth_rad - step.theta);
            if locus.state == LocusState::Dormant {
                continue;
            }
            let (azimuth_rad, gate) = locus.predict(step, sensor, &self.rule);
            self.followed.push(place);
            self.expected.push(ExpectedEdge {
                azimuth_rad,
                sign: Some(locus.sign),
                length_px: locus.length_px,
                gate_rad: gate + f64::from(locus.missed) * self.rule.gate_growth_rad,
            });
        }
    }

    /// Joins loci that have just been located with dormant ones at the same place.
    fn relink(&mut self) {
        for place in 0..self.loci.len() {
            let Some(newer) = self.loci[place].located().filter(|_| self.loci[place].missed == 0) else {
                continue;
            };
            let twin = self.loci.iter().position(|old| {
                let older = old.located().filter(|_| old.state == LocusState::Dormant);
                older.is_some_and(|older| relink(&older, &newer, &self.rule.relinking).is_some())
            });
            if let Some(twin) = twin {
                self.join(twin, place);
            }
        }
    }

    /// The older one lives on with the sightings of both; the newer one is left empty, to be dropped.
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
        for place in self.locus_of_seen.iter_mut().filter(|place| **place == Some(new)) {
            *place = Some(old);
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
        for place in (0..self.loci.len()).rev() {
            let locus = &self.loci[place];
            let waits = locus.state == LocusState::Dormant && locus.missed < u32::MAX;
            if locus.missed <= rule.dormant_after || waits {
                continue;
            }
            let mut sightings = self.loci.swap_remove(place).sightings;
            sightings.clear();
            self.spare.push(sightings);
            let moved = self.loci.len();
            for seen in &mut self.locus_of_seen {
                if *seen == Some(moved) {
                    *seen = Some(place);
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

    fn look(edges: &[(Point2<f64>, EdgeSign)], sensor: &Pose2) -> Vec<SeenEdge> {
        edges
            .iter()
            .map(|(edge, sign)| {
                let away = edge - sensor.position();
                let azimuth_rad = wrap_angle(away.y.atan2(away.x) - sensor.theta);
                SeenEdge { azimuth_rad, sign: *sign, length_px: 60.0 }
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

    fn way(frame: usize) -> Pose2 {
        Pose2::new(-0.6 + 0.04 * frame as f64, 0.1 * (0.2 * frame as f64).sin(), 0.02 * frame as f64)
    }

    #[test]
    fn all_edges_are_located_and_keep_their_numbers() {
        let edges = room();
        let mut tracker = LocusTracker::new(LocusRule::default());
        for frame in 0..30 {
            tracker.take(&look(&edges, &way(frame)), &way(frame));
        }
        assert_eq!(tracker.loci().len(), edges.len());
        for (number, (edge, sign)) in edges.iter().enumerate() {
            let place = tracker.locus_of_seen()[number].unwrap();
            let locus = &tracker.loci()[place];
            assert_eq!((locus.seen, locus.state, locus.sign), (30, LocusState::Confirmed, *sign));
            assert!((locus.position.unwrap().position - edge).norm() < 1e-6);
            assert!(locus.misfit_rad().unwrap().abs() < 1e-6);
        }
    }

    #[test]
    fn an_edge_that_was_hidden_is_the_same_again() {
        let edges = room();
        let mut tracker = LocusTracker::new(LocusRule::default());
        let mut number = None;
        for frame in 0..60 {
            let is_hidden = (25..38).contains(&frame);
            let seen = look(&edges[usize::from(is_hidden)..], &way(frame));
            tracker.take(&seen, &way(frame));
            if frame == 24 {
                number = tracker.locus_of_seen()[0].map(|place| tracker.loci()[place].number);
            }
            if frame == 36 {
                let state = number.and_then(|number| tracker.locus(number)).map(|locus| locus.state);
                assert_eq!(state, Some(LocusState::Dormant));
            }
        }
        assert!(number.is_some());
        assert_eq!(tracker.locus_of_seen()[0].map(|place| tracker.loci()[place].number), number);
        assert_eq!(tracker.loci().len(), edges.len());
    }

    #[test]
    fn what_was_seen_once_is_dropped_and_no_number_harms() {
        let mut tracker = LocusTracker::new(LocusRule::default());
        tracker.take(&look(&room(), &Pose2::IDENTITY), &Pose2::IDENTITY);
        tracker.take(&[], &Pose2::new(f64::NAN, 0.0, 0.0));
        assert_eq!(tracker.loci().len(), 7);
        let broken = SeenEdge { azimuth_rad: f64::NAN, sign: EdgeSign::Darker, length_px: 1.0 };
        for _ in 0..7 {
            tracker.take(&[broken], &Pose2::IDENTITY);
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
            tracker.take(&look(&edges, &sensor), &sensor);
        }
        assert_eq!(tracker.loci().len(), edges.len());
        assert!(tracker.loci().iter().all(|locus| locus.sightings.len() <= 16 && locus.seen == 200));
    }
}
