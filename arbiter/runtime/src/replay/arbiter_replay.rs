//! The arbiter of a live run again: its decisions from what it heard, in the order in which it heard it.

use std::rc::Rc;

use yamabico_arbiter::policy::Policy;
use yamabico_core::message::{
    Control, DecisionHeader, Goal, Heard, HeardHeader, HeardKind, Message, MessageType, Proposal, View,
};
use yamabico_core::time::Time;
use yamabico_host::topics;

use super::behavior_replay::{Past, Published};
use super::steps::{RecordedMessage, raw};
use crate::execution::ArbiterCore;

/// The arbiter under replay.
pub(super) struct ArbiterReplay {
    core: ArbiterCore,
    /// Names of the behaviors and critical sensors as the recorded arbiter counted them.
    behaviors: Vec<String>,
    sensors: Vec<String>,
    sequence: Option<u64>,
    /// Cause why the replay of the arbiter has ended early.
    pub ended: Option<String>,
}

impl ArbiterReplay {
    /// An arbiter with `policy`, on the log of one with the policy `recorded`.
    pub fn new(policy: Policy, recorded: &Policy) -> ArbiterReplay {
        ArbiterReplay {
            behaviors: recorded.behaviors.iter().map(|behavior| behavior.name.to_string()).collect(),
            sensors: recorded.sensors.iter().map(|sensor| sensor.name.to_string()).collect(),
            core: ArbiterCore::new(policy),
            sequence: None,
            ended: None,
        }
    }

    /// Repeats a decision of the log; returns the goals, the command and the decision that follow.
    pub fn repeat(&mut self, header: &HeardHeader, heard: &[Heard], past: &Past<'_>) -> Published {
        if self.ended.is_some() {
            return Published::new();
        }
        let gap = self.sequence.map(|last| header.sequence.saturating_sub(last + 1));
        let is_next = self.sequence.is_none_or(|last| header.sequence == last + 1);
        self.sequence = Some(header.sequence);
        let outcome = match (is_next, header.left_out) {
            (false, _) => Err(format!("{} records of what it heard are lost", gap.unwrap_or(0))),
            (_, 0) => self.hear(heard, past),
            (_, left_out) => Err(format!("{left_out} of the things that it heard are not logged")),
        };
        let goals = match outcome {
            Ok(goals) => goals,
            Err(what) => {
                let time_s = Time(header.stamp_ns).as_secs_f64();
                self.ended = Some(format!("the arbiter is replayed up to {time_s:.3} s (stamp): {what}"));
                return Published::new();
            }
        };
        self.core.decide(Time(header.stamp_ns));
        let command = self.core.command(Time(header.sent_ns));
        let (decision, verdicts) = self.core.message();
        let goal = |goal: &Goal| message(topics::GOAL, goal, &[]);
        let decided = message::<DecisionHeader>(topics::DECISION, &decision, verdicts);
        goals.iter().map(goal).chain([message(topics::COMMAND, &command, &[]), decided]).collect()
    }

    /// Hears everything again; returns the goals that follow.
    fn hear(&mut self, heard: &[Heard], past: &Past<'_>) -> Result<Vec<Goal>, String> {
        let mut goals = Vec::new();
        for item in heard {
            let (key, at) = ((item.sequence, item.stamp_ns), Time(item.heard_ns));
            let named = |names: &[String]| names.get(item.index as usize).cloned();
            match item.kind() {
                Some(HeardKind::Proposal) => {
                    let name = named(&self.behaviors).ok_or("a proposal of an unknown behavior")?;
                    let Some(index) = self.core.policy.find(&name) else { continue };
                    let topic = topics::proposal(&name);
                    let recorded = past.window.find(&topic, key).cloned();
                    let found = (past.replayed)(&topic, item.sequence).or(recorded);
                    let found =
                        found.ok_or_else(|| format!("proposal {} of {name} is not recorded", key.0))?;
                    let proposal = View::<Proposal>::of(raw(&found)).ok_or("a malformed proposal")?;
                    self.core.hear_proposal(index, *proposal.header, at);
                }
                Some(HeardKind::Sensor) => {
                    let name = named(&self.sensors).ok_or("a measurement of an unknown sensor")?;
                    let mut sensors = self.core.policy.sensors.iter();
                    if let Some(index) = sensors.position(|sensor| sensor.name.as_str() == name) {
                        self.core.hear_sensor(index, Time(item.stamp_ns));
                    }
                }
                Some(HeardKind::Control) => {
                    let found = past.window.find(topics::CONTROL, key).cloned();
                    let found: Rc<RecordedMessage> = found.ok_or("a request is not recorded")?;
                    let control = View::<Control>::of(raw(&found)).ok_or("a malformed request")?;
                    goals.extend(self.core.hear_control(control.header, at));
                }
                Some(HeardKind::ShutDown) => self.core.shut_down(),
                None => return Err("something of an unknown kind".to_owned()),
            }
        }
        Ok(goals)
    }
}

fn message<M: Message>(topic: &str, header: &M, items: &[M::Item]) -> RecordedMessage {
    RecordedMessage {
        topic: topic.to_owned(),
        message: MessageType::of::<M>(),
        header: bytemuck::bytes_of(header).to_vec(),
        items: bytemuck::cast_slice(items).to_vec(),
    }
}
