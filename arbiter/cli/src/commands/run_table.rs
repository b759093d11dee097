//! The tables at the end of a run.

use std::fmt::Write;

use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::report::{LatencyFigures, RunSummary, Spread};
use yamabico_runtime::run::RunResult;

use crate::output::table;

/// The tables of a run, for people.
pub fn run_table(ran: &RunResult) -> String {
    let mut text = figures(ran);
    if !ran.summary.halts.is_empty() {
        text += &halts(ran);
    }
    text += &behaviors(&ran.summary);
    text += &latencies(&ran.summary);
    text += &topics(&ran.summary);
    text += &files(ran);
    text
}

fn figures(ran: &RunResult) -> String {
    let summary = &ran.summary;
    let end = match ran.end {
        RunEnd::Arrived => "arrived",
        RunEnd::SensorsEnded => "all sensors ended",
        RunEnd::TimeOver if ran.is_done() => "time over",
        RunEnd::TimeOver => "time over, not arrived",
        RunEnd::Interrupted => "interrupted",
    };
    let meters = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.3} m"));
    let count = |value: Option<u32>| value.map_or("-".into(), |value| value.to_string());
    let halted = summary.halts.iter().fold(0.0, |sum, halt| sum + halt.duration_s);
    let mut table = table(&[&ran.task, end], 1..2);
    table.add_row(["seed", &ran.seed.to_string()]);
    table.add_row(["distance", &format!("{:.2} m", summary.distance_m)]);
    table.add_row(["time", &format!("{:.1} s", summary.time_s)]);
    table.add_row(["contacts", &count(summary.contacts)]);
    table.add_row(["collisions caused by people", &count(summary.struck)]);
    table.add_row(["minimum clearance", &meters(summary.smallest_clearance_m)]);
    table.add_row(["nearest person while stopped", &meters(summary.smallest_person_standing_m)]);
    table.add_row(["nearest person while moving", &meters(summary.smallest_person_moving_m)]);
    table.add_row(["RMS offset from the reference line", &meters(summary.rms_offset_m)]);
    table.add_row(["halts", &format!("{} ({halted:.1} s)", summary.halts.len())]);
    table.add_row(["waiting for the first readings", &format!("{:.1} s", summary.waiting_s)]);
    table.add_row(["no behavior in control", &format!("{:.1} s", summary.idle_s)]);
    table.add_row(["real-time factor", &format!("{:.1}", summary.real_time_factor)]);
    if is_live(summary) {
        table.add_row([
            "lateness of arbiter ticks: p50, p99, max",
            &format!("{} ms", spread(&summary.tick_lateness)),
        ]);
        table.add_row(["restarts", &restarts(summary)]);
    }
    for (name, latency) in &summary.behaviors {
        if let Some(LatencyFigures { budget_ms: Some(budget_ms), late_commands, .. }) = latency.latency {
            let late = format!("{late_commands} based on data older than {budget_ms:.0} ms");
            table.add_row([&format!("late commands of {name}"), &late]);
        }
    }
    format!("{table}\n")
}

/// Returns true for a live run: lockstep has no ticks that could be late.
fn is_live(summary: &RunSummary) -> bool {
    summary.tick_lateness.count > 0
}

fn spread(spread: &Spread) -> String {
    format!("{:.2}, {:.2}, {:.1}", spread.p50_ms, spread.p99_ms, spread.max_ms)
}

fn restarts(summary: &RunSummary) -> String {
    let restarted = summary.restarts.iter().filter(|(_, restarts)| **restarts > 0);
    let restarted: Vec<String> = restarted.map(|(name, restarts)| format!("{name} {restarts} x")).collect();
    if restarted.is_empty() { "none".to_owned() } else { restarted.join(", ") }
}

/// The latencies from measurement to command; empty in lockstep, where computing takes no time.
fn latencies(summary: &RunSummary) -> String {
    if !is_live(summary) {
        return String::new();
    }
    let head =
        ["p50, p99, max; ms", "to behavior", "to proposal", "to arbiter", "to command", "since capture"];
    let mut table = table(&head, 1..6);
    for (name, behavior) in &summary.behaviors {
        let Some(latency) = &behavior.latency else { continue };
        let stages = [
            latency.captured_to_received,
            latency.received_to_proposed,
            latency.proposed_to_accepted,
            latency.accepted_to_commanded,
            latency.captured_to_commanded,
        ];
        table.add_row(std::iter::once(name.clone()).chain(stages.iter().map(spread)));
    }
    format!("{table}\n")
}

