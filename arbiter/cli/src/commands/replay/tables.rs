//! The tables of a replay.

use std::fmt::Write;

use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::replay::{ClosedLoop, ControlChange, FieldDifference, FirstDifference, Report};
use yamabico_runtime::report::RunSummary;

use crate::output::table;

/// Reminder in every output of a what-if.
const OPEN_LOOP: &str = "open loop: the inputs are the recorded ones, the world did not react to the changes";
/// Maximum number of changes of control that are printed; JSON has them all.
const MAX_CHANGES: usize = 20;

/// A replay compared with its recording.
pub fn comparison(report: &Report) -> String {
    let mut text = report.first.as_ref().map_or_else(String::new, difference);
    text += &topics(report);
    text += &notes(report);
    let result = match report.is_equal() {
        true => format!("all {} messages are equal to the byte", report.compared()),
        false if report.first.is_none() => "nothing was compared".to_owned(),
        false => "the replay differs from the recording".to_owned(),
    };
    let _ = write!(text, "{}: {result}; {}", report.task, speed(report));
    text
}

/// Several runs of one file, each with its number.
pub fn runs(reports: &[Report], text: impl Fn(&Report) -> String) -> String {
    let numbered = reports.iter().enumerate();
    let texts = numbered.map(|(i, report)| format!("run {} of {}\n{}", i + 1, reports.len(), text(report)));
    texts.collect::<Vec<_>>().join("\n\n")
}

/// The answer to a what-if.
pub fn what_if(report: &Report) -> String {
    let mut text = format!("{OPEN_LOOP}\n");
    if let Some(first) = &report.first {
        text += &difference(first);
    }
    let mut changes =
        table(&["from", "to", "axis", "recorded", "what if", "largest difference", "why"], 0..2);
    for change in report.changes.iter().take(MAX_CHANGES) {
        let ControlChange { axis, unit, recorded_winner, winner, recorded_why, why, .. } = change;
        let shown = |name: &str| if name.is_empty() { "no behavior".to_owned() } else { name.to_owned() };
        changes.add_row([
            format!("{:.2} s", change.from_s),
            format!("{:.2} s", change.to_s),
            (*axis).to_owned(),
            shown(recorded_winner),
            shown(winner),
            format!("{:.3e} {unit}", change.max_difference),
            if why == recorded_why { why.clone() } else { format!("{why}\ninstead of: {recorded_why}") },
        ]);
    }
    if !report.changes.is_empty() {
        let _ = writeln!(text, "{changes}");
    }
    if report.changes.len() > MAX_CHANGES {
        let _ = writeln!(text, "and {} more; --json lists them", report.changes.len() - MAX_CHANGES);
    }
    text += &notes(report);
    if let Some(output) = &report.output {
        let _ = writeln!(text, "recorded under /what-if/ in {}", output.display());
    }
    let Report { task, decisions, differing_decisions, .. } = report;
    let _ = write!(text, "{task}: {differing_decisions} of {decisions} decisions differ; {}", speed(report));
    text
}

/// A recorded simulation beside the same one with changes.
pub fn closed_loop(closed: &ClosedLoop) -> String {
    let mut figures = table(&["closed loop", "recorded", "changed"], 1..3);
    let (a, b) = (&closed.recorded, &closed.changed);
    let count = |value: Option<u32>| value.map_or("-".into(), |value| value.to_string());
    let meters = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.3} m"));
    let mut row = |name: &str, of: &dyn Fn(&RunSummary) -> String| {
        figures.add_row([name.to_owned(), of(a), of(b)]);
    };
    row("distance", &|run| format!("{:.2} m", run.distance_m));
    row("time", &|run| format!("{:.1} s", run.time_s));
    row("contacts", &|run| count(run.contacts));
    row("minimum clearance", &|run| meters(run.smallest_clearance_m));
    row("halts", &|run| run.halts.len().to_string());
    let owners: std::collections::BTreeSet<&String> = a.control_s.keys().chain(b.control_s.keys()).collect();
    for owner in owners {
        let control = |run: &RunSummary| run.control_s.get(owner).copied().unwrap_or(0.0);
        row(&format!("control of {owner}"), &|run| format!("{:.1} s", control(run)));
    }
    let mut text = format!("{figures}\n");
    if let Some((distance_m, time_s)) = closed.largest_deviation {
        let _ = writeln!(
            text,
            "largest distance between both at the same time: {distance_m:.3} m at {time_s:.1} s"
        );
    }
    let _ = write!(text, "the changed run: {}", end(closed.end));
    text
}

