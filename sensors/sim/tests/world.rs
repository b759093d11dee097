//! World files: any world that passes the check can be built and rendered; others are refused with their key.

use proptest::prelude::*;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};

/// World file with one of every part.
const ALL: &str = r#"
texture_seed = 1
ambient = 0.4
[corridor]
start_x_m = -1
length_m = 6
width_m = 2
height_m = 2.6
thickness_m = 0.12
color = [0.7, 0.7, 0.6]
end_color = [0.6, 0.6, 0.6]
lamp_spacing_m = 2.4
lamp_size_m = [1.2, 0.3]
lamp_brightness = 12
baseboard = { height_m = 0.1, depth_m = 0.012, color = [0.1, 0.1, 0.1] }
window = { at_m = 1, width_m = 1.2, sill_m = 0.9, height_m = 1.3, brightness = 2.5 }
[[corridor.door]]
side = "left"
at_m = 1
width_m = 0.9
height_m = 2
open_deg = 60
room_depth_m = 2
color = [0.3, 0.2, 0.1]
frame_color = [0.3, 0.2, 0.1]
[[corridor.branch]]
side = "right"
at_m = 3
width_m = 1.2
depth_m = 2
[[wall]]
from_m = [8, -2]
to_m = [8, 2]
height_m = 2.5
thickness_m = 0.1
color = [0.5, 0.5, 0.5]
baseboard = { height_m = 0.1 }
door = [{ at_m = 1, width_m = 0.9, height_m = 2 }]
window = [{ at_m = 3, width_m = 1, sill_m = 1, height_m = 1 }]
[[box]]
at_m = [2, 0.5]
base_m = 0.2
yaw_deg = 20
size_m = [0.3, 0.2, 0.4]
color = [0.8, 0.8, 0.8]
[[lamp]]
at_m = [7, 0]
size_m = [1, 0.3]
brightness = 10
[[person]]
path_m = [[2, 0], [3, 0.5]]
pause_s = [0, 1]
start_s = 0
jitter_s = 0.5
speed_mps = 1
height_m = 1.7
shirt = [0.2, 0.3, 0.5]
trousers = [0.1, 0.1, 0.1]
[floor]
color = [0.4, 0.4, 0.3]
speckle = 0.1
grain_m = 0.006
gloss = 0.5
joint_spacing_m = [0.5, 0.5]
joint_width_m = 0.004
joint_tone = 0.6
[ceiling]
height_m = 2.6
color = [0.8, 0.8, 0.8]
joint_spacing_m = [0.6, 0.6]
"#;

/// Minimum and maximum values of the keys, and invalid values.
const NUMBERS: [f64; 22] = [
    0.0,
    1e-6,
    0.002,
    0.01,
    0.05,
    0.2,
    0.4,
    0.5,
    0.8,
    1.0,
    1.5,
    2.2,
    3.0,
    10.0,
    20.0,
    100.0,
    200.0,
    1000.0,
    -1.0,
    1e300,
    f64::NAN,
    f64::INFINITY,
];

fn numbers_in(value: &mut toml::Value) -> Vec<&mut toml::Value> {
    match value {
        toml::Value::Integer(_) | toml::Value::Float(_) => vec![value],
        toml::Value::Array(items) => items.iter_mut().flat_map(numbers_in).collect(),
        toml::Value::Table(table) => table.iter_mut().flat_map(|(_, value)| numbers_in(value)).collect(),
        _ => Vec::new(),
    }
}

fn all() -> toml::Value {
    toml::Value::Table(ALL.parse().unwrap())
}

/// Builds and renders a world; returns false if it is refused.
fn is_rendered(value: &toml::Value) -> bool {
    let Ok(world) = World::from_toml(&toml::to_string(value).unwrap()) else { return false };
    let mut scene = Scene::new(&world, 1).unwrap();
    scene.set_time(1.0).unwrap();
    let photometry = Photometry { vignetting: 0.0, noise_sigma: 0.0, ..Photometry::default() };
    let view = CameraView {
        intrinsics: Intrinsics::from_horizontal_fov(32, 24, 1.2),
        mount: Mount::tilted(0.6, 0.1),
        robot: Pose2::new(0.5, 0.1, 0.05),
    };
    let mut pixels = vec![0; 32 * 24];
    Renderer::new(photometry, random::stream(1, "test")).render(&scene, &view, &mut pixels).unwrap();
    true
}

#[test]
fn the_world_with_all_parts_is_rendered() {
    assert!(is_rendered(&all()));
    assert!(World::corridor(12.0, 2.0).check().is_ok());
    assert!((0..20).all(|seed| World::random_corridor(u64::MAX - seed, 2.0).check().is_ok()));
}

#[test]
fn every_number_has_a_range() {
    let count = numbers_in(&mut all()).len();
    assert!(count > 90, "{count}");
    for i in 0..count {
        for wrong in [f64::NAN, 1e300, -1e300] {
            let mut world = all();
            *numbers_in(&mut world)[i] = toml::Value::Float(wrong);
            let refused = World::from_toml(&toml::to_string(&world).unwrap()).err();
            assert!(refused.is_some(), "number {i} of {count} as {wrong}:\n{world}");
        }
    }
}

#[test]
fn values_that_would_panic_or_never_end_are_refused_by_key() {
    for (text, key, problem) in [
        ("[floor]\njoint_spacing_m = [1e-6, 0]", "joint_spacing_m", "at least 0.05 m"),
        ("[ceiling]\njoint_spacing_m = [nan, 0]", "joint_spacing_m", "finite"),
        ("[corridor]\nlamp_spacing_m = 1e-6", "lamp_spacing_m", "at least 0.5 m"),
        ("[corridor]\nlamp_size_m = [nan, 1]", "lamp_size_m", "finite"),
        ("[corridor.window]\nat_m = nan", "at_m", "finite"),
        ("[corridor.window]\nat_m = 1.9", "at_m", "inside the wall"),
        ("[corridor.window]\nheight_m = 2", "height_m", "it ends at 2.9 m, the wall at 2.6 m"),
        ("[corridor]\ncolor = [2, 0, 0]", "color", "too large"),
        ("[floor]\njoint_width_m = 1", "joint_width_m", "too large"),
        ("[[box]]\nat_m = [1e300, 0]", "at_m", "too large"),
        ("[[person]]\npath_m = [[0, 0]]\npause_s = [1, 2]", "pause_s", "more pauses"),
        ("[[wall]]\nfrom_m = [1, 1]\nto_m = [1, 1]", "to_m", "but is 0 m"),
        (
            "[[corridor.branch]]\nside = \"left\"\nat_m = 3\nwidth_m = 2\ndepth_m = 2\n\
             [[corridor.branch]]\nside = \"left\"\nat_m = 4\nwidth_m = 2\ndepth_m = 2",
            "at_m",
            "to a side corridor",
        ),
    ] {
        let refused = World::from_toml(text).expect_err(text).to_string();
        assert!(refused.contains(&format!("`{key}`")) && refused.contains(problem), "{text}\n{refused}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_checked_world_is_rendered(
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop::sample::select(&NUMBERS[..])), 1..4),
    ) {
        let mut world = all();
        for (which, number) in changes {
            let mut numbers = numbers_in(&mut world);
            let i = which.index(numbers.len());
            *numbers[i] = toml::Value::Float(number);
        }
        is_rendered(&world);
    }
}
