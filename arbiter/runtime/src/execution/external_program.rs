//! A behavior in a program of its own, called as one in this process is: each call is answered before the next.
//!
//! The program takes turns as in a run with a driver's clock, on a bus of its own: its inputs are copied there, its proposals and
//! outputs from there. It decides itself whether a call is due, and counts its proposals, as in a live run. An exception in
//! the program is its own affair, and costs one proposal; a program that ends or does not answer fails for good.

use std::process::Child;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use yamabico_core::message::{
    FailureHeader, Heartbeat, Kind, Message, MessageType, Name, OverlayHeader, Proposal, RawMessage,
    RetuneHeader, RetuneOutcome, RetuneStep, RetunedHeader, SavedStateHeader, StepPhase, StepSignal, View,
};
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher, RawPublisher, RawSubscriber, Subscriber, WaitSet};
use yamabico_host::config::Clock;
use yamabico_host::process::Start;
use yamabico_host::{BehaviorPlan, CallStats, HostError, topics};

use super::hosted_behavior::Hosting;
use super::plan::{Overlays, Plan};
use crate::supervisor::{ProcessPlan, Program, launch};

/// Deadlines of the behavior within which its program answers: a busy machine must not look like a hanging program.
const DEADLINES: u32 = 40;
/// Time within which a program opens its parts.
const OPENING_TIMEOUT: Duration = Duration::from_secs(20);
/// Time within which a program ends on request; after that it is killed.
const ENDING_TIMEOUT: Duration = Duration::from_secs(1);
/// Longest wait without a look at the process, and at messages that do not notify.
const MAX_WAIT: Duration = Duration::from_millis(5);

/// Program of one behavior.
pub(crate) struct ExternalProgram {
    name: String,
    process: Process,
    /// Topics of its inputs: here, and on its bus.
    inputs: Vec<(RawSubscriber, RawPublisher)>,
    /// Topics of its outputs: on its bus, and here.
    outputs: Vec<Output>,
    announcements: Publisher<StepSignal>,
    acknowledgments: Subscriber<StepSignal>,
    requests: Publisher<RetuneHeader>,
    replies: Subscriber<RetunedHeader>,
    failures: Subscriber<FailureHeader>,
    wait_set: WaitSet,
    timeout: Duration,
    /// Announced phase that is still to be acknowledged.
    awaited: Option<StepSignal>,
    sequence: u64,
    /// Number of proposals of earlier instances.
    counted: u64,
    stats: CallStats,
    began: Instant,
    /// Set once it has ended or hung; it is silent from then on.
    has_failed: bool,
    // Dropped last: ports must go before their bus.
    _bus: Bus,
}

struct Output {
    from: RawSubscriber,
    to: RawPublisher,
    message: MessageType,
}

/// Process that ends when dropped.
struct Process(Child);

impl ExternalProgram {
    /// Starts the program of `behavior`, a part of a plan, and waits until it has opened its parts. It begins with the
    /// saved state `state`, if that is not empty.
    ///
    /// # Errors
    /// It does not start, refuses its parameters, or the bus fails.
    pub fn open(
        behavior: BehaviorPlan,
        hosting: &Hosting<'_>,
        program: &Program,
        state: &[u8],
    ) -> Result<ExternalProgram, HostError> {
        let (name, timeout) = (behavior.setup.name.clone(), behavior.settings.host.deadline.hang_timeout());
        let mut plan =
            Plan { behaviors: vec![behavior], clock: Clock::Driver, ..hosting.plan.of_behavior(&name) }
                .live();
        let bus = Bus::private()?;
        plan.create_topics(&bus)?;
        let here = hosting.bus;
        let inputs = plan.behaviors.iter().flat_map(|behavior| &behavior.inputs);
        let mut inputs: Vec<(String, MessageType)> =
            inputs.map(|(_, topic, message)| (topic.clone(), *message)).collect();
        let sleeps = plan.behaviors.iter().any(|behavior| behavior.settings.sleeps_while_inhibited);
        let decisions = MessageType::of::<yamabico_core::message::DecisionHeader>();
        if sleeps && !inputs.iter().any(|(topic, _)| topic == topics::DECISION) {
            inputs.push((topics::DECISION.to_owned(), decisions));
        }
        // Slots that share a topic share its copy.
        inputs.sort_by(|a, b| a.0.cmp(&b.0));
        inputs.dedup_by(|a, b| a.0 == b.0);
        let inputs = inputs.iter().map(|(topic, message)| {
            Ok((here.subscriber_raw(topic, message)?, bus.publisher_raw(topic, message)?))
        });
        let inputs = inputs.collect::<Result<_, BusError>>()?;
        let outputs = plan.behaviors.iter().flat_map(|behavior| &behavior.factory.info().outputs);
        let mut outputs: Vec<(String, MessageType)> =
            outputs.map(|slot| (topics::output(&name, &slot.name), slot.message)).collect();
        if hosting.plan.overlays == Overlays::Recorded {
            outputs.push((topics::overlay(&name), MessageType::of::<OverlayHeader>()));
        }
        if hosting.publishes_states {
            outputs.push((topics::SAVED_STATES.to_owned(), MessageType::of::<SavedStateHeader>()));
        }
        outputs.push((topics::proposal(&name), MessageType::of::<Proposal>()));
        let outputs = outputs.into_iter().map(|(topic, message)| {
            Ok(Output {
                from: bus.tap(&topic, &message)?,
                to: here.publisher_raw(&topic, &message)?,
                message,
            })
        });
        let outputs = outputs.collect::<Result<_, BusError>>()?;
        let heartbeats = bus.subscriber(topics::HEARTBEATS)?;
        let mut opened = ExternalProgram {
            inputs,
            outputs,
            announcements: bus.publisher(topics::STEP_ANNOUNCEMENTS)?,
            acknowledgments: bus.subscriber(topics::STEP_ACKNOWLEDGMENTS)?,
            requests: bus.publisher(topics::RETUNE)?,
            replies: bus.subscriber(topics::RETUNED)?,
            failures: bus.subscriber(topics::FAILURES)?,
            wait_set: bus.wait_set(&[topics::STEP_ACKNOWLEDGMENTS])?,
            timeout: (timeout * DEADLINES).max(Duration::from_millis(1)),
            awaited: None,
            sequence: 0,
            counted: 0,
            stats: CallStats::default(),
            began: Instant::now(),
            has_failed: false,
            process: Process(
                start(&mut plan, &bus, program, state)
                    .map_err(|reason| HostError::Process { name: name.clone(), reason })?,
            ),
            _bus: bus,
            name,
        };
        opened.wait_until_open(&heartbeats)?;
        Ok(opened)
    }

