//! A decision in words.

mod axis;
mod behavior;

use std::fmt;

use serde::Serialize;
use yamabico_core::message::{DecisionHeader, Mode, Process, Proposal, Twist};

use super::told::Told;
use crate::policy::Policy;

/// What is known besides a decision: it makes the words more exact, and none of it is needed.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The newest proposal of each behavior, as far as it was heard.
    pub proposals: Vec<Proposal>,
    /// The processes of plugins.
    pub processes: Vec<Process>,
    /// What each behavior is held to.
    pub terms: Vec<Terms>,
}

/// What a behavior is held to.
#[derive(Clone, Debug, PartialEq)]
pub struct Terms {
    /// Its name.
    pub behavior: String,
    /// Oldest stamp that is heard, seconds.
    pub max_age_s: f64,
    /// Oldest evidence that is heard, seconds.
    pub max_evidence_age_s: f64,
    /// Longest silence, of a critical one, seconds.
    pub deadline_s: Option<f64>,
}

/// A decision in words: what the robot does, an entry for each axis that the drive has, and one for each behavior.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explanation {
    /// What the robot does, and why.
    pub what: String,
    /// The axes.
    pub axes: Vec<AxisWords>,
    /// The behaviors, in the order of the task.
    pub behaviors: Vec<BehaviorWords>,
}

/// One axis in words.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisWords {
    /// Its name.
    pub axis: &'static str,
    /// What the motors get.
    pub commanded: f64,
    /// What the winner asks for.
    pub wanted: f64,
    /// `m/s` or `rad/s`.
    pub unit: &'static str,
    /// From what was asked to what the motors get, step by step.
    pub why: Vec<String>,
}

/// One behavior in words.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BehaviorWords {
    /// Its name.
    pub behavior: String,
    /// Its priority.
    pub priority: i32,
    /// What became of what it says.
    pub outcome: &'static str,
    /// The same in a sentence, with its numbers.
    pub why: String,
    /// What it says itself; empty where it says nothing.
    pub because: String,
    /// What its process went through; empty where that is nothing new.
    pub process: String,
}

/// Explains a decision.
pub fn explain(told: &Told, scene: &Scene) -> Explanation {
    Explanation {
        what: what(told, scene),
        axes: told.header.axes.iter().map(|axis| axis::in_words(&told.header, axis)).collect(),
        behaviors: told.verdicts.iter().map(|verdict| behavior::in_words(told, verdict, scene)).collect(),
    }
}

impl Scene {
    /// The scene of a policy, with what was proposed.
    pub fn of(policy: &Policy, proposals: &[Option<Proposal>]) -> Scene {
        let named = policy.behaviors.iter().zip(proposals);
        let proposals = named
            .filter_map(|(behavior, proposal)| Some(Proposal { behavior: behavior.name, ..(*proposal)? }));
        let terms = policy.behaviors.iter().map(|behavior| Terms {
            behavior: behavior.name.as_str().to_owned(),
            max_age_s: behavior.max_age.as_secs_f64(),
            max_evidence_age_s: behavior.max_evidence_age.as_secs_f64(),
            deadline_s: behavior.critical.then_some(behavior.deadline.as_secs_f64()),
        });
        Scene { proposals: proposals.collect(), processes: Vec::new(), terms: terms.collect() }
    }

    fn terms(&self, behavior: &str) -> Option<&Terms> {
        self.terms.iter().find(|terms| terms.behavior == behavior)
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.what)?;
        for AxisWords { axis, commanded, unit, why, .. } in &self.axes {
            let commanded = axis::speed(*commanded);
            writeln!(f, "  {axis:<8}{commanded:>6} {unit:<6} {}", why.join("; "))?;
        }
        let label = |words: &BehaviorWords| format!("{} ({})", words.behavior, words.priority);
        let widest = self.behaviors.iter().map(|words| label(words).chars().count()).max().unwrap_or(0);
        for words in &self.behaviors {
            write!(f, "  {:<widest$}  {}", label(words), words.why)?;
            if !words.because.is_empty() {
                write!(f, ": {}", words.because)?;
            }
            if !words.process.is_empty() {
                write!(f, "; {}", words.process)?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

fn what(told: &Told, scene: &Scene) -> String {
    let DecisionHeader { note, .. } = &told.header;
    match told.header.mode() {
        Some(Mode::Driving) if note.is_empty() => "driving".to_owned(),
        Some(Mode::Driving) => format!("driving, {note}"),
        Some(Mode::Idle) if told.header.commanded != Twist::ZERO => {
            "coming to rest: nobody wants to drive".to_owned()
        }
        Some(Mode::Idle) => "standing: nobody wants to drive".to_owned(),
        Some(Mode::Halted) => format!("halted: {note}"),
        Some(Mode::CriticalSilent) => critical(told, scene),
        Some(Mode::EmergencyStop) => "emergency stop: latched until `yamabico reset`".to_owned(),
        Some(Mode::ShuttingDown) => "the run ends: the robot is brought to rest".to_owned(),
        None => format!("in a state that this program does not know: {note}"),
    }
}

/// Such as `stopped: sonar-halt is silent, without which the robot must not move (at most 0.30 s)`.
fn critical(told: &Told, scene: &Scene) -> String {
    let note = told.header.note;
    let Some(name) = note.as_str().strip_suffix(" is silent") else { return format!("stopped: {note}") };
    let longest = scene.terms(name).and_then(|terms| terms.deadline_s);
    let longest = longest.map_or(String::new(), |longest| format!(" (for more than {longest:.2} s)"));
    format!("stopped: {note}{longest}, and the robot must not move without it")
}
