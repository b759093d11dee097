//! What the avoider makes of one picture.
//!
//!     cargo run -p yamabico-stationary-obstacle-avoider --example propose_on_image -- [PICTURE.png] [--at X Y HEADING_DEG] [--out FILE.png]
//!
//! The picture must be one of the robot of the hallway (256 x 240, 60 degrees) taken at the given pose of its map. Without one,
//! the hallway is rendered with a box in it. The overlay: green edges that the map explains, blue those that it lets expect, red
//! those that it does not have, yellow what is taken for an obstacle, violet where the bare floor begins.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "an example")]

use std::path::{Path, PathBuf};
use yamabico_core::camera::{Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_drawing::Canvas;
use yamabico_sim::world::BoxItem;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};
use yamabico_stationary_obstacle_avoider::detector::{Detector, DetectorRules};
use yamabico_stationary_obstacle_avoider::overlay;
use yamabico_stationary_obstacle_avoider::safe_passage::{Interval, SafePassage, region_on_plane};
use yamabico_stationary_obstacle_avoider::threshold_table::ThresholdTable;
use yamabico_vision::map::WireFrame;

const SIZE: (u32, u32) = (256, 240);
const HALF_WIDTH_M: f64 = 0.23;

fn main() {
    let (mut file, mut out, mut robot) = (None, None::<PathBuf>, Pose2::new(3.0, 0.0, 0.0));
    let mut rest = std::env::args().skip(1);
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--out" => out = rest.next().map(PathBuf::from),
            "--at" => {
                let mut number =
                    || rest.next().and_then(|n| n.parse::<f64>().ok()).expect("--at X Y HEADING_DEG");
                robot = Pose2::new(number(), number(), number().to_radians());
            }
            _ => file = Some(argument),
        }
    }
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
    let intrinsics = Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, 60_f64.to_radians());
    let mount = Mount::tilted(0.6, 6_f64.to_radians());
    let pixels = match file {
        Some(file) => image::open(file).expect("a picture").to_luma8().into_raw(),
        None => {
            let text = std::fs::read_to_string(configs.join("worlds/hallway.toml")).unwrap();
            let mut world = World::from_toml(&text).unwrap();
            world.people.clear();
            world.boxes = vec![BoxItem { at_m: [robot.x + 1.9, 0.15], yaw_deg: 20.0, ..BoxItem::default() }];
            let scene = Scene::new(&world, 1).unwrap();
            let mut pixels = vec![0; (SIZE.0 * SIZE.1) as usize];
            Renderer::new(Photometry::default(), random::stream(1, "propose_on_image"))
                .render(&scene, &CameraView { intrinsics, mount, robot }, &mut pixels)
                .unwrap();
            pixels
        }
    };
    let image =
        ImageView::new(&pixels, SIZE.0 as usize, SIZE.1 as usize, SIZE.0 as usize).expect("256 x 240");
    let map = WireFrame::read(&configs.join("maps/hallway.toml")).expect("a map");
    let table = ThresholdTable::read(&configs.join("maps/hallway-thresholds.toml")).expect("a table");
    let place = table.at(&robot, table.exposure).expect("nothing was learned near this pose");
    let rules = DetectorRules::for_size(SIZE.0, SIZE.1);
    let mut detector = Detector::new(Pinhole::ideal(intrinsics), mount, map, rules);
    let sights = match detector.look(image, &robot, 1e-3, &place) {
        Ok(sights) => sights.to_vec(),
        Err(reason) => return println!("nothing to be seen: {reason}"),
    };
    let half_view = (0.5 * intrinsics.horizontal_fov()).tan();
    let mut passage = SafePassage::default();
    passage.begin(Interval::new(-half_view, half_view).widened(-HALF_WIDTH_M));
    println!("T0 {}, region: extra edges (at most), level edges, faint step", place.t0);
    for (region, sight) in sights.iter().enumerate() {
        let what = if sight.is_obstacle { "obstacle" } else { "open" };
        println!(
            "{region}: {:3} ({:.0}), {:3}, {:4.1}: {what}",
            sight.extra, sight.limit, sight.level, sight.upright.contrast
        );
        if sight.is_obstacle {
            passage.block(region_on_plane(region, sights.len(), half_view).widened(HALF_WIDTH_M));
        }
    }
    match passage.choose(0.0, 0.05) {
        Some(aim) if aim.deviates => println!("passage at {:+.0} deg", aim.bearing().to_degrees()),
        Some(_) => println!("straight on"),
        None => println!("no passage in view: looks around"),
    }
    if let Some(out) = out {
        let mut rgb = vec![0; 3 * pixels.len()];
        let mut canvas = Canvas::new(&mut rgb, SIZE.0 as usize, SIZE.1 as usize).unwrap();
        overlay::draw(&detector, image, &mut canvas);
        image::save_buffer(out, &rgb, SIZE.0, SIZE.1, image::ExtendedColorType::Rgb8).unwrap();
    }
}
