//! Corridors of a building whose frames are cropped: the horizon lies far from their middle.

use std::path::Path;

use clap::Args;
use nalgebra::Vector2;

use super::answers::{Answer, Looker, Summary};
use super::{draw_answer, table_lines};
use crate::arguments::Data;
use crate::images::{Output, load_gray};
use crate::report::{Report, Table, number, optional};

/// Probability of a corridor and error of its heading on frames whose horizon lies far from their middle (`multi_floor/`).
///
/// The horizon is not given. A heading is right within 3 degrees of the labeled vanishing point's column at an assumed
/// field of view of 90 degrees; in a frame without a label, a probability above 0.5 is wrong. Tracked: frames in order, each floor by
/// itself, without odometry.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let Some(folder) = self.data.set("multi_floor") else { return Ok(Report::default()) };
        let answers = answers(&folder, out)?;
        let mut each = Table::new("Multi floor", &["frame", "probability", "tracked", "error, degrees"]);
        for answer in &answers {
            let (alone, tracked) = (number(answer.probability, 3), number(answer.acting, 3));
            each.row([answer.name.clone().into(), alone, tracked, optional(answer.error_deg, 2)]);
        }
        let mut summary = Summary::new("Summary");
        summary.row("all", &answers.iter().collect::<Vec<_>>());
        Ok(Report::new([each, summary.0]))
    }
}

/// Answers about every frame, in order.
pub fn answers(folder: &Path, out: &Output) -> Result<Vec<Answer>, String> {
    let (mut answers, mut looker, mut floor) = (Vec::new(), None, "");
    let lines = table_lines(folder, "vanishing_points.csv")?;
    for line in &lines {
        let mut fields = line.split(',').map(str::trim);
        let file = fields.next().unwrap_or_default();
        let mut coordinate = || fields.next().and_then(|field| field.parse::<f64>().ok());
        let truth = coordinate().zip(coordinate()).map(|(u, v)| Vector2::new(u, v));
        let image = load_gray(&folder.join("images").join(file))?;
        let view = image.view().map_err(|error| format!("{file}: {error}"))?;
        if file.split('_').next() != Some(floor) {
            floor = file.split('_').next().unwrap_or_default();
            looker = None;
        }
        let looker = looker.get_or_insert_with(|| Looker::guessed(view));
        let name = file.trim_end_matches(".jpg");
        let (answer, look) = looker.answer(name, &image, truth)?;
        out.overlay(name, view, |canvas| draw_answer(canvas, &look, truth))?;
        answers.push(answer);
    }
    if answers.is_empty() { Err(format!("{}: no frame", folder.display())) } else { Ok(answers) }
}
