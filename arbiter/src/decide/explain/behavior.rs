//! What became of one behavior, and why.

use yamabico_core::message::{
    Axes, Axis, DecisionHeader, Kind, Outcome, Process, ProcessState, Reason, Twist, Verdict,
};

use super::axis::speed;
use super::{BehaviorWords, Scene, Told};

/// A death is news for so long, seconds.
const NEWS_S: f64 = 10.0;

pub(super) fn in_words(told: &Told, verdict: &Verdict, scene: &Scene) -> BehaviorWords {
    let name = verdict.behavior.as_str();
    let process = scene.processes.iter().find(|process| process.plugin == verdict.behavior);
    BehaviorWords {
        behavior: name.to_owned(),
        priority: verdict.priority,
        outcome: verdict.outcome().map_or("unknown", Outcome::as_str),
        why: why(told, verdict, scene),
        because: because(verdict, scene),
        process: process.map_or_else(String::new, |process| fate(process, &told.header)),
    }
}

fn why(told: &Told, verdict: &Verdict, scene: &Scene) -> String {
    let Verdict { by, claimed, won, number, behavior, .. } = verdict;
    let name = behavior.as_str();
    let axes = *claimed;
    let Some(outcome) = verdict.outcome() else { return "an outcome that this program does not know".into() };
    let terms = scene.terms(name);
    match outcome {
        Outcome::Silent => "has not said anything yet".to_owned(),
        Outcome::Abstained => "abstains".to_owned(),
        Outcome::Won => format!("drives {won}"),
        Outcome::WonPart => format!("drives {won}, but not {}{}", axes.without(*won), rival(told, verdict)),
        Outcome::Blended => format!("drives {won}, blended with its equals"),
        Outcome::Limiting => format!("limits {}{}", limit(axes, *number), faulty(verdict)),
        Outcome::LimitElsewhere => {
            format!("limits {}, but not where the robot goes{}", limit(axes, *number), faulty(verdict))
        }
        Outcome::Halting => format!("halts {axes}{}", faulty(verdict)),
        Outcome::Held => held(verdict),
        Outcome::Disabled => format!("disabled: not heard until `yamabico enable {name}`"),
        Outcome::Stale => {
            let most = terms.map_or(String::new(), |terms| format!(", at most {:.2}", terms.max_age_s));
            format!("not heard, its last word is {number:.2} s old{most}")
        }
        Outcome::StaleEvidence => {
            let most =
                terms.map_or(String::new(), |terms| format!(", at most {:.2}", terms.max_evidence_age_s));
            format!("not heard, what it goes by is {number:.2} s old{most}")
        }
        Outcome::FromTheFuture => format!("not heard, stamped {:.3} s in the future", -number),
        Outcome::Malformed => "not heard, its numbers make no sense".to_owned(),
        Outcome::Inhibited => format!("inhibited by {by}{}", left(verdict)),
        Outcome::Suppressed => format!("suppressed by {by} on {axes}{}", left(verdict)),
        Outcome::OutRanked if by.is_empty() => "claims no axis that the drive has".to_owned(),
        Outcome::OutRanked => format!("out-ranked on {axes}{}", rival(told, verdict)),
        Outcome::GaveUp if by.is_empty() => "gives up: the drive cannot move as it asks".to_owned(),
        Outcome::GaveUp => {
            let restrains = |outcome| matches!(outcome, Outcome::Halting | Outcome::Held);
            let is_halt = told.verdict(by.as_str()).and_then(Verdict::outcome).is_some_and(restrains);
            let how = if is_halt { "halted" } else { "taken" };
            format!("gives up {axes}: a part of it is {how}{}", rival(told, verdict))
        }
        Outcome::Waiting => format!("waits to take over from {by}{}", left(verdict)),
        Outcome::Stopped if by.is_empty() => format!("would drive {axes}, stopped with the whole robot"),
        Outcome::Stopped => format!("would drive {axes}, stopped by {by}"),
    }
}

/// Such as ` by sonar-halt (100)`.
fn rival(told: &Told, verdict: &Verdict) -> String {
    let by = verdict.by.as_str();
    if by.is_empty() {
        return String::new();
    }
    let priority = told.verdict(by).map_or(String::new(), |rival| format!(" ({})", rival.priority));
    format!(" by {by}{priority}")
}

