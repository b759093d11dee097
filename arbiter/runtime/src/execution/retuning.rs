//! Changes parameters of behaviors while they run: checked, prepared by all whom it concerns, and only then applied.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use yamabico_core::behavior::BehaviorFactory;
use yamabico_core::message::{
    Control, ControlKind, Name, Note, RetuneHeader, RetuneStep, RetunedHeader, Retuning,
};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher, Subscriber};
use yamabico_host::config::retune;
use yamabico_host::{MAX_PARAMETERS, MAX_WORDS, topics};

use super::plan::Plan;
use crate::supervisor::Supervisor;

/// A behavior that has not answered by then does not know how to.
const PREPARING: Duration = Duration::from_secs(3);
/// Who was ready and has not applied it by then has died, and its successor is asked.
const AGAIN: Duration = Duration::from_millis(300);
/// Then it is given up.
const APPLYING: Duration = Duration::from_secs(5);

/// Changes parameters of a robot's behaviors, one request at a time.
pub(super) struct RetuningDesk {
    parameters: BTreeMap<String, (Arc<dyn BehaviorFactory>, toml::Table)>,
    controls: Subscriber<Control>,
    answers: Subscriber<RetunedHeader>,
    requests: Publisher<RetuneHeader>,
    told: Publisher<RetunedHeader>,
    waiting: Vec<(u64, String)>,
    current: Option<Change>,
    sequence: u64,
    answered: u64,
}

/// A request on its way.
struct Change {
    request: u64,
    tables: BTreeMap<String, toml::Table>,
    step: RetuneStep,
    missing: Vec<String>,
    since: Time,
    asked: Time,
}

/// Why parameters are not changed.
struct Refusal {
    behavior: Name,
    key: Note,
    words: String,
}

impl RetuningDesk {
    /// That of the behaviors of `plan`.
    pub fn open(plan: &Plan, bus: &Bus) -> Result<RetuningDesk, BusError> {
        let parameters = plan.behaviors.iter().map(|behavior| {
            (behavior.setup.name.clone(), (Arc::clone(&behavior.factory), behavior.table.clone()))
        });
        Ok(RetuningDesk {
            parameters: parameters.collect(),
            controls: bus.subscriber(topics::CONTROL)?,
            answers: bus.subscriber(topics::RETUNED)?,
            requests: bus.publisher(topics::RETUNE)?,
            told: bus.publisher(topics::RETUNED)?,
            waiting: Vec::new(),
            current: None,
            sequence: 0,
            answered: 0,
        })
    }

    /// Does what can be done by `now`. Successors of processes that die are told of new parameters by the `supervisor`.
    ///
    /// # Errors
    /// The bus failed.
    pub fn step(&mut self, supervisor: Option<&Supervisor>, now: Time) -> Result<(), BusError> {
        while let Some(control) = self.controls.receive()? {
            if control.header().kind() == Some(ControlKind::Retune) {
                let text = String::from_utf8_lossy(control.items()).into_owned();
                self.waiting.push((control.header().stamp_ns, text));
            }
        }
        if self.current.is_none() && !self.waiting.is_empty() {
            let (request, text) = self.waiting.remove(0);
            match self.check(&text) {
                Ok(tables) => {
                    let missing = tables.keys().cloned().collect();
                    let step = RetuneStep::Prepare;
                    let change = Change { request, tables, step, missing, since: now, asked: now };
                    self.send(&change, now)?;
                    self.current = Some(change);
                }
                Err(refusal) => self.answer(request, Err(refusal), now)?,
            }
        }
        self.listen(supervisor, now)
    }

    /// The new tables of parameters of all whom the request names.
    fn check(&self, text: &str) -> Result<BTreeMap<String, toml::Table>, Refusal> {
        let refusal = |behavior: &str, words: String| Refusal {
            behavior: Name::new(behavior),
            key: Note::default(),
            words,
        };
        let asked: toml::Table =
            toml::from_str(text).map_err(|error| refusal("", error.message().to_owned()))?;
        let mut tables = BTreeMap::new();
        for (name, changes) in &asked {
            let (Some((factory, table)), Some(changes)) = (self.parameters.get(name), changes.as_table())
            else {
                let names = self.parameters.keys().map(String::as_str);
                let instead = yamabico_parameters::instead(name, names, "behavior");
                return Err(refusal(name, format!("the robot has no behavior `{name}`: {instead}")));
            };
            let changed = retune(factory.info(), name, table, changes).map_err(|problems| {
                let lines = problems.entries().into_iter().map(|entry| {
                    let help = entry.help.map_or(String::new(), |help| format!(": {help}"));
                    format!("{}{help}", entry.message)
                });
                refusal(name, lines.collect::<Vec<_>>().join("\n"))
            })?;
            if toml::to_string(&changed).map_or(usize::MAX, |text| text.len()) > MAX_PARAMETERS {
                let words =
                    format!("its parameters take more than {MAX_PARAMETERS} bytes: put them into a file");
                return Err(refusal(name, words));
            }
            tables.insert(name.clone(), changed);
        }
        if tables.is_empty() { Err(refusal("", "nothing is asked for".to_owned())) } else { Ok(tables) }
    }

