//! Behavior in control, and halts.

use std::collections::BTreeMap;

use serde::Serialize;
use yamabico_core::message::{Axis, DecisionHeader, Kind, Mode, Outcome, Reason, Verdict};
use yamabico_core::time::Time;

/// A time during which the arbiter kept the robot from moving forward, after the first readings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Halt {
    /// Begin, s of the run.
    pub begin_s: f64,
    /// Duration, s; until the end of the run if it was not released.
    pub duration_s: f64,
    /// Behavior that halted the robot, or the mode and the silent part.
    pub by: String,
}

/// Follows the decisions of a run: control times and halts.
#[derive(Clone, Debug, Default)]
pub struct ControlLog {
    /// Set once the first readings have arrived.
    ready: bool,
    current: Option<(Time, Owner)>,
    halted_since: Option<(Time, String)>,
    time: ControlTime,
    halts: Vec<Halt>,
}

/// Times of a run by the behavior in control, which add up to its duration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ControlTime {
    /// Time for which each behavior, or a stop that no behavior asked for, was in control, s.
    pub by_owner_s: BTreeMap<String, f64>,
    /// Time in which no behavior was in control, s.
    pub idle_s: f64,
    /// Time at the start in which critical behaviors and sensors waited for their first readings, s.
    pub waiting_s: f64,
}

/// Holder of the control over the robot.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Owner {
    /// Behavior, or a stop that no behavior asked for.
    Named(String),
    /// No behavior.
    NoBehavior,
    /// No behavior, since critical behaviors and sensors wait for their first readings.
    FirstReadings,
}

