//! Beginning of a recording that a replay passes over: what the behaviors need of it to continue.

use std::collections::BTreeMap;

use yamabico_core::message::{Message, Proposal, SavedStateHeader, View};
use yamabico_host::topics;

use super::steps::{RecordedMessage, Step, raw};
use crate::execution::{Life, Plan};

/// State of the recording before the replay of the behaviors begins.
#[derive(Default)]
pub(super) struct Prelude {
    lives: BTreeMap<String, Life>,
    /// Newest message on each topic that is an input of a behavior.
    newest: BTreeMap<String, Option<RecordedMessage>>,
}

impl Prelude {
    /// A prelude to the behaviors of `plan`, of which nothing has been read.
    pub fn new(plan: &Plan) -> Prelude {
        let name = |behavior: &yamabico_host::BehaviorPlan| (behavior.setup.name.clone(), Life::default());
        let inputs = plan.behaviors.iter().flat_map(|behavior| &behavior.inputs);
        // The arbiter is replayed, and publishes these itself.
        let inputs =
            inputs.filter(|(_, topic, _)| ![topics::DECISION, topics::GOAL].contains(&topic.as_str()));
        Prelude {
            lives: plan.behaviors.iter().map(name).collect(),
            newest: inputs.map(|(_, topic, _)| (topic.clone(), None)).collect(),
        }
    }

    /// Takes in a recorded message.
    pub fn take(&mut self, message: &RecordedMessage) {
        match message.message.name {
            Proposal::NAME => {
                let Some(View { header, .. }) = View::<Proposal>::of(raw(message)) else { return };
                if let Some(life) = self.lives.get_mut(header.behavior.as_str()) {
                    life.sequence = header.sequence;
                }
            }
            SavedStateHeader::NAME => {
                let Some(View { header, items }) = View::<SavedStateHeader>::of(raw(message)) else { return };
                if let Some(life) = self.lives.get_mut(header.plugin.as_str()) {
                    items.clone_into(&mut life.saved_state);
                }
            }
            _ => {}
        }
        if let Some(newest) = self.newest.get_mut(&message.topic) {
            *newest = Some(message.clone());
        }
    }

    /// Lives of the behaviors so far.
    pub fn lives(&self) -> &BTreeMap<String, Life> {
        &self.lives
    }

    /// Takes out the lives of the behaviors that propose in a step.
    pub fn take_lives(&mut self, step: &Step) -> BTreeMap<String, Life> {
        let proposals = step.messages.iter().filter(|message| message.message.name == Proposal::NAME);
        let names = proposals.filter_map(|message| Some(View::<Proposal>::of(raw(message))?.header.behavior));
        names.filter_map(|name| self.lives.remove_entry(name.as_str())).collect()
    }

    /// Newest messages that are inputs of behaviors.
    pub fn newest(&self) -> impl Iterator<Item = &RecordedMessage> {
        self.newest.values().flatten()
    }

    /// Memory with which each behavior begins.
    pub fn memories(&self) -> BTreeMap<String, Memory> {
        let memory = |life: &Life| match (life.sequence, life.saved_state.is_empty()) {
            (0, _) => Memory::NotNeeded,
            (_, true) => Memory::None,
            (_, false) => Memory::Restored,
        };
        self.lives.iter().map(|(name, life)| (name.clone(), memory(life))).collect()
    }
}

/// Memory with which a behavior begins in the middle of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Memory {
    /// It had not proposed before.
    NotNeeded,
    /// It had saved no state.
    None,
    /// The state that it had saved last.
    Restored,
}