    fn listen(&mut self, supervisor: Option<&Supervisor>, now: Time) -> Result<(), BusError> {
        let Some(mut change) = self.current.take() else {
            while self.answers.receive()?.is_some() {}
            return Ok(());
        };
        while let Some(answer) = self.answers.receive()? {
            let header = *answer.header();
            if header.request != change.request || header.behavior.is_empty() {
                continue;
            }
            match (header.outcome(), change.step) {
                (Some(Retuning::Ready), RetuneStep::Prepare)
                | (Some(Retuning::Applied), RetuneStep::Apply) => {
                    change.missing.retain(|name| name != header.behavior.as_str());
                }
                (Some(Retuning::Refused), _) => {
                    let words = String::from_utf8_lossy(answer.items()).into_owned();
                    drop(answer);
                    let refusal = Refusal { behavior: header.behavior, key: header.key, words };
                    return self.give_up(change, refusal, now);
                }
                _ => {}
            }
        }
        match change.step {
            RetuneStep::Prepare if change.missing.is_empty() => {
                for (name, table) in &change.tables {
                    if let Some((_, parameters)) = self.parameters.get_mut(name) {
                        parameters.clone_from(table);
                    }
                    if let Some(supervisor) = supervisor {
                        supervisor.retune(name, table.clone());
                    }
                }
                change.step = RetuneStep::Apply;
                change.missing = change.tables.keys().cloned().collect();
                (change.since, change.asked) = (now, now);
                self.send(&change, now)?;
            }
            RetuneStep::Prepare if now.since(change.since) > PREPARING => {
                let words = "it does not answer: its program cannot be retuned while it runs, or it hangs";
                return self.time_out(change, words, now);
            }
            RetuneStep::Apply if change.missing.is_empty() => {
                return self.answer(change.request, Ok(()), now);
            }
            RetuneStep::Apply if now.since(change.since) > APPLYING => {
                return self.time_out(
                    change,
                    "it does not tell whether it has them; its successor will",
                    now,
                );
            }
            RetuneStep::Apply if now.since(change.asked) > AGAIN => {
                change.asked = now;
                self.send(&change, now)?;
            }
            _ => {}
        }
        self.current = Some(change);
        Ok(())
    }

    fn time_out(&mut self, change: Change, words: &str, now: Time) -> Result<(), BusError> {
        let behavior = Name::new(change.missing.first().map_or("", String::as_str));
        let refusal = Refusal { behavior, key: Note::default(), words: words.to_owned() };
        self.give_up(change, refusal, now)
    }

    /// Lets everybody forget what was prepared.
    fn give_up(&mut self, mut change: Change, refusal: Refusal, now: Time) -> Result<(), BusError> {
        change.step = RetuneStep::Drop;
        change.missing = change.tables.keys().cloned().collect();
        self.send(&change, now)?;
        self.answer(change.request, Err(refusal), now)
    }

    /// Asks everybody who is missing.
    fn send(&mut self, change: &Change, now: Time) -> Result<(), BusError> {
        for name in &change.missing {
            let text = change.tables.get(name).and_then(|table| toml::to_string(table).ok());
            self.sequence += 1;
            let header = RetuneHeader {
                stamp_ns: now.0,
                sequence: self.sequence,
                request: change.request,
                behavior: Name::new(name),
                step: change.step.code(),
                reserved: 0,
            };
            self.requests.publish(&header, text.unwrap_or_default().as_bytes())?;
        }
        Ok(())
    }

    /// Tells whoever asked.
    fn answer(&mut self, request: u64, outcome: Result<(), Refusal>, now: Time) -> Result<(), BusError> {
        let (outcome, key, words) = match outcome {
            Ok(()) => (Retuning::Applied, Note::default(), String::new()),
            Err(Refusal { behavior, key, words }) => {
                let whose = if behavior.is_empty() { String::new() } else { format!("{behavior}: ") };
                (Retuning::Refused, key, whose + &words)
            }
        };
        tracing::info!("parameters: {outcome} {words}");
        self.answered += 1;
        let header = RetunedHeader {
            stamp_ns: now.0,
            sequence: self.answered,
            request,
            behavior: Name::default(),
            key,
            outcome: outcome.code(),
            reserved: 0,
        };
        self.told.publish(&header, &words.as_bytes()[..words.len().min(MAX_WORDS)])
    }
}
