//! Beginning of the report: the run in a few sentences and figures.

use std::fmt::Write;

use serde_json::Value;

use super::super::figure::escaped;
use super::super::timeline::EventKind;
use super::{Page, is_behavior};

/// Number of failures in the summary.
const MAX_FAILURES: usize = 3;

impl Page<'_> {
    /// End of the run, as a colored label.
    pub(super) fn badge(&self) -> String {
        let end = self.run.facts.result.get("end").map(String::as_str);
        let (class, text) = match end {
            _ if self.run.broken_off.is_some() => ("bad", "recording cut off"),
            Some("arrived") => ("good", "arrived"),
            Some("sensors-ended") => ("good", "all sensors ended"),
            Some("time-over") if self.run.goal.is_none() => ("good", "time over"),
            Some("time-over") => ("bad", "not arrived: time over"),
            Some(other) => ("bad", other),
            None => ("bad", "end not recorded"),
        };
        format!("<span class=\"badge {class}\">{}</span>", escaped(text))
    }

    /// The run in a few sentences.
    pub(super) fn story(&mut self) {
        let run = self.run;
        let mut story = String::new();
        if let Some(reason) = &run.broken_off {
            let seconds = self.axis.seconds(run.timeline.last());
            let _ = write!(
                story,
                "<b>The recording ends early, after {seconds:.1} s</b> ({}). This report covers it up to there. ",
                escaped(reason)
            );
        }
        let end = run.facts.result.get("end").map_or("", String::as_str);
        let arrived = if end == "arrived" { " and arrived at its goal" } else { "" };
        let [distance, time] = ["distance_m", "time_s"].map(|key| self.number(key).unwrap_or(0.0));
        let _ = write!(story, "The robot drove {distance:.1} m in {time:.1} s{arrived}. ");
        if end == "time-over" && run.goal.is_some() {
            story += "Its time was over before it reached the goal. ";
        }
        let control = run.summary.get("control_s").and_then(Value::as_object);
        let mut shares: Vec<(&str, f64)> = control.map_or_else(Vec::new, |control| {
            control.iter().filter_map(|(name, time)| Some((name.as_str(), time.as_f64()?))).collect()
        });
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        if !shares.is_empty() {
            let shares: Vec<String> = shares
                .iter()
                .map(|(name, seconds)| format!("<b>{}</b> {seconds:.1} s", escaped(name)))
                .collect();
            let _ = write!(story, "In control: {}. ", shares.join(", "));
        }
        let halts = run.trace.halts();
        if halts.is_empty() {
            story += "It was never halted. ";
        } else {
            let total: f64 = halts.iter().map(|mark| mark.halt.duration_s).sum();
            let first = &halts[0].halt;
            let reason = run.moments.list().first().map_or("", |moment| moment.reason.as_str());
            let reason = if reason.is_empty() { String::new() } else { format!(": {}", escaped(reason)) };
            let times = if halts.len() == 1 { "once".to_owned() } else { format!("{} times", halts.len()) };
            let _ = write!(
                story,
                "It was halted {times}, {total:.1} s in all; first at {:.1} s{} <b>{}</b>{reason}. ",
                self.axis.seconds(yamabico_core::time::Time::from_secs_f64(first.begin_s)),
                if is_behavior(&first.by) { " by" } else { ":" },
                escaped(&first.by)
            );
        }
        let failures: Vec<_> =
            run.timeline.events().0.iter().filter(|event| event.kind == EventKind::Failure).collect();
        for event in failures.iter().take(MAX_FAILURES) {
            let _ = write!(
                story,
                "<b>At {:.1} s {}.</b> ",
                self.axis.seconds(event.at),
                escaped(event.text.trim_end_matches('.'))
            );
        }
        if failures.len() > MAX_FAILURES {
            let more = failures.len() - MAX_FAILURES;
            let _ = write!(story, "<b>{more} more failures</b> are in the log below. ");
        }
        match self.number("contacts") {
            Some(0.0) => story += "It touched nothing. ",
            Some(contacts) => {
                let _ = write!(story, "<b>It touched something {contacts} times.</b> ");
            }
            None => {}
        }
        self.add(format_args!("<p class=\"story\">{story}</p>\n"));
    }

    pub(super) fn figures(&mut self) {
        let meters = |key: &str| self.number(key).map(|value| format!("{value:.2} m"));
        let hand_overs = self.run.timeline.events().0.iter();
        let hand_overs = hand_overs.filter(|event| event.kind == EventKind::HandOver).count();
        let count = |key: &str| self.number(key).map(|value| format!("{value}"));
        let seconds = |key: &str| self.number(key).map(|value| format!("{value:.1} s"));
        let cells = [
            ("distance", meters("distance_m")),
            ("time", seconds("time_s")),
            ("halts", Some(self.run.trace.halts().len().to_string())),
            ("hand-overs", Some(hand_overs.to_string())),
            ("contacts", count("contacts")),
            ("smallest clearance", meters("smallest_clearance_m")),
            ("nearest person, moving", meters("smallest_person_moving_m")),
            ("nearest person, standing", meters("smallest_person_standing_m")),
            ("no behavior in control", seconds("idle_s")),
            ("waiting for first readings", seconds("waiting_s")),
        ];
        let mut html = String::from("<div class=\"figures\">");
        for (name, value) in cells {
            if let Some(value) = value {
                let _ = write!(html, "<div><b>{value}</b><span>{name}</span></div>");
            }
        }
        self.add(format_args!("{html}</div>\n"));
    }
}
