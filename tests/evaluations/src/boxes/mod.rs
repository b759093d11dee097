//! Detection of boxes in the rendered hallway, and false alarms.

#![allow(clippy::unwrap_used, reason = "the hallway and its images are valid")]

mod fading;
mod hallway;
mod plot;

use clap::Args;

use self::fading::{curve, faded_boxes};
use self::hallway::{BROWN, Hallway, Observation, REGIONS, WHITE};
use self::plot::{Curve, plot};
use crate::arguments::Samples;
use crate::images::Output;
use crate::report::{Report, Table, number, percent};
use crate::statistics::mean;

/// Contrast of the brown boxes to the floor, gray levels.
const FAINT: (f64, f64) = (12.0, 20.0);
/// Maximum contrast of faded boxes, gray levels.
const MAX_FADED: f64 = 40.0;

/// Detection of a white and a brown box in the rendered hallway, and rate of false alarms.
///
/// Thresholds are learned first, every half meter of the empty hallway from twelve images of a robot that weaves by 15 cm and 6 degrees.
/// A box of 24 x 24 x 35 cm with random yaw stands in the corridor, 1 to 3 m ahead (2 m in the outer regions), its center in one of the
/// five regions; the robot is up to 0.3 m off the center line, turned by up to 8 degrees. The detector gets the true pose with errors of
/// 2 cm across, 5 cm along and 0.2 degrees (standard deviations). Images are independent. A box is detected if a region that shows a
/// part of it is reported; its contrast is the median difference to the floor that it hides, without noise. Images that the detector
/// refuses count as without detection. Images: those evaluated wrongly. `--fading` limits the difference of a box to its background.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    samples: Samples,
    /// Evaluate faded boxes too: share detected over contrast, and its plot.
    #[arg(long)]
    fading: bool,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let images = self.samples.count_or(200);
        let mut hallway = Hallway::new(self.samples.seed, out);
        hallway.learn();
        let mut tables = vec![thresholds(&hallway), false_alarms(&mut hallway, 5 * images)];
        tables.push(detections(&mut hallway, images));
        if self.fading {
            tables.push(fading(&mut hallway, 10 * images, out)?);
        }
        Ok(Report::new(tables))
    }
}

fn thresholds(hallway: &Hallway) -> Table {
    let mut table = Table::new(
        "Learned thresholds at 256 x 240",
        &["x, m", "T0", "N0", "N0 extra", "contrast", "level", "recall"],
    );
    for p in &hallway.table.places {
        table.row([
            number(p.x_m, 1),
            u32::from(p.t0).into(),
            p.n0.into(),
            p.n0_extra.into(),
            number(p.contrast, 1),
            number(f64::from(p.level), 0),
            number(p.recall, 2),
        ]);
    }
    table
}

fn false_alarms(hallway: &mut Hallway, images: usize) -> Table {
    let mut false_alarms = 0_u32;
    let empty = hallway.empty.clone();
    for _ in 0..images {
        let robot = hallway.random_pose(0.0..12.0);
        let pixels = hallway.image(&empty, robot);
        if hallway.flagged(&pixels, robot).contains(&true) {
            false_alarms += 1;
            hallway.draw(&pixels, &format!("false_{false_alarms}"));
        }
    }
    let mut table =
        Table::new("Images without a box", &["images", "false alarms", "false alarms, %", "refused"]);
    table.row([
        images.into(),
        false_alarms.into(),
        percent(f64::from(false_alarms), images as f64),
        hallway.refused.into(),
    ]);
    table
}

fn detections(hallway: &mut Hallway, images: usize) -> Table {
    let mut table = Table::new(
        "Images with a box",
        &["box", "region", "images", "detected", "detected, %", "mean distance, m", "refused so far"],
    );
    for (name, faint) in [("white", None), ("brown, 12 to 20 gray levels", Some(FAINT))] {
        let (mut missing, mut observations) = ([images; REGIONS], Vec::new());
        while missing.iter().any(|&count| count > 0) {
            hallway.try_box(&mut missing, faint, &mut observations);
        }
        let mut row = |region: String, observations: &[&Observation]| {
            let found = observations.iter().filter(|observation| observation.is_found).count();
            let distances: Vec<f64> = observations.iter().map(|observation| observation.distance_m).collect();
            table.row([
                name.into(),
                region.into(),
                observations.len().into(),
                found.into(),
                percent(found as f64, observations.len() as f64),
                number(mean(&distances), 2),
                hallway.refused.into(),
            ]);
        };
        for region in 0..REGIONS {
            let here: Vec<_> =
                observations.iter().filter(|observation| observation.region == region).collect();
            row(region.to_string(), &here);
        }
        row("all".to_owned(), &observations.iter().collect::<Vec<_>>());
    }
    table
}

fn fading(hallway: &mut Hallway, images: usize, out: &Output) -> Result<Table, String> {
    let mut table = Table::new("Faded boxes", &["box", "contrast", "images", "detected, %"]);
    let curves =
        [WHITE, BROWN].map(|color| curve(&faded_boxes(hallway, color, images, MAX_FADED), 2.0, MAX_FADED));
    for (name, curve) in ["white", "brown"].into_iter().zip(&curves) {
        for &(contrast, share, count) in curve {
            table.row([name.into(), number(contrast, 1), count.into(), number(share, 1)]);
        }
    }
    let [white, brown] = &curves;
    let curves = [
        Curve { name: "white box, faded", color: [20, 60, 200], points: white },
        Curve { name: "brown box, faded", color: [190, 90, 20], points: brown },
    ];
    plot(out, &curves, MAX_FADED)?;
    Ok(table)
}
