//! Recorded and replayed messages side by side.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use serde::Serialize;
use yamabico_arbiter::decide::{DecisionMessage, ExplainContext, explain};
use yamabico_core::message::{DecisionHeader, Message, MessageType, Proposal, RawMessage, View};
use yamabico_core::time::Time;

use super::difference::{self, FieldDifference, author};
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
            steps: 0,
        }
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
            let before = comparison.different + comparison.missing + comparison.extra;
            add(comparison);
            if before == 0 && comparison.different + comparison.missing + comparison.extra > 0 {
                comparison.first_s = Some(time.as_secs_f64());
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
