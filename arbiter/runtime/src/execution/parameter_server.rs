//! Server of parameter updates: checks a request, has every behavior concerned prepare it, and only then apply it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use yamabico_core::behavior::BehaviorFactory;
use yamabico_core::message::{
    Control, ControlKind, Name, Note, RetuneHeader, RetuneOutcome, RetuneStep, RetunedHeader,
};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher, Subscriber};
use yamabico_host::config::retune;
use yamabico_host::{MAX_FAILURE_TEXT_BYTES, MAX_PARAMETER_BYTES, topics};

use super::plan::Plan;
use crate::supervisor::Supervisor;

/// Time within which a behavior prepares new parameters; one that does not answer cannot update them while it runs.
const PREPARE_TIMEOUT: Duration = Duration::from_secs(3);
/// Retry apply after this: the behavior probably restarted.
const APPLY_RETRY_PERIOD: Duration = Duration::from_millis(300);
/// Time within which every behavior applies new parameters.
const APPLY_TIMEOUT: Duration = Duration::from_secs(5);

/// Updates parameters of a robot's behaviors, one request at a time.
pub(super) struct ParameterServer {
    parameters: BTreeMap<String, (Arc<dyn BehaviorFactory>, toml::Table)>,
    controls: Subscriber<Control>,
    answers: Subscriber<RetunedHeader>,
    requests: Publisher<RetuneHeader>,
    results: Publisher<RetunedHeader>,
    waiting: Vec<(u64, String)>,
    current: Option<Update>,
    sequence: u64,
    answered: u64,
}

/// A request in progress.
struct Update {
    request: u64,
    tables: BTreeMap<String, toml::Table>,
    step: RetuneStep,
    missing: Vec<String>,
    since: Time,
    sent: Time,
}

/// Refusal of a request.
struct Refusal {
    behavior: Name,
    key: Note,
    problem: String,
}

impl ParameterServer {
    /// Opens the server for the behaviors of `plan`.
    pub fn open(plan: &Plan, bus: &Bus) -> Result<ParameterServer, BusError> {
        let parameters = plan.behaviors.iter().map(|behavior| {
            (behavior.setup.name.clone(), (Arc::clone(&behavior.factory), behavior.table.clone()))
        });
        Ok(ParameterServer {
            parameters: parameters.collect(),
            controls: bus.subscriber(topics::CONTROL)?,
            answers: bus.subscriber(topics::RETUNED)?,
            requests: bus.publisher(topics::RETUNE)?,
            results: bus.publisher(topics::RETUNED)?,
            waiting: Vec::new(),
            current: None,
            sequence: 0,
            answered: 0,
        })
    }

