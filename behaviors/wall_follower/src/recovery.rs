//! Recovery while no vanishing point is found: coast, creep on, stop, look to both sides, give up.

use yamabico_core::geometry::angle_difference;

use crate::config::Lost;
use crate::steering::CREEP_MPS;

/// Tolerance of the heading at which a search direction is reached, rad.
const ARRIVED_RAD: f64 = 0.03;

/// Recovery action.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Recovery {
    /// Drive on at half speed by the last estimate.
    Coast,
    /// Drive on slowly in the direction of the corridor, heading in the odometry frame, radians.
    CreepAlong(f64),
    /// Turn in place to this heading in the odometry frame, radians.
    TurnTo(f64),
    /// Stop: the search is complete, or impossible without odometry.
    GiveUp,
}

/// State machine of the recovery. Reset by the first frame with a vanishing point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Recoverer {
    search: Option<Search>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Search {
    start_heading: f64,
    step: u32,
    has_arrived: bool,
}

/// Description of the loss at one call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loss {
    /// Time since the last frame with a vanishing point, s; infinite if there was none.
    pub for_s: f64,
    /// True if enough frames showed the corridor to coast along: a single look does not establish one.
    pub is_established: bool,
    /// Distance driven since then, m.
    pub for_m: f64,
    /// Heading in the odometry frame, rad; `None` without odometry.
    pub heading: Option<f64>,
    /// Heading along the corridor that was followed last, odometry frame, rad; `None` if it is unknown.
    pub along: Option<f64>,
    /// True if that heading is settled, and no wall across the way is in view.
    pub leads_on: bool,
    /// True if a frame without a vanishing point arrived since the last call.
    pub has_new_frame: bool,
}

impl Recoverer {
    /// Ends the recovery: a vanishing point was found.
    pub fn found(&mut self) {
        self.search = None;
    }

    /// Returns the next action.
    pub fn step(&mut self, loss: &Loss, rules: &Lost) -> Recovery {
        let may_coast = loss.is_established && loss.for_s <= rules.coast_s && loss.for_m <= rules.coast_m;
        if self.search.is_none() && may_coast {
            return Recovery::Coast;
        }
        let Some(heading) = loss.heading else { return Recovery::GiveUp };
        let may_creep = self.search.is_none()
            && loss.leads_on
            && loss.for_m < rules.creep_m
            && loss.for_s < rules.coast_s + rules.creep_m / CREEP_MPS;
        if let Some(along) = loss.along.filter(|_| may_creep) {
            return Recovery::CreepAlong(along);
        }
        let start_heading = loss.along.unwrap_or(heading);
        let search = self.search.get_or_insert(Search { start_heading, step: 0, has_arrived: false });
        let Some(offset) = search_offset(search.step, rules) else { return Recovery::GiveUp };
        let target = search.start_heading + offset;
        if search.has_arrived && loss.has_new_frame {
            *search = Search { step: search.step + 1, has_arrived: false, ..*search };
        } else if angle_difference(target, heading).abs() < ARRIVED_RAD {
            search.has_arrived = true;
        }
        search_offset(search.step, rules)
            .map_or(Recovery::GiveUp, |offset| Recovery::TurnTo(search.start_heading + offset))
    }
}

