//! Buildings drawn from seeds: reproducible, within their ranges, passable, and fit to be rendered.

use std::collections::BTreeSet;

use yamabico_core::geometry::Pose2;
use yamabico_sim::building::{Building, FloorKind, PersonKind, Properties};
use yamabico_sim::{CameraView, Renderer, Scene, clearance, random};

const NONE: &[String] = &[];

fn building(seed: u64) -> Building {
    Building::new(seed, NONE).unwrap()
}

#[test]
fn one_seed_gives_the_same_bytes_and_another_seed_others() {
    for seed in 0..20 {
        let text = building(seed).world_toml();
        assert_eq!(text, building(seed).world_toml());
        assert_ne!(text, building(seed + 1).world_toml());
        let read = yamabico_sim::World::from_toml(&text).unwrap();
        assert_eq!(format!("{read:?}"), format!("{:?}", building(seed).world), "the file is the world");
    }
}

#[test]
fn an_override_changes_its_property_and_no_other() {
    let drawn = building(5).properties;
    let changed = Building::new(5, &["floor = \"mirror\"".into(), "width_m = 1.4".into()]).unwrap();
    let expected = Properties { floor: FloorKind::Mirror, width_m: 1.4, ..drawn };
    assert_eq!(changed.properties, expected);
    assert!((changed.world.floor.reflectance - 0.04).abs() > 1e-3);
}

#[test]
fn an_invalid_override_is_refused_with_its_key() {
    for (line, key) in
        [("width_m = 0.3", "width_m"), ("floor = \"lawn\"", "floor"), ("depth = 1", "depth"), ("= 3", "=")]
    {
        let problems = Building::new(1, &[line.to_owned()]).unwrap_err().to_string();
        assert!(problems.contains(key), "{line}: {problems}");
    }
}

#[test]
fn properties_cover_their_ranges() {
    let drawn: Vec<Properties> = (0..400).map(Properties::draw).collect();
    let span = |of: fn(&Properties) -> f64| {
        let values = drawn.iter().map(of);
        (values.clone().fold(f64::MAX, f64::min), values.fold(f64::MIN, f64::max))
    };
    let covers = |of: fn(&Properties) -> f64, low: f64, high: f64| {
        let (min, max) = span(of);
        let slack = 0.05 * (high - low);
        assert!(
            min >= low - 1e-6 && min < low + slack && max <= high + 1e-6 && max > high - slack,
            "{min} {max}"
        );
    };
    covers(|p| p.width_m, 1.3, 3.0);
    covers(|p| p.camera_m, 0.35, 0.9);
    covers(|p| p.view_deg, 50.0, 80.0);
    covers(|p| p.noise.into(), 0.5, 5.0);
    covers(|p| p.blur_px.into(), 0.0, 1.2);
    covers(|p| p.gain.into(), 0.66, 1.52);
    covers(|p| p.lost_frames, 0.0, 0.15);
    covers(|p| p.boxes.into(), 1.0, 3.0);
    let kinds = |of: fn(&Properties) -> String| drawn.iter().map(of).collect::<BTreeSet<_>>().len();
    assert_eq!(kinds(|p| format!("{:?}", p.floor)), 7);
    assert_eq!(kinds(|p| format!("{:?}", p.baseboard)), 3);
    assert_eq!(kinds(|p| format!("{:?}", p.walls)), 3);
    assert_eq!(kinds(|p| format!("{:?}", p.glare)), 3);
    assert_eq!(kinds(|p| format!("{:?}", p.person)), 3);
    assert!(drawn.iter().all(|p| p.person != PersonKind::Meets || p.width_m >= 1.7));
}

/// Drives a disk of the robot's size along the hallway: at each x there must be a free y within a step of the last ones.
#[test]
fn a_robot_fits_past_the_boxes_to_the_goal() {
    const CELL_M: f64 = 0.05;
    for seed in 0..60 {
        let Building { world, properties, .. } = building(seed);
        assert!(!world.boxes.is_empty(), "seed {seed}");
        let scene = Scene::new(&world, seed).unwrap();
        let half = (properties.width_m / 2.0 / CELL_M) as i32;
        let is_free = |x: f64, cell: i32| {
            clearance::to_solids(scene.solids(), [x, f64::from(cell) * CELL_M], 0.2, 1.0) > 0.05
        };
        let mut reached: BTreeSet<i32> = BTreeSet::from([0]);
        for step in 0..=(properties.distance_m / CELL_M) as i32 {
            let x = f64::from(step) * CELL_M;
            let near = reached.iter().flat_map(|cell| cell - 1..=cell + 1);
            reached = near.filter(|cell| cell.abs() <= half && is_free(x, *cell)).collect();
            assert!(!reached.is_empty(), "seed {seed}: blocked at {x:.2} m");
        }
    }
}

#[test]
fn the_person_walks_through_doors_and_not_through_walls_or_boxes() {
    for seed in 0..60 {
        let Building { world, properties, .. } = building(seed);
        let scene = Scene::new(&world, seed).unwrap();
        for walker in scene.walkers() {
            for tenth in 0..1500 {
                let at = walker.at(f64::from(tenth) * 0.1).at;
                let free_m = clearance::to_solids(scene.solids(), at, 0.15, 1.7);
                let kind = properties.person;
                assert!(free_m > 0.0, "seed {seed}: {kind:?} at {at:?} within {free_m:.2} m of something");
            }
        }
    }
}

#[test]
fn every_building_shows_floor_walls_and_light() {
    for seed in 0..30 {
        let building = building(seed);
        let scene = Scene::new(&building.world, seed).unwrap();
        let (intrinsics, mount) = building.camera();
        let view = CameraView { intrinsics, mount, robot: Pose2::IDENTITY };
        let mut pixels = vec![0; (intrinsics.width * intrinsics.height) as usize];
        let mut renderer = Renderer::new(building.photometry(), random::stream(seed, "front"));
        renderer.render(&scene, &view, &mut pixels).unwrap();
        let mean = pixels.iter().map(|p| f64::from(*p)).sum::<f64>() / pixels.len() as f64;
        let saturated = pixels.iter().filter(|p| **p == 255).count() as f64 / pixels.len() as f64;
        assert!(
            (35.0..225.0).contains(&mean) && saturated < 0.5,
            "seed {seed}: mean {mean:.0}, white {saturated:.2}"
        );
        let bottom = 0.5 * intrinsics.fy.recip() * f64::from(intrinsics.height);
        let nearest_m = mount.z / (mount.tilt + bottom.atan()).tan();
        assert!(nearest_m < 1.3, "seed {seed}: the floor is in view from {nearest_m:.2} m on");
    }
}
