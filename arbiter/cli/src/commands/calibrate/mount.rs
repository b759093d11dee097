//! `yamabico calibrate mount`: height, tilt, roll and pan of a camera.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;
use yamabico_learning::calibration::floor_board::{self, Alignment};
use yamabico_learning::calibration::mount::{self, Learned, Options};
use yamabico_learning::calibration::pictures;
use yamabico_learning::calibration::robot_camera::RobotCamera;
use yamabico_vision::calibration::horizon_fit::PrincipalRow;

use super::{BoardArguments, CameraArguments, Written, with_sigma};
use crate::output::{CommandResult, DONE, Failure, Print, table};

/// Arguments of `calibrate mount`.
#[derive(Args)]
pub struct Arguments {
    /// Pictures taken by the robot's camera while it drives along a corridor, or folders of them; or one recording (.mcap) of such a
    /// drive, which with odometry also gives height and pan. With --board: pictures of the board on the floor.
    #[arg(value_name = "PICTURES|RECORDING", required = true)]
    sources: Vec<PathBuf>,
    #[command(flatten)]
    camera: CameraArguments,
    /// Horizontal field of view of a camera without a robot file, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 60.0, allow_negative_numbers = true)]
    fov_deg: f64,
    /// Width of the corridor at the floor, between the baseboards, m: gives the height.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    corridor_width_m: Option<f64>,
    /// Height of the camera above the floor, m, if it was measured by hand.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    height_m: Option<f64>,
    /// Row of the principal point, where horizon and plumb lines contradict the robot file, as in cropped pictures.
    #[arg(long, value_enum, default_value_t = Row::Judge)]
    principal_row: Row,
    /// Overlay to write: horizon, plumb lines and ground grid over a picture.
    #[arg(long, value_name = "FILE.png", default_value = "mount.png")]
    overlay: PathBuf,
    /// Measures from pictures of the printed board, which lies on the floor wholly in view.
    #[arg(long)]
    board: bool,
    /// The board lies square: a side is parallel to the robot's forward axis, which gives the pan.
    #[arg(long, requires = "board")]
    square: bool,
    #[command(flatten)]
    page: BoardArguments,
}

#[derive(Clone, Copy, ValueEnum)]
enum Row {
    /// Estimate it where the contradiction is clear.
    Judge,
    /// Keep that of the robot file.
    Keep,
    /// Estimate it in any case.
    Estimate,
}

#[derive(Serialize)]
struct Shown<T> {
    #[serde(flatten)]
    learned: T,
    robot: Written,
}

/// Calibrates the mount and prints it.
pub fn calibrate(arguments: &Arguments, print: Print) -> CommandResult {
    if !(5.0..=170.0).contains(&arguments.fov_deg) {
        return Err(Failure::usage(format!("--fov-deg is 5 to 170, not {}", arguments.fov_deg)));
    }
    let recording = arguments.sources.iter().find(|path| pictures::is_recording(path));
    if let Some(recording) = recording {
        if arguments.sources.len() > 1 || arguments.board {
            let problem = if arguments.board {
                "--board needs pictures, not a recording"
            } else {
                "name one recording, or pictures"
            };
            return Err(Failure::usage(problem));
        }
        let camera = arguments.camera.camera_of(recording)?;
        let learned = mount::from_recording(recording, &camera, &arguments.options())?;
        return arguments.show(learned, &camera, print);
    }
    let camera = arguments.camera.camera()?;
    let pictures = pictures::read(&arguments.sources)?;
    if arguments.board {
        let camera = camera.ok_or_else(|| {
            Failure::usage("--board needs the lens: name the robot file with --robot after `yamabico calibrate intrinsics`")
        })?;
        let alignment = if arguments.square { Alignment::Square } else { Alignment::Any };
        let learned =
            floor_board::learn(&pictures, &camera, &arguments.page.board()?, alignment, &arguments.overlay)?;
        let robot = arguments.camera.finish(&camera, &learned.findings)?;
        print.show(&Shown { learned, robot }, board_text);
        return Ok(DONE);
    }
    let camera = camera.unwrap_or_else(|| RobotCamera::assumed(pictures[0].size(), arguments.fov_deg));
    let learned = mount::from_pictures(&pictures, &camera, &arguments.options())?;
    arguments.show(learned, &camera, print)
}

