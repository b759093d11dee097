//! Images of pinhole cameras: exact edges, agreement of polygons and rays, and golden images of the hallway.
//!
//! `YAMABICO_BLESS=1 cargo test -p yamabico-sim --test integration render` rewrites the golden images: inspect them.

use std::path::PathBuf;

use nalgebra::{Point3, Vector2};
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_sim::world::{Floor, Window};
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};

const HALLWAY: &str = include_str!("../../../configs/worlds/hallway.toml");
const PLAIN: Photometry =
    Photometry { exposure: 1.0, vignetting: 0.0, noise_sigma: 0.0, flicker: 0.0, blur_px: 0.0, glare: 0.0 };

fn view(width: u32, height: u32, mount: Mount, robot: Pose2) -> CameraView {
    CameraView { intrinsics: Intrinsics::from_horizontal_fov(width, height, 1.05), mount, robot }
}

fn render_image(scene: &Scene, view: &CameraView, photometry: Photometry) -> Vec<u8> {
    let mut pixels = vec![0; (view.intrinsics.width * view.intrinsics.height) as usize];
    Renderer::new(photometry, random::stream(1, "test")).render(scene, view, &mut pixels).unwrap();
    pixels
}

fn pixel_of(view: &CameraView, point: Point3<f64>) -> Vector2<f64> {
    let at = view.robot.inverse().transform_point(point.xy());
    let p = view.mount.body_from_camera().inverse() * Point3::new(at.x, at.y, point.z);
    view.intrinsics.pixel_from_normalized(Vector2::new(p.x / p.z, p.y / p.z))
}

/// Compares the left edge of a bright pane in an otherwise black hallway with its projection, row by row.
#[test]
fn edges_are_exact_to_a_few_hundredths_of_a_pixel() {
    let mut world = World::corridor(12.0, 2.0);
    world.ambient = Some(0.0);
    world.floor.gloss = 0.0;
    let corridor = world.corridor.as_mut().unwrap();
    corridor.lamp_spacing_m = 0.0;
    corridor.window = Some(Window { brightness: 0.8, ..Window::default() });
    let scene = Scene::new(&world, 1).unwrap();
    let pane_x = 10.0 + 0.8 * 0.12 - 0.002;
    let edge = |z: f64| Point3::new(pane_x, 0.55, z);

    let (mut rows, mut worst, mut sum) = (0, 0.0_f64, 0.0);
    for i in 0..40 {
        let t = f64::from(i);
        let mount = Mount { z: 1.5, roll: 0.1 * (0.7 * t).sin(), ..Mount::default() };
        let view = view(320, 240, mount, Pose2::new(5.0 + 0.03 * t, 0.2 * t.sin(), 0.06 * t.cos()));
        let pixels = render_image(&scene, &view, PLAIN);
        let (low, high) = (pixel_of(&view, edge(1.1)), pixel_of(&view, edge(2.0)));
        for y in high.y.ceil() as usize + 1..low.y.floor() as usize {
            let expected = high.x + (low.x - high.x) * (y as f64 - high.y) / (low.y - high.y);
            let inside = expected as usize + 4;
            let light = |x: usize| (f64::from(pixels[y * 320 + x]) / 255.0).powi(2);
            let lit: f64 = (inside - 8..inside).map(|x| light(x) / light(inside)).sum();
            let measured = inside as f64 - 0.5 - lit;
            let error = measured - expected;
            worst = worst.max(error.abs());
            sum += error;
            rows += 1;
        }
    }
    assert!(rows > 1000);
    assert!(
        worst < 0.04 && (sum / f64::from(rows)).abs() < 0.005,
        "worst {worst}, mean {}",
        sum / f64::from(rows)
    );
}

#[test]
fn polygons_and_rays_agree() {
    let mut world = World::from_toml(HALLWAY).unwrap();
    // Only the rasterizer blurs reflections.
    for (gloss, mean_limit, far_limit) in [(0.0, 0.8, 0.005), (0.5, 3.0, 0.05)] {
        // A plain floor: the rasterizer averages the speckle over a larger area than the ray caster.
        world.floor = Floor { gloss, speckle: 0.0, joint_spacing_m: [0.5, 0.5], ..world.floor };
        let mut scene = Scene::new(&world, 3).unwrap();
        for (seconds, robot) in [(10.0, Pose2::new(2.5, 0.2, 0.1)), (23.0, Pose2::new(7.5, -0.3, -0.3))] {
            scene.set_time(seconds).unwrap();
            let mount = Mount { roll: 0.05, ..Mount::tilted(0.6, 0.1) };
            let view = view(96, 72, mount, robot);
            let drawn = render_image(&scene, &view, PLAIN);
            let mut cast = vec![0; drawn.len()];
            let mut renderer = Renderer::new(PLAIN, random::stream(1, "test"));
            renderer.cast(&scene, &view, 8, &mut cast).unwrap();
            let differences: Vec<u8> = drawn.iter().zip(&cast).map(|(a, b)| a.abs_diff(*b)).collect();
            let mean = differences.iter().map(|d| f64::from(*d)).sum::<f64>() / differences.len() as f64;
            let far_off = differences.iter().filter(|d| **d > 12).count() as f64 / differences.len() as f64;
            assert!(
                mean < mean_limit && far_off < far_limit,
                "gloss {gloss}: mean {mean}, far off {far_off}"
            );
        }
    }
}

