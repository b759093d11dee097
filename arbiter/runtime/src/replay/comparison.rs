//! Recorded and replayed messages side by side.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use serde::Serialize;
use yamabico_arbiter::decide::{DecisionMessage, ExplainContext, explain};
use yamabico_core::message::{
    DecisionHeader, Layout, Message, MessageType, OverlayHeader, Proposal, RawMessage, View,
};
use yamabico_core::time::Time;

use super::difference::{self, ARBITER, FieldDifference, author};
use super::prelude::Memory;
use super::steps::{RecordedMessage, Step, raw};
use crate::record::Tap;

/// Comparison of the messages of one topic.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TopicComparison {
    /// Number of recorded messages that were compared.
    pub compared: u64,
    /// Number of those that differ.
    pub different: u64,
    /// Number of recorded messages that the replay did not publish.
    pub missing: u64,
    /// Number of replayed messages that were not recorded.
    pub extra: u64,
    /// Time of the first difference of any kind, s.
    pub first_s: Option<f64>,
    /// Time of the last difference, s.
    pub last_s: Option<f64>,
}

impl TopicComparison {
    fn differences(&self) -> u64 {
        self.different + self.missing + self.extra
    }
}

/// First difference of a replay.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FirstDifference {
    /// Time of the step, s.
    pub time_s: f64,
    /// Number of the step, from 0.
    pub step: u64,
    /// Topic.
    pub topic: String,
    /// Behavior that published the message, or the arbiter.
    pub author: String,
    /// Axes that the difference is about.
    pub axes: Vec<String>,
    /// Fields that differ; empty if one side has no message.
    pub fields: Vec<FieldDifference>,
    /// Kind of the difference.
    pub what: String,
    /// Explanation of the recorded decision of that step.
    pub recorded_why: String,
    /// Explanation of the replayed decision of that step.
    pub replayed_why: String,
}

/// Decisions of one side of the comparison, with the proposals behind them.
#[derive(Default)]
pub(super) struct Side {
    pub decision: Option<DecisionMessage>,
    pub context: ExplainContext,
}

impl Side {
    /// Takes in a message if it is a decision or a proposal.
    pub fn take(&mut self, message: &MessageType, raw: RawMessage<'_>) {
        match message.name {
            DecisionHeader::NAME => {
                let Some(View { header, items }) = View::<DecisionHeader>::of(raw) else { return };
                match &mut self.decision {
                    Some(decision) => {
                        decision.header = *header;
                        items.clone_into(&mut decision.verdicts);
                    }
                    None => {
                        self.decision = Some(DecisionMessage { header: *header, verdicts: items.to_vec() });
                    }
                }
            }
            Proposal::NAME => {
                let Some(View { header, .. }) = View::<Proposal>::of(raw) else { return };
                let proposals = &mut self.context.proposals;
                match proposals.iter_mut().find(|known| known.behavior == header.behavior) {
                    Some(known) => *known = *header,
                    None => proposals.push(*header),
                }
            }
            _ => {}
        }
    }

    /// Explanation of the newest decision.
    pub fn why(&self) -> String {
        let decision = self.decision.as_ref();
        decision.map_or("no decision".to_owned(), |decision| explain(decision, &self.context).to_string())
    }
}

/// Compares the messages of each step.
pub(super) struct Comparison {
    /// Topics that the replay computes.
    computed: BTreeSet<String>,
    expected: BTreeMap<String, VecDeque<RecordedMessage>>,
    pub topics: BTreeMap<String, TopicComparison>,
    pub recorded: Side,
    pub replayed: Side,
    pub first: Option<FirstDifference>,
    /// First difference of this step, before its decisions are known.
    pending: Option<FirstDifference>,
    /// In a replay that began in the middle: by how much a behavior's count of an output is behind, by topic.
    behind: Option<BTreeMap<String, u64>>,
    /// Set if there are overlays that are not compared.
    pub leaves_out_overlays: bool,
    steps: u64,
}

