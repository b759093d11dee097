//! The arbiter of a run: receives proposals, publishes decisions and commands.

use std::collections::BTreeMap;

use yamabico_core::message::{
    Command, Control, DecisionHeader, Goal, Heard, HeardHeader, HeardKind, MessageType, Proposal,
};
use yamabico_core::time::{Time, TimeSource};
use yamabico_host::bus::{Bus, BusError, Publisher, RawSubscriber, Subscriber};

use super::arbiter_core::{ArbiterCore, MAX_HEARD};
use super::plan::Plan;
use crate::report::LatencyFigures;
use yamabico_host::topics;

/// The arbiter between proposals and commands. It alone holds the publisher of commands.
pub(super) struct ArbiterHost {
    core: ArbiterCore,
    time: TimeSource,
    incoming: Vec<Subscriber<Proposal>>,
    sensors: Vec<(RawSubscriber, MessageType)>,
    controls: Subscriber<Control>,
    goals: Publisher<Goal>,
    commands: Publisher<Command>,
    decisions: Publisher<DecisionHeader>,
    /// Log of what was heard, in a live run.
    log: Option<HearingLog>,
    /// Set once a decision could not be published.
    has_failed_to_publish: bool,
}

/// Log of what the arbiter heard, from which its decisions can be replayed.
struct HearingLog {
    publisher: Publisher<HeardHeader>,
    heard: Vec<Heard>,
    left_out: u64,
    is_shutting_down: bool,
}

impl HearingLog {
    fn add(&mut self, kind: HeardKind, index: usize, message: (u64, u64), at: Time) {
        if self.heard.len() == MAX_HEARD {
            self.left_out += 1;
            return;
        }
        let ((sequence, stamp_ns), heard_ns) = (message, at.0);
        self.heard.push(Heard { kind: kind.code(), index: index as u32, sequence, stamp_ns, heard_ns });
    }

    /// Publishes what was heard before a decision.
    fn publish(&mut self, decision: &DecisionHeader, sent: Time) -> Result<(), BusError> {
        let header = HeardHeader {
            stamp_ns: decision.stamp_ns,
            sequence: decision.sequence,
            sent_ns: sent.0,
            left_out: std::mem::take(&mut self.left_out),
        };
        let published = self.publisher.publish(&header, &self.heard);
        self.heard.clear();
        published
    }
}

impl ArbiterHost {
    /// Opens the arbiter's topics, the command topic first, so that no other process can publish on it.
    ///
    /// # Errors
    /// The bus fails.
    pub fn open(plan: &Plan, bus: &Bus) -> Result<ArbiterHost, BusError> {
        let policy = plan.policy.clone();
        let commands = bus.publisher(topics::COMMAND)?;
        let incoming =
            policy.behaviors.iter().map(|behavior| bus.subscriber(&topics::proposal(behavior.name.as_str())));
        let find = |name: &str| plan.topics.iter().find(|topic| topic.name == name);
        let sensors = policy.sensors.iter().filter_map(|sensor| {
            let name = topics::sensor(sensor.name.as_str());
            let message = find(&name)?.message;
            Some(bus.subscriber_raw(&name, &message).map(|subscriber| (subscriber, message)))
        });
        let log = find(topics::HEARD).map(|topic| {
            Ok(HearingLog {
                publisher: bus.publisher(&topic.name)?,
                heard: Vec::with_capacity(MAX_HEARD),
                left_out: 0,
                is_shutting_down: false,
            })
        });
        Ok(ArbiterHost {
            time: TimeSource::Step,
            incoming: incoming.collect::<Result<_, _>>()?,
            sensors: sensors.collect::<Result<_, _>>()?,
            controls: bus.subscriber(topics::CONTROL)?,
            goals: bus.publisher(topics::GOAL)?,
            commands,
            decisions: bus.publisher(topics::DECISION)?,
            log: log.transpose()?,
            has_failed_to_publish: false,
            core: ArbiterCore::new(policy),
        })
    }

