//! A decision in the form of messages.

use yamabico_core::message::{DecisionHeader, Verdict};

use super::decision::Decision;
use crate::policy::Policy;

/// A decision with its verdicts, as published on the bus.
#[derive(Clone, Debug, PartialEq)]
pub struct DecisionMessage {
    /// The decision without its verdicts.
    pub header: DecisionHeader,
    /// Verdict on each behavior.
    pub verdicts: Vec<Verdict>,
}

impl DecisionMessage {
    /// Converts `decision` to a message.
    pub fn new(policy: &Policy, decision: &Decision) -> DecisionMessage {
        let mut verdicts = vec![Verdict::default(); policy.behaviors.len()];
        let count = decision.write_verdicts(policy, &mut verdicts);
        verdicts.truncate(count);
        DecisionMessage { header: decision.header(policy), verdicts }
    }

    /// Verdict on the behavior `name`; `None` if the robot has no such behavior.
    pub fn verdict(&self, name: &str) -> Option<&Verdict> {
        self.verdicts.iter().find(|verdict| verdict.behavior.as_str() == name)
    }
}
