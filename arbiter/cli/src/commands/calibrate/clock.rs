//! `yamabico calibrate clock`: the latency of a camera.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use yamabico_learning::calibration::clock::{self, Learned};

use super::{CameraArguments, Written, with_sigma};
use crate::output::{CommandResult, DONE, Print};

/// Arguments of `calibrate clock`.
#[derive(Args)]
pub struct Arguments {
    /// Recording (.mcap) of a robot that turns left and right in place, at changing speed, for 20 s or more, in a room with edges to see.
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    #[command(flatten)]
    camera: CameraArguments,
}

#[derive(Serialize)]
struct Shown {
    #[serde(flatten)]
    learned: Learned,
    robot: Option<Written>,
}

/// Estimates the offset and prints it.
pub fn calibrate(arguments: &Arguments, print: Print) -> CommandResult {
    let camera = arguments.camera.camera_of(&arguments.recording)?;
    let learned = clock::learn(&arguments.recording, &camera)?;
    let finish = |findings| arguments.camera.finish(&camera, findings);
    let robot = learned.latency_ms.map(|_| finish(&learned.findings)).transpose()?;
    print.show(&Shown { learned, robot }, text);
    Ok(DONE)
}

fn text(shown: &Shown) -> String {
    let Shown { learned, robot } = shown;
    let offset = &learned.offset_ms;
    let mut text = format!(
        "frames are stamped {} ms later than odometry (correlation {:.3}, {} turns between {} frames, {:.0}°/s)\n\
         turns by frames are {:.3} of those by odometry",
        with_sigma(offset, 1),
        learned.correlation,
        learned.frames[1],
        learned.frames[0],
        learned.rate_degps,
        learned.scale
    );
    text += if (learned.scale - 1.0).abs() > 0.05 {
        ": check the field of view, and the track of the wheels\n"
    } else {
        "\n"
    };
    for warning in &learned.warnings {
        text += &format!("note: {warning}\n");
    }
    match (learned.latency_before_ms, learned.latency_ms) {
        (Some(before), Some(after)) => text += &format!("latency_ms: {before:.1} before, {after:.1} now\n"),
        (Some(before), None) => {
            text += &format!(
                "latency_ms is {before:.1} and would be negative: the odometry arrives late; state its latency instead, by {:.1} ms\n",
                -offset.value
            );
        }
        (None, _) => text += &format!("add {:.1} ms to latency_ms of the camera\n", offset.value),
    }
    text + &robot.as_ref().map_or_else(String::new, Written::text)
}
