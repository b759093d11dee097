//! Who is in control, and when the robot is halted.

use std::collections::BTreeMap;

use serde::Serialize;
use yamabico_core::message::{Axis, DecisionHeader, Kind, Mode, Outcome, Verdict};
use yamabico_core::time::Time;

/// In control while no behaviour is.
const NOBODY: &str = "nobody";
/// In control until every critical part has been heard for the first time.
const FIRST_READINGS: &str = "wait for first readings";

/// A time during which the arbiter kept the robot from moving forward, once every critical part had been heard.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Halt {
    /// When it began, seconds of the run.
    pub begin_s: f64,
    /// How long it lasted, seconds; up to the run's end where it was never released.
    pub duration_s: f64,
    /// Who halted; the mode in words where no behaviour did.
    pub by: String,
}

/// Follows the decisions of a run.
#[derive(Clone, Debug, Default)]
pub struct ControlLog {
    /// Whether every critical part has been heard.
    ready: bool,
    current: Option<(Time, String)>,
    halted_since: Option<(Time, String)>,
    time_s: BTreeMap<String, f64>,
    halts: Vec<Halt>,
}

impl ControlLog {
    /// The next decision.
    pub fn decision(&mut self, header: &DecisionHeader, verdicts: &[Verdict]) {
        let now = Time(header.stamp_ns);
        self.ready |= header.mode() != Some(Mode::CriticalSilent);
        let halter = if self.ready { halter(header, verdicts) } else { None };
        let owner = match &halter {
            Some(halter) => halter.clone(),
            None if self.ready => driver(verdicts),
            None => FIRST_READINGS.to_owned(),
        };
        match &mut self.current {
            Some((since, current)) => {
                let elapsed = now.since(*since).as_secs_f64();
                match self.time_s.get_mut(current.as_str()) {
                    Some(time) => *time += elapsed,
                    None => drop(self.time_s.insert(current.clone(), elapsed)),
                }
                *since = now;
                if *current != owner {
                    *current = owner;
                }
            }
            None => self.current = Some((now, owner)),
        }
        match (&self.halted_since, halter) {
            (None, Some(by)) => self.halted_since = Some((now, by)),
            (Some(_), None) => self.release(now),
            _ => {}
        }
    }

    /// Who is in control now; `None` before the first decision.
    pub fn owner(&self) -> Option<&str> {
        self.current.as_ref().map(|(_, owner)| owner.as_str())
    }

    /// Whether the robot is halted now.
    pub fn is_halted(&self) -> bool {
        self.halted_since.is_some()
    }

    /// Halts so far; one that lasts ends at the last decision.
    pub fn halts(&self) -> Vec<Halt> {
        let mut log = self.clone();
        if let Some((last, _)) = self.current {
            log.release(last);
        }
        log.halts
    }

    /// Seconds that each behaviour was in control; what was in control while no behaviour was goes by its own name.
    pub fn time_s(&self) -> &BTreeMap<String, f64> {
        &self.time_s
    }

    fn release(&mut self, now: Time) {
        if let Some((since, by)) = self.halted_since.take() {
            self.halts.push(Halt {
                begin_s: since.as_secs_f64(),
                duration_s: now.since(since).as_secs_f64(),
                by,
            });
        }
    }
}

/// Who keeps the robot from moving forward.
fn halter(header: &DecisionHeader, verdicts: &[Verdict]) -> Option<String> {
    match header.mode() {
        Some(mode @ (Mode::CriticalSilent | Mode::EmergencyStop)) => Some(mode.as_str().to_owned()),
        Some(Mode::Halted) if header.halted.contains(Axis::Linear) => {
            let author = verdicts.iter().find(|verdict| halts_forward_motion(verdict));
            Some(author.map_or(Mode::Halted.as_str(), |verdict| verdict.behaviour.as_str()).to_owned())
        }
        _ => None,
    }
}

/// Whether the behaviour's own halt, even one that is only held, is on the forward axis.
fn halts_forward_motion(verdict: &Verdict) -> bool {
    let halts = match verdict.outcome() {
        Some(Outcome::Halting) => true,
        Some(Outcome::Held) => verdict.kind == Kind::Halt.code(),
        _ => false,
    };
    halts && verdict.claimed.without(verdict.won).contains(Axis::Linear)
}