    /// Receives, decides, and publishes the command and the decision.
    ///
    /// If the bus does not deliver proposals, they count as silent, which stops the robot; if it does not deliver requests,
    /// the robot makes an emergency stop. A decision that cannot be published is logged once.
    ///
    /// # Errors
    /// The command cannot be published.
    pub fn step(&mut self, now: Time) -> Result<(), BusError> {
        self.receive(now);
        // Not earlier than anything received.
        let now = self.time.now(now);
        self.core.decide(now);
        let sent = self.time.now(now);
        self.commands.publish(&self.core.command(sent), &[])?;
        self.core.count(sent);
        let (header, verdicts) = self.core.message();
        let published = self.decisions.publish(&header, verdicts);
        let logged = self.log.as_mut().map_or(Ok(()), |log| log.publish(&header, sent));
        if let Err(error) = published.and(logged)
            && !std::mem::replace(&mut self.has_failed_to_publish, true)
        {
            tracing::error!("could not publish decisions: {error}");
        }
        Ok(())
    }

    fn receive(&mut self, step: Time) {
        let ArbiterHost { core, time, log, .. } = self;
        let mut note = |kind, index, message, at| {
            if let Some(log) = log.as_mut() {
                log.add(kind, index, message, at);
            }
        };
        for (index, incoming) in self.incoming.iter().enumerate() {
            if let Ok(Some(newest)) = incoming.newest() {
                let (proposal, at) = (*newest.header(), time.now(step));
                core.hear_proposal(index, proposal, at);
                note(HeardKind::Proposal, index, (proposal.sequence, proposal.stamp_ns), at);
            }
        }
        for (index, (sensor, message)) in self.sensors.iter().enumerate() {
            if let Ok(Some(newest)) = sensor.newest() {
                let stamp = (message.stamps)(newest.header()).0;
                core.hear_sensor(index, stamp);
                note(HeardKind::Sensor, index, (0, stamp.0), stamp);
            }
        }
        if let Err(error) = self.goals.resend_to_new_subscribers() {
            tracing::error!("could not resend the goal to new subscribers: {error}");
        }
        loop {
            let control = self.controls.receive();
            match control.map(|control| control.map(|control| *control.header())) {
                Ok(Some(control)) => {
                    let at = time.now(step);
                    note(HeardKind::Control, 0, (control.sequence, control.stamp_ns), at);
                    if let Some(goal) = core.hear_control(&control, at)
                        && let Err(error) = self.goals.publish(&goal, &[])
                    {
                        tracing::error!("could not publish the goal: {error}");
                    }
                }
                Ok(None) => break,
                Err(error) => {
                    // The lost request may have been an emergency stop.
                    tracing::error!("emergency stop, because receiving requests failed: {error}");
                    core.emergency_stop();
                    if let Some(log) = &mut self.log {
                        log.left_out += 1;
                    }
                    break;
                }
            }
        }
    }

    /// Gives subscribers that came late the newest decision and command.
    pub fn serve_new_subscribers(&self) {
        let served = self.decisions.resend_to_new_subscribers();
        if let Err(error) = served.and(self.commands.resend_to_new_subscribers()) {
            tracing::error!("could not resend decisions to new subscribers: {error}");
        }
    }

    /// Sets the clock that stamps the stages of commands; without it, time stands still within a step.
    pub fn keep_time_by(&mut self, time: TimeSource) {
        self.time = time;
    }

    /// Latencies of each behavior's proposals, by name.
    pub fn latencies(&self) -> BTreeMap<String, LatencyFigures> {
        self.core.latencies()
    }

    /// Brings the robot to a standstill for the end of the run.
    pub fn shut_down(&mut self) {
        self.core.shut_down();
        if let Some(log) = &mut self.log
            && !std::mem::replace(&mut log.is_shutting_down, true)
        {
            log.add(HeardKind::ShutDown, 0, (0, 0), Time::ZERO);
        }
    }
}
