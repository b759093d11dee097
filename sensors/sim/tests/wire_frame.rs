//! Wire-frame map of a world.

use nalgebra::Point2;
use yamabico_sim::World;
use yamabico_sim::building::Building;
use yamabico_testkit::config;
use yamabico_vision::map::{EdgeKind, WireFrame};

fn hallway() -> World {
    World::from_toml(&std::fs::read_to_string(config("worlds/hallway.toml")).unwrap()).unwrap()
}

#[test]
fn the_map_file_equals_the_map_of_the_world() {
    let map = WireFrame::read(&config("maps/hallway.toml")).unwrap();
    let from_world = WireFrame::from_toml(&hallway().wire_frame().to_toml()).unwrap();
    assert_eq!(
        map, from_world,
        "write it again: cargo run --release -p yamabico-evaluations -- render map configs/worlds/hallway.toml configs/maps/hallway.toml"
    );
    assert!(map.edges().iter().filter(|edge| edge.kind == EdgeKind::Vertical).count() > 40);
}

#[test]
fn the_map_of_every_building_can_be_read() {
    for seed in 0..200 {
        let building = Building::new(seed, &[]).unwrap();
        let text = building.world.wire_frame().to_toml();
        if let Err(problems) = WireFrame::from_toml(&text) {
            panic!("seed {seed}: {problems}");
        }
    }
}

#[test]
fn walls_close_the_hallway_but_for_open_doors_and_the_side_corridor() {
    let map = hallway().wire_frame();
    let aside = |x: f64, y: f64| map.is_open(Point2::new(x, 0.0), Point2::new(x, y));
    assert!(!aside(0.0, 1.3) && !aside(0.0, -1.3), "walls");
    assert!(!aside(1.6, 1.3), "a closed door");
    assert!(aside(5.0, 1.3) && aside(6.2, -1.3), "open doors");
    assert!(aside(9.4, -4.0) && !aside(9.4, -6.0), "the side corridor and its end");
    assert!(!map.is_open(Point2::new(12.0, 0.0), Point2::new(17.0, 0.0)), "the far end");
    assert!((map.clearance(Point2::new(0.0, 0.2)) - 0.8).abs() < 1e-9);
}

#[test]
fn a_wall_without_a_baseboard_stands_on_the_floor() {
    let world = World::from_toml("[corridor]\nlength_m = 10").unwrap();
    let lines = world.wire_frame();
    let on_floor = |y: f64| {
        let lies = |z: f64, place: f64| z == 0.0 && (place - y).abs() < 1e-9;
        lines.edges().iter().any(|edge| lies(edge.from.z, edge.from.y) && lies(edge.to.z, edge.to.y))
    };
    assert!(on_floor(1.0) && on_floor(-1.0));
}

#[test]
fn the_edge_of_a_painted_lower_wall_is_on_the_map_and_a_poster_is_not() {
    let wall = "[[wall]]\nfrom_m = [0, 0]\nto_m = [4, 0]";
    let edges = |more: &str| {
        let world = World::from_toml(&format!("{wall}\n{more}")).unwrap();
        world.wire_frame().edges().to_vec()
    };
    let plain = edges("");
    assert_eq!(edges("poster = [{ at_m = 2 }]"), plain);
    let painted = edges("dado = { height_m = 1.1 }\ndoor = [{ at_m = 2 }]");
    let at_dado: Vec<f64> =
        painted.iter().filter(|e| e.from.z == 1.1).map(|e| (e.to - e.from).norm()).collect();
    assert_eq!(at_dado.len(), 2, "on either side of the door");
    assert!((at_dado.iter().sum::<f64>() - (4.0 - 0.9 - 0.12)).abs() < 1e-9, "{at_dado:?}");
}
