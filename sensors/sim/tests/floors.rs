//! Floors and what lies on them: mirror images, tiles, patches.

use nalgebra::{Point3, Vector2};
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_sim::world::{Floor, Grain, Lamp, Patch, Poster, Reflection};
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};

const SIZE: [u32; 2] = [256, 240];

fn view(robot: Pose2) -> CameraView {
    let intrinsics = Intrinsics::from_horizontal_fov(SIZE[0], SIZE[1], 1.05);
    CameraView { intrinsics, mount: Mount { roll: 0.02, ..Mount::tilted(0.6, 0.1) }, robot }
}

fn plain() -> Photometry {
    Photometry { vignetting: 0.0, noise_sigma: 0.0, ..Photometry::default() }
}

fn image(world: &World, view: &CameraView, photometry: Photometry) -> Vec<u8> {
    let scene = Scene::new(world, 1).unwrap();
    let mut pixels = vec![0; (SIZE[0] * SIZE[1]) as usize];
    Renderer::new(photometry, random::stream(1, "test")).render(&scene, view, &mut pixels).unwrap();
    pixels
}

fn pixel_of(view: &CameraView, point: Point3<f64>) -> Vector2<f64> {
    let at = view.robot.inverse().transform_point(point.xy());
    let p = view.mount.body_from_camera().inverse() * Point3::new(at.x, at.y, point.z);
    view.intrinsics.pixel_from_normalized(Vector2::new(p.x / p.z, p.y / p.z))
}

/// Returns a hallway with one lamp and no other light, and a floor that mirrors a tenth of it.
fn mirror_hall(lamp: [f64; 2]) -> World {
    let mut world = World::corridor(14.0, 2.4);
    let corridor = world.corridor.as_mut().unwrap();
    (corridor.lamp_spacing_m, corridor.window) = (0.0, None);
    world.ambient = Some(0.0);
    world.lamps = vec![Lamp { at_m: lamp, size_m: [0.6, 0.4], brightness: 12.0 }];
    world.floor = Floor {
        gloss: 1.0,
        reflectance: 0.1,
        reflection: Reflection::Sharp,
        color: [0.02; 3],
        speckle: 0.0,
        ..world.floor
    };
    world
}

