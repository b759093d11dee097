//! The situation of the robot by the arbiter's last decision.

use yamabico_core::message::{Axes, DecisionHeader, Kind, Mode, Name, Outcome, Reason, Verdict, View};

/// Speed of a wish below which it counts as standing, m/s.
const STANDING_MPS: f64 = 0.02;
/// Turn rate of a wish below which it counts as standing, rad/s.
const STANDING_RADPS: f64 = 0.05;

/// Motion that the other behaviors ask for, and their halts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Situation {
    /// True if another behavior asks for motion, or abstains only because it does not see or recognize enough.
    pub wants_to_drive: bool,
    /// True if a behavior of higher priority drives, or an emergency stops the robot.
    pub is_overruled: bool,
    /// True if a halt stops the translation.
    pub is_held: bool,
    /// True if a halt stops turning alone.
    pub is_turn_held: bool,
    /// Author of a halt of every axis that the drive has; none if an axis is free.
    pub halter: Option<Name>,
}

impl Situation {
    /// Reads a decision for the behavior `own`.
    #[must_use]
    pub fn of(decision: &View<'_, DecisionHeader>, own: &Name) -> Self {
        let header = decision.header;
        let others = || decision.items.iter().filter(|verdict| verdict.behavior != *own);
        let own_verdict = decision.items.iter().find(|verdict| verdict.behavior == *own);
        let outranks = |verdict: &&Verdict| own_verdict.is_some_and(|own| verdict.priority > own.priority);
        let drives = |verdict: &&Verdict| header.source.contains(&verdict.behavior);
        let is_overruled = others().filter(drives).any(|verdict| outranks(&verdict))
            || !matches!(header.mode(), Some(Mode::Driving | Mode::Idle | Mode::Halted));
        // While the behavior drives itself, the wish is its own: then any drive of another counts.
        let moves = if own_verdict.is_some_and(is_drive) {
            others().any(is_drive)
        } else {
            header.wished.speed() > STANDING_MPS || header.wished.angular.abs() > STANDING_RADPS
        };
        let is_blocked = others().any(|verdict| is_drive(verdict) && is(verdict, Reason::PassageBlocked));
        // One that searches stands between two looks.
        let searches = others().any(|verdict| is_drive(verdict) && is(verdict, Reason::Searching));
        let has_doubts = !others().any(is_drive) && others().any(doubts);
        let halted = header.halted.intersection(header.axes);
        let stops_all = !header.axes.is_empty() && header.axes.without(halted).is_empty();
        let halters = header.halter.iter().find(|name| !name.is_empty());
        Self {
            wants_to_drive: moves || is_blocked || searches || has_doubts,
            is_overruled,
            is_held: !halted.without(Axes::ANGULAR).is_empty(),
            is_turn_held: !halted.is_empty() && halted.without(Axes::ANGULAR).is_empty(),
            halter: halters.copied().filter(|_| stops_all),
        }
    }
}

fn is(verdict: &Verdict, reason: Reason) -> bool {
    verdict.reason == reason.code()
}

/// Returns true if the behavior proposes to drive, and the proposal is not refused as stale or malformed.
fn is_drive(verdict: &Verdict) -> bool {
    verdict.kind == Kind::Drive.code() && verdict.claimed != Axes::NONE && verdict.fault == 0
}

/// Returns true if the behavior abstains because it does not see or recognize enough, or waits for a way to become free.
fn doubts(verdict: &Verdict) -> bool {
    let is_perception = verdict.reason >= Reason::TooFewSegments.code() || is(verdict, Reason::Searching);
    is_perception && matches!(verdict.outcome(), Some(Outcome::Abstained | Outcome::Halting))
}