/// One what-if for each value of a key.
pub fn open_sweep(key: &str, reports: &[(String, Report)]) -> String {
    let head =
        [key, "differing decisions", "first at", "linear, at most", "angular, at most", "others in control"];
    let mut rows = table(&head, 0..6);
    for (value, report) in reports {
        let largest = |axis: &str| {
            let changes = report.changes.iter().filter(|change| change.axis == axis);
            changes.map(|change| change.max_difference).fold(0.0, f64::max)
        };
        let others = report.changes.iter().filter(|change| change.winner != change.recorded_winner);
        rows.add_row([
            value.clone(),
            format!("{} of {}", report.differing_decisions, report.decisions),
            report.changes.first().map_or("-".into(), |change| format!("{:.2} s", change.from_s)),
            format!("{:.3e} m/s", largest("linear")),
            format!("{:.3e} rad/s", largest("angular")),
            format!("{} times", others.count()),
        ]);
    }
    format!("{OPEN_LOOP}\n{rows}")
}

/// One run in the simulator for each value of a key.
pub fn closed_sweep(key: &str, runs: &[(String, ClosedLoop)]) -> String {
    let head = [key, "end", "time", "distance", "contacts", "clearance", "halts", "largest deviation"];
    let mut rows = table(&head, 2..8);
    for (value, run) in runs {
        let ClosedLoop { changed, .. } = run;
        rows.add_row([
            value.clone(),
            end(run.end).to_owned(),
            format!("{:.1} s", changed.time_s),
            format!("{:.2} m", changed.distance_m),
            changed.contacts.map_or("-".into(), |contacts| contacts.to_string()),
            changed.smallest_clearance_m.map_or("-".into(), |clearance| format!("{clearance:.3} m")),
            changed.halts.len().to_string(),
            run.largest_deviation.map_or("-".into(), |(distance_m, _)| format!("{distance_m:.3} m")),
        ]);
    }
    format!("closed loop: each run in the simulator\n{rows}")
}

fn end(end: RunEnd) -> &'static str {
    match end {
        RunEnd::Arrived => "arrived",
        RunEnd::SensorsEnded => "all sensors ended",
        RunEnd::TimeOver => "time over",
        RunEnd::Interrupted => "interrupted",
    }
}

fn topics(report: &Report) -> String {
    let mut topics = table(&["topic", "compared", "different", "missing", "extra", "first at"], 1..6);
    for (topic, compared) in &report.topics {
        let number = |number: u64| if number == 0 { "-".to_owned() } else { number.to_string() };
        topics.add_row([
            topic.clone(),
            compared.compared.to_string(),
            number(compared.different),
            number(compared.missing),
            number(compared.extra),
            compared.first_s.map_or("-".into(), |first| format!("{first:.2} s")),
        ]);
    }
    format!("{topics}\n")
}

fn notes(report: &Report) -> String {
    report.notes.iter().map(|note| format!("note: {note}\n")).collect()
}

fn speed(report: &Report) -> String {
    let Report { seconds, steps, wall_s, .. } = report;
    let factor = seconds / wall_s.max(1e-9);
    let calls =
        report.behaviors_s.map_or(String::new(), |calls_s| format!(", {calls_s:.1} s of them in calls"));
    format!("{seconds:.1} s in {steps} steps, computed in {wall_s:.1} s{calls} ({factor:.1} x real time)")
}

fn difference(first: &FirstDifference) -> String {
    let FirstDifference { time_s, step, topic, author, axes, fields, what, .. } = first;
    let axes = if axes.is_empty() { String::new() } else { format!(", axes {}", axes.join(" and ")) };
    let mut text =
        format!("first difference: {author}{axes}, at {time_s:.3} s (step {step}) on {topic}: {what}\n");
    for FieldDifference { field, recorded, replayed } in fields {
        let _ = writeln!(text, "  {field}: recorded {recorded}, replayed {replayed}");
    }
    let _ = writeln!(text, "\nrecorded: {}", first.recorded_why.trim_end());
    let _ = writeln!(text, "\nreplayed: {}\n", first.replayed_why.trim_end());
    text
}
