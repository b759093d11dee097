//! Photographs of a real corridor, from the sensor to the proposal: the behavior steers towards the labeled end of the corridor.
//!
//! The photographs are the data set `corridor_drive`.

use std::collections::HashMap;
use std::path::Path;

use yamabico_core::message::{Message, MessageType, Proposal};
use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::record::Tap;

use crate::support::{run_seed, task};

/// Principal column, px, of images 960 px wide.
const CENTER_PX: f64 = 479.5;
/// Assumed focal length, px: 90 degrees.
const FOCAL_PX: f64 = 480.0;
/// Distance of a label from the center below which it decides no steering direction, px.
const STEERING_DEADBAND_PX: f64 = 10.0;

/// Column of the corridor's end, px, and proposed turn rate, rad/s, by the index of the photograph.
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
            // One frame per second, the first at the start.
            self.0.insert(proposal.evidence_ns / 1_000_000_000, (column, proposal.twist.angular));
        }
    }
}

/// Returns index and labeled column, px, of every photograph with a label.
fn labels(folder: &Path) -> Vec<(u64, f64)> {
    let mut names: Vec<String> = std::fs::read_dir(folder.join("images"))
        .unwrap()
        .map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    names.sort();
    let text = std::fs::read_to_string(folder.join("labels.csv")).unwrap();
    // The polygons between the quotes contain commas; the point is the last two fields.
    let labeled = text.lines().filter_map(|line| {
        let column = line.rsplit(',').nth(1)?.parse().ok()?;
        let number = names.iter().position(|name| Some(name.as_str()) == line.split(',').next())?;
        Some((number as u64, column))
    });
    labeled.collect()
}

/// Returns a quantile of sorted values, interpolated.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let position = share * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[position.floor() as usize], sorted[position.ceil() as usize]);
    below + (above - below) * position.fract()
}

#[test]
fn the_behavior_steers_towards_the_end_of_a_real_corridor() {
    let Some(folder) = yamabico_testkit::data::data_set("corridor_drive") else { return };
    let folder = folder.canonicalize().unwrap();
    let images = folder.join("images");
    let set = format!("robot.sensors.front.files={:?}", images.to_str().unwrap());
    let task = task("corridor-photos", &[&set]);
    let mut answers = Answers::default();
    let result = run_seed(&task, 1, &mut answers);
    assert_eq!(result.end, RunEnd::SensorsEnded);

    let (mut errors, mut steered, mut correct) = (Vec::new(), 0, 0);
    for (number, column) in labels(&folder) {
        // A photograph without a proposal counts as half the width off and as steered wrongly.
        let (found, turn) = answers.0.get(&number).copied().unwrap_or((CENTER_PX + 480.0, 0.0));
        errors.push((found - column).abs());
        let offset = column - CENTER_PX;
        if offset.abs() > STEERING_DEADBAND_PX {
            steered += 1;
            // A turn to the right is negative.
            correct += usize::from(turn * offset < 0.0);
        }
    }
    errors.sort_by(f64::total_cmp);
    let (median, p90) = (percentile(&errors, 0.5), percentile(&errors, 0.9));
    println!(
        "{} photographs: median {median:.1}, 90 % {p90:.1} px; correct direction in {correct} of {steered}",
        errors.len()
    );
    assert!(errors.len() > 100 && median < 7.5 && p90 < 18.5, "median {median} px, 90 % {p90} px");
    assert!(100 * correct >= 98 * steered, "{correct} of {steered}");
}
