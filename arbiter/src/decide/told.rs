//! A decision as it traveled.

use yamabico_core::message::{DecisionHeader, Verdict};

use super::decision::Decision;
use crate::policy::Policy;

/// A decision with its verdicts, as everybody on the bus hears it.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// The decision.
    pub header: DecisionHeader,
    /// What became of each behavior.
    pub verdicts: Vec<Verdict>,
}

impl Told {
    /// `decision` as it travels.
    pub fn of(policy: &Policy, decision: &Decision) -> Told {
        let mut verdicts = vec![Verdict::default(); policy.behaviors.len()];
        let count = decision.write_verdicts(policy, &mut verdicts);
        verdicts.truncate(count);
        Told { header: decision.header(policy), verdicts }
    }

    /// What became of the behavior `name`; `None` where the robot has none of this name.
    pub fn verdict(&self, name: &str) -> Option<&Verdict> {
        self.verdicts.iter().find(|verdict| verdict.behavior.as_str() == name)
    }
}