/// Everybody who drives, joined by `+`.
fn driver(verdicts: &[Verdict]) -> String {
    let mut owner = String::new();
    for verdict in verdicts {
        if matches!(verdict.outcome(), Some(Outcome::Won | Outcome::WonPart | Outcome::Blended)) {
            if !owner.is_empty() {
                owner.push('+');
            }
            owner.push_str(verdict.behaviour.as_str());
        }
    }
    if owner.is_empty() { NOBODY.to_owned() } else { owner }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{Axes, Name};

    fn verdict(behaviour: &str, outcome: Outcome, kind: Kind) -> Verdict {
        let behaviour = Name::new(behaviour);
        let (outcome, kind) = (outcome.code(), kind.code());
        Verdict { behaviour, outcome, kind, claimed: Axes::PLANAR, ..Verdict::default() }
    }

    fn decision(seconds: f64, mode: Mode, halted: Axes) -> DecisionHeader {
        let stamp_ns = Time::from_secs_f64(seconds).0;
        DecisionHeader { stamp_ns, mode: mode.code(), halted, ..DecisionHeader::default() }
    }

    #[test]
    fn time_goes_to_the_owner_until_the_next_decision() {
        let mut log = ControlLog::default();
        let wall = verdict("wall", Outcome::Won, Kind::Drive);
        let stopped = verdict("wall", Outcome::Stopped, Kind::Drive);
        let sonar = verdict("sonar", Outcome::Halting, Kind::Halt);
        let held = verdict("sonar", Outcome::Held, Kind::Halt);
        log.decision(&decision(1.0, Mode::Driving, Axes::NONE), &[wall]);
        log.decision(&decision(3.0, Mode::Halted, Axes::ALL), &[sonar, stopped]);
        assert!(log.is_halted());
        log.decision(&decision(3.5, Mode::Halted, Axes::ALL), &[held, stopped]);
        log.decision(&decision(4.0, Mode::Driving, Axes::NONE), &[wall]);
        log.decision(&decision(4.5, Mode::Idle, Axes::NONE), &[]);
        log.decision(&decision(4.75, Mode::EmergencyStop, Axes::ALL), &[]);
        log.decision(&decision(5.0, Mode::EmergencyStop, Axes::ALL), &[]);
        let time = |owner: &str| log.time_s()[owner];
        assert_eq!((time("wall"), time("sonar"), time("nobody")), (2.5, 1.0, 0.25));
        let halts = log.halts();
        assert_eq!(halts[0], Halt { begin_s: 3.0, duration_s: 1.0, by: "sonar".into() });
        assert_eq!((halts.len(), halts[1].by.as_str(), halts[1].duration_s), (2, "emergency stop", 0.25));
    }

    #[test]
    fn a_halt_of_turning_alone_is_not_a_halt_of_the_robot() {
        let mut log = ControlLog::default();
        let wall = verdict("wall", Outcome::WonPart, Kind::Drive);
        log.decision(&decision(0.0, Mode::Halted, Axes::ANGULAR), &[wall]);
        assert_eq!((log.owner(), log.is_halted()), (Some("wall"), false));
    }

    #[test]
    fn a_halt_goes_to_the_author_that_halts_driving_forward() {
        let mut log = ControlLog::default();
        let turn = Verdict { claimed: Axes::ANGULAR, ..verdict("turn", Outcome::Halting, Kind::Halt) };
        let limit = verdict("limit", Outcome::Held, Kind::Limit);
        let sonar = verdict("sonar", Outcome::Held, Kind::Halt);
        log.decision(&decision(0.0, Mode::Halted, Axes::PLANAR), &[turn, limit, sonar]);
        assert_eq!(log.owner(), Some("sonar"));
    }

    #[test]
    fn waiting_for_the_first_readings_is_no_halt_but_losing_them_is() {
        let mut log = ControlLog::default();
        for (seconds, mode) in [
            (0.0, Mode::CriticalSilent),
            (0.25, Mode::Idle),
            (1.0, Mode::CriticalSilent),
            (3.0, Mode::Idle),
        ] {
            log.decision(&decision(seconds, mode, Axes::NONE), &[]);
        }
        let halts = log.halts();
        assert_eq!((halts.len(), halts[0].begin_s, halts[0].duration_s), (1, 1.0, 2.0));
        assert_eq!(log.time_s()[FIRST_READINGS], 0.25);
        assert_eq!(log.time_s().values().sum::<f64>(), 3.0);
    }

    #[test]
    fn several_drivers_are_joined() {
        let mut log = ControlLog::default();
        let parts =
            [verdict("a", Outcome::Blended, Kind::Drive), verdict("b", Outcome::Blended, Kind::Drive)];
        log.decision(&decision(0.0, Mode::Driving, Axes::NONE), &parts);
        assert_eq!(log.owner(), Some("a+b"));
    }
}
