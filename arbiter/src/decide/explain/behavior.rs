//! Explains the verdict on one behavior.

use yamabico_core::message::{
    Axes, Axis, DecisionHeader, Kind, Outcome, Process, ProcessState, Reason, Twist, Verdict,
};

use super::axis::speed;
use super::{BehaviorExplanation, DecisionMessage, ExplainContext};

/// Time after which the end of a process that is up again is no longer reported, s.
const NEWS_S: f64 = 10.0;

pub(super) fn explain_behavior(
    message: &DecisionMessage,
    verdict: &Verdict,
    context: &ExplainContext,
) -> BehaviorExplanation {
    let name = verdict.behavior.as_str();
    let process = context.processes.iter().find(|process| process.plugin == verdict.behavior);
    BehaviorExplanation {
        behavior: name.to_owned(),
        priority: verdict.priority,
        outcome: verdict.outcome().map_or("unknown", Outcome::as_str),
        why: why(message, verdict, context),
        because: because(verdict, context),
        process: process.map_or_else(String::new, |process| process_history(process, &message.header)),
    }
}

fn why(message: &DecisionMessage, verdict: &Verdict, context: &ExplainContext) -> String {
    let Verdict { by, claimed, won, number, behavior, .. } = verdict;
    let name = behavior.as_str();
    let axes = *claimed;
    let Some(outcome) = verdict.outcome() else {
        return "unknown outcome: build this program and the robot from one version".into();
    };
    let terms = context.terms(name);
    match outcome {
        Outcome::Silent => "no proposal yet".to_owned(),
        Outcome::Abstained => "abstains".to_owned(),
        Outcome::Won => format!("drives {won}"),
        Outcome::WonPart => {
            format!("drives {won}, but not {}{}", axes.without(*won), winner(message, verdict))
        }
        Outcome::Blended => format!("drives {won}, blended with behaviors of equal priority"),
        Outcome::Limiting => format!("limits {}{}", limit(axes, *number), fault(verdict)),
        Outcome::LimitElsewhere => {
            format!(
                "limits {}, but the robot moves outside its sector{}",
                limit(axes, *number),
                fault(verdict)
            )
        }
        Outcome::Halting => format!("halts {axes}{}", fault(verdict)),
        Outcome::Held => held(verdict),
        Outcome::Disabled => format!("disabled: enable it with `yamabico enable {name}`"),
        Outcome::Stale => {
            let max = terms.map_or(String::new(), |terms| format!(", maximum {:.2} s", terms.max_age_s));
            format!("ignored, because its last proposal is {number:.2} s old{max}")
        }
        Outcome::StaleEvidence => {
            let max =
                terms.map_or(String::new(), |terms| format!(", maximum {:.2} s", terms.max_evidence_age_s));
            format!("ignored, because its sensor data is {number:.2} s old{max}")
        }
        Outcome::FromTheFuture => format!("ignored, because its stamp is {:.3} s in the future", -number),
        Outcome::Malformed => "ignored, because its proposal is malformed".to_owned(),
        Outcome::Inhibited => format!("inhibited by {by}{}", remaining(verdict)),
        Outcome::Suppressed => format!("suppressed by {by} on {axes}{}", remaining(verdict)),
        Outcome::Outranked if by.is_empty() => "claims no axis that the drive has".to_owned(),
        Outcome::Outranked => format!("outranked on {axes}{}", winner(message, verdict)),
        Outcome::GaveUp if by.is_empty() => {
            "gives up, because the drive lacks an axis that it needs".to_owned()
        }
        Outcome::GaveUp => {
            let restrains = |outcome| matches!(outcome, Outcome::Halting | Outcome::Held);
            let is_halt = message.verdict(by.as_str()).and_then(Verdict::outcome).is_some_and(restrains);
            let how = if is_halt { "halted" } else { "taken" };
            format!("gives up {axes}, because one axis is {how}{}", winner(message, verdict))
        }
        Outcome::Waiting => format!("waits to take over from {by}{}", remaining(verdict)),
        Outcome::Stopped if by.is_empty() => format!("would drive {axes}, but the whole robot is stopped"),
        Outcome::Stopped => format!("would drive {axes}, but is stopped by {by}"),
    }
}

/// Such as ` by sonar-halt (100)`.
fn winner(message: &DecisionMessage, verdict: &Verdict) -> String {
    let by = verdict.by.as_str();
    if by.is_empty() {
        return String::new();
    }
    let priority = message.verdict(by).map_or(String::new(), |winner| format!(" ({})", winner.priority));
    format!(" by {by}{priority}")
}

