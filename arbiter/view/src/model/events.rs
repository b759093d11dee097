//! Log of a run: hand-overs, halts, contacts, lateness, failures and requests of operators.

use std::collections::{BTreeMap, VecDeque};

use serde::{Deserialize, Serialize};
use yamabico_arbiter::decide::{DecisionMessage, ExplainContext, explain};
use yamabico_core::message::{
    Axes, Axis, Command, Control, ControlKind, DecisionHeader, FailureHeader, Message, MessageType, Mode,
    Name, Outcome, Process, ProcessesHeader, Proposal, Reason, Truth, Verdict,
};
use yamabico_core::time::Time;
use yamabico_runtime::record::Tap;

use super::read::{header, items};

/// Maximum number of events that are kept; the oldest drop out.
pub const MAX_EVENTS: usize = 2000;
/// Minimum time between two decisions that counts as a gap, s.
const MIN_GAP_S: f64 = 0.1;
/// Number of usual intervals between two decisions above which they have a gap.
const GAP_INTERVALS: f64 = 4.0;
/// Time without a late command after which the next one is a new event, s.
const LATE_PAUSE_S: f64 = 1.0;

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EventKind {
    /// An axis went from one behavior to another.
    HandOver,
    /// A halt or a stop of the whole robot began.
    Halt,
    /// It ended.
    Release,
    /// The robot touched something.
    Contact,
    /// Something was too late: a proposal, a command or a decision.
    Late,
    /// A process ended or started again, or a plugin failed.
    Failure,
    /// An operator's request.
    Operator,
}

/// An event of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Event {
    /// Time.
    #[serde(skip)]
    pub at: Time,
    /// Kind.
    pub kind: EventKind,
    /// Behavior or plugin that caused it; empty for the whole robot.
    pub who: String,
    /// Sentence, such as `avoider took linear+angular from localizer: obstacle at 1.6 m`.
    pub text: String,
}

/// Finds the events of a run in its messages.
#[derive(Clone, Debug, Default)]
pub struct EventLog {
    events: VecDeque<Event>,
    dropped: u64,
    proposals: BTreeMap<String, Proposal>,
    owners: Option<[Owner; 3]>,
    stopped: Option<(Mode, Time)>,
    halted_since: BTreeMap<String, Time>,
    faults: BTreeMap<String, Outcome>,
    last_decision: Option<Time>,
    interval_s: f64,
    budgets: BTreeMap<String, f64>,
    late_until: BTreeMap<String, Time>,
    contacts: Option<u32>,
    processes: BTreeMap<String, Process>,
}

/// Holder of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Owner {
    name: Name,
    halts: bool,
}

impl EventLog {
    /// Events that are kept, the oldest first.
    pub fn events(&self) -> impl DoubleEndedIterator<Item = &Event> {
        self.events.iter()
    }

    /// Number of events so far, including those that dropped out.
    pub fn count(&self) -> u64 {
        self.dropped + self.events.len() as u64
    }

    /// Sets the age of data above which a command of `behavior` is late, s.
    pub fn set_latency_budget(&mut self, behavior: &str, budget_s: f64) {
        self.budgets.insert(behavior.to_owned(), budget_s);
    }

    fn add(&mut self, at: Time, kind: EventKind, who: &str, text: String) {
        if self.events.len() == MAX_EVENTS {
            self.events.pop_front();
            self.dropped += 1;
        }
        self.events.push_back(Event { at, kind, who: who.to_owned(), text });
    }

    fn decision(&mut self, at: Time, decision: &DecisionMessage) {
        self.gap(at);
        self.lateness(at, &decision.verdicts);
        let mode = decision.header.mode();
        match (mode, self.stopped) {
            (Some(mode @ (Mode::EmergencyStop | Mode::CriticalSilent)), before) => {
                if before.is_none_or(|(known, _)| known != mode) {
                    let what = explain(decision, &ExplainContext::default()).what;
                    self.add(at, EventKind::Halt, "", what);
                    self.stopped = Some((mode, at));
                }
                return;
            }
            (_, Some((mode, since))) => {
                let text = format!("{mode} ended after {:.1} s", at.seconds_after(since));
                self.add(at, EventKind::Release, "", text);
                self.stopped = None;
            }
            _ => {}
        }
        let now = owners(&decision.header);
        let before = self.owners.replace(now).unwrap_or_default();
        let mut changes: Vec<(Owner, Owner, Axes)> = Vec::new();
        for axis in decision.header.axes.iter() {
            let (from, to) = (before[axis as usize], now[axis as usize]);
            if from == to {
                continue;
            }
            match changes.iter_mut().find(|(a, b, _)| (*a, *b) == (from, to)) {
                Some((.., axes)) => *axes = axes.union(axis.into()),
                None => changes.push((from, to, axis.into())),
            }
        }
        for (from, to, axes) in changes {
            self.hand_over(at, from, to, axes);
        }
    }

