//! Report on a recorded run: one HTML file that needs nothing else.

mod halts;
mod story;
mod tables;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use yamabico_core::message::Axis;
use yamabico_drawing::Color;

use super::charts::{self, TimeAxis};
use super::figure::{escaped, hexadecimal};
use super::recorded::Recorded;
use super::timeline::Span;
use super::trajectory::{self, draw_trajectory};
use crate::record::PlaybackError;

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
        for (name, color) in names.chain([halted, ("no behavior".to_owned(), [235; 3])]) {
            let _ = write!(legend, "{}", swatch(color, &name));
        }
        self.add(format_args!(
            "<h2>Who had control of each axis</h2>\n<figure>{strips}</figure><p class=\"legend\">{legend}</p>\n\
             <h2>Speeds</h2>\n<figure>{speeds}</figure>\n"
        ));
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