fn halts(ran: &RunResult) -> String {
    let mut table = table(&["halted by", "at", "duration", "nearest person"], 1..4);
    for halt in &ran.summary.halts {
        let end_s = halt.begin_s + halt.duration_s;
        let encounters =
            ran.summary.encounters.iter().filter(|met| met.begin_s <= end_s && met.end_s >= halt.begin_s);
        let nearest = encounters.flat_map(|met| &met.stood_at_m).copied().reduce(f64::min);
        let nearest = nearest.map_or("-".into(), |m| format!("{m:.2} m"));
        table.add_row([
            halt.by.clone(),
            format!("{:.1} s", halt.begin_s - ran.summary.began_s),
            format!("{:.1} s", halt.duration_s),
            nearest,
        ]);
    }
    format!("{table}\n")
}

fn behaviors(summary: &RunSummary) -> String {
    let head = [
        "behavior",
        "in control",
        "calls",
        "p50",
        "p99",
        "overruns",
        "panics",
        "abstentions",
        "most frequent reason",
    ];
    let mut table = table(&head, 1..8);
    let (behaviors, control_s) = (&summary.behaviors, &summary.control_s);
    let seconds = |name: &str| format!("{:.1} s", control_s.get(name).copied().unwrap_or(0.0));
    for (name, behavior) in behaviors {
        let timing = &behavior.timing;
        let reason =
            behavior.reasons.iter().max_by_key(|(_, count)| **count).map_or("", |(reason, _)| reason);
        table.add_row([
            name.clone(),
            seconds(name),
            timing.calls.to_string(),
            format!("{:.0} us", timing.p50_us),
            format!("{:.0} us", timing.p99_us),
            timing.overruns.to_string(),
            timing.panics.to_string(),
            behavior.abstentions.to_string(),
            reason.to_owned(),
        ]);
    }
    for name in control_s.keys().filter(|name| !behaviors.contains_key(*name)) {
        table.add_row([name.clone(), seconds(name)]);
    }
    format!("{table}\n")
}

fn topics(summary: &RunSummary) -> String {
    let mut table = table(&["topic", "messages"], 1..2);
    for (topic, messages) in &summary.topics {
        table.add_row([topic.clone(), messages.to_string()]);
    }
    format!("{table}\n")
}

fn files(ran: &RunResult) -> String {
    let mut text = format!("digest {}\n", ran.summary.digest);
    if let Some(trajectory) = &ran.trajectory {
        // Writing to a `String` cannot fail.
        let _ = writeln!(text, "trajectory {}", trajectory.display());
    }
    if let Some(report) = &ran.report {
        let _ = writeln!(text, "report {}", report.display());
    }
    if let Some(recording) = &ran.recording {
        let megabytes = recording.bytes as f64 / 1e6;
        let _ = writeln!(text, "recording {} ({megabytes:.1} MB)", recording.path.display());
        if recording.missing > 0 {
            let _ = writeln!(text, "{} messages or frames are missing in the recording", recording.missing);
        }
        if let Some(problem) = &recording.problem {
            let _ = writeln!(text, "{problem}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_runtime::report::{BehaviorSummary, ReferenceLine, RunFacts, SummaryTap};

    fn summary() -> RunSummary {
        RunSummary {
            control_s: [("wall", 2.5), ("emergency stop", 0.5)].map(|(name, s)| (name.into(), s)).into(),
            behaviors: [("wall".into(), BehaviorSummary::default())].into(),
            topics: [("truth".into(), 41)].into(),
            ..SummaryTap::new(ReferenceLine::default()).finish(RunFacts::default())
        }
    }

    #[test]
    fn every_second_of_control_is_in_the_table() {
        let table = behaviors(&summary());
        let seconds_of = |name: &str| {
            let row = table.lines().find(|line| line.contains(name)).unwrap();
            row.split('┆').nth(1).unwrap().trim().trim_end_matches(['│', ' ']).to_owned()
        };
        assert_eq!((seconds_of("wall"), seconds_of("emergency stop")), ("2.5 s".into(), "0.5 s".into()));
    }

    #[test]
    fn panics_are_in_the_table() {
        let mut summary = summary();
        summary.behaviors.values_mut().for_each(|behavior| behavior.timing.panics = 73);
        assert!(behaviors(&summary).contains("73"));
    }

    #[test]
    fn latencies_are_in_the_tables_of_a_live_run_only() {
        let mut summary = summary();
        let spread = Spread { count: 9, p50_ms: 1.25, p99_ms: 2.5, max_ms: 3.0 };
        let latency = LatencyFigures { captured_to_commanded: spread, ..LatencyFigures::default() };
        summary.behaviors.values_mut().for_each(|behavior| behavior.latency = Some(latency));
        assert_eq!(latencies(&summary), "");
        summary.tick_lateness = spread;
        assert!(
            latencies(&summary).lines().any(|row| row.contains("wall") && row.contains("1.25, 2.50, 3.0"))
        );
    }

    #[test]
    fn topics_are_listed_with_their_number_of_messages() {
        let table = topics(&summary());
        assert!(table.lines().any(|line| line.contains("truth") && line.contains("41")), "{table}");
    }
}
