//! Reliability of the probability of a corridor over all photographs.

use clap::Args;
use nalgebra::Vector2;
use yamabico_drawing::palette::{GRID, INK};
use yamabico_drawing::{Canvas, font};

use super::answers::{Answer, Summary};
use super::{corridor_drive, multi_floor, no_corridor, york_urban};
use crate::arguments::Data;
use crate::images::Output;
use crate::report::{Report, Table, number};

/// Bounds of the bins of probability.
const BINS: [f64; 7] = [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0];
/// Least share of right answers where the probability is at least 0.9.
const MIN_RIGHT_WHERE_SURE: f64 = 0.95;

/// Reliability of the probability of a corridor: how often answers of a probability are right.
///
/// Takes every photograph of `multi_floor/` and `no_corridor/`, the indoor ones of `york_urban/` and the labeled ones of
/// `corridor_drive/`, each judged alone. Image: `reliability.png`. Fails if fewer than 95 % of the answers with a probability of at
/// least 0.9 are right.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
}

/// Answers of one bin.
struct Bin {
    range: [f64; 2],
    count: usize,
    mean: f64,
    right: usize,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let quiet = Output::new(None)?;
        let mut sets = Vec::new();
        if let Some(folder) = self.data.set("multi_floor") {
            sets.push(("multi_floor", multi_floor::answers(&folder, &quiet)?));
        }
        if let Some(folder) = self.data.set("no_corridor") {
            sets.push(("no_corridor", no_corridor::answers(&folder, &quiet)?));
        }
        if let Some(folder) = self.data.set("york_urban") {
            sets.push(("york_urban, indoor", york_urban::indoor_answers(&folder)?));
        }
        if let Some(folder) = self.data.set("corridor_drive") {
            sets.push(("corridor_drive", corridor_drive::answers(&folder, &quiet)?));
        }
        if sets.is_empty() {
            return Ok(Report::default());
        }
        let mut summary = Summary::new("Answers by set");
        for (name, answers) in &sets {
            summary.row(name, &answers.iter().collect::<Vec<_>>());
        }
        let all: Vec<&Answer> = sets.iter().flat_map(|(_, answers)| answers).collect();
        summary.row("all", &all);
        let bins = bins(&all);
        let mut table =
            Table::new("Reliability", &["from", "to", "photographs", "mean p", "right", "share right"]);
        for bin in &bins {
            table.row([
                number(bin.range[0], 1),
                number(bin.range[1], 1),
                bin.count.into(),
                number(bin.mean, 3),
                bin.right.into(),
                number(bin.right as f64 / bin.count as f64, 3),
            ]);
        }
        plot(out, &bins)?;
        let (sure, right) = bins.last().map_or((0, 0), |bin| (bin.count, bin.right));
        let is_reliable = right as f64 >= MIN_RIGHT_WHERE_SURE * sure as f64;
        let problem = format!("{right} of {sure} answers with a probability of at least 0.9 are right");
        Ok(Report::new([summary.0, table]).require(is_reliable, problem))
    }
}

fn bins(answers: &[&Answer]) -> Vec<Bin> {
    let ranges = BINS.windows(2).map(|pair| [pair[0], pair[1]]);
    let bin = |range: [f64; 2]| {
        let within = |p: f64| p >= range[0] && (p < range[1] || range[1] == 1.0);
        let inside: Vec<_> = answers.iter().filter(|answer| within(answer.probability)).collect();
        Bin {
            range,
            count: inside.len(),
            mean: inside.iter().map(|answer| answer.probability).sum::<f64>() / inside.len() as f64,
            right: inside.iter().filter(|answer| answer.is_right()).count(),
        }
    };
    ranges.map(bin).collect()
}

/// Writes the plot as `reliability.png`: share of right answers over mean probability, with two standard deviations.
fn plot(out: &Output, bins: &[Bin]) -> Result<(), String> {
    const SIZE: (usize, usize) = (480, 460);
    const LEFT: f64 = 56.0;
    const TOP: f64 = 40.0;
    const SIDE: f64 = 360.0;
    let mut pixels = vec![255; 3 * SIZE.0 * SIZE.1];
    let mut canvas = Canvas::new(&mut pixels, SIZE.0, SIZE.1).ok_or("no canvas")?;
    let at = |p: f64, share: f64| Vector2::new(LEFT + SIDE * p, TOP + SIDE * (1.0 - share));
    for tick in (0..=10).map(|tick| f64::from(tick) / 10.0) {
        let color = if tick == 0.0 { INK } else { GRID };
        canvas.line(at(0.0, tick), at(1.0, tick), color);
        canvas.line(at(tick, 0.0), at(tick, 1.0), color);
        let text = format!("{tick:.1}");
        let width = font::width(&text, font::TEXT_PX);
        canvas.text(at(0.0, tick) + Vector2::new(-8.0 - width, -4.0), &text, INK);
        canvas.text(at(tick, 0.0) + Vector2::new(-0.5 * width, 8.0), &text, INK);
    }
    canvas.line(at(0.0, 0.0), at(1.0, 1.0), [150, 150, 150]);
    canvas.text(Vector2::new(LEFT, 8.0), "share of right answers, with two standard deviations", INK);
    let below = "probability of a corridor with the right heading";
    canvas.text(Vector2::new(LEFT, TOP + SIDE + 28.0), below, INK);
    for bin in bins.iter().filter(|bin| bin.count > 0) {
        let (count, share) = (bin.count as f64, bin.right as f64 / bin.count as f64);
        // Two successes and failures more keep the interval honest at 0 and 1 (Agresti and Coull, 1998).
        let center = (bin.right as f64 + 2.0) / (count + 4.0);
        let sigma = (center * (1.0 - center) / (count + 4.0)).sqrt();
        let (low, high) = ((center - 2.0 * sigma).max(0.0), (center + 2.0 * sigma).min(1.0));
        canvas.line(at(bin.mean, low), at(bin.mean, high), [200, 120, 60]);
        canvas.cross(at(bin.mean, share), 4.0, [200, 40, 40]);
        canvas.text(at(bin.mean, share) + Vector2::new(6.0, 4.0), &bin.count.to_string(), INK);
    }
    out.rgb("reliability", &pixels, SIZE.0 as u32, SIZE.1 as u32)
}