    /// Name in the task file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Durations of the calls, with the way to the program and back.
    pub fn stats(&self) -> &CallStats {
        &self.stats
    }

    /// Continues the count of an earlier instance's proposals.
    pub fn resume(&mut self, sequence: u64) {
        self.counted = sequence;
    }

    /// Passes every waiting input to the program, which receives it.
    ///
    /// # Errors
    /// The program has failed, or the bus.
    pub fn collect(&mut self) -> Result<(), DeviceError> {
        self.unless_failed(|program| {
            // What arrives later must not be received with what came before.
            program.wait_for_answer()?;
            for (from, to) in &program.inputs {
                while let Some(sample) = from.receive().map_err(text)? {
                    to.publish(sample.header(), sample.items()).map_err(text)?;
                }
            }
            program.announce(StepPhase::Collect, Time::ZERO)
        })
    }

    /// Asks the program to propose if it is due, without waiting for the answer.
    ///
    /// # Errors
    /// The program has failed, or the bus.
    pub fn ask(&mut self, now: Time) -> Result<(), DeviceError> {
        self.unless_failed(|program| {
            program.began = Instant::now();
            program.announce(StepPhase::Propose, now)
        })
    }

    /// Waits for the answer of the program, and publishes its proposal and outputs.
    ///
    /// # Errors
    /// The program has failed, or the bus.
    pub fn answer(&mut self, now: Time) -> Result<(), DeviceError> {
        self.unless_failed(|program| {
            program.wait_for_answer()?;
            program.publish(now)
        })
    }

    /// Changes its parameters as [`BehaviorHost::retune`](yamabico_host::BehaviorHost::retune) does.
    ///
    /// # Errors
    /// The program refuses them, has failed, or the bus.
    pub fn retune(&mut self, table: &toml::Table) -> Result<(), DeviceError> {
        self.unless_failed(|program| {
            program.wait_for_answer()?;
            program.sequence += 1;
            let header = RetuneHeader {
                sequence: program.sequence,
                request: program.sequence,
                behavior: Name::new(&program.name),
                step: RetuneStep::Apply.code(),
                ..RetuneHeader::default()
            };
            let parameters = toml::to_string(table).map_err(text)?;
            program.requests.publish(&header, parameters.as_bytes()).map_err(text)?;
            let (begun, timeout) = (Instant::now(), program.timeout.max(OPENING_TIMEOUT));
            loop {
                while let Some(reply) = program.replies.receive().map_err(text)? {
                    match reply.header().outcome() {
                        _ if reply.header().request != header.request => {}
                        Some(RetuneOutcome::Applied) => return Ok(()),
                        _ => {
                            return Err(format!(
                                "refuses its new parameters: {}",
                                String::from_utf8_lossy(reply.items())
                            ));
                        }
                    }
                }
                program.wait(begun, timeout)?;
            }
        })
    }

    /// Does `work` unless the program has failed before: a failure is reported once.
    fn unless_failed(
        &mut self,
        work: impl FnOnce(&mut ExternalProgram) -> Result<(), String>,
    ) -> Result<(), DeviceError> {
        if self.has_failed {
            return Ok(());
        }
        work(self).map_err(|reason| {
            self.has_failed = true;
            let reported = self.failures.receive().ok().flatten();
            let reported = reported.map_or_else(String::new, |failure| {
                format!("; it reported: {}", String::from_utf8_lossy(failure.items()))
            });
            DeviceError::Reported(format!("the program of the behavior `{}` {reason}{reported}", self.name))
        })
    }

