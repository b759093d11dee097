//! A decision in words.

use std::fmt;

use yamabico_core::message::{Axis, Kind, Outcome, Reason};

use super::decision::{Decision, Ruling};
use crate::policy::Policy;

/// A decision in words: one line for the mode, one for each axis that the drive has, and one for each behaviour that does
/// not drive all that it claims.
pub fn explain<'a>(policy: &'a Policy, decision: &'a Decision) -> Explanation<'a> {
    Explanation { policy, decision }
}

/// See [`explain`].
#[derive(Clone, Copy, Debug)]
pub struct Explanation<'a> {
    policy: &'a Policy,
    decision: &'a Decision,
}

impl fmt::Display for Explanation<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {}", self.decision.mode, self.decision.stamp)?;
        let note = self.decision.note(self.policy);
        if !note.is_empty() {
            write!(f, ": {note}")?;
        }
        writeln!(f)?;
        for axis in self.policy.axes().iter() {
            self.axis(f, axis)?;
        }
        for (behaviour, ruling) in self.policy.behaviours.iter().zip(&self.decision.rulings) {
            if ruling.outcome != Outcome::Won {
                write!(f, "{}: ", behaviour.name)?;
                self.ruling(f, ruling)?;
                writeln!(f)?;
            }
        }
        Ok(())
    }
}

impl Explanation<'_> {
    /// Such as `linear 0.10 m/s: wall-follower wants 0.40, front-guard allows 0.10`.
    fn axis(&self, f: &mut fmt::Formatter<'_>, axis: Axis) -> fmt::Result {
        let decision = self.decision;
        let i = axis as usize;
        let unit = if axis == Axis::Angular { "rad/s" } else { "m/s" };
        write!(f, "{} {:.2} {unit}: ", axis.as_str(), decision.commanded.get(axis))?;
        match decision.source[i] {
            Some(index) => {
                write!(f, "{} wants {:.2}", self.policy.name(Some(index)), decision.wanted.get(axis))?;
            }
            None => write!(f, "nobody claims it")?,
        }
        if decision.stop.is_some() {
            write!(f, ", the robot is being stopped")?;
        } else if let Some(index) = decision.halted_by[i] {
            write!(f, ", {} halts it", self.policy.name(Some(index)))?;
        } else if let Some((index, limit)) = decision.limited_by[i]
            && decision.wanted.get(axis).abs() > limit
        {
            write!(f, ", {} allows {limit:.2}", self.policy.name(Some(index)))?;
        }
        let allowed = decision.allowed.get(axis);
        if (decision.commanded.get(axis) - allowed).abs() > 0.005 {
            write!(f, ", on the ramp to {allowed:.2}")?;
        }
        writeln!(f)
    }

    /// Such as `out-ranked by sonar-halt on linear+angular`.
    fn ruling(&self, f: &mut fmt::Formatter<'_>, ruling: &Ruling) -> fmt::Result {
        let by = self.policy.name(ruling.by);
        match ruling.outcome {
            Outcome::Silent => return f.write_str("nothing heard"),
            Outcome::Abstained | Outcome::Disabled => write!(f, "{}", ruling.outcome)?,
            Outcome::Stale | Outcome::StaleEvidence => {
                write!(f, "{}, {:.2} s old", ruling.outcome, ruling.number)?;
            }
            Outcome::FromTheFuture => write!(f, "{:.3} s {}", -ruling.number, ruling.outcome)?,
            Outcome::Malformed => write!(f, "{}", ruling.outcome)?,
            Outcome::OutRanked if ruling.by.is_none() => f.write_str("claims no axis that the drive has")?,
            Outcome::GaveUp if ruling.by.is_none() => {
                f.write_str("gave up, the drive cannot move as it asks")?;
            }
            Outcome::Limiting | Outcome::LimitElsewhere => {
                write!(f, "{}, {} to {:.2}", ruling.outcome, ruling.claimed, ruling.number)?;
            }
            Outcome::Halting | Outcome::Held => write!(f, "{} on {}", ruling.outcome, ruling.claimed)?,
            Outcome::WonPart | Outcome::Blended => write!(f, "{}, {}", ruling.outcome, ruling.won)?,
            outcome => write!(f, "{outcome} on {}", ruling.claimed)?,
        }
        if !by.is_empty() {
            write!(f, ", by {by}")?;
        }
        if let Some(fault) = ruling.fault
            && fault != ruling.outcome
            && ruling.outcome != Outcome::Held
        {
            let kind = Kind::from_code(ruling.kind).map_or("proposal", Kind::as_str);
            write!(f, ", its {kind} is {fault} and counts all the same")?;
        }
        if let (Outcome::Held, Some(fault)) = (ruling.outcome, ruling.fault) {
            write!(f, ", its newest proposal is {fault}")?;
        }
        match Reason::from_code(ruling.reason) {
            None | Some(Reason::None | Reason::Nominal) => Ok(()),
            Some(reason) => write!(f, " ({reason})"),
        }
    }
}
