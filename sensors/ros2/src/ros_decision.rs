//! Decisions of the arbiter as diagnostics and as JSON.

use serde_json::{Value, json};
use yamabico_core::geometry::{Axis, Twist};
use yamabico_core::message::{DecisionHeader, Kind, Mode, Name, Outcome, Reason, Verdict};

use crate::message::{DiagnosticArray, DiagnosticStatus, Header, Level};

/// Returns the state of the arbiter, and of each behavior, as `/diagnostics` shows them.
#[must_use]
pub fn diagnostics(
    decision: &DecisionHeader,
    verdicts: &[Verdict],
    robot: &str,
    header: Header,
) -> DiagnosticArray {
    let arbiter = DiagnosticStatus::new(
        level(decision),
        format!("{robot}: arbiter"),
        summary(decision),
        robot,
        [("wanted", &decision.wanted), ("allowed", &decision.allowed), ("commanded", &decision.commanded)]
            .map(|(name, twist)| (name.to_owned(), twist_text(twist)))
            .to_vec(),
    );
    let behaviors = verdicts.iter().map(|verdict| {
        let fault = Outcome::from_code(verdict.fault).filter(|_| verdict.fault != 0);
        let level = if fault.is_some() || is_faulty(verdict) { Level::Warn } else { Level::Ok };
        let mut values = vec![
            ("priority".to_owned(), verdict.priority.to_string()),
            ("claimed".to_owned(), verdict.claimed.to_string()),
            ("won".to_owned(), verdict.won.to_string()),
        ];
        values.extend(fault.map(|fault| ("fault".to_owned(), fault.to_string())));
        DiagnosticStatus::new(
            level,
            format!("{robot}: {}", verdict.behavior.as_str()),
            text(verdict),
            robot,
            values,
        )
    });
    DiagnosticArray { header, status: std::iter::once(arbiter).chain(behaviors).collect() }
}

/// Returns a decision as one line of JSON, with the texts in place of the codes.
#[must_use]
pub fn json(decision: &DecisionHeader, verdicts: &[Verdict]) -> String {
    let behavior = |verdict: &Verdict| {
        json!({
            "name": verdict.behavior.as_str(),
            "priority": verdict.priority,
            "kind": Kind::from_code(verdict.kind).map(Kind::as_str),
            "outcome": verdict.outcome().map(Outcome::as_str),
            "by": named(verdict.by.as_str()),
            "reason": Reason::from_code(verdict.reason).map(Reason::as_str),
            "claimed": verdict.claimed.to_string(),
            "won": verdict.won.to_string(),
            "number": verdict.number,
        })
    };
    let names = |names: &[yamabico_core::message::Name; 3]| {
        Axis::ALL
            .map(|axis| (axis.as_str().to_owned(), named(names[axis as usize].as_str())))
            .into_iter()
            .collect::<serde_json::Map<_, _>>()
    };
    json!({
        "sequence": decision.sequence,
        "mode": decision.mode().map(Mode::as_str),
        "note": decision.note.as_str(),
        "drives": names(&decision.source),
        "limits": names(&decision.limiter),
        "halts": names(&decision.halter),
        "wanted": twist_json(&decision.wanted),
        "allowed": twist_json(&decision.allowed),
        "commanded": twist_json(&decision.commanded),
        "behaviors": verdicts.iter().map(behavior).collect::<Vec<_>>(),
    })
    .to_string()
}

fn level(decision: &DecisionHeader) -> Level {
    match decision.mode() {
        Some(Mode::Driving | Mode::Idle) => Level::Ok,
        Some(Mode::Halted | Mode::ShuttingDown) => Level::Warn,
        Some(Mode::CriticalSilent | Mode::EmergencyStop) | None => Level::Error,
    }
}

fn is_faulty(verdict: &Verdict) -> bool {
    let faults = [Outcome::Stale, Outcome::StaleEvidence, Outcome::FromTheFuture, Outcome::Malformed];
    verdict.outcome().is_none_or(|outcome| faults.contains(&outcome))
}

/// The behaviors that drive, or why the robot stands.
fn summary(decision: &DecisionHeader) -> String {
    let mode = decision.mode().map_or("unknown", Mode::as_str);
    let note = decision.note.as_str();
    let mut drivers: Vec<&str> =
        decision.source.iter().map(Name::as_str).filter(|name| !name.is_empty()).collect();
    drivers.dedup();
    match (drivers.is_empty(), note.is_empty()) {
        (false, _) => format!("{mode}: {}", drivers.join(", ")),
        (true, false) => format!("{mode}: {note}"),
        (true, true) => mode.to_owned(),
    }
}

fn text(verdict: &Verdict) -> String {
    let outcome = verdict.outcome().map_or("unknown", Outcome::as_str);
    let by = verdict.by.as_str();
    let by = if by.is_empty() { String::new() } else { format!(" by {by}") };
    let reason = Reason::from_code(verdict.reason).filter(|reason| *reason != Reason::None);
    let reason = reason.map_or(String::new(), |reason| format!(": {reason}"));
    format!("{outcome}{by}{reason}")
}

fn twist_text(twist: &Twist) -> String {
    format!("{:.3} m/s forward, {:.3} m/s left, {:.3} rad/s", twist.linear, twist.lateral, twist.angular)
}

fn twist_json(twist: &Twist) -> Value {
    json!({ "linear": twist.linear, "lateral": twist.lateral, "angular": twist.angular })
}

fn named(name: &str) -> Value {
    if name.is_empty() { Value::Null } else { name.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::Name;

    #[test]
    fn a_decision_is_told_in_words() {
        let halted = DecisionHeader { mode: Mode::Halted.code(), ..DecisionHeader::default() };
        let verdicts = [
            Verdict {
                behavior: Name::new("nav2"),
                by: Name::new("sonar-halt"),
                outcome: Outcome::Stopped.code(),
                reason: Reason::Nominal.code(),
                ..Verdict::default()
            },
            Verdict { behavior: Name::new("joy"), outcome: Outcome::Stale.code(), ..Verdict::default() },
        ];
        let array = diagnostics(&halted, &verdicts, "cart", Header::default());
        let value = serde_json::to_value(&array).unwrap();
        assert_eq!(value["status"][0]["level"], 1);
        assert_eq!(value["status"][1]["message"], "stopped by a halt by sonar-halt: nominal");
        assert_eq!((&value["status"][1]["level"], &value["status"][2]["level"]), (&json!(0), &json!(1)));
        let value: Value = serde_json::from_str(&json(&halted, &verdicts)).unwrap();
        assert_eq!((&value["mode"], &value["behaviors"][0]["by"]), (&json!("halted"), &json!("sonar-halt")));
        assert_eq!(value["drives"]["linear"], Value::Null);
    }
}
