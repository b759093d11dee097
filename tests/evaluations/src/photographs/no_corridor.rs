//! Photographs without any corridor.

use std::path::Path;

use clap::Args;

use super::answers::{Answer, Looker, Summary};
use super::{draw_answer, table_lines};
use crate::arguments::Data;
use crate::images::{Output, load_gray};
use crate::report::{Report, Table, number};

/// Probability of a corridor in photographs without any (`no_corridor/`): rooms, doors and cupboards.
///
/// Each photograph is judged alone; a probability above 0.5 is wrong.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let Some(folder) = self.data.set("no_corridor") else { return Ok(Report::default()) };
        let answers = answers(&folder, out)?;
        let mut each = Table::new("Wrong answers", &["photograph", "probability"]);
        for answer in answers.iter().filter(|answer| answer.probability > 0.5) {
            each.row([answer.name.clone().into(), number(answer.probability, 3)]);
        }
        let mut summary = Summary::new("Summary");
        summary.row("all", &answers.iter().collect::<Vec<_>>());
        Ok(Report::new([each, summary.0]))
    }
}

/// Answers about every photograph.
pub fn answers(folder: &Path, out: &Output) -> Result<Vec<Answer>, String> {
    let mut answers = Vec::new();
    for line in table_lines(folder, "index.csv")? {
        let file = line.split(',').next().unwrap_or_default();
        let image = load_gray(&folder.join("images").join(file))?;
        let view = image.view().map_err(|error| format!("{file}: {error}"))?;
        let name = file.split('.').next().unwrap_or_default();
        let (answer, look) = Looker::guessed(view).answer(name, &image, None)?;
        out.overlay(name, view, |canvas| draw_answer(canvas, &look, None))?;
        answers.push(Answer { acting: answer.probability, ..answer });
    }
    if answers.is_empty() { Err(format!("{}: no photograph", folder.display())) } else { Ok(answers) }
}
