//! The wall-follower's default method on frames of a real building, before and after the mount is calibrated on other frames of it.

use std::path::{Path, PathBuf};

use yamabico_core::camera::{Calibration, Intrinsics, Mount, Pinhole};
use yamabico_learning::calibration::mount::{Learned, Options, from_pictures};
use yamabico_learning::calibration::pictures::{self, Picture};
use yamabico_learning::calibration::robot_camera::RobotCamera;
use yamabico_vision::calibration::horizon_fit::PrincipalRow;
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::observer::{CorridorCamera, CorridorObserver};

use crate::images::Output;
use crate::report::{Table, number};

/// Assumed field of view, degrees, and largest error of a right heading, degrees.
const FOV_DEG: f64 = 90.0;
const RIGHT_DEG: f64 = 3.0;

/// Frame with the column of its vanishing point, px, if a corridor is in view.
struct Frame {
    picture: Picture,
    column: Option<f64>,
}

/// Rates within 3 degrees on one floor, before and after a calibration on the other.
pub fn table(folder: &Path, out: &Output) -> Result<Table, String> {
    let mut table = Table::new(
        "Multi floor, presumed horizon",
        &[
            "calibrated on",
            "horizon, row",
            "tilt, deg",
            "row, px",
            "scored on",
            "corridors",
            "within 3 deg before",
            "after",
        ],
    );
    for (learn_on, score_on) in [("f1", "f3"), ("f3", "f1")] {
        let (known, new) = (frames(folder, learn_on)?, frames(folder, score_on)?);
        let pictures: Vec<Picture> = known.into_iter().map(|frame| frame.picture).collect();
        let camera = RobotCamera::assumed(pictures[0].size(), FOV_DEG);
        let overlay =
            std::env::temp_dir().join(format!("yamabico-building-{}-{learn_on}.png", std::process::id()));
        let options = Options {
            corridor_width_m: None,
            height_m: None,
            principal_row: PrincipalRow::Judged,
            overlay: overlay.clone(),
        };
        let learned = from_pictures(&pictures, &camera, &options).map_err(|error| error.to_string())?;
        out.keep(&format!("building_{learn_on}"), &overlay)?;
        let given = camera.intrinsics.intrinsics();
        let (after, mount) = calibrated(&learned, &given);
        table.row([
            learn_on.into(),
            number(learned.horizon_row.value, 1),
            number(learned.tilt_deg.value, 2),
            number(after.cy, 1),
            score_on.into(),
            new.iter().filter(|frame| frame.column.is_some()).count().into(),
            right(&new, given, Mount::level(1.0)).into(),
            right(&new, after, mount).into(),
        ]);
    }
    Ok(table)
}

fn calibrated(learned: &Learned, given: &Intrinsics) -> (Intrinsics, Mount) {
    let mount = Mount {
        tilt: learned.tilt_deg.value.to_radians(),
        roll: learned.roll_deg.value.to_radians(),
        ..Mount::level(1.0)
    };
    (Intrinsics { cy: learned.findings.principal_row.unwrap_or(given.cy), ..*given }, mount)
}

/// Number of frames with a corridor whose heading is right.
fn right(frames: &[Frame], intrinsics: Intrinsics, mount: Mount) -> usize {
    let is_right = |frame: &&Frame| {
        let camera = CorridorCamera {
            pinhole: Pinhole::ideal(intrinsics),
            mount,
            calibration: Calibration::Guessed,
            horizon_sigma_rad: 8_f64.to_radians(),
        };
        let mut observer = CorridorObserver::new(camera, FloorLineRule::default());
        let seen = frame.picture.gray.view().ok().and_then(|view| observer.observe(view, None).ok());
        let heading = |column: f64| ((column - intrinsics.cx) / intrinsics.fx).atan().to_degrees();
        let both = seen.zip(frame.column);
        both.is_some_and(|(seen, truth)| {
            (heading(seen.vanishing_point.x) - heading(truth)).abs() <= RIGHT_DEG
        })
    };
    frames.iter().filter(is_right).count()
}

/// Frames of a floor.
fn frames(folder: &Path, floor: &str) -> Result<Vec<Frame>, String> {
    let path = folder.join("vanishing_points.csv");
    let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let of_floor = text.lines().skip(1).filter(|line| line.starts_with(floor));
    let frames: Result<Vec<Frame>, String> = of_floor
        .map(|line| {
            let mut fields = line.split(',').map(str::trim);
            let file: PathBuf = folder.join("images").join(fields.next().unwrap_or_default());
            let mut read = pictures::read(&[file]).map_err(|error| error.to_string())?;
            Ok(Frame { picture: read.remove(0), column: fields.next().and_then(|field| field.parse().ok()) })
        })
        .collect();
    frames.and_then(|frames| {
        if frames.is_empty() { Err(format!("{}: no frame of {floor}", path.display())) } else { Ok(frames) }
    })
}
