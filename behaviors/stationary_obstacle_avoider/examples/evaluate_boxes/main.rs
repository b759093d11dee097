//! How surely a white and a brown box are seen in the rendered hallway, and how often something is seen where nothing is.
//!
//!     cargo run --release -p yamabico-stationary-obstacle-avoider --example evaluate_boxes -- [--images N] [--seed N] [--plot FILE.png] [--show DIR]
//!
//! Thresholds are learned first, every half meter of the empty hallway from twelve pictures of a
//! robot that weaves by 15 cm and 6 degrees. A box 24 x 24 x 35 cm stands, turned at
//! random, inside the corridor, 1 to 3 m ahead (2 m in the outer regions), its middle in one of the five regions; the robot is up
//! to 0.3 m beside the middle, turned by up to 8 degrees. The detector is told the true pose with errors of 2 cm across, 5 cm along
//! and 0.2 degrees (standard deviations). Each picture stands alone. A box is found where a region that it covers a part of is
//! flagged. Its contrast is the median difference to the bare floor over what it hides of it, without noise. A picture that is
//! not judged counts as one in which nothing was found. `--show` keeps the pictures that were judged wrongly. `--plot` fades boxes
//! into what is behind them: no pixel of a box differs by more than a limit from the picture without it, and its contrast is the
//! largest difference that is left along its upright outline.

#![allow(clippy::unwrap_used, clippy::expect_used, missing_docs, reason = "an evaluation")]

mod course;
mod fading;
mod plot;

use std::path::PathBuf;

use crate::course::{BROWN, Course, REGIONS, Seen, WHITE};
use crate::fading::{curve, faded_boxes};
use crate::plot::{Curve, plot};

/// Contrasts (gray levels) of the brown boxes that are to be found.
const FAINT: (f64, f64) = (12.0, 20.0);
/// Contrast up to which faded boxes are looked at, gray levels.
const FAINTEST: f64 = 40.0;

fn report(name: &str, seen: &[Seen]) {
    for region in 0..REGIONS {
        let here: Vec<&Seen> = seen.iter().filter(|seen| seen.region == region).collect();
        let found = here.iter().filter(|seen| seen.is_found).count();
        println!("{name}, region {region}: found {found} of {}", here.len());
    }
    let found = seen.iter().filter(|seen| seen.is_found).count();
    let distance_m = seen.iter().map(|seen| seen.distance_m).sum::<f64>() / seen.len() as f64;
    println!(
        "{name}: found {found} of {} ({:.1} %), {distance_m:.2} m ahead on average",
        seen.len(),
        100.0 * found as f64 / seen.len() as f64
    );
}

fn main() {
    let (mut images, mut seed, mut file, mut show) = (200, 1, None::<PathBuf>, None::<PathBuf>);
    let mut rest = std::env::args().skip(1);
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--images" => images = rest.next().and_then(|n| n.parse().ok()).expect("--images N"),
            "--seed" => seed = rest.next().and_then(|n| n.parse().ok()).expect("--seed N"),
            "--show" => show = rest.next().map(PathBuf::from),
            "--plot" => file = rest.next().map(PathBuf::from),
            other => panic!("unknown argument {other}"),
        }
    }
    let mut course = Course::new(seed, show);
    course.learn();
    let n0 = course.table.places.iter().map(|place| place.n0);
    println!("N0 from {} to {} at 256 x 240", n0.clone().min().unwrap(), n0.max().unwrap());
    println!("   x      T0  N0  N0_extra  contrast level recall");
    for p in &course.table.places {
        println!(
            "{:6.1} {:4} {:4} {:6} {:9.1} {:6} {:8.2}",
            p.x_m, p.t0, p.n0, p.n0_extra, p.contrast, p.level, p.recall
        );
    }
    let mut false_alarms = 0;
    let empty = course.empty.clone();
    let clear = 5 * images;
    for _ in 0..clear {
        let robot = course.somewhere(0.0..12.0);
        let pixels = course.picture(&empty, robot);
        let flagged = course.flagged(&pixels, robot);
        if flagged.contains(&true) {
            false_alarms += 1;
            course.show(&pixels, &format!("false_{false_alarms}"));
        }
    }
    println!(
        "clear pictures with a false alarm: {false_alarms} of {clear} ({:.1} %), not judged: {}",
        100.0 * f64::from(false_alarms) / clear as f64,
        course.unjudged
    );
    for (name, faint) in [("white", None), ("brown, 12 to 20 gray levels", Some(FAINT))] {
        let (mut wanted, mut seen) = ([images; REGIONS], Vec::new());
        while wanted.iter().any(|&left| left > 0) {
            course.try_box(&mut wanted, faint, &mut seen);
        }
        report(name, &seen);
    }
    println!("pictures not judged so far, which count as not found: {}", course.unjudged);
    if let Some(file) = file {
        let curves = [WHITE, BROWN].map(|color| {
            let faded = faded_boxes(&mut course, color, 10 * images, FAINTEST);
            curve(&faded, 2.0, FAINTEST)
        });
        for (name, curve) in ["white", "brown"].iter().zip(&curves) {
            for (contrast, share, count) in curve {
                println!("{name} faded, contrast {contrast:4.1}: {share:5.1} % of {count}");
            }
        }
        let [white, brown] = &curves;
        let curves = [
            Curve { name: "white box, faded", color: [20, 60, 200], points: white },
            Curve { name: "brown box, faded", color: [190, 90, 20], points: brown },
        ];
        plot(&file, &curves, FAINTEST);
    }
}
