//! Looks at one picture with the map-localizer: `propose_on_image [PICTURE] [--out OVERLAY.png] [--at X,Y,HEADING_DEG]`.
//!
//! Without a picture one of the simulated hallway is rendered, from 5 cm and 1 degree beside the pose that the robot believes.
//! With one, it must be of a camera 60 degrees wide, 0.6 m above the floor, 6 degrees down, in the hallway of the map.
//! Prints what was matched, the pose before and after, and the proposal. In the overlay: what should be in view from the believed
//! pose (yellow), the segments that were matched (green), and the matched edges from the pose after it (red).

use std::error::Error;
use std::path::PathBuf;

use image::{GrayImage as Picture, RgbImage};
use nalgebra::Vector2;
use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::message::{FrameHeader, Odometry};
use yamabico_core::sensor::Robot;
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_drawing::Canvas;
use yamabico_map_localizer::finder::Finder;
use yamabico_map_localizer::{CAMERA, MapLocalizer, ODOMETRY};
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_vision::map::{ExpectationMap, ExpectationRules, MapView};

const YELLOW: [u8; 3] = [255, 200, 0];
const GREEN: [u8; 3] = [0, 255, 60];
const RED: [u8; 3] = [255, 0, 70];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (mut picture, mut out, mut at) = (None, None, [2.6, 0.1, 3.0]);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--out" => out = arguments.next(),
            "--at" => at = numbers(&arguments.next().unwrap_or_default())?,
            file => picture = Some(file.to_owned()),
        }
    }
    let believed = Pose2::new(at[0], at[1], at[2].to_radians());
    let picture = match picture {
        Some(file) => image::open(file)?.into_luma8(),
        None => render(Pose2::new(believed.x + 0.05, believed.y - 0.05, believed.theta + 0.0175))?,
    };
    let (width, height) = picture.dimensions();
    let (intrinsics, mount) = camera(width, height);

    let config = format!(
        "map = \"maps/hallway.toml\"\nroute = [[12.5, 0.0]]\n\
         start = {{ x_m = {}, y_m = {}, heading_deg = {}, sigma_m = 0.06, sigma_deg = 1.2 }}",
        at[0], at[1], at[2]
    );
    let mut bench = Bench::<MapLocalizer>::new(&config, setup(intrinsics, mount))?;
    let frame = FrameHeader::gray(width, height, 0);
    bench.feed(&ODOMETRY, &Odometry::default(), &[]).feed(&CAMERA, &frame, picture.as_raw());
    let proposal = bench.propose();
    let localizer = &bench.behavior;
    let (status, reason) = localizer.status();
    if let (Some(fix), Some(belief)) = (localizer.last_fix(), localizer.belief()) {
        let Pose2 { x, y, theta } = belief.pose;
        println!("{} edges expected, {} matched, {:?}", fix.expected, fix.lines, fix.verdict);
        println!(
            "before: x {:.3} m, y {:+.3} m, {:+.2} deg",
            believed.x,
            believed.y,
            believed.theta.to_degrees()
        );
        println!("after:  x {x:.3} m, y {y:+.3} m, {:+.2} deg", theta.to_degrees());
    }
    println!("{} ({})", status.as_str(), reason.as_str());
    println!(
        "proposal: {:.2} m/s, {:+.2} rad/s: {}",
        proposal.twist.linear,
        proposal.twist.angular,
        proposal.note.as_str()
    );
    if let Some(out) = out {
        draw(localizer, &picture, &believed)?.save(out)?;
    }
    Ok(())
}

fn draw(localizer: &MapLocalizer, picture: &Picture, believed: &Pose2) -> Result<RgbImage, Box<dyn Error>> {
    let (width, height) = picture.dimensions();
    let (intrinsics, mount) = camera(width, height);
    let mut overlay = RgbImage::new(width, height);
    let mut canvas = Canvas::new(&mut overlay, width as usize, height as usize).ok_or("another size")?;
    canvas.copy_gray(ImageView::new(picture.as_raw(), width as usize, height as usize, width as usize)?);
    let Finder::Wireframe(finder) = localizer.finder() else { return Err("not by a wire frame".into()) };
    let fixer = finder.fixer();
    let mut expectation = ExpectationMap::new(ExpectationRules::for_width(width));
    for edge in expectation.compute(fixer.map(), fixer.pinhole(), &mount, believed) {
        canvas.line(edge.from, edge.to, YELLOW);
    }
    let after = localizer.belief().ok_or("no pose")?.pose;
    let view = MapView::new(&intrinsics, &mount, &after);
    for pair in fixer.used() {
        let expected = fixer.expected()[pair.expected];
        if let Some(clipped) = view.clip(&fixer.map().edges()[expected.edge]) {
            // The part that is not hidden: what was expected, moved on to the new line.
            let [p, q] = clipped.pixels;
            let along = (q - p).normalize();
            let onto = |point: Vector2<f64>| p + along * along.dot(&(point - p)).clamp(0.0, (q - p).norm());
            canvas.line(onto(expected.from), onto(expected.to), RED);
        }
        let segment = &fixer.segments()[pair.segment];
        canvas.line(segment.p0, segment.p1, GREEN);
    }
    Ok(overlay)
}

fn camera(width: u32, height: u32) -> (Intrinsics, Mount) {
    let intrinsics = Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians());
    (intrinsics, Mount::tilted(0.6, 6_f64.to_radians()))
}

fn configs() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs"))
}

fn render(robot: Pose2) -> Result<Picture, Box<dyn Error>> {
    let world = World::from_toml(&std::fs::read_to_string(configs().join("worlds/hallway.toml"))?)?;
    let (intrinsics, mount) = camera(640, 480);
    let mut pixels = vec![0; 640 * 480];
    Renderer::new(Photometry::default(), stream(1, "picture")).render(
        &Scene::new(&world, 1)?,
        &CameraView { intrinsics, mount, robot },
        &mut pixels,
    )?;
    Ok(Picture::from_raw(640, 480, pixels).ok_or("a picture of another size")?)
}

fn setup(intrinsics: Intrinsics, mount: Mount) -> Setup {
    Setup {
        folder: configs(),
        robot: Robot { radius_m: 0.2, ..Robot::default() },
        ..camera_setup(intrinsics, mount)
    }
}

fn numbers(text: &str) -> Result<[f64; 3], Box<dyn Error>> {
    let parts = text.split(',').map(|part| part.trim().parse()).collect::<Result<Vec<f64>, _>>()?;
    <[f64; 3]>::try_from(parts).map_err(|_| "a pose is X,Y,HEADING_DEG".into())
}