impl Comparison {
    /// A comparison of the messages on the topics `computed`.
    pub fn new(computed: BTreeSet<String>, context: &ExplainContext) -> Comparison {
        let side = || Side { decision: None, context: context.clone() };
        Comparison {
            computed,
            expected: BTreeMap::new(),
            topics: BTreeMap::new(),
            recorded: side(),
            replayed: side(),
            first: None,
            pending: None,
            behind: None,
            leaves_out_overlays: false,
            steps: 0,
        }
    }

    /// Compares the messages on the topics `computed` from now on. Behaviors that begin now count their outputs from one, which is no
    /// difference.
    pub fn begin_in_the_middle(&mut self, computed: BTreeSet<String>) {
        self.computed = computed;
        self.behind = Some(BTreeMap::new());
    }

    /// Says of each behavior that began in the middle whether it went on as recorded.
    pub fn continued(&self, memories: &BTreeMap<String, Memory>) -> Vec<String> {
        let note = |(name, memory): (&String, &Memory)| {
            let own = self.topics.iter().filter(|(topic, _)| author(topic) == name);
            let (mut compared, mut differences, mut last_s) = (0, 0, 0.0_f64);
            for (_, topic) in own {
                compared += topic.compared + topic.missing + topic.extra;
                differences += topic.differences();
                last_s = last_s.max(topic.last_s.unwrap_or(0.0));
            }
            let memory = match memory {
                Memory::NotNeeded => "begins here",
                Memory::None => "begins without a saved state",
                Memory::Restored => "continues from its saved state",
            };
            match (compared, differences) {
                (0, 0) => format!("{name} {memory}: it was not called"),
                (_, 0) => format!("{name} {memory}: exact"),
                _ => format!(
                    "{name} {memory}, which is not all that it remembers: {differences} of {compared} messages differ, \
                     the last at {last_s:.3} s"
                ),
            }
        };
        memories.iter().map(note).collect()
    }

    /// Replayed header with the number that it would have if the behavior had counted from its beginning.
    fn renumbered(
        &mut self,
        topic: &str,
        message: &MessageType,
        recorded: &[u8],
        replayed: &[u8],
    ) -> Option<Vec<u8>> {
        let behind = self.behind.as_mut()?;
        if author(topic) == ARBITER || message.name == Proposal::NAME {
            return None;
        }
        let Layout::Struct(layout) = message.header else { return None };
        let at = layout.fields.iter().find(|field| field.name == "sequence")?.offset;
        let number = (message.sequence)(replayed);
        let offset = *behind
            .entry(topic.to_owned())
            .or_insert_with(|| (message.sequence)(recorded).wrapping_sub(number));
        let mut header = replayed.to_vec();
        header.get_mut(at..at + 8)?.copy_from_slice(&number.wrapping_add(offset).to_ne_bytes());
        Some(header)
    }

    /// Takes the recorded messages of a step that the replay is to compute; returns the others, its inputs.
    pub fn expect(&mut self, step: Step) -> Vec<RecordedMessage> {
        let (computed, inputs): (Vec<_>, Vec<_>) =
            step.messages.into_iter().partition(|message| self.computed.contains(&message.topic));
        for message in computed {
            self.recorded
                .take(&message.message, RawMessage { header: &message.header, items: &message.items });
            match self.expected.get_mut(&message.topic) {
                Some(queue) => queue.push_back(message),
                None => drop(self.expected.insert(message.topic.clone(), [message].into())),
            }
        }
        self.leaves_out_overlays |= inputs.iter().any(|input| input.message.name == OverlayHeader::NAME);
        // Proposals that are not replayed explain the decisions of both sides.
        for message in inputs.iter().filter(|message| message.message.name == Proposal::NAME) {
            self.recorded.take(&message.message, raw(message));
            self.replayed.take(&message.message, raw(message));
        }
        inputs
    }

