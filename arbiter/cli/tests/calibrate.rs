//! `yamabico calibrate`: what it finds in rendered pictures and recordings, and what it refuses.

use std::path::PathBuf;
use std::process::Output;

use image::GrayImage;
use yamabico_core::camera::{Distortion, Intrinsics, Pinhole};
use yamabico_rigs::board::{INDOORS, held_board, render_board};
use yamabico_sim::random::stream;
use yamabico_testkit::config;
use yamabico_vision::calibration::Board;

use crate::program::{TestFolder, assert_exit, text, yamabico};

fn calibrate(folder: &TestFolder, arguments: &[&str]) -> Output {
    yamabico().arg("calibrate").args(arguments).current_dir(folder.path()).output().unwrap()
}

fn json(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {}", text(output)))
}

fn lens() -> Pinhole {
    let intrinsics = Intrinsics { fx: 600.0, fy: 598.0, cx: 325.0, cy: 236.0, width: 640, height: 480 };
    Pinhole::new(intrinsics, Distortion { k1: -0.2, k2: 0.05, ..Distortion::NONE })
}

/// Writes pictures of a held board.
fn pictures(folder: &TestFolder, count: usize) {
    let (board, pinhole) = (Board::new("9x6", 0.025).unwrap(), lens());
    let mut rng = stream(7, "pictures");
    for index in 0..count {
        let pose = held_board(&board, &pinhole, &mut rng);
        let picture = render_board(&board, &pinhole, &pose, INDOORS, &mut rng);
        save(folder.file(&format!("board{index:02}.png")), 640, 480, picture.pixels());
    }
}

fn save(path: PathBuf, width: u32, height: u32, pixels: &[u8]) {
    GrayImage::from_raw(width, height, pixels.to_vec()).unwrap().save(path).unwrap();
}

#[test]
fn a_lens_is_measured_and_written_into_the_robot_file() {
    let folder = TestFolder::new("calibrate-lens");
    pictures(&folder, 9);
    let before = std::fs::read_to_string(config("robots/usb-cart.toml")).unwrap();
    std::fs::write(folder.file("cart.toml"), &before).unwrap();
    let output = calibrate(&folder, &["intrinsics", ".", "--write", "cart.toml", "--json"]);
    let found = json(&output);
    for (index, name, truth, within) in [(0, "fx", 600.0, 3.0), (2, "cx", 325.0, 3.0), (4, "k1", -0.2, 0.02)]
    {
        let parameter = &found["parameters"][index];
        assert_eq!(parameter[0], name);
        assert!((parameter[1]["value"].as_f64().unwrap() - truth).abs() < within, "{parameter}");
    }
    let after = std::fs::read_to_string(folder.file("cart.toml")).unwrap();
    let changed: Vec<(&str, &str)> =
        before.lines().zip(after.lines()).filter(|(old, new)| old != new).collect();
    assert_eq!((changed.len(), before.lines().count()), (1, after.lines().count()), "{changed:?}");
    assert!(changed[0].1.starts_with("intrinsics = { width = 640, height = 480, fx = "), "{changed:?}");
}

#[test]
fn unsuitable_pictures_are_refused_by_name() {
    let folder = TestFolder::new("calibrate-refusals");
    let refused = |arguments: &[&str], parts: &[&str]| assert_exit(&calibrate(&folder, arguments), 2, parts);
    std::fs::create_dir(folder.file("empty")).unwrap();
    refused(&["intrinsics", "empty"], &["empty has no .png"]);
    refused(&["intrinsics", "nowhere"], &["nowhere does not exist"]);
    std::fs::write(folder.file("text.png"), "no picture").unwrap();
    refused(&["intrinsics", "text.png"], &["text.png is no picture"]);
    std::fs::remove_file(folder.file("text.png")).unwrap();

    pictures(&folder, 3);
    refused(&["intrinsics", "."], &["different views of the board: 3, in pictures: 3", "5 are needed"]);
    refused(
        &["intrinsics", ".", "--corners", "8x5"],
        &[
            "no picture shows the board of 8x5",
            "3 of 3 pictures",
            "--corners 9x6",
            "(3 pictures): the board in view",
        ],
    );
    refused(&["intrinsics", ".", "--corners", "9"], &["such as 9x6"]);
    save(folder.file("small.png"), 320, 240, &[90; 320 * 240]);
    refused(&["intrinsics", "."], &["small.png has 320 x 240 pixels", "board00.png has 640 x 480"]);
    refused(
        &["intrinsics", "small.png"],
        &["no picture shows the board", "small.png: no checkerboard is in view"],
    );
    refused(&["mount", "small.png"], &["only 0 pictures show where a corridor leads"]);
    refused(&["mount", "small.png", "--board"], &["--board needs the lens"]);
    let cart = config("robots/usb-cart.toml").display().to_string();
    refused(&["mount", "small.png", "--robot", &cart], &["small.png has 320 x 240", "`front` has 640 x 480"]);
    refused(
        &["mount", "board00.png", "--robot", &cart, "--sensor", "rear"],
        &["no sensor `rear`", "`front`"],
    );
    refused(&["clock", "small.png"], &["is not an MCAP recording"]);
    refused(&["board", "--square-mm", "-3"], &["2 to 1000 mm, not -3 mm"]);
    refused(&["mount", ".", "--corridor-width-m", "-2"], &["small.png has 320 x 240"]);
    std::fs::remove_file(folder.file("small.png")).unwrap();
    refused(
        &["mount", ".", "--board", "--robot", &cart, "--corners", "8x5"],
        &["no picture shows the board of 8x5", "--corners 9x6"],
    );
    refused(
        &["mount", "board00.png", "--board", "--robot", &cart],
        &["board00.png: the board does not lie on the floor"],
    );
    refused(&["mount", ".", "--corridor-width-m", "-2"], &["0.5 to 10 m wide, not -2 m"]);
    refused(&["board", "--square-mm", "40"], &["does not fit A4", "--square-mm 26"]);
}

#[test]
fn a_recorded_drive_gives_the_mount_of_the_simulated_camera() {
    let folder = TestFolder::new("calibrate-mount");
    let task = config("corridor.toml");
    let mut run = yamabico();
    run.arg("run").arg(&task).args(["--record", "run.mcap", "--set", "run.duration_s=12"]);
    run.current_dir(folder.path()).output().unwrap();
    let output = calibrate(&folder, &["mount", "run.mcap", "--json"]);
    let found = json(&output);
    let robot = std::fs::read_to_string(config("robots/sim-corridor.toml")).unwrap();
    println!("{found:#}\n{robot}");
    let robot: toml::Table = robot.parse().unwrap();
    let mount = robot["sensors"].as_table().unwrap().values().find_map(|sensor| sensor.get("mount")).cloned();
    let number = |key: &str| {
        let number = mount.as_ref().and_then(|mount| mount.get(key).cloned());
        number.map_or(0.0, |number| {
            number.as_float().or(number.as_integer().map(|number| number as f64)).unwrap()
        })
    };
    let value = |key: &str| found[key]["value"].as_f64().unwrap_or(f64::NAN);
    assert!((value("tilt_deg") - number("tilt_deg")).abs() < 0.5, "{found}");
    assert!(value("roll_deg").abs() < 0.7, "{found}");
    assert_eq!(found["is_cropped"], false, "{found}");
    assert!(folder.file("mount.png").metadata().unwrap().len() > 1000);
    let output = calibrate(&folder, &["mount", "run.mcap", "--height-m", "2"]);
    assert_exit(&output, 0, &["--height-m 2.000 contradicts", "by the motion of the floor"]);
}
