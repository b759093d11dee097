//! Explanation of a decision in plain English.

mod axis;
mod behavior;

use std::fmt;

use serde::Serialize;
use yamabico_core::message::{DecisionHeader, Mode, Process, Proposal, Twist};

use super::decision_message::DecisionMessage;
use crate::policy::Policy;

/// Context of a decision: makes its explanation more exact; none of it is required.
#[derive(Clone, Debug, Default)]
pub struct ExplainContext {
    /// Newest proposal of each behavior, if one was received.
    pub proposals: Vec<Proposal>,
    /// Processes of plugins.
    pub processes: Vec<Process>,
    /// Maximum ages and deadline of each behavior.
    pub terms: Vec<ProposalTerms>,
}

/// Maximum ages and deadline of one behavior.
#[derive(Clone, Debug, PartialEq)]
pub struct ProposalTerms {
    /// Name of the behavior.
    pub behavior: String,
    /// Maximum age of a proposal's stamp, s.
    pub max_age_s: f64,
    /// Maximum age of a proposal's evidence, s.
    pub max_evidence_age_s: f64,
    /// Maximum silence of a critical behavior, s; `None` if it is not critical.
    pub deadline_s: Option<f64>,
}

/// An explained decision: what the robot does, an entry for each axis of the drive, and one for each behavior.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explanation {
    /// Mode of the robot and its cause.
    pub what: String,
    /// Axes of the drive.
    pub axes: Vec<AxisExplanation>,
    /// Behaviors in the order of the task.
    pub behaviors: Vec<BehaviorExplanation>,
}

/// Explanation of one axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisExplanation {
    /// Name of the axis.
    pub axis: &'static str,
    /// Commanded speed.
    pub commanded: f64,
    /// Speed that the winner asks for.
    pub wanted: f64,
    /// Unit of the speeds: `m/s` or `rad/s`.
    pub unit: &'static str,
    /// Steps from the proposed to the commanded speed.
    pub why: Vec<String>,
}

/// Explanation of one behavior's verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BehaviorExplanation {
    /// Name of the behavior.
    pub behavior: String,
    /// Priority.
    pub priority: i32,
    /// Outcome of its newest proposal.
    pub outcome: &'static str,
    /// Outcome as a sentence, with its numbers.
    pub why: String,
    /// Reason or note of the behavior itself; empty if it gives none.
    pub because: String,
    /// Recent end or restart of its process; empty if there was none.
    pub process: String,
}

/// Explains a decision; `context` makes the explanation more exact.
pub fn explain(message: &DecisionMessage, context: &ExplainContext) -> Explanation {
    Explanation {
        what: headline(message, context),
        axes: message.header.axes.iter().map(|axis| axis::explain_axis(&message.header, axis)).collect(),
        behaviors: message
            .verdicts
            .iter()
            .map(|verdict| behavior::explain_behavior(message, verdict, context))
            .collect(),
    }
}

impl ExplainContext {
    /// Context of a policy with the newest proposals, without processes.
    pub fn of(policy: &Policy, proposals: &[Option<Proposal>]) -> ExplainContext {
        let named = policy.behaviors.iter().zip(proposals);
        let proposals = named
            .filter_map(|(behavior, proposal)| Some(Proposal { behavior: behavior.name, ..(*proposal)? }));
        let terms = policy.behaviors.iter().map(|behavior| ProposalTerms {
            behavior: behavior.name.as_str().to_owned(),
            max_age_s: behavior.max_age.as_secs_f64(),
            max_evidence_age_s: behavior.max_evidence_age.as_secs_f64(),
            deadline_s: behavior.critical.then_some(behavior.deadline.as_secs_f64()),
        });
        ExplainContext { proposals: proposals.collect(), processes: Vec::new(), terms: terms.collect() }
    }

    fn terms(&self, behavior: &str) -> Option<&ProposalTerms> {
        self.terms.iter().find(|terms| terms.behavior == behavior)
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.what)?;
        for AxisExplanation { axis, commanded, unit, why, .. } in &self.axes {
            let commanded = axis::speed(*commanded);
            writeln!(f, "  {axis:<8}{commanded:>6} {unit:<6} {}", why.join("; "))?;
        }
        let label = |entry: &BehaviorExplanation| format!("{} ({})", entry.behavior, entry.priority);
        let widest = self.behaviors.iter().map(|entry| label(entry).chars().count()).max().unwrap_or(0);
        for entry in &self.behaviors {
            write!(f, "  {:<widest$}  {}", label(entry), entry.why)?;
            if !entry.because.is_empty() {
                write!(f, ": {}", entry.because)?;
            }
            if !entry.process.is_empty() {
                write!(f, "; {}", entry.process)?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

fn headline(message: &DecisionMessage, context: &ExplainContext) -> String {
    let DecisionHeader { note, .. } = &message.header;
    match message.header.mode() {
        Some(Mode::Driving) if note.is_empty() => "driving".to_owned(),
        Some(Mode::Driving) => format!("driving, {note}"),
        Some(Mode::Idle) if message.header.commanded != Twist::ZERO => {
            "slowing to a stop: no behavior drives".to_owned()
        }
        Some(Mode::Idle) => "standing: no behavior drives".to_owned(),
        Some(Mode::Halted) => format!("halted: {note}"),
        Some(Mode::CriticalSilent) => critical(message, context),
        Some(Mode::EmergencyStop) => "emergency stop: latched until `yamabico reset`".to_owned(),
        Some(Mode::ShuttingDown) => "stopping: the run ends".to_owned(),
        None => format!("unknown mode ({note}): build this program and the robot from one version"),
    }
}

/// Such as `stopped: sonar-halt is silent for more than 0.30 s, and it is critical`.
fn critical(message: &DecisionMessage, context: &ExplainContext) -> String {
    let note = message.header.note;
    let Some(name) = note.as_str().strip_suffix(" is silent") else { return format!("stopped: {note}") };
    let deadline = context.terms(name).and_then(|terms| terms.deadline_s);
    let deadline = deadline.map_or(String::new(), |deadline| format!(" for more than {deadline:.2} s"));
    format!("stopped: {note}{deadline}, and it is critical")
}
