//! Mounts from rendered corridors, and from a rendered board on the floor.

use std::ops::Range;

use nalgebra::{Isometry3, Vector2, Vector3};
use rand::RngExt;
use yamabico_core::camera::{Calibration, Distortion, Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_learning::calibration::mount::{Options, from_drive};
use yamabico_learning::calibration::pictures::Picture;
use yamabico_learning::calibration::robot_camera::RobotCamera;
use yamabico_rigs::board::{INDOORS, render_board};
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_vision::calibration::board_mount::board_mount;
use yamabico_vision::calibration::float_image::FloatImage;
use yamabico_vision::calibration::horizon_fit::PrincipalRow;
use yamabico_vision::calibration::{Board, find_board};

use super::{COLUMNS, errors_row};
use crate::images::Output;
use crate::report::Table;

/// Width of the corridor between its baseboards, m, and number of frames of a drive.
const WIDTH_M: f64 = 2.0;
const FRAMES: usize = 30;
/// Error of the odometry's scale.
const ODOMETRY_SCALE: f64 = 1.005;
/// Size and horizontal field of view of the frames.
const SIZE: (u32, u32) = (640, 480);
const FOV_RAD: f64 = 1.1;
const LENS: Distortion = Distortion { k1: -0.12, k2: 0.02, p1: 0.0, p2: 0.0, k3: 0.0 };

/// Errors of tilt, roll, principal row, height and pan by drives, and by a board.
pub fn tables(seeds: Range<u64>, out: &Output) -> Result<[Table; 2], String> {
    Ok([drives(seeds.clone(), out)?, boards(seeds, out)?])
}

fn drives(seeds: Range<u64>, out: &Output) -> Result<Table, String> {
    let [mut tilt, mut roll, mut row, mut by_width, mut by_motion, mut pan] = [const { Vec::new() }; 6];
    let (mut judged, mut drives, mut cropped) = (0, 0, 0);
    for seed in seeds {
        let mut rng = stream(seed, "mount");
        let mut near = |middle: f64, range: f64| rng.random_range(middle - range..middle + range);
        let degrees = |angle: f64| angle.to_radians();
        let mount = Mount {
            x: 0.1,
            y: 0.0,
            z: near(0.55, 0.3),
            tilt: degrees(near(5.0, 7.0)),
            roll: degrees(near(0.0, 3.0)),
            pan: degrees(near(0.0, 3.0)),
        };
        let given = Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, FOV_RAD);
        let is_cropped = seed % 2 == 0;
        let cropped_px = if is_cropped { near(0.0, 1.0).signum() * near(110.0, 30.0) } else { 0.0 };
        let truth = Intrinsics { cy: given.cy + cropped_px, ..given };
        let (mut pictures, mut poses, mut at) = (Vec::new(), Vec::new(), 0.3);
        let scene = Scene::new(&World::random_corridor(seed, WIDTH_M + 2.0 * baseboard_m()), 0)
            .map_err(|error| error.to_string())?;
        let photometry = Photometry { noise_sigma: 4.0, blur_px: 0.8, ..Photometry::default() };
        let mut renderer = Renderer::new(photometry, stream(seed, "noise"));
        let (mut y, mut heading) = (near(0.0, 0.2), 0.0_f64);
        for frame in 0..FRAMES {
            let robot = Pose2::new(at, y, heading);
            pictures.push(Picture {
                name: format!("{frame}"),
                gray: frame_of(&mut renderer, &scene, &truth, &mount, robot)?,
            });
            poses.push(Some(Pose2::new(ODOMETRY_SCALE * at, ODOMETRY_SCALE * y, heading)));
            let step = near(0.12, 0.05);
            (at, y) = (at + step * heading.cos(), y + step * heading.sin());
            heading = 0.05 * (0.4 * frame as f64).sin() - 0.1 * y;
        }
        let mut camera = RobotCamera::assumed([SIZE.0, SIZE.1], FOV_RAD.to_degrees());
        camera.intrinsics.distortion = LENS;
        camera.mount.x_m = mount.x;
        camera.mount.z_m = 0.4;
        camera.calibration = Calibration::Measured;
        let overlay = std::env::temp_dir().join(format!("yamabico-mount-{}-{seed}.png", std::process::id()));
        let options = Options {
            corridor_width_m: Some(WIDTH_M),
            height_m: None,
            principal_row: PrincipalRow::Judged,
            overlay: overlay.clone(),
        };
        drives += 1;
        cropped += usize::from(is_cropped);
        let Ok(found) = from_drive(&pictures, &poses, &camera, &options) else { continue };
        out.keep(&format!("mount_{seed}"), &overlay)?;
        tilt.push(found.tilt_deg.value - mount.tilt.to_degrees());
        roll.push(found.roll_deg.value - mount.roll.to_degrees());
        if found.is_cropped {
            row.push(found.estimated_row.value - truth.cy);
        }
        judged += usize::from(found.is_cropped == is_cropped);
        by_width.extend(found.height_by_width_m.map(|height| 1e3 * (height.value - mount.z)));
        by_motion.extend(found.height_by_motion_m.map(|height| 1e3 * (height.value - mount.z)));
        pan.extend(found.pan_deg.map(|pan| pan.value - mount.pan.to_degrees()));
    }
    let title =
        format!("{drives} drives of {FRAMES} frames, every other one cropped: {judged} judged rightly");
    let mut table = Table::new(title, &COLUMNS);
    for (name, errors) in [
        ("tilt, degrees", &tilt),
        ("roll, degrees", &roll),
        ("principal row where cropped, px", &row),
        ("height by the corridor's width, mm", &by_width),
        ("height by the floor's motion, mm", &by_motion),
        ("pan, degrees", &pan),
    ] {
        let of = if name.contains("cropped") { cropped } else { drives };
        errors_row(&mut table, name, errors, of);
    }
    Ok(table)
}