    fn hand_over(&mut self, at: Time, from: Owner, to: Owner, axes: Axes) {
        let [from_name, to_name] = [from.name, to.name].map(|name| name.as_str().to_owned());
        let because = |log: &EventLog, name: &str| match log.because(name) {
            because if because.is_empty() => String::new(),
            because => format!(": {because}"),
        };
        if to.halts {
            let text = format!("{to_name} halts {axes}{}", because(self, &to_name));
            self.halted_since.entry(to_name.clone()).or_insert(at);
            return self.add(at, EventKind::Halt, &to_name, text);
        }
        if from.halts {
            let since = self.halted_since.remove(&from_name);
            let after =
                since.map_or(String::new(), |since| format!(" after {:.1} s", at.seconds_after(since)));
            let next = match to_name.as_str() {
                "" => "no behavior drives".to_owned(),
                name => format!("{name} drives"),
            };
            let text = format!("{from_name} released {axes}{after}; {next}");
            return self.add(at, EventKind::Release, &from_name, text);
        }
        let text = match (from_name.as_str(), to_name.as_str()) {
            ("", to) => format!("{to} took {axes}{}", because(self, to)),
            (from, "") => format!("{from} gave up {axes}{}; no behavior drives", because(self, from)),
            (from, to) => format!("{to} took {axes} from {from}{}", because(self, to)),
        };
        let who = if to_name.is_empty() { &from_name } else { &to_name };
        self.add(at, EventKind::HandOver, who, text);
    }

    /// Note of the behavior's newest proposal, or else its reason.
    fn because(&self, behavior: &str) -> String {
        let Some(proposal) = self.proposals.get(behavior) else { return String::new() };
        match (proposal.note.as_str(), proposal.reason()) {
            ("", None | Some(Reason::None | Reason::Nominal)) => String::new(),
            ("", Some(reason)) => reason.as_str().to_owned(),
            (note, _) => note.to_owned(),
        }
    }

    /// Notes a pause between two decisions that is much longer than usual.
    fn gap(&mut self, at: Time) {
        if let Some(last) = self.last_decision.replace(at) {
            let interval_s = at.seconds_after(last);
            let usual_s = if self.interval_s > 0.0 { self.interval_s } else { interval_s };
            if interval_s > (GAP_INTERVALS * usual_s).max(MIN_GAP_S) {
                self.add(at, EventKind::Late, "", format!("no decision for {:.0} ms", interval_s * 1e3));
            }
            self.interval_s = 0.98 * usual_s + 0.02 * interval_s.max(0.0);
        }
    }

    /// Notes proposals that became too old.
    fn lateness(&mut self, at: Time, verdicts: &[Verdict]) {
        for verdict in verdicts {
            let name = verdict.behavior.as_str();
            let fault = match verdict.outcome().filter(|outcome| is_late(*outcome)) {
                None => Outcome::from_code(verdict.fault).filter(|outcome| is_late(*outcome)),
                outcome => outcome,
            };
            let before = self.faults.get(name).copied();
            if fault == before {
                continue;
            }
            match fault {
                Some(fault) => {
                    self.faults.insert(name.to_owned(), fault);
                    let age_s = if verdict.number > 0.0 {
                        format!(": {:.2} s old", verdict.number)
                    } else {
                        String::new()
                    };
                    self.add(at, EventKind::Late, name, format!("{name} is {fault}{age_s}"));
                }
                None => drop(self.faults.remove(name)),
            }
        }
    }

