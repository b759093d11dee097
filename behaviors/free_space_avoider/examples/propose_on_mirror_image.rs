//! What the free-space avoider proposes on one picture of a mirror camera.
//!
//! `propose_on_mirror_image [PICTURE] [--at X,Y,HEADING_DEG] [--set TOML] [--out FILE]`
//!
//! Without a picture the simulator takes one on the small field, at a pose (m, degrees). The camera is the one of the field's robot in
//! either case: 256 x 220 pixels. `--set` gives keys of the behavior, such as `directions = 48`; `--out` writes what it saw.

mod arguments;
mod field;
#[path = "field/robot.rs"]
mod field_robot;
#[path = "field/overlay.rs"]
mod overlay;

use std::process::ExitCode;

use arguments::Arguments;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Axes, Odometry};
use yamabico_core::testing::Bench;
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider, ODOMETRY};
use yamabico_sim::{Scene, World};

fn main() -> ExitCode {
    match propose() {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

fn propose() -> Result<(), String> {
    let Arguments { picture, robot, toml, out } =
        Arguments::read(Pose2::new(-0.75, 0.0, 0.0), field_robot::CONFIG)?;
    let pixels = match picture {
        Some(path) => {
            let rgb = image::open(&path).map_err(|e| format!("{}: {e}", path.display()))?.to_rgb8();
            if rgb.dimensions() != (256, 220) {
                return Err(format!(
                    "{}: needs 256 x 220 pixels, not {:?}",
                    path.display(),
                    rgb.dimensions()
                ));
            }
            rgb.into_raw()
        }
        None => {
            let world = World::from_toml(field::FIELD).map_err(|e| e.to_string())?;
            let scene = Scene::new(&world, 1).map_err(|e| e.to_string())?;
            field::render(&mut field::renderer(field::camera()), &scene, robot)
        }
    };
    let setup = field_robot::setup(field::camera(), Axes::ALL);
    let mut bench = Bench::<FreeSpaceAvoider>::new(&toml, setup).map_err(|e| e.to_string())?;
    // A cell is free once it has been so in two pictures.
    for seconds in [0.96, 1.0] {
        let header = field_robot::frame_header(seconds);
        let odometry = Odometry { stamp_ns: header.stamp_ns, ..Odometry::default() };
        bench.at(seconds).feed(&ODOMETRY, &odometry, &[]).feed(&CAMERA, &header, &pixels);
        bench.propose();
    }
    let proposal = bench.propose();
    println!(
        "{:?}: {:.2} m/s ahead, {:+.2} m/s to the left, {:+.2} rad/s; {}; {}",
        proposal.kind(),
        proposal.twist.linear,
        proposal.twist.lateral,
        proposal.twist.angular,
        proposal.reason().map_or("", |reason| reason.as_str()),
        proposal.note,
    );
    let sight = bench.behavior.polar_cells().ok_or("the method must be polar-cells")?.sight();
    println!("floor       {:?}", sight.colors());
    println!("free rings  {:?}", sight.free().rings());
    for end in sight.distances().ends() {
        print!("{:+.0} deg {:.2} m  ", end.azimuth_rad.to_degrees(), end.distance_m);
    }
    println!();
    match out {
        Some(path) => overlay::draw(&pixels, sight, &proposal, &path),
        None => Ok(()),
    }
}
