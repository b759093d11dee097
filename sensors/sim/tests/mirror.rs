//! Images of mirror cameras: exact edges, agreement with single rays, and golden images of the hallway.
//!
//! `YAMABICO_BLESS=1 cargo test -p yamabico-sim --test integration mirror` rewrites the golden images: inspect them.

use std::path::PathBuf;

use nalgebra::{Point3, Vector2};
use yamabico_core::camera::{
    ConicMirror, HyperboloidalMirror, Mirror, MirrorCamera, MirrorImage, Mount, RadialModel, RadialProfile,
};
use yamabico_core::geometry::Pose2;
use yamabico_sim::world::{Floor, Window};
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene, World, random};

const HALLWAY: &str = include_str!("../../../configs/worlds/hallway.toml");
const PLAIN: Photometry =
    Photometry { exposure: 1.0, vignetting: 0.0, noise_sigma: 0.0, flicker: 0.0, blur_px: 0.0, glare: 0.0 };

/// Returns a camera of each kind, for images of this size, with the height of its lens or viewpoint (m).
fn cameras(width: u32, height: u32) -> [(&'static str, f64, MirrorCamera); 3] {
    let rim_px = 0.5 * f64::from(height);
    let scale = rim_px / 240.0;
    let image = MirrorImage::centered(width, height).with_ring((16.0 * scale).ceil(), rim_px).unwrap();
    let cone = ConicMirror::new(112.6_f64.to_radians(), 0.11, 576.563 * scale).unwrap();
    let hyperboloid = HyperboloidalMirror::new(520.0 * scale, 1.45, 0.08).unwrap();
    let profile = RadialProfile::Tangent { range_m: 1.788, rad_per_px: 0.0077 / scale, height_m: 0.6 };
    let radial = RadialModel::new(profile, 0.0, rim_px).unwrap();
    [
        ("conic", 0.3, Mirror::Conic(cone)),
        ("hyperboloidal", 0.6, Mirror::Hyperboloidal(hyperboloid)),
        ("radial", 0.6, Mirror::Radial(radial)),
    ]
    .map(|(name, height_m, mirror)| (name, height_m, MirrorCamera::new(image, mirror).unwrap()))
}

fn renderer(camera: &MirrorCamera, photometry: Photometry) -> MirrorRenderer {
    MirrorRenderer::new(camera.clone(), photometry, random::stream(1, "test"))
}

fn render_image(scene: &Scene, camera: &MirrorCamera, view: &MirrorView) -> Vec<u8> {
    let mut pixels = vec![0; (camera.image().width * camera.image().height) as usize];
    renderer(camera, PLAIN).render(scene, view, &mut pixels).unwrap();
    pixels
}

fn pixel_of(camera: &MirrorCamera, view: &MirrorView, point: Point3<f64>) -> Vector2<f64> {
    let at = view.robot.inverse().transform_point(point.xy());
    let point_in_mirror = view.mount.body_from_mirror().inverse() * Point3::new(at.x, at.y, point.z);
    camera.pixel_from_point(&point_in_mirror).unwrap()
}

/// Compares the left edge of a bright pane in an otherwise black hallway with its projection, row by row.
#[test]
fn upright_edges_are_exact_to_hundredths_of_a_pixel() {
    let mut world = World::corridor(12.0, 2.0);
    world.ambient = Some(0.0);
    world.floor.gloss = 0.0;
    let corridor = world.corridor.as_mut().unwrap();
    corridor.lamp_spacing_m = 0.0;
    corridor.window = Some(Window { brightness: 0.8, sill_m: 0.02, ..Window::default() });
    let scene = Scene::new(&world, 1).unwrap();
    let pane_x = 10.0 + 0.8 * 0.12 - 0.002;
    let edge = |z: f64| Point3::new(pane_x, 0.55, z);

    for (name, height_m, camera) in cameras(512, 480) {
        let mut renderer = renderer(&camera, PLAIN);
        let mut pixels = vec![0; 512 * 480];
        for sway in [0.0, 0.02] {
            let (mut rows, mut worst, mut sum, mut squares) = (0, 0.0_f64, 0.0, 0.0);
            for i in 0..24 {
                let t = f64::from(i);
                let sway = sway * (0.9 * t).sin();
                let mount = Mount { roll: sway, tilt: 0.5 * sway, ..Mount::level(height_m) };
                let view =
                    MirrorView { mount, robot: Pose2::new(6.0 + 0.11 * t, 0.2 * t.sin(), 0.12 * t.cos()) };
                renderer.render(&scene, &view, &mut pixels).unwrap();
                let low = 0.15;
                let (mut z, foot) = (0.36, pixel_of(&camera, &view, edge(low)));
                let top = pixel_of(&camera, &view, edge(z));
                for y in top.y.ceil() as usize + 1..foot.y.floor() as usize {
                    // The edge is curved in the image of a tilted mirror.
                    let (mut below, mut above) = (low, 0.36);
                    for _ in 0..40 {
                        z = 0.5 * (below + above);
                        if pixel_of(&camera, &view, edge(z)).y > y as f64 { below = z } else { above = z }
                    }
                    let expected = pixel_of(&camera, &view, edge(z)).x;
                    let inside = expected as usize + 5;
                    let light = |x: usize| (f64::from(pixels[y * 512 + x]) / 255.0).powi(2);
                    let lit: f64 = (inside - 10..inside).map(|x| light(x) / light(inside)).sum();
                    let error = inside as f64 - 0.5 - lit - expected;
                    worst = worst.max(error.abs());
                    sum += error;
                    squares += error * error;
                    rows += 1;
                }
            }
            let (mean, rms) = (sum / f64::from(rows), (squares / f64::from(rows)).sqrt());
            println!(
                "{name}, tilted by up to {sway} rad: {rows} rows, mean {mean:.4} px, rms {rms:.4} px, worst {worst:.3} px"
            );
            assert!(rows > 200, "{name}: {rows}");
            assert!(
                worst < 0.15 && rms < 0.03 && mean.abs() < 0.005,
                "{name}: worst {worst}, mean {mean}, rms {rms}"
            );
        }
    }
}

#[test]
fn rings_and_rays_agree() {
    let mut world = World::from_toml(HALLWAY).unwrap();
    world.boxes.clear();
    // Only the rasterizer blurs reflections.
    for (gloss, mean_limit, far_limit) in [(0.0, 1.2, 0.02), (0.5, 3.0, 0.06)] {
        world.floor = Floor { gloss, speckle: 0.0, joint_spacing_m: [0.5, 0.5], ..world.floor };
        let mut scene = Scene::new(&world, 3).unwrap();
        scene.set_time(10.0).unwrap();
        for (name, height_m, camera) in cameras(128, 120) {
            let mount = Mount { roll: 0.03, tilt: -0.02, ..Mount::level(height_m) };
            let view = MirrorView { mount, robot: Pose2::new(2.5, 0.2, 0.4) };
            let drawn = render_image(&scene, &camera, &view);
            let mut cast = vec![0; drawn.len()];
            renderer(&camera, PLAIN).cast(&scene, &view, 4, &mut cast).unwrap();
            // Only the ray caster antialiases the rim.
            let inner = |i: usize| {
                let pixel = Vector2::new((i % 128) as f64, (i / 128) as f64);
                let radius_px = camera.image().mirror_from_pixel(pixel).norm();
                radius_px > camera.image().blind_radius_px() + 1.0
                    && radius_px < camera.image().rim_radius_px() - 1.0
            };
            let pairs = drawn.iter().zip(&cast).enumerate().filter(|(i, _)| inner(*i));
            let differences: Vec<u8> = pairs.map(|(_, (a, b))| a.abs_diff(*b)).collect();
            let mean = differences.iter().map(|d| f64::from(*d)).sum::<f64>() / differences.len() as f64;
            let far_off = differences.iter().filter(|d| **d > 16).count() as f64 / differences.len() as f64;
            println!("{name}, gloss {gloss}: mean {mean:.2}, far off {far_off:.4}");
            assert!(mean < mean_limit && far_off < far_limit, "{name}, gloss {gloss}: {mean}, {far_off}");
        }
    }
}

#[test]
fn color_images_have_the_luminance_of_gray_images() {
    let scene = Scene::new(&World::from_toml(HALLWAY).unwrap(), 1).unwrap();
    for (name, height_m, camera) in cameras(128, 120) {
        let view = MirrorView { mount: Mount::level(height_m), robot: Pose2::new(1.0, 0.0, 0.3) };
        let gray = render_image(&scene, &camera, &view);
        let mut rgb = vec![0; 3 * gray.len()];
        renderer(&camera, PLAIN).render_rgb(&scene, &view, &mut rgb).unwrap();
        let light = |v: u8| (f64::from(v) / 255.0).powi(2);
        let unsaturated = |(g, c): &(&u8, &[u8])| **g < 250 && c.iter().all(|v| *v < 250);
        for (g, c) in gray.iter().zip(rgb.chunks_exact(3)).filter(unsaturated) {
            let luminance = 0.2126 * light(c[0]) + 0.7152 * light(c[1]) + 0.0722 * light(c[2]);
            assert!((luminance.sqrt() * 255.0 - f64::from(*g)).abs() < 2.0, "{name}: {g} {c:?}");
        }
    }
}

#[test]
fn the_image_is_black_outside_the_ring_and_a_wrong_buffer_is_refused() {
    let scene = Scene::new(&World::corridor(12.0, 2.0), 1).unwrap();
    for (name, height_m, camera) in cameras(128, 120) {
        let view = MirrorView { mount: Mount::level(height_m), robot: Pose2::IDENTITY };
        let pixels = render_image(&scene, &camera, &view);
        for (i, gray) in pixels.iter().enumerate() {
            let pixel = Vector2::new((i % 128) as f64, (i / 128) as f64);
            let radius_px = camera.image().mirror_from_pixel(pixel).norm();
            assert_eq!(*gray > 0, camera.image().is_in_ring(radius_px), "{name} at {pixel}");
        }
        let mut renderer = renderer(&camera, PLAIN);
        assert!(renderer.render(&scene, &view, &mut [0; 7]).is_err());
        let lost = MirrorView { robot: Pose2 { x: f64::NAN, ..Pose2::IDENTITY }, ..view };
        assert!(renderer.render(&scene, &lost, &mut vec![0; pixels.len()]).is_err());
    }
}

/// Rotating the robot and rotating the camera give the same image; flipping the image mirrors it.
#[test]
fn rotations_and_flips_have_the_right_sense() {
    let scene = Scene::new(&World::from_toml(HALLWAY).unwrap(), 1).unwrap();
    let (_, height_m, camera) = cameras(121, 121)[1].clone();
    let view = |pan: f64, theta: f64| MirrorView {
        mount: Mount { pan, ..Mount::level(height_m) },
        robot: Pose2::new(2.0, 0.1, theta),
    };
    let plain = render_image(&scene, &camera, &view(0.0, 0.5));
    let panned = render_image(&scene, &camera, &view(0.5, 0.0));
    assert!(plain.iter().zip(&panned).all(|(a, b)| a.abs_diff(*b) <= 1));
    let unflipped = nalgebra::Matrix2::new(0.0, -1.0, 1.0, 0.0);
    let image = camera.image().with_orientation(unflipped).unwrap();
    let flipped = MirrorCamera::new(image, camera.mirror().clone()).unwrap();
    let turned = render_image(&scene, &flipped, &view(0.0, 0.5));
    let mirrored = (0..121 * 121).map(|i| turned[i / 121 * 121 + 120 - i % 121]);
    assert!(plain.iter().zip(mirrored).all(|(a, b)| a.abs_diff(b) <= 1));
}

#[test]
fn the_hallway_matches_the_golden_images() {
    let boxes = "[[box]]\nat_m = [3.6, 0.4]\ncolor = [0.85, 0.85, 0.83]\n\
                 [[box]]\nat_m = [2.2, -0.5]\ncolor = [0.30, 0.19, 0.10]";
    let mut scene = Scene::new(&World::from_toml(&format!("{HALLWAY}\n{boxes}")).unwrap(), 1).unwrap();
    scene.set_time(10.0).unwrap();
    for (name, height_m, camera) in cameras(170, 160) {
        let view = MirrorView { mount: Mount::level(height_m), robot: Pose2::new(2.9, 0.1, 0.2) };
        let pixels = render_image(&scene, &camera, &view);
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/mirror-{name}.png"));
        if std::env::var_os("YAMABICO_BLESS").is_some() {
            image::save_buffer(&path, &pixels, 170, 160, image::ExtendedColorType::L8).unwrap();
        }
        let golden = image::open(&path).unwrap().to_luma8().into_raw();
        let differences = pixels.iter().zip(&golden).map(|(a, b)| f64::from(a.abs_diff(*b)));
        let mean = differences.clone().sum::<f64>() / pixels.len() as f64;
        let far_off = differences.filter(|d| *d > 10.0).count();
        assert!(golden.len() == pixels.len() && mean < 0.5 && far_off < 40, "{name}: {mean}, {far_off}");
    }
}
