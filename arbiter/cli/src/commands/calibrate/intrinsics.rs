//! `yamabico calibrate intrinsics`: the lens of a camera.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use yamabico_learning::calibration::lens::{self, Learned};
use yamabico_learning::calibration::pictures;
use yamabico_learning::calibration::robot_camera::{Findings, RobotCamera};

use super::{BoardArguments, CameraArguments, Written};
use crate::output::{CommandResult, DONE, Print, table};

/// Arguments of `calibrate intrinsics`.
#[derive(Args)]
pub struct Arguments {
    /// Pictures of the board (PNG, JPEG), or folders of them: 15 or more, sharp, all of one size, with the focus fixed. The board
    /// is near and far, in the middle and at the edges, and turned by up to 45 degrees about both axes.
    #[arg(value_name = "PICTURES", required = true)]
    pictures: Vec<PathBuf>,
    #[command(flatten)]
    board: BoardArguments,
    #[command(flatten)]
    camera: CameraArguments,
    /// Folder for copies of the pictures with the corners drawn into them.
    #[arg(long, value_name = "DIR")]
    overlays: Option<PathBuf>,
}

#[derive(Serialize)]
struct Shown {
    #[serde(flatten)]
    learned: Learned,
    robot: Written,
}

/// Calibrates the lens and prints it.
pub fn calibrate(arguments: &Arguments, print: Print) -> CommandResult {
    let board = arguments.board.board()?;
    let camera = arguments.camera.camera()?;
    let pictures = pictures::read(&arguments.pictures)?;
    let size = pictures[0].size();
    let camera = match camera {
        Some(camera) => {
            camera.check_size(&pictures[0].name, size)?;
            camera
        }
        None => RobotCamera::assumed(size, 60.0),
    };
    let learned = lens::learn(&pictures, &board, arguments.overlays.as_deref())?;
    let robot =
        arguments.camera.finish(&camera, &Findings { lens: learned.pinhole, ..Findings::default() })?;
    print.show(&Shown { learned, robot }, text);
    Ok(DONE)
}

fn text(shown: &Shown) -> String {
    let Shown { learned, robot } = shown;
    let mut rows = table(&["picture", "residual px", ""], 1..2);
    for picture in &learned.pictures {
        let residual = picture.rms_px.map_or_else(|| "-".to_owned(), |rms| format!("{rms:.3}"));
        let note = picture.refused.as_ref().map_or_else(String::new, |cause| format!("not used: {cause}"));
        rows.add_row([picture.name.clone(), residual, note]);
    }
    let mut values = table(&["", "value", "standard deviation"], 1..3);
    for (name, number) in &learned.parameters {
        let decimals = if name.starts_with(['f', 'c']) { 2 } else { 5 };
        let sigma = number.sigma.unwrap_or_default();
        values.add_row([
            (*name).to_owned(),
            format!("{:.decimals$}", number.value),
            format!("{sigma:.decimals$}"),
        ]);
    }
    let used = learned.pictures.iter().filter(|picture| picture.refused.is_none()).count();
    let mut text = format!(
        "{rows}\n{values}\n{used} of {} pictures used, residual {:.3} px, horizontal field of view {:.1}°\n",
        learned.pictures.len(),
        learned.rms_px,
        learned.fov_deg
    );
    for advice in &learned.advice {
        text += &format!("more accurate: {advice}\n");
    }
    if let Some(folder) = &learned.overlays {
        text += &format!("overlays {}\n", folder.display());
    }
    text + &robot.text() + "\nnext: the mount (`yamabico calibrate mount`)\n"
}