    /// Advances the updates. The `supervisor` passes new parameters to processes that it restarts.
    ///
    /// # Errors
    /// The bus fails.
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
                    let update = Update { request, tables, step, missing, since: now, sent: now };
                    self.send(&update, now)?;
                    self.current = Some(update);
                }
                Err(refusal) => self.answer(request, Err(refusal), now)?,
            }
        }
        self.listen(supervisor, now)
    }

    /// Checks a request; returns the new parameter table of each behavior that it names.
    fn check(&self, text: &str) -> Result<BTreeMap<String, toml::Table>, Refusal> {
        let refusal = |behavior: &str, problem: String| Refusal {
            behavior: Name::new(behavior),
            key: Note::default(),
            problem,
        };
        let sent: toml::Table =
            toml::from_str(text).map_err(|error| refusal("", error.message().to_owned()))?;
        let mut tables = BTreeMap::new();
        for (name, changes) in &sent {
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
            if toml::to_string(&changed).map_or(usize::MAX, |text| text.len()) > MAX_PARAMETER_BYTES {
                let problem = format!(
                    "its parameters take more than {MAX_PARAMETER_BYTES} bytes: put them into a file"
                );
                return Err(refusal(name, problem));
            }
            tables.insert(name.clone(), changed);
        }
        if tables.is_empty() {
            Err(refusal("", "the request names no parameter".to_owned()))
        } else {
            Ok(tables)
        }
    }

    fn listen(&mut self, supervisor: Option<&Supervisor>, now: Time) -> Result<(), BusError> {
        let Some(mut update) = self.current.take() else {
            while self.answers.receive()?.is_some() {}
            return Ok(());
        };
        while let Some(answer) = self.answers.receive()? {
            let header = *answer.header();
            if header.request != update.request || header.behavior.is_empty() {
                continue;
            }
            match (header.outcome(), update.step) {
                (Some(RetuneOutcome::Ready), RetuneStep::Prepare)
                | (Some(RetuneOutcome::Applied), RetuneStep::Apply) => {
                    update.missing.retain(|name| name != header.behavior.as_str());
                }
                (Some(RetuneOutcome::Refused), _) => {
                    let problem = String::from_utf8_lossy(answer.items()).into_owned();
                    drop(answer);
                    let refusal = Refusal { behavior: header.behavior, key: header.key, problem };
                    return self.give_up(update, refusal, now);
                }
                _ => {}
            }
        }
        match update.step {
            RetuneStep::Prepare if update.missing.is_empty() => {
                for (name, table) in &update.tables {
                    if let Some((_, parameters)) = self.parameters.get_mut(name) {
                        parameters.clone_from(table);
                    }
                    if let Some(supervisor) = supervisor {
                        supervisor.set_parameters(name, table.clone(), update.request);
                    }
                }
                update.step = RetuneStep::Apply;
                update.missing = update.tables.keys().cloned().collect();
                (update.since, update.sent) = (now, now);
                self.send(&update, now)?;
            }
            RetuneStep::Prepare if now.since(update.since) > PREPARE_TIMEOUT => {
                let problem =
                    "it did not answer: its program cannot update parameters while it runs, or it is hung";
                return self.time_out(update, problem, now);
            }
            RetuneStep::Apply if update.missing.is_empty() => {
                return self.answer(update.request, Ok(()), now);
            }
            RetuneStep::Apply if now.since(update.since) > APPLY_TIMEOUT => {
                let problem = "it did not confirm the new parameters; it gets them when it restarts";
                return self.time_out(update, problem, now);
            }
            RetuneStep::Apply if now.since(update.sent) > APPLY_RETRY_PERIOD => {
                update.sent = now;
                self.send(&update, now)?;
            }
            _ => {}
        }
        self.current = Some(update);
        Ok(())
    }

    fn time_out(&mut self, update: Update, problem: &str, now: Time) -> Result<(), BusError> {
        let behavior = Name::new(update.missing.first().map_or("", String::as_str));
        let refusal = Refusal { behavior, key: Note::default(), problem: problem.to_owned() };
        self.give_up(update, refusal, now)
    }

    /// Cancels the request: every behavior drops what it prepared.
    fn give_up(&mut self, mut update: Update, refusal: Refusal, now: Time) -> Result<(), BusError> {
        update.step = RetuneStep::Drop;
        update.missing = update.tables.keys().cloned().collect();
        self.send(&update, now)?;
        self.answer(update.request, Err(refusal), now)
    }

    /// Sends the current step to every behavior that has not completed it.
    fn send(&mut self, update: &Update, now: Time) -> Result<(), BusError> {
        for name in &update.missing {
            let text = update.tables.get(name).and_then(|table| toml::to_string(table).ok());
            self.sequence += 1;
            let header = RetuneHeader {
                stamp_ns: now.0,
                sequence: self.sequence,
                request: update.request,
                behavior: Name::new(name),
                step: update.step.code(),
                reserved: 0,
            };
            self.requests.publish(&header, text.unwrap_or_default().as_bytes())?;
        }
        Ok(())
    }

    /// Answers the client that sent the request.
    fn answer(&mut self, request: u64, outcome: Result<(), Refusal>, now: Time) -> Result<(), BusError> {
        let (outcome, key, problem) = match outcome {
            Ok(()) => (RetuneOutcome::Applied, Note::default(), String::new()),
            Err(Refusal { behavior, key, problem }) => {
                let prefix = if behavior.is_empty() { String::new() } else { format!("{behavior}: ") };
                (RetuneOutcome::Refused, key, prefix + &problem)
            }
        };
        tracing::info!("parameters: {outcome} {problem}");
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
        self.results.publish(&header, &problem.as_bytes()[..problem.len().min(MAX_FAILURE_TEXT_BYTES)])
    }
}
