//! Meetings with people, as the judge sees them.

use serde::Serialize;
use yamabico_core::message::Truth;
use yamabico_core::time::Time;

use super::STANDING_MPS;

/// Nearer than this a person is met, meters from the footprint.
const MEETING_M: f64 = 1.0;
/// Farther than this the meeting is over, meters.
const PARTING_M: f64 = 1.2;

/// One meeting with people.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Encounter {
    /// When somebody came near, seconds of the run.
    pub begin_s: f64,
    /// When nobody was near any more; the run's end where it did not come to that.
    pub end_s: f64,
    /// Where the robot was when the person was nearest, map frame, meters.
    pub x: f64,
    /// Where the robot was when the person was nearest, map frame, meters.
    pub y: f64,
    /// Smallest distance from the footprint, meters.
    pub nearest_m: f64,
    /// Smallest distance while the robot moved by itself, meters; `None` where it stood all the time.
    pub nearest_moving_m: Option<f64>,
    /// Distance at each moment when it came to stand, meters; empty where it never stood.
    pub stood_at_m: Vec<f64>,
}

/// Follows the truth of a run.
#[derive(Clone, Debug, Default)]
pub struct Encounters {
    current: Option<Encounter>,
    /// Whether the robot stood at the last truth of the current meeting.
    stands: bool,
    past: Vec<Encounter>,
}

impl Encounters {
    /// The next truth.
    pub fn truth(&mut self, truth: &Truth) {
        let (now_s, person_m) = (Time(truth.stamp_ns).as_secs_f64(), truth.person_m);
        if self.current.is_none() && person_m < MEETING_M {
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
        if person_m > PARTING_M {
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

    /// Meetings so far, with the one that lasts.
    pub fn list(&self) -> Vec<Encounter> {
        self.past.iter().chain(&self.current).cloned().collect()
    }
}

/// Whether the robot stands.
pub(super) fn is_standing(truth: &Truth) -> bool {
    truth.vx.hypot(truth.vy) < STANDING_MPS
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
    fn nobody_is_met_without_people() {
        let mut encounters = Encounters::default();
        for person_m in [f64::INFINITY, f64::NAN] {
            encounters.truth(&Truth { person_m, ..Truth::default() });
        }
        assert!(encounters.list().is_empty());
    }
}
