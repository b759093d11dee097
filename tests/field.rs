//! The soccer field with cubes: one image of a mirror camera determines the pose to a centimeter, anywhere on the field.

use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{Encoding, FrameHeader, Odometry};
use yamabico_core::sensor::MountedMirror;
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_map_localizer::finder::Finder;
use yamabico_map_localizer::{CAMERA, MapLocalizer, ODOMETRY};
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene, random};

use crate::support::task;

/// Poses of the robot, m and degrees: six spots all over the field, as in the experiment of Sekimori et al. (2001).
const SPOTS: [(f64, f64, f64); 6] = [
    (0.0, 0.05, 0.0),
    (0.75, 0.1, 35.0),
    (-0.7, -0.3, -60.0),
    (1.1, 0.3, 120.0),
    (-1.1, 0.2, 200.0),
    (0.5, -0.45, -110.0),
];
/// Number of images at each spot, each with the cubes at other positions.
const IMAGES: u32 = 10;

#[test]
fn the_outline_of_the_floor_determines_the_pose() {
    let task = task("field", &[]);
    let behavior = task.behaviors.iter().find(|b| b.factory.info().name == "map-localizer").unwrap();
    let MountedMirror { camera, mount, .. } = behavior.setup.mirror_camera(&CAMERA).unwrap();
    let world = yamabico_rigs::camera::world("field");
    let [width, height] = camera.image().size();
    let mut renderer = MirrorRenderer::new(camera, Photometry::default(), random::stream(1, "six spots"));
    let mut pixels = vec![0; 3 * (width * height) as usize];
    let (mut squares, mut worst, mut turn_squares, mut found) = (0.0, 0.0_f64, 0.0, 0);
    for (spot, (x, y, degrees)) in SPOTS.into_iter().enumerate() {
        let mut squares_of_spot = [0.0; 2];
        for image in 0..IMAGES {
            let truth = Pose2::new(x, y, degrees.to_radians());
            let scene = Scene::new(&world, u64::from(image) + 1).unwrap();
            renderer.render_rgb(&scene, &MirrorView { mount, robot: truth }, &mut pixels).unwrap();
            // The initial estimate is within 5 cm and 5 degrees.
            let offset = |k: f64| (3.7 * f64::from(image) + 1.3 * spot as f64 + k).sin();
            let toml = format!(
                "method = \"floor-outline\"\nfloor_plan = \"maps/field-plan.toml\"\n\
                 floor_colors = \"maps/field-floor.toml\"\n\
                 start = {{ x_m = {}, y_m = {}, heading_deg = {}, sigma_m = 0.05, sigma_deg = 5 }}",
                x + 0.05 * offset(0.0),
                y + 0.05 * offset(2.0),
                (degrees + 5.0 * offset(4.0) + 180.0).rem_euclid(360.0) - 180.0
            );
            let mut bench = Bench::<MapLocalizer>::new(&toml, behavior.setup.clone()).unwrap();
            let header = FrameHeader {
                stamp_ns: Time::from_secs_f64(0.0).0,
                width,
                height,
                stride: 3 * width,
                encoding: Encoding::Rgb8.code(),
                ..FrameHeader::default()
            };
            bench.feed(&ODOMETRY, &Odometry::default(), &[]).feed(&CAMERA, &header, &pixels);
            bench.propose();
            let Finder::FloorOutline(finder) = bench.behavior.finder() else { panic!("not floor-outline") };
            let Some(fix) = finder.last() else {
                println!("spot {spot}, image {image}: {:?}", bench.behavior.status());
                continue;
            };
            let error = fix.belief.pose.distance(&truth);
            let turn = angle_difference(fix.belief.pose.theta, truth.theta);
            found += 1;
            squares += error * error;
            turn_squares += turn * turn;
            worst = worst.max(error);
            squares_of_spot[0] += error * error;
            squares_of_spot[1] += turn * turn;
        }
        let [position, turn] = squares_of_spot.map(|sum| (sum / f64::from(IMAGES)).sqrt());
        println!("({x:5.2}, {y:5.2}) m: {:5.1} mm, {:.2} deg", 1e3 * position, turn.to_degrees());
    }
    let rms = (squares / f64::from(found)).sqrt();
    let turn = (turn_squares / f64::from(found)).sqrt().to_degrees();
    println!("{found} of 60 found, RMS {:.1} mm, {turn:.2} deg, max {:.1} mm", 1e3 * rms, 1e3 * worst);
    assert_eq!(found, 60);
    assert!(rms <= 0.012 && turn <= 0.5, "RMS {rms} m, {turn} deg");
}