    fn announce(&mut self, phase: StepPhase, now: Time) -> Result<(), String> {
        self.sequence += 1;
        let signal = StepSignal {
            stamp_ns: now.0,
            sequence: self.sequence,
            step: self.sequence,
            phase: phase.code(),
            ..StepSignal::default()
        };
        self.awaited = Some(signal);
        self.announcements.publish(&signal, &[]).map_err(text)
    }

    /// Waits until the program has executed its last step.
    fn wait_for_answer(&mut self) -> Result<(), String> {
        let Some(awaited) = self.awaited.take() else { return Ok(()) };
        let begun = Instant::now();
        loop {
            while let Some(answer) = self.acknowledgments.receive().map_err(text)? {
                if answer.header().step == awaited.step {
                    return Ok(());
                }
            }
            self.wait(begun, self.timeout)?;
        }
    }

    /// Waits for a message, and for the end of the process or of the time.
    fn wait(&mut self, begun: Instant, timeout: Duration) -> Result<(), String> {
        if let Ok(Some(status)) = self.process.0.try_wait() {
            return Err(format!("has ended ({status}); its last words are on standard error"));
        }
        if begun.elapsed() > timeout {
            return Err(format!(
                "has not answered for {timeout:.1?}: it hangs, or its `deadline_ms` is too short ({DEADLINES} deadlines are waited for)"
            ));
        }
        self.wait_set.wait(MAX_WAIT).map(drop).map_err(text)
    }

    /// Publishes here what the program has published.
    fn publish(&mut self, now: Time) -> Result<(), String> {
        for Output { from, to, message } in &self.outputs {
            while let Some(sample) = from.receive().map_err(text)? {
                let raw = RawMessage { header: sample.header(), items: sample.items() };
                let published = match message.name {
                    Proposal::NAME => {
                        let Some(view) = View::<Proposal>::of(raw) else { continue };
                        let mut proposal = *view.header;
                        proposal.sequence += self.counted;
                        self.stats.calls.add(self.began.elapsed());
                        self.stats.abstentions += u64::from(proposal.kind() == Some(Kind::Abstain));
                        to.publish(bytemuck::bytes_of(&proposal), &[])
                    }
                    SavedStateHeader::NAME => {
                        let Some(view) = View::<SavedStateHeader>::of(raw) else { continue };
                        let header = SavedStateHeader { stamp_ns: now.0, ..*view.header };
                        to.publish(bytemuck::bytes_of(&header), sample.items())
                    }
                    _ => to.publish(sample.header(), sample.items()),
                };
                published.map_err(text)?;
            }
        }
        Ok(())
    }

    fn wait_until_open(&mut self, heartbeats: &Subscriber<Heartbeat>) -> Result<(), HostError> {
        let begun = Instant::now();
        let refused = |name: &str, reason| HostError::Process { name: name.to_owned(), reason };
        loop {
            if let Some(failure) = self.failures.receive()? {
                let (key, problem) =
                    (failure.header().key.as_str(), String::from_utf8_lossy(failure.items()));
                let key = if key.is_empty() { String::new() } else { format!("`{key}` ") };
                return Err(refused(&self.name, format!("{key}{problem}")));
            }
            if heartbeats.receive()?.is_some() {
                return Ok(());
            }
            self.wait(begun, OPENING_TIMEOUT)
                .map_err(|reason| refused(&self.name, format!("it {reason}")))?;
        }
    }
}

/// Starts the process of the only behavior of `plan`.
fn start(plan: &mut Plan, bus: &Bus, program: &Program, state: &[u8]) -> Result<Child, String> {
    let plans = plan.split_off_processes().plans(bus).map_err(text)?;
    let process = plans.into_iter().next().ok_or("it has no program")?;
    let mut launched = ProcessPlan { ..process };
    launched.launch.start = Start::Immediately;
    launched.launch.saved_state = String::from_utf8_lossy(state).into_owned();
    launch(program, &launched).map_err(text)
}

fn text(error: impl ToString) -> String {
    error.to_string()
}

impl Drop for Process {
    /// Asks the process to end, and kills it if it does not.
    fn drop(&mut self) {
        let pid = i32::try_from(self.0.id()).ok().and_then(Pid::from_raw);
        // A process that has been waited for has no id any more.
        if matches!(self.0.try_wait(), Ok(None)) {
            let _ = pid.map(|pid| kill_process(pid, Signal::TERM));
        }
        let asked = Instant::now();
        while matches!(self.0.try_wait(), Ok(None)) && asked.elapsed() < ENDING_TIMEOUT {
            std::thread::sleep(Duration::from_millis(1));
        }
        let _ = self.0.kill().and_then(|()| self.0.wait());
    }
}
