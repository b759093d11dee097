//! Error of the vanishing point's column on a drive along a real corridor.

use std::path::Path;

use clap::Args;
use nalgebra::Vector2;

use super::answers::{Answer, Looker, Summary};
use super::{draw_answer, table_lines};
use crate::arguments::Data;
use crate::images::{Output, load_gray};
use crate::report::{Cell, Report, Table, number, percent};
use crate::statistics::percentile;

/// Distance of a label from the image center below which it decides no steering direction, px.
const STEERING_DEADBAND_PX: f64 = 10.0;
/// Width of the images and column of their center, px.
const WIDTH_PX: f64 = 960.0;
const CENTER_PX: f64 = 479.5;

/// Error of the vanishing point's column on a drive along a real corridor (`corridor_drive/`), and its probability.
///
/// Compares every labeled frame without prediction. The camera is not calibrated: a focal length of half the image width is assumed,
/// and nothing about the horizon. A frame without a vanishing point counts as half the image width off and as steered wrongly. The
/// method that presumes the horizon answers in the same table.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let Some(folder) = self.data.set("corridor_drive") else { return Ok(Report::default()) };
        let frames = frames(&folder, out)?;
        let mut table = Table::new(
            format!("Corridor drive (steering: labels more than {STEERING_DEADBAND_PX} px off the center)"),
            &["method", "frames", "found", "median, px", "90 %, px", "steered", "correct sign", "correct, %"],
        );
        let point = |frame: &Frame| frame.answer.point;
        table.row(row("evidence", &frames, point));
        table.row(row("presumed horizon", &frames, |frame| frame.presumed));
        let mut summary = Summary::new("Summary");
        summary.row("all", &frames.iter().map(|frame| &frame.answer).collect::<Vec<_>>());
        Ok(Report::new([table, summary.0]))
    }
}

/// A labeled frame with the answers about it.
struct Frame {
    answer: Answer,
    /// Vanishing point of the method that presumes the horizon.
    presumed: Option<Vector2<f64>>,
    label: Vector2<f64>,
}

/// Answers about every labeled frame, in order.
pub fn answers(folder: &Path, out: &Output) -> Result<Vec<Answer>, String> {
    Ok(frames(folder, out)?.into_iter().map(|frame| frame.answer).collect())
}

fn frames(folder: &Path, out: &Output) -> Result<Vec<Frame>, String> {
    let (mut frames, mut looker) = (Vec::new(), None);
    for (name, label) in labels(folder)? {
        let image = load_gray(&folder.join("images").join(format!("{name}.jpg")))?;
        let view = image.view().map_err(|error| format!("{name}: {error}"))?;
        let looker = looker.get_or_insert_with(|| Looker::guessed(view));
        let (answer, look) = looker.answer(&name, &image, Some(label))?;
        out.overlay(&name, view, |canvas| draw_answer(canvas, &look, Some(label)))?;
        frames.push(Frame { answer, presumed: look.presumed, label });
    }
    if frames.is_empty() { Err(format!("{}: no labeled frame", folder.display())) } else { Ok(frames) }
}

fn row(name: &str, frames: &[Frame], point: impl Fn(&Frame) -> Option<Vector2<f64>>) -> [Cell; 8] {
    let off = |frame: &Frame| point(frame).map_or(0.5 * WIDTH_PX, |point| (point.x - frame.label.x).abs());
    let errors: Vec<f64> = frames.iter().map(off).collect();
    let offset = |frame: &Frame| frame.label.x - CENTER_PX;
    let steered: Vec<_> = frames.iter().filter(|frame| offset(frame).abs() > STEERING_DEADBAND_PX).collect();
    let is_correct =
        |frame: &&&Frame| point(frame).is_some_and(|point| (point.x - CENTER_PX) * offset(frame) > 0.0);
    let correct = steered.iter().filter(is_correct).count();
    [
        name.into(),
        frames.len().into(),
        frames.iter().filter(|frame| point(frame).is_some()).count().into(),
        number(percentile(&errors, 0.5), 1),
        number(percentile(&errors, 0.9), 1),
        steered.len().into(),
        correct.into(),
        percent(correct as f64, steered.len().max(1) as f64),
    ]
}

/// Reads name and labeled vanishing point of every frame that has one.
fn labels(folder: &Path) -> Result<Vec<(String, Vector2<f64>)>, String> {
    let mut labels = Vec::new();
    for line in table_lines(folder, "labels.csv")? {
        // The polygons between the quotes contain commas; the point is the last two fields.
        let name = line.split(',').next().unwrap_or_default();
        let mut last = line.rsplit(',');
        let (v, u) = (last.next().unwrap_or_default(), last.next().unwrap_or_default());
        if let (Ok(u), Ok(v)) = (u.trim().parse(), v.trim().parse()) {
            labels.push((name.to_owned(), Vector2::new(u, v)));
        }
    }
    Ok(labels)
}
