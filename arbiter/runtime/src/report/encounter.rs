//! Encounters with people, from the ground truth.

use serde::Serialize;
use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::Truth;
use yamabico_core::time::Time;

use super::STANDING_MPS;

/// Distance below which an encounter begins, m from the footprint.
const BEGIN_M: f64 = 1.0;
/// Distance above which an encounter ends, m from the footprint.
const END_M: f64 = 1.2;

/// One encounter with people.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Encounter {
    /// Begin, s of the run.
    pub begin_s: f64,
    /// End, s of the run.
    pub end_s: f64,
    /// Position of the robot at the smallest distance, map frame, m.
    pub x: f64,
    /// Position of the robot at the smallest distance, map frame, m.
    pub y: f64,
    /// Smallest distance from the footprint, m.
    pub nearest_m: f64,
    /// Smallest distance while the robot moved, m; `None` if it stood all the time.
    pub nearest_moving_m: Option<f64>,
    /// Distance each time that it came to a standstill, m; empty if it never did.
    pub stood_at_m: Vec<f64>,
}

/// Detects encounters in the ground truth of a run.
#[derive(Clone, Debug, Default)]
pub struct Encounters {
    current: Option<Encounter>,
    /// Set if the robot stood at the last truth of the current encounter.
    stands: bool,
    past: Vec<Encounter>,
}

impl Encounters {
    /// Takes in the next ground truth.
    pub fn truth(&mut self, truth: &Truth) {
        let (now_s, person_m) = (Time(truth.stamp_ns).as_secs_f64(), truth.person_m);
        if self.current.is_none() && person_m < BEGIN_M {
            self.stands = false;
            self.current = Some(Encounter {
                begin_s: now_s,
                end_s: now_s,
                x: truth.x,
                y: truth.y,
                nearest_m: f64::INFINITY,
                nearest_moving_m: None,
                stood_at_m: Vec::new(),
            });
        }
        let Some(mut current) = self.current.take() else { return };
        current.end_s = now_s;
        if person_m > END_M {
            self.past.push(current);
            return;
        }
        if person_m < current.nearest_m {
            (current.x, current.y, current.nearest_m) = (truth.x, truth.y, person_m);
        }
        let stood = std::mem::replace(&mut self.stands, is_standing(truth));
        if self.stands {
            current.stood_at_m.extend((!stood).then_some(person_m));
        } else {
            let nearest = current.nearest_moving_m.unwrap_or(f64::INFINITY).min(person_m);
            current.nearest_moving_m = Some(nearest);
        }
        self.current = Some(current);
    }

    /// Encounters so far, including one that has not ended.
    pub fn list(&self) -> Vec<Encounter> {
        self.past.iter().chain(&self.current).cloned().collect()
    }
}

/// Returns true if the robot stands.
pub(super) fn is_standing(truth: &Truth) -> bool {
    truth.vx.hypotenuse(truth.vy) < STANDING_MPS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_person_comes_near_and_leaves() {
        let mut encounters = Encounters::default();
        let samples = [
            (0.0, 3.0, 0.4),
            (1.0, 0.9, 0.4),
            (2.0, 0.5, 0.2),
            (3.0, 0.4, 0.0),
            (4.0, 0.3, 0.0),
            (4.5, 0.45, 0.2),
            (5.0, 1.1, 0.0),
            (6.0, 1.3, 0.3),
            (7.0, 0.8, 0.4),
        ];
        for (seconds, person_m, vx) in samples {
            let stamp_ns = Time::from_secs_f64(seconds).0;
            encounters.truth(&Truth { stamp_ns, person_m, vx, x: seconds, ..Truth::default() });
        }
        let list = encounters.list();
        let first = Encounter {
            begin_s: 1.0,
            end_s: 6.0,
            x: 4.0,
            y: 0.0,
            nearest_m: 0.3,
            nearest_moving_m: Some(0.45),
            stood_at_m: vec![0.4, 1.1],
        };
        assert_eq!(list[0], first);
        assert_eq!((list.len(), list[1].stood_at_m.as_slice(), list[1].begin_s), (2, &[][..], 7.0));
    }

    #[test]
    fn without_people_there_is_no_encounter() {
        let mut encounters = Encounters::default();
        for person_m in [f64::INFINITY, f64::NAN] {
            encounters.truth(&Truth { person_m, ..Truth::default() });
        }
        assert!(encounters.list().is_empty());
    }
}
