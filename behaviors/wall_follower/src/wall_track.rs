//! Distance of one wall, propagated from frame to frame: a scalar Kalman filter, with a rival that takes over once it is confirmed.

use yamabico_vision::corridor::floor_lines::WallEstimate;

use crate::width_memory::Rival;

/// Jump of the distance (m) above which it may be a recess, until it lasts for [`CONFIRM_M`].
const JUMP_M: f64 = 0.15;
/// Driven distance that confirms a changed wall distance or width, m.
pub(crate) const CONFIRM_M: f64 = 0.5;
/// Driven distance without an observation after which the wall is dropped, m.
const FORGET_M: f64 = 1.0;
/// Growth of the distance's standard deviation per meter driven without an observation, m.
const DRIFT_PER_METER: f64 = 0.04;

/// One wall of the corridor.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WallTrack {
    known: Option<Wall>,
    rival: Option<Rival>,
}

#[derive(Clone, Copy, Debug)]
struct Wall {
    distance_m: f64,
    variance: f64,
    unobserved_m: f64,
}

impl WallTrack {
    /// Signed distance from the robot with its standard deviation, m, positive to the left; `None` without a wall.
    pub fn estimate(&self) -> Option<WallEstimate> {
        self.known.map(|wall| WallEstimate { distance_m: wall.distance_m, sigma_m: wall.variance.sqrt() })
    }

    /// Drops the wall; a rival may still be confirmed.
    pub fn drop_known(&mut self) {
        self.known = None;
    }

    /// Propagates over `meters` driven, `across_m` of them to the left.
    pub fn drive(&mut self, meters: f64, across_m: f64) {
        if let Some(wall) = &mut self.known {
            wall.distance_m -= across_m;
            wall.variance += (DRIFT_PER_METER * meters).powi(2) + 1e-6;
            wall.unobserved_m += meters;
            if wall.unobserved_m > FORGET_M {
                self.known = None;
            }
        }
        if let Some(rival) = &mut self.rival {
            rival.distance_m -= across_m;
            rival.for_m += meters;
        }
    }

    /// Takes in an observation.
    pub fn update(&mut self, seen: WallEstimate) {
        let noise = seen.sigma_m.powi(2);
        let fresh = Wall { distance_m: seen.distance_m, variance: noise, unobserved_m: 0.0 };
        let Some(wall) = &mut self.known else {
            self.known = Some(fresh);
            return;
        };
        let innovation = seen.distance_m - wall.distance_m;
        if innovation.abs() < JUMP_M {
            let gain = wall.variance / (wall.variance + noise);
            wall.distance_m += gain * innovation;
            wall.variance *= 1.0 - gain;
            wall.unobserved_m = 0.0;
            self.rival = None;
            return;
        }
        let rival = self
            .rival
            .filter(|rival| (rival.distance_m - seen.distance_m).abs() < JUMP_M)
            .unwrap_or(Rival { distance_m: seen.distance_m, for_m: 0.0 });
        if rival.for_m >= CONFIRM_M {
            *self = Self { known: Some(fresh), rival: None };
        } else {
            self.rival = Some(Rival { distance_m: seen.distance_m, for_m: rival.for_m });
        }
    }
}