/// Returns a direction of the search relative to its start (rad): straight ahead, steps to the left, then to the right,
/// then back; `None` after the last.
fn search_offset(step: u32, rules: &Lost) -> Option<f64> {
    let looks = (rules.search_deg / rules.step_deg).floor() as u32;
    let steps = match step {
        _ if looks == 0 || step > 2 * looks + 1 => return None,
        _ if step == 2 * looks + 1 => 0.0,
        _ if step <= looks => f64::from(step),
        _ => -f64::from(step - looks),
    };
    Some(steps * rules.step_deg.to_radians())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loss(for_s: f64, for_m: f64, heading: Option<f64>) -> Loss {
        Loss { for_s, for_m, is_established: true, heading, along: None, leads_on: true, has_new_frame: true }
    }

    #[test]
    fn coasts_for_a_second_or_half_a_meter() {
        let rules = Lost::default();
        assert_eq!(Recoverer::default().step(&loss(0.9, 0.4, Some(0.0)), &rules), Recovery::Coast);
        assert_ne!(Recoverer::default().step(&loss(1.1, 0.4, Some(0.0)), &rules), Recovery::Coast);
        assert_ne!(Recoverer::default().step(&loss(0.9, 0.6, Some(0.0)), &rules), Recovery::Coast);
        assert_eq!(Recoverer::default().step(&loss(f64::INFINITY, 0.0, None), &rules), Recovery::GiveUp);
    }

    #[test]
    fn looks_to_both_sides_in_steps_and_gives_up() {
        let rules = Lost::default();
        let mut recoverer = Recoverer::default();
        let (mut heading, mut seen) = (0.5, Vec::new());
        for _ in 0..100 {
            match recoverer.step(&loss(2.0, 0.0, Some(heading)), &rules) {
                Recovery::TurnTo(target) => {
                    let degrees = (target - 0.5).to_degrees().round();
                    if seen.last() != Some(&degrees) {
                        seen.push(degrees);
                    }
                    heading = target;
                }
                other => assert_eq!(other, Recovery::GiveUp),
            }
        }
        assert_eq!(seen, [0.0, 10.0, 20.0, 30.0, -10.0, -20.0, -30.0, 0.0]);
        assert_eq!(recoverer.step(&loss(2.0, 0.0, Some(heading)), &rules), Recovery::GiveUp);
        recoverer.found();
        assert_eq!(recoverer.step(&loss(0.1, 0.0, Some(heading)), &rules), Recovery::Coast);
    }

    #[test]
    fn waits_for_a_frame_captured_after_the_turn() {
        let rules = Lost::default();
        let mut recoverer = Recoverer::default();
        let blind = Loss { has_new_frame: false, ..loss(2.0, 0.0, Some(0.0)) };
        let Recovery::TurnTo(first) = recoverer.step(&blind, &rules) else { panic!("no search") };
        for _ in 0..5 {
            let there = Loss { heading: Some(first), ..blind };
            assert_eq!(recoverer.step(&there, &rules), Recovery::TurnTo(first));
        }
        let looked = Loss { heading: Some(first), has_new_frame: true, ..blind };
        assert_ne!(recoverer.step(&looked, &rules), Recovery::TurnTo(first));
    }

    #[test]
    fn creeps_on_for_a_while_before_it_searches() {
        let rules = Lost { creep_m: 2.0, ..Lost::default() };
        let step = |for_s: f64, for_m: f64, along: Option<f64>| {
            Recoverer::default().step(&Loss { along, ..loss(for_s, for_m, Some(0.4)) }, &rules)
        };
        assert_eq!(step(0.9, 0.4, Some(0.1)), Recovery::Coast);
        assert_eq!(step(5.0, 1.0, Some(0.1)), Recovery::CreepAlong(0.1));
        assert_eq!(step(5.0, 2.1, Some(0.1)), Recovery::TurnTo(0.1), "too far");
        assert_eq!(step(22.0, 1.0, Some(0.1)), Recovery::TurnTo(0.1), "too long");
        assert_eq!(step(5.0, 1.0, None), Recovery::TurnTo(0.4), "no direction is known");
        let before_wall = Loss { leads_on: false, along: Some(0.1), ..loss(5.0, 1.0, Some(0.4)) };
        assert_eq!(Recoverer::default().step(&before_wall, &rules), Recovery::TurnTo(0.1));
        let glimpse = Loss { is_established: false, along: Some(0.1), ..loss(0.2, 0.0, Some(0.4)) };
        assert_eq!(Recoverer::default().step(&glimpse, &rules), Recovery::CreepAlong(0.1));
    }

    #[test]
    fn the_search_starts_along_the_corridor() {
        let loss = Loss { along: Some(-1.2), ..loss(2.0, 0.0, Some(0.4)) };
        assert_eq!(Recoverer::default().step(&loss, &Lost::default()), Recovery::TurnTo(-1.2));
    }
}