#[test]
fn color_images_have_the_luminance_of_gray_images() {
    let scene = Scene::new(&World::from_toml(HALLWAY).unwrap(), 1).unwrap();
    let view = view(96, 72, Mount::tilted(0.6, 0.1), Pose2::new(1.0, 0.0, 0.3));
    let gray = render_image(&scene, &view, PLAIN);
    let mut rgb = vec![0; 3 * gray.len()];
    Renderer::new(PLAIN, random::stream(1, "test")).render_rgb(&scene, &view, &mut rgb).unwrap();
    let light = |v: u8| (f64::from(v) / 255.0).powi(2);
    for (g, c) in
        gray.iter().zip(rgb.chunks_exact(3)).filter(|(g, c)| **g < 250 && c.iter().all(|v| *v < 250))
    {
        let luminance = 0.2126 * light(c[0]) + 0.7152 * light(c[1]) + 0.0722 * light(c[2]);
        assert!((luminance.sqrt() * 255.0 - f64::from(*g)).abs() < 2.0, "{g} {c:?}");
    }
}

#[test]
fn noise_has_the_configured_deviation_and_a_wrong_buffer_is_refused() {
    let scene = Scene::new(&World::corridor(12.0, 2.0), 1).unwrap();
    let view = view(160, 120, Mount::tilted(0.6, 0.1), Pose2::IDENTITY);
    let clean = render_image(&scene, &view, PLAIN);
    let noisy = render_image(&scene, &view, Photometry { noise_sigma: 4.0, ..PLAIN });
    let within: Vec<f64> = clean
        .iter()
        .zip(&noisy)
        .filter(|(c, _)| (30..220).contains(*c))
        .map(|(c, n)| f64::from(*n) - f64::from(*c))
        .collect();
    let mean = within.iter().sum::<f64>() / within.len() as f64;
    let deviation = (within.iter().map(|d| d * d).sum::<f64>() / within.len() as f64).sqrt();
    assert!(mean.abs() < 0.15 && (deviation - 4.0).abs() < 0.15, "{mean} {deviation}");
    let mut renderer = Renderer::new(PLAIN, random::stream(1, "test"));
    assert!(renderer.render(&scene, &view, &mut [0; 7]).is_err());
    let lost = CameraView { robot: Pose2 { x: f64::NAN, ..Pose2::IDENTITY }, ..view };
    assert!(renderer.render(&scene, &lost, &mut vec![0; 160 * 120]).is_err());
}

#[test]
fn the_hallway_matches_the_golden_images() {
    let mut scene = Scene::new(&World::from_toml(HALLWAY).unwrap(), 1).unwrap();
    let views = [
        ("start", 0.0, Pose2::new(0.0, 0.0, 0.0)),
        ("person", 10.0, Pose2::new(3.2, 0.1, 0.05)),
        ("branch", 0.0, Pose2::new(6.0, 0.2, -0.25)),
        ("end", 0.0, Pose2::new(11.0, -0.3, 0.1)),
    ];
    for (name, seconds, robot) in views {
        scene.set_time(seconds).unwrap();
        let view = view(160, 120, Mount::tilted(0.6, 0.09), robot);
        agrees_with_golden(name, &render_image(&scene, &view, PLAIN));
    }
}

#[test]
fn white_and_brown_boxes_differ_from_the_floor() {
    let boxes = "[[box]]\nat_m = [2.2, 0.4]\ncolor = [0.85, 0.85, 0.83]\n\
                 [[box]]\nat_m = [2.2, -0.4]\ncolor = [0.30, 0.19, 0.10]";
    let scene = Scene::new(&World::from_toml(&format!("{HALLWAY}\n{boxes}")).unwrap(), 1).unwrap();
    let view = view(160, 120, Mount::tilted(0.6, 0.25), Pose2::IDENTITY);
    let pixels = render_image(&scene, &view, PLAIN);
    let gray_at = |point: Point3<f64>| {
        let pixel = pixel_of(&view, point);
        f64::from(pixels[pixel.y.round() as usize * 160 + pixel.x.round() as usize])
    };
    // The faces toward the robot, and the floor in front of them, beside the reflection of the lamps.
    let (white, brown) = (gray_at(Point3::new(2.08, 0.4, 0.2)), gray_at(Point3::new(2.08, -0.4, 0.2)));
    let floor = gray_at(Point3::new(1.8, 0.4, 0.0));
    let top = gray_at(Point3::new(2.2, 0.4, 0.35));
    assert!(
        top > floor + 40.0 && white > floor + 8.0 && brown < floor - 60.0,
        "white {top} and {white}, floor {floor}, brown {brown}"
    );
    agrees_with_golden("boxes", &pixels);
}

/// Compares with a golden image of 160 x 120 pixels.
fn agrees_with_golden(name: &str, pixels: &[u8]) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/{name}.png"));
    if std::env::var_os("YAMABICO_BLESS").is_some() {
        image::save_buffer(&path, pixels, 160, 120, image::ExtendedColorType::L8).unwrap();
    }
    let golden = image::open(&path).unwrap().to_luma8().into_raw();
    let differences = pixels.iter().zip(&golden).map(|(a, b)| f64::from(a.abs_diff(*b)));
    let mean = differences.clone().sum::<f64>() / pixels.len() as f64;
    let far_off = differences.filter(|d| *d > 10.0).count();
    assert!(
        golden.len() == pixels.len() && mean < 0.5 && far_off < 40,
        "{name}: mean {mean}, far off {far_off}"
    );
}