impl Arguments {
    fn options(&self) -> Options {
        Options {
            corridor_width_m: self.corridor_width_m,
            height_m: self.height_m,
            principal_row: match self.principal_row {
                Row::Judge => PrincipalRow::Judged,
                Row::Keep => PrincipalRow::Given,
                Row::Estimate => PrincipalRow::Estimated,
            },
            overlay: self.overlay.clone(),
        }
    }

    fn show(&self, learned: Learned, camera: &RobotCamera, print: Print) -> CommandResult {
        let robot = self.camera.finish(camera, &learned.findings)?;
        print.show(&Shown { learned, robot }, text);
        Ok(DONE)
    }
}

fn text(shown: &Shown<Learned>) -> String {
    let Shown { learned, robot } = shown;
    let mut values = table(&["", "value", "from"], 1..2);
    let [all, corridors, agree] = learned.pictures;
    let of_horizon = if learned.is_cropped { "plumb lines" } else { "horizon and principal row" };
    values.add_row(["tilt, degrees down", &with_sigma(&learned.tilt_deg, 2), of_horizon]);
    values.add_row([
        "tilt by plumb lines",
        &with_sigma(&learned.plumb_tilt_deg, 2),
        &format!("{} plumb lines", learned.plumb_lines),
    ]);
    values.add_row(["roll, degrees", &with_sigma(&learned.roll_deg, 2), "plumb lines, vanishing points"]);
    values.add_row([
        "horizon, row",
        &with_sigma(&learned.horizon_row, 1),
        &format!("{corridors} vanishing points"),
    ]);
    values.add_row(["principal point, row", &format!("{:.1}", learned.given_row), "robot file"]);
    values.add_row(["... estimated", &with_sigma(&learned.estimated_row, 1), "horizon and plumb lines"]);
    for (name, height, from) in [
        ("height, m", &learned.height_by_width_m, "width of the corridor"),
        ("height, m", &learned.height_by_motion_m, "motion of the floor"),
    ] {
        if let Some(height) = height {
            values.add_row([name, &with_sigma(height, 3), from]);
        }
    }
    if let Some(pan) = &learned.pan_deg {
        values.add_row(["pan, degrees left", &with_sigma(pan, 2), "motion of the floor"]);
    }
    let mut text = format!(
        "{values}\n{corridors} of {all} pictures show a corridor, {agree} agree with the horizon, residual {:.1} px\n",
        learned.residual_px
    );
    if learned.is_cropped {
        text += "the picture is cropped: its principal point is not where the robot file says, and its row is corrected\n";
    }
    for note in &learned.notes {
        text += &format!("note: {note}\n");
    }
    text += &format!(
        "overlay {}: the red line is the horizon, plumb lines are blue; look whether they fit\n",
        learned.overlay.display()
    );
    text + &robot.text()
}

fn board_text(shown: &Shown<floor_board::Learned>) -> String {
    let Shown { learned, robot } = shown;
    let mut rows = table(&["picture", "residual px", ""], 1..2);
    for picture in &learned.pictures {
        let residual = picture.rms_px.map_or_else(|| "-".to_owned(), |rms| format!("{rms:.3}"));
        rows.add_row([picture.name.clone(), residual, picture.refused.clone().unwrap_or_default()]);
    }
    let mut text = format!(
        "{rows}\nheight {} m, tilt {}° down, roll {}°\n",
        with_sigma(&learned.height_m, 4),
        with_sigma(&learned.tilt_deg, 3),
        with_sigma(&learned.roll_deg, 3)
    );
    if let Some(pan) = &learned.pan_deg {
        text += &format!("pan {}° left, if the board lies square\n", with_sigma(pan, 3));
    }
    text += &format!("overlay {}: look whether the grid lies on the floor\n", learned.overlay.display());
    text + &robot.text()
}
