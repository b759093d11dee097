//! What the free-space avoider proposes on one picture.
//!
//! `propose_on_image [PICTURE] [--at X,Y,HEADING_DEG] [--set TOML] [--out FILE]`
//!
//! Without a picture the simulator takes one in the office, at a pose (m, degrees). The camera is the one of the office
//! robot in either case. `--set` gives keys of the behavior, such as `columns = 34`; `--out` writes what it saw.

mod arguments;
mod office;
#[path = "office/world.rs"]
mod office_world;
#[path = "office/overlay.rs"]
mod overlay;

use std::process::ExitCode;

use arguments::Arguments;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::message::FrameHeader;
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider};
use yamabico_sim::random::stream;
use yamabico_sim::{Renderer, Scene, World};

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
        Arguments::read(Pose2::new(3.3, 3.0, 170_f64.to_radians()), "")?;
    let image = match picture {
        Some(path) => {
            let rgb = image::open(&path).map_err(|e| format!("{}: {e}", path.display()))?.to_rgb8();
            let (width, height) = (rgb.width() as usize, rgb.height() as usize);
            let mut gray = GrayImage::default();
            gray.copy_from_rgb8(rgb.as_raw(), width, height, 3 * width).map_err(|e| e.to_string())?;
            gray
        }
        None => {
            let world = World::from_toml(office_world::OFFICE).map_err(|e| e.to_string())?;
            let scene = Scene::new(&world, 1).map_err(|e| e.to_string())?;
            let mut renderer = Renderer::new(office_world::photometry(), stream(1, "noise"));
            office::render(&mut renderer, &scene, office::camera(340, 180), robot)?
        }
    };
    let (intrinsics, mount) = office::camera(image.width() as u32, image.height() as u32);
    let mut bench =
        Bench::<FreeSpaceAvoider>::new(&toml, office::setup(intrinsics, mount)).map_err(|e| e.to_string())?;
    let stamp_ns = Time::from_secs_f64(1.0).0;
    bench.at(1.0).feed(
        &CAMERA,
        &FrameHeader::gray(intrinsics.width, intrinsics.height, stamp_ns),
        image.pixels(),
    );
    let proposal = bench.propose();
    println!(
        "{:?}: {:.2} m/s, {:+.2} rad/s; {}; {}",
        proposal.kind(),
        proposal.twist.linear,
        proposal.twist.angular,
        proposal.reason().map_or("", |reason| reason.as_str()),
        proposal.note,
    );
    let sight = bench.behavior.navel_grid().ok_or("the method must be navel-grid")?.sight();
    println!(
        "free cells  {:?}\nway         {:?}\nweighed     {:?}",
        sight.free(),
        sight.covered().0,
        sight.covered().1
    );
    for direction in sight.directions() {
        print!("{:+.0} deg {:.2} m  ", direction.azimuth_rad.to_degrees(), direction.distance_m);
    }
    println!();
    match out {
        Some(path) => overlay::draw(image.view().map_err(|e| e.to_string())?, sight, &proposal, &path),
        None => Ok(()),
    }
}