    /// Notes a command that rests on data older than its author's budget.
    fn command(&mut self, at: Time, command: &Command) {
        let Some(source) = command.source.iter().find(|source| !source.is_empty()) else { return };
        let source = source.as_str();
        let age_s = Time(command.sent_ns).seconds_after(Time(command.evidence_ns));
        if self.budgets.get(source).is_none_or(|budget_s| age_s <= *budget_s) {
            return;
        }
        let until =
            self.late_until.insert(source.to_owned(), at + std::time::Duration::from_secs_f64(LATE_PAUSE_S));
        if until.is_none_or(|until| at > until) {
            let text = format!("{source}: command on data {:.0} ms old", age_s * 1e3);
            self.add(at, EventKind::Late, source, text);
        }
    }

    fn truth(&mut self, at: Time, truth: &Truth) {
        let before = self.contacts.replace(truth.contacts).unwrap_or(0);
        if truth.contacts > before {
            let text = format!("contact at ({:.2}, {:.2})", truth.x, truth.y);
            self.add(at, EventKind::Contact, "", text);
        }
    }

    fn processes(&mut self, at: Time, processes: impl Iterator<Item = Process>) {
        for process in processes {
            let name = process.plugin.as_str().to_owned();
            let before = self.processes.insert(name.clone(), process);
            let Some(before) = before else { continue };
            if process.ended_ns != before.ended_ns && !process.ended.is_empty() {
                self.add(at, EventKind::Failure, &name, format!("{name}: its process {}", process.ended));
            }
            if process.restarts > before.restarts {
                let text = format!("{name}: restarted, {} in all", process.restarts);
                self.add(at, EventKind::Failure, &name, text);
            }
        }
    }

    fn control(&mut self, at: Time, control: &Control, text: &str) {
        let kind = control.kind();
        let what = kind.map_or("unknown request", ControlKind::as_str);
        let text = match kind {
            Some(ControlKind::Goal) => format!("goal ({:.2}, {:.2})", control.goal[0], control.goal[1]),
            Some(ControlKind::Retune) => {
                let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
                format!("parameters: {}", text.chars().take(120).collect::<String>())
            }
            _ => format!("{what} {}", control.target).trim_end().to_owned(),
        };
        let text = format!("operator: {text}");
        // A request without effect is repeated every 100 ms.
        let is_repeated = |event: &Event| {
            event.kind == EventKind::Operator && event.text == text && at.seconds_after(event.at) < 2.0
        };
        if !self.events.iter().rev().take(8).any(is_repeated) {
            self.add(at, EventKind::Operator, control.target.as_str(), text);
        }
    }
}

impl Tap for EventLog {
    fn message(&mut self, _: &str, message: &MessageType, time: Time, bytes: &[u8], list: &[u8]) {
        match message.name {
            Proposal::NAME => {
                let Some(proposal) = header::<Proposal>(bytes) else { return };
                match self.proposals.get_mut(proposal.behavior.as_str()) {
                    Some(known) => *known = proposal,
                    None => drop(self.proposals.insert(proposal.behavior.as_str().to_owned(), proposal)),
                }
            }
            DecisionHeader::NAME => {
                let Some(header) = header(bytes) else { return };
                self.decision(time, &DecisionMessage { header, verdicts: items(list).collect() });
            }
            Command::NAME => {
                let Some(command) = header(bytes) else { return };
                self.command(time, &command);
            }
            Truth::NAME => {
                let Some(truth) = header(bytes) else { return };
                self.truth(time, &truth);
            }
            ProcessesHeader::NAME => self.processes(time, items(list)),
            FailureHeader::NAME => {
                let Some(failure) = header::<FailureHeader>(bytes) else { return };
                let name = failure.plugin.as_str();
                let text = String::from_utf8_lossy(list);
                let text = format!("{name} failed: {}", text.chars().take(200).collect::<String>());
                self.add(time, EventKind::Failure, name, text);
            }
            Control::NAME => {
                let Some(control) = header(bytes) else { return };
                self.control(time, &control, &String::from_utf8_lossy(list));
            }
            _ => {}
        }
    }
}

/// Returns true if the event log needs messages of this type.
pub(crate) fn makes_events(message: &MessageType) -> bool {
    matches!(
        message.name,
        Proposal::NAME
            | DecisionHeader::NAME
            | Command::NAME
            | Truth::NAME
            | ProcessesHeader::NAME
            | FailureHeader::NAME
            | Control::NAME
    )
}

fn is_late(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Stale | Outcome::StaleEvidence)
}