fn boards(seeds: Range<u64>, out: &Output) -> Result<Table, String> {
    let board = Board::new("9x6", 0.025).map_err(|error| error.to_string())?;
    let [mut tilt, mut roll, mut height, mut pan] = [const { Vec::new() }; 4];
    let mut mounts = 0;
    for seed in seeds {
        let mut rng = stream(seed, "floor board");
        let mut near = |middle: f64, range: f64| rng.random_range(middle - range..middle + range);
        let mount = Mount {
            z: near(0.35, 0.15),
            tilt: near(18.0, 8.0).to_radians(),
            roll: near(0.0, 3.0).to_radians(),
            pan: near(0.0, 4.0).to_radians(),
            ..Mount::default()
        };
        let pinhole = Pinhole::new(Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, FOV_RAD), LENS);
        let ahead_m = mount.z / (mount.tilt + 0.2).tan();
        let shifts = [0.0, 0.05, -0.05].map(|shift| Vector2::new(ahead_m - 0.07, 0.1 + shift));
        let mut found = Vec::new();
        for (number, shift) in shifts.into_iter().enumerate() {
            // The board's x to the right, and its y towards the robot, face up.
            let turn =
                nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -std::f64::consts::FRAC_PI_2);
            let body_from_board = Isometry3::from_parts(
                Vector3::new(shift.x + 0.125, shift.y, 0.0).into(),
                turn * nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI),
            );
            let pose = mount.body_from_camera().inverse() * body_from_board;
            let picture = render_board(&board, &pinhole, &pose, INDOORS, &mut rng);
            if out.is_on() {
                out.gray(&format!("floor_{seed}_{number}"), picture.pixels(), SIZE.0, SIZE.1)?;
            }
            found.extend(find_board(picture.view().map_err(|error| error.to_string())?, &board));
        }
        mounts += 1;
        let Ok(measured) = board_mount(&pinhole, &board, &found) else { continue };
        tilt.push((measured.tilt - mount.tilt).to_degrees());
        roll.push((measured.roll - mount.roll).to_degrees());
        height.push(1e3 * (measured.height_m - mount.z));
        pan.push((-measured.board_direction - mount.pan).to_degrees());
    }
    let mut table =
        Table::new(format!("{mounts} mounts, 3 pictures of a board of 250 mm on the floor"), &COLUMNS);
    for (name, errors) in
        [("tilt, degrees", &tilt), ("roll, degrees", &roll), ("height, mm", &height), ("pan, degrees", &pan)]
    {
        errors_row(&mut table, name, errors, mounts);
    }
    Ok(table)
}

/// Renders a frame, and bends it as the lens does.
fn frame_of(
    renderer: &mut Renderer,
    scene: &Scene,
    truth: &Intrinsics,
    mount: &Mount,
    robot: Pose2,
) -> Result<GrayImage, String> {
    // Straight and wide enough for what the lens sees.
    const BORDER: u32 = 40;
    let wide = Intrinsics {
        cx: truth.cx + f64::from(BORDER),
        cy: truth.cy + f64::from(BORDER),
        width: truth.width + 2 * BORDER,
        height: truth.height + 2 * BORDER,
        ..*truth
    };
    let (width, height) = (wide.width as usize, wide.height as usize);
    let mut straight = GrayImage::new(width, height);
    let view = CameraView { intrinsics: wide, mount: *mount, robot };
    renderer.render(scene, &view, straight.pixels_mut()).map_err(|error| error.to_string())?;
    let straight = FloatImage::of(straight.view().map_err(|error| error.to_string())?);
    let lens = Pinhole::new(*truth, LENS);
    let mut bent = GrayImage::new(truth.width as usize, truth.height as usize);
    let columns = truth.width as usize;
    for (index, out) in bent.pixels_mut().iter_mut().enumerate() {
        let pixel = Vector2::new((index % columns) as f64, (index / columns) as f64);
        let at = lens.undistort_pixel(pixel).map(|at| at + Vector2::repeat(f64::from(BORDER)));
        *out = at.and_then(|at| straight.sample(at)).unwrap_or(0.0).round() as u8;
    }
    Ok(bent)
}

/// Depth of both baseboards in front of a wall, m.
fn baseboard_m() -> f64 {
    yamabico_sim::world::Corridor::default().baseboard.map_or(0.0, |baseboard| baseboard.depth_m)
}
