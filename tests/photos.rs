//! Photographs of a real corridor pass the whole spine: the behavior steers towards where people see the corridor end.
//!
//! The photographs are no part of the project: the folder `corridor_drive` in `YAMABICO_DATA`, else in `../shared/data`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use yamabico::plugins::plugins;
use yamabico_core::message::{Message, MessageType, Proposal};
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::End;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, run};

/// The principal column and the guessed focal length, pixels: 960 wide and 90 degrees.
const CENTER_PX: f64 = 479.5;
const FOCAL_PX: f64 = 480.0;
/// Labels nearer to the center say nothing about where to steer, pixels.
const STEERING_DEADBAND_PX: f64 = 10.0;

/// Where the behavior saw the corridor's end, pixels, and how it wanted to turn, rad/s, by the picture's number.
#[derive(Default)]
struct Answers(HashMap<u64, (f64, f64)>);

impl Tap for Answers {
    fn message(
        &mut self,
        _: &str,
        message: &MessageType,
        _: yamabico_core::time::Time,
        header: &[u8],
        _: &[u8],
    ) {
        if message.name != Proposal::NAME {
            return;
        }
        let proposal: Proposal = bytemuck::pod_read_unaligned(header);
        let heading_deg =
            proposal.note.as_str().strip_prefix("heading ").and_then(|text| text.split(' ').next());
        if let Some(Ok(degrees)) = heading_deg.map(str::parse::<f64>) {
            let column = CENTER_PX + FOCAL_PX * degrees.to_radians().tan();
            // One picture a second, the first at the start.
            self.0.insert(proposal.evidence_ns / 1_000_000_000, (column, proposal.twist.angular));
        }
    }
}

/// Number and labeled column, pixels, of every photograph that has a label.
fn labels(folder: &Path) -> Vec<(u64, f64)> {
    let mut names: Vec<String> = std::fs::read_dir(folder.join("images"))
        .unwrap()
        .map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    names.sort();
    let text = std::fs::read_to_string(folder.join("labels.csv")).unwrap();
    // The polygons between the quotes hold commas; the point is the last two fields.
    let labeled = text.lines().filter_map(|line| {
        let column = line.rsplit(',').nth(1)?.parse().ok()?;
        let number = names.iter().position(|name| Some(name.as_str()) == line.split(',').next())?;
        Some((number as u64, column))
    });
    labeled.collect()
}

/// Of sorted values, linear between two of them.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    below + (above - below) * place.fract()
}

#[test]
fn the_behavior_steers_towards_the_end_of_a_real_corridor() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let data = std::env::var_os("YAMABICO_DATA").map_or(root.join("../shared/data"), PathBuf::from);
    let Ok(folder) = data.join("corridor_drive").canonicalize() else {
        println!("skipped: there is no corridor_drive in {}", data.display());
        return;
    };
    let images = folder.join("images");
    let set = vec![format!("robot.sensors.front.files={:?}", images.to_str().unwrap())];
    let path = root.join("configs/corridor-photos.toml");
    let task = load(&path, &Overrides { set, ..Overrides::default() }, &plugins())
        .unwrap_or_else(|problems| panic!("{problems}"));
    let mut answers = Answers::default();
    let ran = run(&task, &Options::default(), &AtomicBool::new(false), &mut answers, &mut |_| {}).unwrap();
    assert_eq!(ran.end, End::SensorsEnded);

    let (mut errors, mut steered, mut right) = (Vec::new(), 0, 0);
    for (number, column) in labels(&folder) {
        // A picture without an answer is half the width off and steered wrongly.
        let (seen, turn) = answers.0.get(&number).copied().unwrap_or((CENTER_PX + 480.0, 0.0));
        errors.push((seen - column).abs());
        let offset = column - CENTER_PX;
        if offset.abs() > STEERING_DEADBAND_PX {
            steered += 1;
            // To what lies on the right, which is a negative turn.
            right += usize::from(turn * offset < 0.0);
        }
    }
    errors.sort_by(f64::total_cmp);
    let (median, most) = (percentile(&errors, 0.5), percentile(&errors, 0.9));
    println!(
        "{} pictures: median {median:.1}, 90 % {most:.1} px; turns to the right side in {right} of {steered}",
        errors.len()
    );
    assert!(errors.len() > 100 && median < 7.5 && most < 18.5, "median {median} px, 90 % {most} px");
    assert!(100 * right >= 98 * steered, "{right} of {steered}");
}