/// Such as `linear to 0.20 m/s`.
fn limit(axes: Axes, least: f64) -> String {
    let unit = if axes == Axes::from(Axis::Angular) { "rad/s" } else { "m/s" };
    format!("{axes} to {least:.2} {unit}")
}

/// Such as `its halt of linear stays in force for another 0.31 s, its last word is stale`.
fn held(verdict: &Verdict) -> String {
    let kind = Kind::from_code(verdict.kind).filter(|kind| matches!(kind, Kind::Halt | Kind::Limit));
    let kind = kind.map_or("halt", Kind::as_str);
    let how_long = match verdict.left_s {
        left_s if left_s < 0.0 => "until it is back".to_owned(),
        left_s => format!("for another {left_s:.2} s"),
    };
    let word = match Outcome::from_code(verdict.fault) {
        None | Some(Outcome::Silent) => String::new(),
        Some(Outcome::Disabled) => ", though it is disabled".to_owned(),
        Some(fault) => format!(", its last word is {fault}"),
    };
    format!("its {kind} of {} stays in force {how_long}{word}", verdict.claimed)
}

/// Of a halt or limit whose author's newest word does not do.
fn faulty(verdict: &Verdict) -> String {
    match Outcome::from_code(verdict.fault) {
        None | Some(Outcome::Silent) => String::new(),
        Some(fault) => format!(", which counts though it is {fault}"),
    }
}

fn left(verdict: &Verdict) -> String {
    if verdict.left_s > 0.0 { format!(", for another {:.2} s", verdict.left_s) } else { String::new() }
}

/// What the behavior itself says: what it asks for in vain, and its note, or else its reason.
fn because(verdict: &Verdict, scene: &Scene) -> String {
    if matches!(verdict.outcome(), Some(Outcome::Disabled | Outcome::Malformed | Outcome::Stale)) {
        return String::new();
    }
    let proposal = scene.proposals.iter().find(|proposal| proposal.behavior == verdict.behavior);
    let proposal = proposal.filter(|proposal| proposal.reason == verdict.reason);
    let note = proposal.map(|proposal| proposal.note).filter(|note| !note.is_empty());
    let said = match (note, Reason::from_code(verdict.reason)) {
        (Some(note), _) => note.as_str().to_owned(),
        (None, None | Some(Reason::None | Reason::Nominal)) => String::new(),
        (None, Some(reason)) => reason.as_str().to_owned(),
    };
    let in_vain = proposal.filter(|proposal| proposal.kind() == Some(Kind::Drive) && verdict.won.is_empty());
    let asked = in_vain.map(|proposal| asked(proposal.axes, &proposal.twist));
    asked.into_iter().chain(Some(said).filter(|said| !said.is_empty())).collect::<Vec<_>>().join("; ")
}

/// Such as `asks for 0.40 m/s, 0.03 rad/s`.
fn asked(axes: Axes, twist: &Twist) -> String {
    let of_axis = |axis: Axis| {
        let unit = if axis == Axis::Angular { "rad/s" } else { "m/s" };
        format!("{} {unit}", speed(twist.get(axis)))
    };
    format!("asks for {}", axes.iter().map(of_axis).collect::<Vec<_>>().join(", "))
}

/// What its process went through of late.
fn fate(process: &Process, now: &DecisionHeader) -> String {
    let ago_s = now.stamp_ns.saturating_sub(process.ended_ns) as f64 * 1e-9;
    let state = process.state().unwrap_or(ProcessState::Up);
    let dead = !process.ended.is_empty();
    if !dead || (state == ProcessState::Up && ago_s > NEWS_S) {
        return String::new();
    }
    let since = match state {
        ProcessState::Due => {
            let in_s = process.due_ns.saturating_sub(now.stamp_ns) as f64 * 1e-9;
            format!("it is started again in {in_s:.2} s")
        }
        ProcessState::ComingUp => "it comes up again".to_owned(),
        ProcessState::Up => "it is up again".to_owned(),
        ProcessState::Ended => "it stays out".to_owned(),
    };
    let times = match process.restarts {
        0 => String::new(),
        1 => ", started again once".to_owned(),
        times => format!(", started again {times} times"),
    };
    format!("its process {} {ago_s:.2} s ago; {since}{times}", process.ended)
}
