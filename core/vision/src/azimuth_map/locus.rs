use nalgebra::RowVector2;

use super::cyclic_matching::{MatchingRule, ObservedEdge};
use super::relink::{LocatedEdge, RelinkRule};
use super::triangulation::{Sighting, Triangulated, TriangulationRule, most_likely_crossing, triangulate};
use crate::azimuth_profile::EdgeSign;
use yamabico_geometry::{Hypotenuse, Pose2, wrap_angle};

/// State of a locus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LocusState {
    /// Observed in few frames.
    Tentative,
    /// Observed in enough frames.
    Confirmed,
    /// Confirmed, but not observed in the last frames.
    Occluded,
    /// Located, but not observed for long: may be relinked with a new locus.
    Dormant,
}

/// Track of one edge over many frames: its azimuths along the robot's path.
#[derive(Clone, Debug)]
pub struct Locus {
    /// Number; never reused.
    pub number: u32,
    /// Sign of the brightness change.
    pub sign: EdgeSign,
    /// Length in the last image that showed it, pixels.
    pub length_px: f64,
    /// State of the track.
    pub state: LocusState,
    /// Number of frames that showed it.
    pub seen: u32,
    /// Number of frames since it was last observed.
    pub missed: u32,
    /// Position; `None` until its bearings can be triangulated.
    pub position: Option<Triangulated>,
    /// Sightings from the oldest to the newest, decimated if there are many.
    pub sightings: Vec<Sighting>,
    /// Last azimuth, minus the rotation of the sensor since.
    pub(super) azimuth_rad: f64,
    /// Decimation factor: every `stride`-th sighting is kept.
    stride: u32,
}

/// Parameters of edge tracking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocusRule {
    /// Matching costs.
    pub matching: MatchingRule,
    /// Criteria for accepting a position.
    pub triangulation: TriangulationRule,
    /// Criteria for relinking a dormant locus with a new one.
    pub relinking: RelinkRule,
    /// Standard deviation of an azimuth, rad.
    pub sigma_rad: f64,
    /// Minimum gate, rad. For an edge that is not located, added to the largest possible effect of the motion.
    pub min_gate_rad: f64,
    /// Growth of the gate per frame without the edge, rad.
    pub gate_growth_rad: f64,
    /// Minimum distance assumed for an edge that is not located, m.
    pub nearest_m: f64,
    /// Number of frames that confirm a locus.
    pub confirmed_after: u32,
    /// Number of frames without the edge after which a locus becomes dormant, or is dropped if it is not located.
    pub dormant_after: u32,
    /// Number of frames without the edge after which a dormant locus is dropped.
    pub forgotten_after: u32,
    /// Maximum number of sightings kept per locus, at least 8.
    pub max_sightings: usize,
    /// Maximum number of loci.
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
            forgotten_after: u32::MAX,
            max_sightings: 64,
            max_loci: 200,
        }
    }
}

impl Locus {
    pub(super) fn begin(
        number: u32,
        edge: &ObservedEdge,
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

    /// Position, covariance and sign of the edge; `None` if it is not located.
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
                let reach = step.x.hypotenuse(step.y) / rule.nearest_m;
                (self.azimuth_rad, reach.min(1.0).asin() + rule.min_gate_rad)
            }
        }
    }

    pub(super) fn extend(&mut self, edge: &ObservedEdge, sighting: Sighting, rule: &LocusRule) {
        self.length_px = edge.length_px;
        self.azimuth_rad = edge.azimuth_rad;
        self.seen += 1;
        self.missed = 0;
        if self.seen.is_multiple_of(self.stride) {
            self.keep(sighting, rule.max_sightings);
            self.locate(rule);
        }
    }

    /// Appends a sighting. Drops every other sighting and doubles the stride if there are too many.
    pub(super) fn keep(&mut self, sighting: Sighting, max_sightings: usize) {
        if self.sightings.len() >= max_sightings.max(8) {
            let mut is_kept = false;
            self.sightings.retain(|_| {
                is_kept = !is_kept;
                is_kept
            });
            self.stride = self.stride.saturating_mul(2);
        }
        self.sightings.push(sighting);
    }

    /// A known position only needs refinement.
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
}
