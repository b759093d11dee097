//! Report on a recorded run: one HTML file that needs nothing else.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::Value;
use yamabico_core::message::Axis;
use yamabico_drawing::Color;

use super::charts::{self, TimeAxis};
use super::figure::{escaped, hexadecimal};
use super::moments::{Moment, Picture};
use super::recorded::Recorded;
use super::timeline::{EventKind, Span};
use super::trajectory::{self, draw_trajectory};
use crate::record::PlaybackError;

/// Quality of the pictures in the report, 1 to 100.
const JPEG_QUALITY: u8 = 80;
/// Radius of the robot in the drawing from above, if the recording does not tell it, m.
const RADIUS_M: f64 = 0.2;
/// Number of failures that are told in the summary.
const MAX_TOLD: usize = 3;
/// Number of events that are listed.
const MAX_LISTED: usize = 200;

const STYLE: &str = include_str!("page.css");

/// Failure to write a report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] PlaybackError),
    /// The recording holds no decision.
    #[error("{} holds no decision of an arbiter: it is not a recording of a run, or ends before the first one", path.display())]
    Empty {
        /// Recording.
        path: PathBuf,
    },
    /// The page cannot be written.
    #[error("cannot write {}: {source}; make the folder writable or choose another", path.display())]
    Writing {
        /// Page.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
}

/// Writes the report on the recording `recording` to the file `page`.
///
/// # Errors
/// The recording cannot be read or is not of a run, or the page cannot be written. A recording that ends early gets a report up to
/// its end that says so.
pub fn write_report(recording: &Path, page: &Path) -> Result<(), ReportError> {
    let recorded = Recorded::read(recording)?;
    if recorded.timeline.speeds().is_empty() {
        return Err(ReportError::Empty { path: recording.to_owned() });
    }
    let html = Page::new(&recorded).html();
    std::fs::write(page, html).map_err(|source| ReportError::Writing { path: page.to_owned(), source })
}

struct Page<'a> {
    run: &'a Recorded,
    axis: TimeAxis,
    html: String,
}

impl<'a> Page<'a> {
    fn new(run: &'a Recorded) -> Page<'a> {
        let axis = TimeAxis::new(run.timeline.first(), run.timeline.last());
        Page { run, axis, html: String::new() }
    }

    fn html(mut self) -> String {
        let name = self.fact("name").unwrap_or("run").to_owned();
        self.add(format_args!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
             <title>{0}: report</title><style>{STYLE}</style></head><body><main>\n<h1>{0} {1}</h1>\n",
            escaped(&name),
            self.badge()
        ));
        self.story();
        self.figures();
        self.map();
        self.control();
        self.events();
        self.halts();
        self.latency();
        self.behaviors();
        self.recording();
        self.add(format_args!("</main></body></html>\n"));
        self.html
    }

    fn add(&mut self, text: std::fmt::Arguments<'_>) {
        // Writing to a `String` cannot fail.
        let _ = self.html.write_fmt(text);
    }

    fn fact(&self, key: &str) -> Option<&str> {
        self.run.facts.run.get(key).map(String::as_str).filter(|fact| !fact.is_empty())
    }

    fn number(&self, key: &str) -> Option<f64> {
        self.run.summary.get(key)?.as_f64()
    }