/// The mirror image of a lamp at height z is the image of a lamp at height -z.
#[test]
fn the_mirror_image_of_a_lamp_is_at_the_right_pixel() {
    let mut cases = 0;
    for (lamp, robot) in [
        ([6.0, 0.0], Pose2::new(0.5, 0.0, 0.0)),
        ([6.0, 0.5], Pose2::new(0.2, -0.2, 0.1)),
        ([7.5, -0.6], Pose2::new(1.5, 0.3, -0.15)),
    ] {
        let world = mirror_hall(lamp);
        let view = view(robot);
        let pixels = image(&world, &view, plain());
        let corners = [(-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (-0.3, 0.2)]
            .map(|(dx, dy)| pixel_of(&view, Point3::new(lamp[0] + dx, lamp[1] + dy, -(2.6 - 0.015))));
        let middle = corners.iter().sum::<Vector2<f64>>() / 4.0;
        let at = |p: Vector2<f64>| pixels[p.y.round() as usize * SIZE[0] as usize + p.x.round() as usize];
        assert!(at(middle) > 200, "{lamp:?}: {} at {middle:?}", at(middle));
        // Just inside each corner it is bright, just outside dark.
        for corner in corners {
            let outward = corner - middle;
            let step = outward.normalize() * 2.5;
            let (inside, outside) = (at(corner - step), at(corner + step));
            assert!(inside > 200 && outside < 120, "{lamp:?}: {inside} inside, {outside} outside {corner:?}");
        }
        cases += 1;
    }
    assert_eq!(cases, 3);
}

#[test]
fn a_mirror_image_is_sharp_only_if_configured() {
    let sharp = mirror_hall([6.0, 0.0]);
    let blurred = World { floor: Floor { reflection: Reflection::Blurred, ..sharp.floor }, ..sharp.clone() };
    let view = view(Pose2::new(0.5, 0.0, 0.0));
    let steepest = |world: &World| {
        let pixels = image(world, &view, plain());
        let floor = &pixels[150 * SIZE[0] as usize..];
        floor.windows(2).map(|pair| pair[0].abs_diff(pair[1])).max().unwrap()
    };
    let (sharp, blurred) = (steepest(&sharp), steepest(&blurred));
    assert!(sharp > 100 && blurred < 80, "{sharp} {blurred}");
}

#[test]
fn polygons_and_rays_agree_on_every_floor() {
    let hall = World::corridor(12.0, 2.0);
    let floors = [
        Floor { gloss: 1.0, reflectance: 0.15, reflection: Reflection::Sharp, ..hall.floor },
        Floor {
            gloss: 0.0,
            joint_spacing_m: [0.4, 0.4],
            joint_angle_deg: 45.0,
            joint_width_m: 0.01,
            ..hall.floor
        },
        Floor {
            gloss: 0.0,
            joint_spacing_m: [1.2, 0.15],
            joint_angle_deg: 90.0,
            stagger: 1.0,
            tile_contrast: 0.15,
            ..hall.floor
        },
    ];
    for (i, floor) in floors.into_iter().enumerate() {
        let patches = vec![
            Patch { at_m: [2.5, 0.3], yaw_deg: 20.0, color: Some([0.7; 3]), ..Patch::default() },
            Patch { at_m: [3.0, -0.4], size_m: [1.0, 0.5], light: 2.0, ..Patch::default() },
        ];
        let world = World { floor: Floor { speckle: 0.0, ..floor }, patches, ..hall.clone() };
        let scene = Scene::new(&world, 1).unwrap();
        let view = view(Pose2::new(0.5, 0.1, 0.05));
        let drawn = image(&world, &view, plain());
        let mut cast = vec![0; drawn.len()];
        Renderer::new(plain(), random::stream(1, "test")).cast(&scene, &view, 4, &mut cast).unwrap();
        let differences = drawn.iter().zip(&cast).map(|(a, b)| f64::from(a.abs_diff(*b)));
        let mean = differences.clone().sum::<f64>() / drawn.len() as f64;
        let far_off = differences.filter(|d| *d > 16.0).count() as f64 / drawn.len() as f64;
        assert!(mean < 1.2 && far_off < 0.015, "floor {i}: mean {mean}, far off {far_off}");
    }
}

#[test]
fn a_patch_is_seen_in_its_color_and_is_no_obstacle() {
    let mut world = World::corridor(12.0, 2.0);
    world.floor = Floor { gloss: 0.0, speckle: 0.0, ..world.floor };
    let bare = Scene::new(&world, 1).unwrap();
    let before = image(&world, &view(Pose2::IDENTITY), plain());
    world.patches = vec![
        Patch { at_m: [2.0, 0.3], color: Some([0.7; 3]), ..Patch::default() },
        Patch { at_m: [2.0, -0.3], light: 0.5, ..Patch::default() },
    ];
    let scene = Scene::new(&world, 1).unwrap();
    assert_eq!((scene.solids().len(), scene.floor_plan()), (bare.solids().len(), bare.floor_plan()));
    let after = image(&world, &view(Pose2::IDENTITY), plain());
    let light = |pixels: &[u8], y: f64| {
        let at = pixel_of(&view(Pose2::IDENTITY), Point3::new(2.0, y, 0.0));
        (f64::from(pixels[at.y.round() as usize * SIZE[0] as usize + at.x.round() as usize]) / 255.0).powi(2)
    };
    let floor = 0.2126 * 0.42 + 0.7152 * 0.39 + 0.0722 * 0.34;
    let (paper, shadow) =
        (light(&after, 0.3) / light(&before, 0.3), light(&after, -0.3) / light(&before, -0.3));
    assert!((paper / (0.7 / floor) - 1.0).abs() < 0.05 && (shadow - 0.5).abs() < 0.02, "{paper} {shadow}");
    assert_eq!(light(&after, 0.8), light(&before, 0.8), "the floor beside them is the same");
}

#[test]
fn a_poster_hangs_where_it_is_configured() {
    let wall = "[[wall]]\nfrom_m = [4, -2]\nto_m = [4, 2]\ncolor = [0.2, 0.2, 0.2]\n[[lamp]]\nat_m = [3, 0]";
    let bare = World::from_toml(wall).unwrap();
    let mut world = bare.clone();
    let sheet =
        Poster { at_m: 2.5, width_m: 0.8, line_spacing_m: [0.0, 0.0], color: [0.9; 3], ..Poster::default() };
    world.walls[0].posters.push(sheet);
    let view = view(Pose2::IDENTITY);
    let (before, after) = (image(&bare, &view, plain()), image(&world, &view, plain()));
    let at = |pixels: &[u8], y: f64, z: f64| {
        let p = pixel_of(&view, Point3::new(4.0, y, z));
        pixels[p.y.round() as usize * SIZE[0] as usize + p.x.round() as usize]
    };
    for (y, z, is_sheet) in
        [(0.5, 1.4, true), (0.15, 1.05, true), (0.85, 1.05, true), (0.05, 1.4, false), (0.95, 1.4, false)]
    {
        let brighter = at(&after, y, z) > at(&before, y, z).saturating_add(30);
        assert_eq!(brighter, is_sheet, "at {y}, {z}");
    }
}

#[test]
fn fine_textures_have_the_configured_contrast() {
    for grain in [Grain::Speckle, Grain::Chips, Grain::Motif] {
        let mut world = World::corridor(12.0, 3.0);
        world.floor = Floor { grain, speckle: 0.2, grain_m: 0.01, gloss: 0.0, ..world.floor };
        let down = CameraView { mount: Mount::tilted(1.0, 1.5), ..view(Pose2::new(3.0, 0.0, 0.0)) };
        let textured = image(&world, &down, plain());
        world.floor.speckle = 0.0;
        let even = image(&world, &down, plain());
        let ratios = textured.iter().zip(&even).map(|(a, b)| (f64::from(*a) / f64::from(*b)).powi(2) - 1.0);
        let deviation = (ratios.clone().map(|r| r * r).sum::<f64>() / ratios.count() as f64).sqrt();
        assert!((0.14..0.24).contains(&deviation), "{grain:?}: {deviation}");
    }
}

#[test]
fn flicker_changes_the_gain_from_frame_to_frame() {
    let scene = Scene::new(&World::corridor(12.0, 2.0), 1).unwrap();
    let mut renderer = Renderer::new(Photometry { flicker: 0.05, ..plain() }, random::stream(1, "test"));
    let mut pixels = vec![0; (SIZE[0] * SIZE[1]) as usize];
    let mut light = || {
        renderer.render(&scene, &view(Pose2::IDENTITY), &mut pixels).unwrap();
        (f64::from(pixels[200 * SIZE[0] as usize + 40]) / 255.0).powi(2)
    };
    let frames: Vec<f64> = (0..200).map(|_| light()).collect();
    let mean = frames.iter().sum::<f64>() / 200.0;
    let deviation = (frames.iter().map(|f| (f / mean - 1.0).powi(2)).sum::<f64>() / 200.0).sqrt();
    assert!((0.04..0.06).contains(&deviation), "{deviation}");
}