    /// Ends the step at `time`: what is still expected is missing.
    pub fn settle(&mut self, time: Time) {
        let missing: Vec<(String, u64)> = self
            .expected
            .iter_mut()
            .filter(|(_, queue)| !queue.is_empty())
            .map(|(topic, queue)| (topic.clone(), queue.drain(..).count() as u64))
            .collect();
        for (topic, count) in missing {
            self.missing(time, &topic, count);
        }
        self.resolve();
    }

    /// Counts recorded messages that the replay does not publish.
    pub fn missing(&mut self, time: Time, topic: &str, count: u64) {
        self.count(topic, time, |topic| topic.missing += count);
        self.note(topic, time, "the replay publishes nothing", Vec::new());
    }

    /// Ends a step, or one event of a live run: its decisions are known, and with them the explanations.
    pub fn resolve(&mut self) {
        if let Some(mut first) = self.pending.take()
            && self.first.is_none()
        {
            first.recorded_why = self.recorded.why();
            first.replayed_why = self.replayed.why();
            self.first = Some(first);
        }
        self.steps += 1;
    }

    /// Compares a replayed message with the recorded one.
    pub fn pair(&mut self, time: Time, replayed: &RecordedMessage, recorded: Option<&RecordedMessage>) {
        let RecordedMessage { topic, message, header, items } = replayed;
        self.replayed.take(message, raw(replayed));
        if let Some(recorded) = recorded {
            self.recorded.take(message, raw(recorded));
        }
        self.judge(time, topic, message, recorded, (header, items));
    }

    fn judge(
        &mut self,
        time: Time,
        topic: &str,
        message: &MessageType,
        recorded: Option<&RecordedMessage>,
        replayed: (&[u8], &[u8]),
    ) {
        let Some(recorded) = recorded else {
            self.count(topic, time, |topic| topic.extra += 1);
            return self.note(topic, time, "the recording has no such message", Vec::new());
        };
        let recorded = (&recorded.header[..], &recorded.items[..]);
        let renumbered = self.renumbered(topic, message, recorded.0, replayed.0);
        let replayed = (renumbered.as_deref().unwrap_or(replayed.0), replayed.1);
        let is_equal = recorded == replayed;
        self.count(topic, time, |topic| {
            topic.compared += 1;
            topic.different += u64::from(!is_equal);
        });
        if !is_equal && self.first.is_none() && self.pending.is_none() {
            let fields = difference::fields(message, recorded, replayed);
            self.note(topic, time, "the messages differ", fields);
        }
    }

    /// Sets the number of steps of a comparison that was made elsewhere.
    pub fn count_steps(&mut self, steps: u64) {
        self.steps = steps;
    }

    /// Topics that the replay computes.
    pub fn computed(&self) -> &BTreeSet<String> {
        &self.computed
    }

    /// Number of steps.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    fn count(&mut self, topic: &str, time: Time, add: impl FnOnce(&mut TopicComparison)) {
        if !self.topics.contains_key(topic) {
            self.topics.insert(topic.to_owned(), TopicComparison::default());
        }
        if let Some(comparison) = self.topics.get_mut(topic) {
            let before = comparison.differences();
            add(comparison);
            if comparison.differences() > before {
                comparison.first_s.get_or_insert(time.as_secs_f64());
                comparison.last_s = Some(time.as_secs_f64());
            }
        }
    }

    fn note(&mut self, topic: &str, time: Time, what: &str, fields: Vec<FieldDifference>) {
        if self.first.is_some() || self.pending.is_some() {
            return;
        }
        self.pending = Some(FirstDifference {
            time_s: time.as_secs_f64(),
            step: self.steps,
            topic: topic.to_owned(),
            author: author(topic).to_owned(),
            axes: difference::axes(&fields),
            fields,
            what: what.to_owned(),
            recorded_why: String::new(),
            replayed_why: String::new(),
        });
    }
}

impl Tap for Comparison {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        if !self.computed.contains(topic) {
            return;
        }
        self.replayed.take(message, RawMessage { header, items });
        let recorded = self.expected.get_mut(topic).and_then(VecDeque::pop_front);
        self.judge(time, topic, message, recorded.as_ref(), (header, items));
    }
}
