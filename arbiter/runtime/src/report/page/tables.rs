//! Tables of the report: the log, the behaviors, and the recording itself.

use std::fmt::Write;

use serde_json::Value;

use super::super::charts;
use super::super::figure::escaped;
use super::super::timeline::EventKind;
use super::{Page, is_behavior};

/// Number of events that are listed.
const MAX_LISTED: usize = 200;

impl Page<'_> {
    /// Hand-overs, halts and failures in the order of time.
    pub(super) fn events(&mut self) {
        let (events, omitted) = self.run.timeline.events();
        let mut rows: Vec<(f64, &str, String)> = events
            .iter()
            .map(|event| {
                let class = if event.kind == EventKind::Failure { "failure" } else { "hand-over" };
                (self.axis.seconds(event.at), class, event.text.clone())
            })
            .collect();
        for (index, mark) in self.run.trace.halts().iter().enumerate() {
            let at = self.axis.seconds(yamabico_core::time::Time::from_secs_f64(mark.halt.begin_s));
            let reason = self.run.moments.list().get(index).map_or("", |moment| moment.reason.as_str());
            let reason = if reason.is_empty() { String::new() } else { format!(": {reason}") };
            let text = match is_behavior(&mark.halt.by) {
                true => {
                    format!("{} halted the robot for {:.1} s{reason}", mark.halt.by, mark.halt.duration_s)
                }
                false => format!("the robot was halted for {:.1} s: {}", mark.halt.duration_s, mark.halt.by),
            };
            rows.push((at, "halt", text));
        }
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        let more = rows.len().saturating_sub(MAX_LISTED) as u64 + omitted;
        let mut table = String::new();
        for (seconds, class, text) in rows.iter().take(MAX_LISTED) {
            let _ = write!(
                table,
                "<tr class=\"{class}\"><td>{seconds:.1} s</td><td>{class}</td><td>{}</td></tr>",
                escaped(text)
            );
        }
        if more > 0 {
            let _ = write!(table, "<tr><td></td><td></td><td>and {more} more</td></tr>");
        }
        self.add(format_args!("<h2>Log</h2>\n<table class=\"log\">{table}</table>\n"));
    }

    pub(super) fn latency(&mut self) {
        let Some(figure) = charts::latencies(self.run.timeline.latencies()) else { return };
        let lockstep = self.fact("execution") == Some("lockstep");
        let note = if lockstep { "in lockstep computing takes no time" } else { "by the machine's clock" };
        self.add(format_args!(
            "<h2>Latency <small>of the data behind each command, {note}</small></h2>\n<figure>{}</figure>\n",
            figure.svg()
        ));
    }

    /// Behaviors with their calls, latencies, late commands and restarts.
    pub(super) fn behaviors(&mut self) {
        let run = self.run;
        let Some(behaviors) = run.summary.get("behaviors").and_then(Value::as_object) else { return };
        let restarts = |name: &str| run.summary.get("restarts")?.get(name)?.as_u64();
        let mut rows = String::new();
        for (name, behavior) in behaviors {
            let number = |key: &str| behavior.get(key).and_then(Value::as_f64);
            let latency = behavior.get("latency").filter(|latency| latency.is_object());
            let of_latency = |key: &str| latency.and_then(|latency| latency.get(key)).and_then(Value::as_f64);
            let whole = |key: &str| {
                let spread = latency.and_then(|latency| latency.get("captured_to_commanded"));
                spread.and_then(|spread| spread.get(key)).and_then(Value::as_f64)
            };
            let text = |value: Option<f64>, digits: usize| {
                value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
            };
            let milliseconds = |key: &str| number(key).map(|us| us / 1e3);
            let bad = |value: Option<f64>| {
                if value.is_some_and(|value| value > 0.0) { " class=\"bad\"" } else { "" }
            };
            let reasons = behavior.get("reasons").and_then(Value::as_object);
            let reasons: Vec<String> = reasons.map_or_else(Vec::new, |reasons| {
                reasons.iter().map(|(reason, count)| format!("{reason} {count}")).collect()
            });
            let restarted = restarts(name).map(|count| count as f64);
            let _ = write!(
                rows,
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td{}>{}</td><td>{}</td><td{}>{}</td>\
                 <td{}>{}</td><td{}>{}</td><td class=\"text\">{}</td></tr>",
                escaped(name),
                text(number("calls"), 0),
                text(number("proposals"), 0),
                text(milliseconds("p50_us"), 2),
                text(milliseconds("p99_us"), 2),
                bad(number("overruns")),
                text(number("overruns"), 0),
                text(whole("p99_ms"), 0),
                bad(of_latency("late_commands")),
                text(of_latency("late_commands"), 0),
                bad(number("panics")),
                text(number("panics"), 0),
                bad(restarted),
                text(restarted, 0),
                escaped(&reasons.join(", "))
            );
        }
        let lateness = run.summary.get("tick_lateness").filter(|spread| spread["count"].as_u64() > Some(0));
        let lateness = lateness.map_or_else(String::new, |spread| {
            let ms = |key: &str| spread.get(key).and_then(Value::as_f64).unwrap_or(0.0);
            format!(
                "<p>The arbiter woke {:.2} ms late at its ticks (median), {:.2} ms (99 %), {:.2} ms at most.</p>",
                ms("p50_ms"),
                ms("p99_ms"),
                ms("max_ms")
            )
        });
        self.add(format_args!(
            "<h2>Late and restarted</h2>\n<table><tr><th>behavior</th><th>calls</th><th>proposals</th>\
             <th>call p50, ms</th><th>call p99, ms</th><th>over budget</th><th>latency p99, ms</th>\
             <th>late commands</th><th>panics</th><th>restarts</th><th>abstained because of</th></tr>{rows}</table>\
             {lateness}\n"
        ));
    }

    pub(super) fn recording(&mut self) {
        let run = self.run;
        let mut rows = String::new();
        let mut row = |key: &str, value: &str| {
            if !value.is_empty() {
                let _ = write!(
                    rows,
                    "<tr><td>{}</td><td class=\"text\">{}</td></tr>",
                    escaped(key),
                    escaped(value)
                );
            }
        };
        row("file", &run.path.display().to_string());
        let fact = |key: &str| run.facts.run.get(key).map_or("", String::as_str);
        row("task", fact("name"));
        row("robot", fact("robot_name"));
        row("overrides", Some(fact("overrides")).filter(|set| *set != "[]").unwrap_or_default());
        for key in ["execution", "seed", "version", "started"] {
            row(key, fact(key));
        }
        row("digest", run.facts.result.get("digest").map_or("", String::as_str));
        row("left out", &run.left_out.join("; "));
        self.add(format_args!("<h2>Recording</h2>\n<table>{rows}</table>\n"));
    }
}