impl ControlLog {
    /// Takes in the next decision.
    pub fn decision(&mut self, header: &DecisionHeader, verdicts: &[Verdict]) {
        let now = Time(header.stamp_ns);
        self.ready |= !lacks_first_readings(header, verdicts);
        let halter = if self.ready { halter(header, verdicts) } else { None };
        let owner = match halter.clone().or_else(|| driver(verdicts)) {
            _ if !self.ready => Owner::FirstReadings,
            Some(name) => Owner::Named(name),
            None => Owner::NoBehavior,
        };
        match &mut self.current {
            Some((since, current)) => {
                let elapsed = now.since(*since).as_secs_f64();
                match current {
                    Owner::Named(name) => match self.time.by_owner_s.get_mut(name.as_str()) {
                        Some(time) => *time += elapsed,
                        None => drop(self.time.by_owner_s.insert(name.clone(), elapsed)),
                    },
                    Owner::NoBehavior => self.time.idle_s += elapsed,
                    Owner::FirstReadings => self.time.waiting_s += elapsed,
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

    /// Behavior in control, or the stop that no behavior asked for; `None` if there is neither.
    pub fn owner(&self) -> Option<&str> {
        match &self.current {
            Some((_, Owner::Named(name))) => Some(name),
            _ => None,
        }
    }

    /// Returns true if the robot is halted.
    pub fn is_halted(&self) -> bool {
        self.halted_since.is_some()
    }

    /// Halts so far; a halt in progress ends at the last decision.
    pub fn halts(&self) -> Vec<Halt> {
        let mut log = self.clone();
        if let Some((last, _)) = &self.current {
            log.release(*last);
        }
        log.halts
    }

    /// Times by the behavior in control.
    pub fn time(&self) -> &ControlTime {
        &self.time
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

/// Finds what keeps the robot from moving forward.
fn halter(header: &DecisionHeader, verdicts: &[Verdict]) -> Option<String> {
    match header.mode() {
        // The note names the silent part: "sonar-halt is silent".
        Some(Mode::CriticalSilent) if !header.note.is_empty() => Some(header.note.as_str().to_owned()),
        Some(mode @ (Mode::CriticalSilent | Mode::EmergencyStop)) => Some(mode.as_str().to_owned()),
        Some(Mode::Halted) if header.halted.contains(Axis::Linear) => {
            let author = halting(verdicts);
            Some(author.map_or(Mode::Halted.as_str(), |verdict| verdict.behavior.as_str()).to_owned())
        }
        _ => None,
    }
}

/// Verdict on the behavior that halts forward motion, including a held halt.
fn halting(verdicts: &[Verdict]) -> Option<&Verdict> {
    verdicts.iter().find(|verdict| {
        let halts = match verdict.outcome() {
            Some(Outcome::Halting) => true,
            Some(Outcome::Held) => verdict.kind == Kind::Halt.code(),
            _ => false,
        };
        halts && verdict.claimed.without(verdict.won).contains(Axis::Linear)
    })
}

/// Returns true if, at the start of a run, the robot stands because a part waits for its first reading, or waited a moment ago.
fn lacks_first_readings(header: &DecisionHeader, verdicts: &[Verdict]) -> bool {
    let waits = |verdict: &Verdict| {
        verdict.outcome() == Some(Outcome::Held) || verdict.reason == Reason::NoInput.code()
    };
    match header.mode() {
        Some(Mode::CriticalSilent) => true,
        Some(Mode::Halted) => halting(verdicts).is_some_and(waits),
        _ => false,
    }
}

/// Behaviors that drive, joined by `+`; `None` if none does.
fn driver(verdicts: &[Verdict]) -> Option<String> {
    let mut owner = String::new();
    for verdict in verdicts {
        if matches!(verdict.outcome(), Some(Outcome::Won | Outcome::WonPart | Outcome::Blended)) {
            if !owner.is_empty() {
                owner.push('+');
            }
            owner.push_str(verdict.behavior.as_str());
        }
    }
    (!owner.is_empty()).then_some(owner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{Axes, Name};

    fn verdict(behavior: &str, outcome: Outcome, kind: Kind) -> Verdict {
        let behavior = Name::new(behavior);
        let (outcome, kind) = (outcome.code(), kind.code());
        Verdict { behavior, outcome, kind, claimed: Axes::PLANAR, ..Verdict::default() }
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
        let time = |owner: &str| log.time().by_owner_s[owner];
        assert_eq!((time("wall"), time("sonar"), log.time().idle_s), (2.5, 1.0, 0.25));
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
        log.decision(&decision(0.0, Mode::Idle, Axes::NONE), &[]);
        log.decision(&decision(1.0, Mode::Halted, Axes::PLANAR), &[turn, limit, sonar]);
        assert_eq!(log.owner(), Some("sonar"));
    }

    #[test]
    fn waiting_for_the_first_readings_is_no_halt_but_losing_them_is() {
        let mut log = ControlLog::default();
        let blind =
            Verdict { reason: Reason::NoInput.code(), ..verdict("sonar", Outcome::Halting, Kind::Halt) };
        let held = verdict("sonar", Outcome::Held, Kind::Halt);
        log.decision(&decision(0.0, Mode::CriticalSilent, Axes::ALL), &[blind]);
        log.decision(&decision(0.25, Mode::Halted, Axes::ALL), &[blind]);
        log.decision(&decision(0.5, Mode::Halted, Axes::ALL), &[held]);
        assert!(!log.is_halted());
        log.decision(&decision(0.75, Mode::Idle, Axes::NONE), &[]);
        log.decision(&decision(1.0, Mode::CriticalSilent, Axes::NONE), &[]);
        log.decision(&decision(3.0, Mode::Halted, Axes::ALL), &[held]);
        log.decision(&decision(4.0, Mode::Idle, Axes::NONE), &[]);
        let halts = log.halts();
        assert_eq!((halts.len(), halts[0].begin_s, halts[0].duration_s), (1, 1.0, 3.0));
        let ControlTime { by_owner_s, idle_s, waiting_s } = log.time();
        assert_eq!((*waiting_s, by_owner_s["sonar"]), (0.75, 1.0));
        assert_eq!(by_owner_s.values().sum::<f64>() + idle_s + waiting_s, 4.0);
    }

    #[test]
    fn a_halt_for_a_silent_part_names_the_part() {
        let mut log = ControlLog::default();
        log.decision(&decision(0.0, Mode::Idle, Axes::NONE), &[]);
        let note = yamabico_core::message::Note::new("sonar-halt is silent");
        log.decision(&DecisionHeader { note, ..decision(1.0, Mode::CriticalSilent, Axes::ALL) }, &[]);
        assert_eq!(log.halts()[0].by, "sonar-halt is silent");
    }

    #[test]
    fn an_echo_at_the_start_is_a_halt() {
        let mut log = ControlLog::default();
        let echo = Verdict { reason: Reason::Echo.code(), ..verdict("sonar", Outcome::Halting, Kind::Halt) };
        log.decision(&decision(0.0, Mode::Halted, Axes::ALL), &[echo]);
        assert!(log.is_halted());
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