    /// End of the run, as a colored label.
    fn badge(&self) -> String {
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
    fn story(&mut self) {
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
        for event in failures.iter().take(MAX_TOLD) {
            let _ = write!(
                story,
                "<b>At {:.1} s {}.</b> ",
                self.axis.seconds(event.at),
                escaped(event.text.trim_end_matches('.'))
            );
        }
        if failures.len() > MAX_TOLD {
            let more = failures.len() - MAX_TOLD;
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

    fn figures(&mut self) {
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
            ("nobody in control", seconds("idle_s")),
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

    fn map(&mut self) {
        let run = self.run;
        let figure = draw_trajectory(&run.trace, &run.walls, run.goal.as_ref());
        let truth = if run.trace.truth().is_empty() { "by odometry" } else { "true path of the simulation" };
        self.add(format_args!(
            "<h2>Path <small>{truth}, in the color of who had control</small></h2>\n<figure>{}</figure>\n",
            figure.svg()
        ));
    }

    /// Color of a behavior, the same as on the map.
    fn color(&self, name: &str) -> Color {
        let owners = self.run.trace.owners();
        let known = owners.iter().position(|owner| owner == name);
        trajectory::owner_color(Some(known.unwrap_or_else(|| {
            let mut others: Vec<&str> = self
                .drivers()
                .into_iter()
                .filter(|other| !owners.iter().any(|owner| owner == other))
                .collect();
            others.sort_unstable();
            owners.len() + others.iter().position(|other| *other == name).unwrap_or(0)
        })))
    }

    /// Behaviors that drove an axis, in the order of appearance.
    fn drivers(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for (_, spans) in self.run.timeline.axes() {
            for span in spans {
                if let super::timeline::Holder::Behavior(name) = &span.holder
                    && !names.contains(&name.as_str())
                {
                    names.push(name);
                }
            }
        }
        names
    }

    fn control(&mut self) {
        let rows = self.run.timeline.axes().map(|(axis, spans): (Axis, &[Span])| (axis.as_str(), spans));
        let strips = charts::strips(&self.axis, rows, &|name| self.color(name)).svg();
        let speeds = charts::speeds(&self.axis, self.run.timeline.speeds()).svg();
        let mut legend = String::new();
        let halted = ("halted".to_owned(), trajectory::HALT);
        let names = self.drivers().into_iter().map(|name| (name.to_owned(), self.color(name)));
        for (name, color) in names.chain([halted, ("nobody".to_owned(), [235; 3])]) {
            let _ = write!(legend, "{}", swatch(color, &name));
        }
        self.add(format_args!(
            "<h2>Who had control of each axis</h2>\n<figure>{strips}</figure><p class=\"legend\">{legend}</p>\n\
             <h2>Speeds</h2>\n<figure>{speeds}</figure>\n"
        ));
    }

    /// Hand-overs, halts and failures in the order of time.
    fn events(&mut self) {
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

    fn halts(&mut self) {
        let moments = self.run.moments.list();
        if moments.is_empty() {
            return;
        }
        self.add(format_args!(
            "<h2>Halts <small>what the cameras and the behaviors saw at that moment</small></h2>\n"
        ));
        let halts = self.run.trace.halts();
        for (index, moment) in moments.iter().enumerate() {
            let halt = halts.get(index).map(|mark| &mark.halt);
            let by = halt.map_or("", |halt| halt.by.as_str());
            let duration_s = halt.map_or(0.0, |halt| halt.duration_s);
            let reason =
                if moment.reason.is_empty() { String::new() } else { format!(": {}", moment.reason) };
            self.add(format_args!(
                "<section class=\"halt\"><h3>{:.1} s: {} for {duration_s:.1} s{}</h3><div class=\"pictures\">",
                self.axis.seconds(moment.at),
                escaped(by),
                escaped(&reason)
            ));
            self.moment(moment);
            self.add(format_args!("</div></section>\n"));
        }
        let others = halts.len().saturating_sub(moments.len());
        if others > 0 {
            self.add(format_args!("<p>{others} more halts without pictures are in the log.</p>\n"));
        }
    }

    fn moment(&mut self, moment: &Moment) {
        for picture in &moment.pictures {
            let age_ms = moment.at.seconds_after(picture.stamp) * 1e3;
            let Some(jpeg) = jpeg(picture) else { continue };
            let layers = picture.layers.iter();
            let legend: String = layers
                .map(|(behavior, name, color)| swatch(*color, &format!("{behavior}: {name}")))
                .collect();
            self.add(format_args!(
                "<figure><img alt=\"{0} with overlays\" src=\"data:image/jpeg;base64,{1}\">\
                 <figcaption>{0}, {age_ms:.0} ms before the halt<br>{legend}</figcaption></figure>",
                escaped(&picture.topic),
                base64(&jpeg)
            ));
        }
        let radius_m = self.fact("radius_m").and_then(|radius| radius.parse().ok()).unwrap_or(RADIUS_M);
        if let Some(figure) = charts::from_above(&moment.from_above, radius_m) {
            let mut legend = String::new();
            for (behavior, marks) in &moment.from_above {
                for layer in yamabico_core::overlay::layers(marks) {
                    if layer.space == yamabico_core::overlay::Space::Robot && !layer.marks.is_empty() {
                        legend += &swatch(layer.color, &format!("{behavior}: {}", layer.name));
                    }
                }
            }
            self.add(format_args!(
                "<figure>{}<figcaption>from above<br>{legend}</figcaption></figure>",
                figure.svg()
            ));
        }
    }

    fn latency(&mut self) {
        let Some(figure) = charts::latencies(self.run.timeline.latencies()) else { return };
        let lockstep = self.fact("execution") == Some("lockstep");
        let note = if lockstep { "in lockstep computing takes no time" } else { "by the machine's clock" };
        self.add(format_args!(
            "<h2>Latency <small>of the data behind each command, {note}</small></h2>\n<figure>{}</figure>\n",
            figure.svg()
        ));
    }

    /// Behaviors with their calls, latencies, late commands and restarts.
    fn behaviors(&mut self) {
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

    fn recording(&mut self) {
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

/// True if a halt was caused by a behavior; otherwise its cause is a sentence, such as "sonar is silent".
fn is_behavior(by: &str) -> bool {
    !by.contains(' ')
}

fn swatch(color: Color, name: &str) -> String {
    format!(
        "<span class=\"swatch\"><i style=\"background:{}\"></i>{}</span> ",
        hexadecimal(color),
        escaped(name)
    )
}

fn jpeg(picture: &Picture) -> Option<Vec<u8>> {
    let mut data = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut data, JPEG_QUALITY);
    picture.image.write_with_encoder(encoder).ok()?;
    Some(data)
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for part in bytes.chunks(3) {
        let word =
            part.iter().chain([0, 0].iter()).take(3).fold(0_u32, |word, &byte| word << 8 | u32::from(byte));
        for digit in 0..4 {
            let value = word >> (18 - 6 * digit) & 63;
            text.push(if digit <= part.len() { char::from(DIGITS[value as usize]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        // RFC 4648, section 10.
        for (text, encoded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(text.as_bytes()), encoded);
        }
    }
}
