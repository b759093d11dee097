use nalgebra::RowVector2;

use super::cyclic_matching::{MatchingRule, SeenEdge};
use super::relink::{LocatedEdge, RelinkRule};
use super::triangulation::{Sighting, Triangulated, TriangulationRule, most_likely_crossing, triangulate};
use crate::azimuth_profile::EdgeSign;
use yamabico_geometry::{Pose2, angle_difference, wrap_angle};

/// How sure a locus is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LocusState {
    /// Seen in a few pictures only.
    Tentative,
    /// Seen in enough pictures.
    Confirmed,
    /// Confirmed, and not seen in the last pictures.
    Occluded,
    /// Located, and not seen for long: it waits to be seen again as another locus.
    Dormant,
}

/// One edge, followed over many pictures: its azimuths along the robot's way.
#[derive(Clone, Debug)]
pub struct Locus {
    /// Its number; never given twice.
    pub number: u32,
    /// How the picture changes across it.
    pub sign: EdgeSign,
    /// Its length in the last picture that showed it, pixels.
    pub length_px: f64,
    /// How sure it is.
    pub state: LocusState,
    /// Pictures that showed it.
    pub seen: u32,
    /// Pictures since that did not.
    pub missed: u32,
    /// Where it is, once its bearings cross well enough.
    pub position: Option<Triangulated>,
    /// Where it was seen from and where, from the oldest to the newest; thinned out once there are many.
    pub sightings: Vec<Sighting>,
    /// The last azimuth, less what the sensor has turned since.
    pub(super) azimuth_rad: f64,
    /// Only every so many pictures' sighting is kept.
    stride: u32,
}

/// How loci are followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocusRule {
    /// Costs of the matching.
    pub matching: MatchingRule,
    /// When a position is believed.
    pub triangulation: TriangulationRule,
    /// When a dormant locus is the same as a new one.
    pub relinking: RelinkRule,
    /// Standard deviation of an azimuth, radians.
    pub sigma_rad: f64,
    /// Least gate, radians: added to what motion can do to an edge that is not located.
    pub min_gate_rad: f64,
    /// How much the gate widens with each picture that does not show the edge, radians.
    pub gate_growth_rad: f64,
    /// Nearest distance of an edge that is not located, meters.
    pub nearest_m: f64,
    /// Pictures that confirm a locus.
    pub confirmed_after: u32,
    /// Pictures without it after which a locus is dormant (or dropped, where it is not located).
    pub dormant_after: u32,
    /// Most sightings kept of a locus, at least 8.
    pub max_sightings: usize,
    /// Most loci.
    pub max_loci: usize,
}

impl Default for LocusRule {
    fn default() -> Self {
        Self {
            matching: MatchingRule::default(),
            triangulation: TriangulationRule::default(),
            relinking: RelinkRule::default(),
            sigma_rad: 0.3_f64.to_radians(),
            min_gate_rad: 1_f64.to_radians(),
            gate_growth_rad: 0.5_f64.to_radians(),
            nearest_m: 0.5,
            confirmed_after: 4,
            dormant_after: 5,
            max_sightings: 64,
            max_loci: 200,
        }
    }
}

impl Locus {
    pub(super) fn begin(
        number: u32,
        edge: &SeenEdge,
        sighting: Sighting,
        mut sightings: Vec<Sighting>,
        rule: &LocusRule,
    ) -> Self {
        sightings.clear();
        sightings.reserve(rule.max_sightings.max(8));
        sightings.push(sighting);
        Self {
            number,
            sign: edge.sign,
            length_px: edge.length_px,
            state: LocusState::Tentative,
            seen: 1,
            missed: 0,
            position: None,
            sightings,
            azimuth_rad: edge.azimuth_rad,
            stride: 1,
        }
    }

    /// The edge as one with a position, if it has one.
    #[must_use]
    pub fn located(&self) -> Option<LocatedEdge> {
        self.position.map(|found| LocatedEdge {
            position: found.position,
            covariance: found.covariance,
            sign: Some(self.sign),
        })
    }

    pub(super) fn predict(&self, step: &Pose2, sensor: &Pose2, rule: &LocusRule) -> (f64, f64) {
        match &self.position {
            Some(found) => {
                let away = found.position - sensor.position();
                let squared = away.norm_squared();
                let jacobian = RowVector2::new(-away.y, away.x) / squared;
                let variance =
                    (jacobian * found.covariance * jacobian.transpose()).x + rule.sigma_rad.powi(2);
                let azimuth = wrap_angle(away.y.atan2(away.x) - sensor.theta);
                (azimuth, (3.0 * variance.sqrt()).max(rule.min_gate_rad))
            }
            None => {
                let reach = step.x.hypot(step.y) / rule.nearest_m;
                (self.azimuth_rad, reach.min(1.0).asin() + rule.min_gate_rad)
            }
        }
    }

    pub(super) fn extend(&mut self, edge: &SeenEdge, sighting: Sighting, rule: &LocusRule) {
        self.length_px = edge.length_px;
        self.azimuth_rad = edge.azimuth_rad;
        self.seen += 1;
        self.missed = 0;
        if self.seen.is_multiple_of(self.stride) {
            self.keep(sighting, rule.max_sightings);
            self.locate(rule);
        }
    }

    /// Every second sighting goes once there are too many; from then on fewer are kept.
    pub(super) fn keep(&mut self, sighting: Sighting, most: usize) {
        if self.sightings.len() >= most.max(8) {
            let mut is_kept = false;
            self.sightings.retain(|_| {
                is_kept = !is_kept;
                is_kept
            });
            self.stride = self.stride.saturating_mul(2);
        }
        self.sightings.push(sighting);
    }

    /// A position that is known already only needs to be polished.
    pub(super) fn locate(&mut self, rule: &LocusRule) {
        let found = match &self.position {
            Some(known) => most_likely_crossing(&self.sightings, known.position, rule.sigma_rad)
                .or_else(|_| triangulate(&self.sightings, rule.sigma_rad, &rule.triangulation)),
            None => triangulate(&self.sightings, rule.sigma_rad, &rule.triangulation),
        };
        let freedom = self.sightings.len().saturating_sub(2).max(1) as f64;
        self.position =
            found.ok().filter(|found| found.chi_squared / freedom <= rule.triangulation.max_chi_squared);
    }

    /// How far the last azimuth lies from that of the position, radians.
    #[must_use]
    pub fn misfit_rad(&self) -> Option<f64> {
        let (found, last) = (self.position.as_ref()?, self.sightings.last()?);
        let away = found.position - last.sensor.position();
        Some(angle_difference(last.bearing_rad(), away.y.atan2(away.x)))
    }
}