fn owners(header: &DecisionHeader) -> [Owner; 3] {
    let owner = |axis: Axis| match header.halter[axis as usize] {
        halter if header.halted.contains(axis) && !halter.is_empty() => Owner { name: halter, halts: true },
        _ => Owner { name: header.source[axis as usize], halts: false },
    };
    [Axis::Linear, Axis::Lateral, Axis::Angular].map(owner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::Note;

    fn decide(log: &mut EventLog, seconds: f64, source: &str, halter: &str) {
        let names = |name: &str| [Name::new(name), Name::default(), Name::new(name)];
        let halted = if halter.is_empty() { Axes::NONE } else { Axes::PLANAR };
        let mode = match (halter, source) {
            ("", "") => Mode::Idle,
            ("", _) => Mode::Driving,
            _ => Mode::Halted,
        };
        let header = DecisionHeader {
            axes: Axes::PLANAR,
            source: names(source),
            halter: names(halter),
            halted,
            mode: mode.code(),
            ..DecisionHeader::default()
        };
        log.decision(Time::from_secs_f64(seconds), &DecisionMessage { header, verdicts: Vec::new() });
    }

    fn texts(log: &EventLog) -> Vec<&str> {
        log.events().map(|event| event.text.as_str()).collect()
    }

    #[test]
    fn hand_overs_and_halts_name_both_sides_and_the_cause() {
        let mut log = EventLog::default();
        let avoider = Proposal {
            behavior: Name::new("avoider"),
            note: Note::new("obstacle at 1.6 m"),
            ..Proposal::drive(Axes::PLANAR, yamabico_core::message::Twist::ZERO)
        };
        let message = MessageType::of::<Proposal>();
        log.message("behaviors/avoider/proposal", &message, Time::ZERO, bytemuck::bytes_of(&avoider), &[]);
        decide(&mut log, 0.02, "localizer", "");
        decide(&mut log, 0.04, "avoider", "");
        decide(&mut log, 0.06, "avoider", "sonar");
        decide(&mut log, 1.26, "localizer", "");
        let expected = [
            "localizer took linear+angular",
            "avoider took linear+angular from localizer: obstacle at 1.6 m",
            "sonar halts linear+angular",
            "no decision for 1200 ms",
            "sonar released linear+angular after 1.2 s; localizer drives",
        ];
        assert_eq!(texts(&log), expected);
    }

    #[test]
    fn contacts_restarts_and_stale_proposals_are_events() {
        let mut log = EventLog::default();
        let truth = Truth { contacts: 1, x: 2.0, ..Truth::default() };
        let message = MessageType::of::<Truth>();
        for _ in 0..2 {
            log.message("truth", &message, Time::ZERO, bytemuck::bytes_of(&truth), &[]);
        }
        let process = Process { plugin: Name::new("avoider"), ..Process::default() };
        log.processes(Time::ZERO, [process].into_iter());
        let ended = Process { ended: Note::new("was killed by signal 9"), ended_ns: 5, ..process };
        log.processes(Time(5), [ended].into_iter());
        log.processes(Time(6), [Process { restarts: 1, ..ended }].into_iter());
        let stale = Verdict {
            behavior: Name::new("wall"),
            outcome: Outcome::Stale.code(),
            number: 0.25,
            ..Verdict::default()
        };
        for _ in 0..2 {
            log.lateness(Time(7), &[stale]);
        }
        let expected = [
            "contact at (2.00, 0.00)",
            "avoider: its process was killed by signal 9",
            "avoider: restarted, 1 in all",
            "wall is stale: 0.25 s old",
        ];
        assert_eq!(texts(&log), expected);
    }

    #[test]
    fn a_repeated_request_is_one_event_and_the_log_is_bounded() {
        let mut log = EventLog::default();
        let control = Control { kind: ControlKind::EmergencyStop.code(), ..Control::default() };
        for i in 0..5 {
            log.control(Time(i * 100_000_000), &control, "");
        }
        assert_eq!(texts(&log), ["operator: e-stop"]);
        for i in 0..(MAX_EVENTS + 10) {
            log.add(Time(i as u64), EventKind::Late, "", String::new());
        }
        assert_eq!((log.events().count(), log.count()), (MAX_EVENTS, MAX_EVENTS as u64 + 11));
    }
}
