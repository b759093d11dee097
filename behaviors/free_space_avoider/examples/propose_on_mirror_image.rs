//! What the free-space avoider proposes on one picture of a mirror camera.
//!
//! `propose_on_mirror_image [PICTURE] [--at X,Y,HEADING_DEG] [--set TOML] [--out FILE]`
//!
//! Without a picture the simulator takes one on the small field, at a pose (m, degrees). The camera is the one of the field's robot in
//! either case: 256 x 220 pixels. `--set` gives keys of the behaviour, such as `directions = 48`; `--out` writes what it saw.

#[allow(dead_code, reason = "tests and benches use the rest")]
mod field;

use std::path::PathBuf;
use std::process::ExitCode;

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
    let (mut picture, mut out, mut toml) = (None, None, field::CONFIG.to_owned());
    let mut at = [-0.75, 0.0, 0.0];
    let mut rest = std::env::args().skip(1);
    while let Some(argument) = rest.next() {
        let mut value = || rest.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "--at" => {
                let text = value()?;
                let numbers: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
                at = numbers.ok().and_then(|list| list.try_into().ok()).ok_or("--at X,Y,HEADING_DEG")?;
            }
            "--set" => toml = toml + &value()? + "\n",
            "--out" => out = Some(PathBuf::from(value()?)),
            _ if picture.is_none() && !argument.starts_with('-') => picture = Some(PathBuf::from(&argument)),
            _ => return Err(format!("unknown argument {argument}")),
        }
    }
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
            let robot = Pose2::new(at[0], at[1], at[2].to_radians());
            field::render(&mut field::renderer(field::camera()), &scene, robot)
        }
    };
    let setup = field::setup(field::camera(), Axes::ALL);
    let mut bench = Bench::<FreeSpaceAvoider>::new(&toml, setup).map_err(|e| e.to_string())?;
    // A cell is free once it has been so in two pictures.
    for seconds in [0.96, 1.0] {
        let header = field::frame_header(seconds);
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
    println!("floor       {:?}", sight.colours());
    println!("free rings  {:?}", sight.free().rings());
    for end in sight.distances().ends() {
        print!("{:+.0} deg {:.2} m  ", end.azimuth_rad.to_degrees(), end.distance_m);
    }
    println!();
    match out {
        Some(path) => field::draw(&pixels, sight, &proposal, &path),
        None => Ok(()),
    }
}