/// Such as `linear to 0.20 m/s`.
fn limit(axes: Axes, limit: f64) -> String {
    let unit = if axes == Axes::from(Axis::Angular) { "rad/s" } else { "m/s" };
    format!("{axes} to {limit:.2} {unit}")
}

/// Such as `its halt of linear stays in force for another 0.31 s, its last proposal is stale`.
fn held(verdict: &Verdict) -> String {
    let kind = Kind::from_code(verdict.kind).filter(|kind| matches!(kind, Kind::Halt | Kind::Limit));
    let kind = kind.map_or("halt", Kind::as_str);
    let how_long = match verdict.left_s {
        left_s if left_s < 0.0 => "until it proposes again".to_owned(),
        left_s => format!("for another {left_s:.2} s"),
    };
    let fault = match Outcome::from_code(verdict.fault) {
        None | Some(Outcome::Silent) => String::new(),
        Some(Outcome::Disabled) => ", although it is disabled".to_owned(),
        Some(fault) => format!(", its last proposal is {fault}"),
    };
    format!("its {kind} of {} stays in force {how_long}{fault}", verdict.claimed)
}

/// Such as `, which counts although it is stale`, of a faulty halt or limit; empty without a fault.
fn fault(verdict: &Verdict) -> String {
    match Outcome::from_code(verdict.fault) {
        None | Some(Outcome::Silent) => String::new(),
        Some(fault) => format!(", which counts although it is {fault}"),
    }
}

fn remaining(verdict: &Verdict) -> String {
    if verdict.left_s > 0.0 { format!(", for another {:.2} s", verdict.left_s) } else { String::new() }
}

/// Motion that the behavior asks for without driving, and its note, or else its reason.
fn because(verdict: &Verdict, context: &ExplainContext) -> String {
    if matches!(verdict.outcome(), Some(Outcome::Disabled | Outcome::Malformed | Outcome::Stale)) {
        return String::new();
    }
    let proposal = context.proposals.iter().find(|proposal| proposal.behavior == verdict.behavior);
    let proposal = proposal.filter(|proposal| proposal.reason == verdict.reason);
    let note = proposal.map(|proposal| proposal.note).filter(|note| !note.is_empty());
    let reason = match (note, Reason::from_code(verdict.reason)) {
        (Some(note), _) => note.as_str().to_owned(),
        (None, None | Some(Reason::None | Reason::Nominal)) => String::new(),
        (None, Some(reason)) => reason.as_str().to_owned(),
    };
    let lost = proposal.filter(|proposal| proposal.kind() == Some(Kind::Drive) && verdict.won.is_empty());
    let request = lost.map(|proposal| request(proposal.axes, &proposal.twist));
    request.into_iter().chain(Some(reason).filter(|reason| !reason.is_empty())).collect::<Vec<_>>().join("; ")
}

/// Such as `asks for 0.40 m/s, 0.03 rad/s`.
fn request(axes: Axes, twist: &Twist) -> String {
    let of_axis = |axis: Axis| {
        let unit = if axis == Axis::Angular { "rad/s" } else { "m/s" };
        format!("{} {unit}", speed(twist.get(axis)))
    };
    format!("asks for {}", axes.iter().map(of_axis).collect::<Vec<_>>().join(", "))
}

/// Such as `its process was killed by signal 9 0.34 s ago; it is starting, restarted 2 times`.
fn process_history(process: &Process, now: &DecisionHeader) -> String {
    let ago_s = now.stamp_ns.saturating_sub(process.ended_ns) as f64 * 1e-9;
    let state = process.state().unwrap_or(ProcessState::Running);
    let dead = !process.ended.is_empty();
    if !dead || (state == ProcessState::Running && ago_s > NEWS_S) {
        return String::new();
    }
    let since = match state {
        ProcessState::Waiting => {
            let in_s = process.due_ns.saturating_sub(now.stamp_ns) as f64 * 1e-9;
            format!("it restarts in {in_s:.2} s")
        }
        ProcessState::Starting => "it is starting".to_owned(),
        ProcessState::Running => "it is running again".to_owned(),
        ProcessState::Ended => "it stays down".to_owned(),
    };
    let times = match process.restarts {
        0 => String::new(),
        1 => ", restarted once".to_owned(),
        times => format!(", restarted {times} times"),
    };
    format!("its process {} {ago_s:.2} s ago; {since}{times}", process.ended)
}
