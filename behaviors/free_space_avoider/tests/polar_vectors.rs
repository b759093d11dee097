//! Known answers of method polar-cells and of the choice of a direction. The files are in millimeters.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use serde_json::Value;
use yamabico_core::camera::{FloorFormula, MirrorImage};
use yamabico_core::geometry::wrap_angle;
use yamabico_free_space_avoider::direction::choice::{ChoiceRules, Chooser, PreviousChoice, Start, Velocity};
use yamabico_free_space_avoider::direction::heading::{self, HeadingRules, Rollout, roll_out};
use yamabico_free_space_avoider::direction::{FreeDistances, LimitedMotion, trajectories};
use yamabico_free_space_avoider::polar_cells::FreeCells;
use yamabico_free_space_avoider::polar_cells::ring_cells::RingCells;
use yamabico_testkit::vectors::{hash_of_mask, number, omni};
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::morphology::Morphology;

const FLOOR: FloorFormula = FloorFormula { a: 10_120.0, b: 20.54, c: 2.298e5 };

fn cases(file: &Value) -> &[Value] {
    let cases = file["cases"].as_array().expect("cases");
    assert!(!cases.is_empty(), "no case");
    cases
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("no list: {value}")).iter().map(number).collect()
}

fn meters(value: &Value) -> Vector2<f64> {
    Vector2::from_vec(numbers(value)) * 1e-3
}

fn check(id: &Value, what: &str, ours: f64, theirs: f64) {
    let is_same = ours == theirs || (ours - theirs).abs() <= 1e-9 * theirs.abs().max(1.0);
    assert!(is_same, "{id}, {what}: {ours} instead of {theirs}");
}

/// Compares a clearance with the file's, in millimeters; 1e300 in the file means that there is no obstacle.
fn check_clearance(id: &Value, ours_m: f64, theirs_mm: &Value) {
    let ours = if ours_m.is_finite() { 1e3 * ours_m } else { 1e300 };
    check(id, "clearance", ours, number(theirs_mm));
}

fn paint(image: &MirrorImage, ops: &Value) -> BitImage {
    let (width, height) = (image.width as usize, image.height as usize);
    let mut pixels = vec![false; width * height];
    for op in ops.as_array().expect("operations") {
        let at = |key: &str| number(&op[key]);
        for (i, pixel) in pixels.iter_mut().enumerate() {
            let (u, v) = ((i % width) as f64, (i / width) as f64);
            let point = image.mirror_from_pixel(Vector2::new(u, v));
            let is_hit = match op["op"].as_str().expect("an operation") {
                "fill" => true,
                "disc" => (u - at("u")).powi(2) + (v - at("v")).powi(2) < at("r").powi(2),
                "rect" => (at("u0")..=at("u1")).contains(&u) && (at("v0")..=at("v1")).contains(&v),
                "sector" => {
                    let square = point.norm_squared();
                    let turn = (point.y.atan2(point.x) - at("phi0")).rem_euclid(TAU);
                    (at("R0").powi(2)..at("R1").powi(2)).contains(&square) && turn < at("dphi")
                }
                "half" => at("a") * u + at("b") * v >= at("c"),
                "lcg" => {
                    let seed = at("seed") as u32;
                    let (u, v) = (u as u32, v as u32);
                    let mut s = u
                        .wrapping_mul(1_664_525)
                        .wrapping_add(v.wrapping_mul(1_013_904_223))
                        .wrapping_add(seed);
                    s ^= s >> 13;
                    s = s.wrapping_mul(2_654_435_761);
                    s ^= s >> 16;
                    f64::from(s % 1000) < at("permille")
                }
                other => panic!("unknown operation {other}"),
            };
            if is_hit {
                *pixel = at("val") != 0.0;
            }
        }
    }
    let mut mask = BitImage::new(width, height);
    (0..width * height).filter(|&i| pixels[i]).for_each(|i| mask.set(i % width, i / width));
    mask
}

/// Returns the hash of all pixels, row by row.
fn hash(mask: &BitImage) -> String {
    let rows = (0..mask.height()).flat_map(|v| (0..mask.width()).map(move |u| mask.get(u, v)));
    hash_of_mask(rows)
}

#[test]
fn sek_cells() {
    let file = omni("sek_cells");
    let schema = &file["schema"];
    let edges = numbers(&schema["edges_px"]);
    let directions = number(&schema["J_directions"]) as usize;
    let image = MirrorImage::centered(256, 220);
    let cells = RingCells::new(&image, &edges, directions, 5.0).expect("a template");
    let whole = |value: &Value| numbers(value).into_iter().map(|n| n as u32).collect::<Vec<_>>();
    assert_eq!(cells.areas(), whole(&schema["cell_area"]));
    assert_eq!(cells.rings() as f64, number(&schema["I_radial"]));
    let (mut morphology, mut counts) = (Morphology::default(), Vec::new());
    for case in cases(&file) {
        let id = &case["id"];
        let mut mask = paint(&image, &case["ops"]);
        assert_eq!(f64::from(mask.count()), number(&case["ones_raw"]), "{id}");
        assert_eq!(Some(hash(&mask).as_str()), case["fnv1a64_raw"].as_str(), "{id}");
        morphology.close(&mut mask, number(&case["closing_iters"]) as u32);
        assert_eq!(f64::from(mask.count()), number(&case["ones_after"]), "{id}");
        cells.count(&mask, &mut counts);
        assert_eq!(counts, whole(&case["count"]), "{id}");
        let mut free = FreeCells::new(&cells, number(&case["r_th"]), 1);
        free.update(&counts);
        let rings: Vec<u32> = free.rings().iter().map(|&rings| rings as u32).collect();
        assert_eq!(rings, whole(&case["a"]), "{id}");
        for (&rings, expected) in free.rings().iter().zip(numbers(&case["dist_mm"])) {
            let distance = FLOOR.floor_radius_m(edges[rings]).expect("below the horizon");
            check(id, "distance", 1e3 * distance, expected);
        }
    }
}

#[test]
fn sek_trajectory() {
    let file = omni("sek_trajectory");
    for case in cases(&file) {
        let id = &case["id"];
        let acceleration = 1e-3 * number(&case["alpha"]);
        let motion = LimitedMotion::new(meters(&case["v_a"]), meters(&case["v_b"]), acceleration);
        check(id, "ramp", motion.ramp_s(), number(&case["t_a"]));
        for sample in case["samples"].as_array().expect("samples") {
            let t = number(&sample["t"]);
            let (p, v) = (1e3 * motion.position_m(t), 1e3 * motion.velocity_mps(t));
            for axis in 0..2 {
                check(id, "position", p[axis], number(&sample["p"][axis]));
                check(id, "velocity", v[axis], number(&sample["v"][axis]));
            }
        }
    }
}

fn free_distances(rings: &Value, edges_mm: &[f64]) -> FreeDistances {
    let rings = numbers(rings);
    let farthest = 1e-3 * edges_mm[edges_mm.len() - 1];
    let mut free = FreeDistances::all_around(Vector2::zeros(), rings.len(), farthest);
    free.set(rings.iter().map(|&rings| 1e-3 * edges_mm[rings as usize]));
    free
}

#[test]
fn sek_direction() {
    let file = omni("sek_direction");
    let params = &file["schema"]["params"];
    let edges_mm = numbers(&params["edges_mm"]);
    let mut chooser = Chooser::default();
    for case in cases(&file) {
        let (id, expect) = (&case["id"], &case["expect"]);
        let velocity = match case["velocity_aware"].as_bool() {
            Some(true) => Velocity::Considered,
            Some(false) => Velocity::Ignored,
            None => panic!("{id}: with or without velocity?"),
        };
        let rules = ChoiceRules {
            speed_mps: 1e-3 * number(&params["v"]),
            acceleration_mps2: 1e-3 * number(&params["alpha"]),
            clearance_m: 1e-3 * number(&params["robot_radius_plus_margin"]),
            step_s: number(&params["dt"]),
            reaction_s: number(&params["tau"]),
            velocity,
            side_change_rad: 0.0,
            nearer_m: 0.0,
            deviation_rad: [0.0, TAU],
        };
        let free = free_distances(&case["a"], &edges_mm);
        let start = Start { velocity_mps: meters(&case["v_a"]), ..Start::default() };
        let side = case["s_prev"].as_i64().unwrap_or(0) as i8;
        let before = PreviousChoice { side, direction_rad: None };
        let choice = chooser.choose(&free, &start, number(&case["goal_dir"]), &before, &rules);
        let Some(choice) = choice else {
            assert_eq!(expect["status"].as_str(), Some("stop"), "{id}");
            check_clearance(id, trajectories::stop_clearance_m(&free, &start, &rules), &expect["stop_clear"]);
            continue;
        };
        assert_eq!(expect["status"].as_str(), Some("move"), "{id}");
        let index = choice.sector.map_or(-1, |sector| sector as i64);
        assert_eq!(Some(index), expect["index"].as_i64(), "{id}");
        assert_eq!(choice.rank as f64, number(&expect["rank"]), "{id}");
        check(id, "direction", choice.direction_rad, number(&expect["dir"]));
        let turn = wrap_angle(choice.direction_rad - number(&expect["dir_wrapped"]));
        check(id, "wrapped direction", turn, 0.0);
        let clearance_m = trajectories::min_clearance_m(&free, &start, choice.velocity_mps, &rules);
        check_clearance(id, clearance_m, &expect["min_clear"]);
        let begin = if velocity == Velocity::Ignored { choice.velocity_mps } else { start.velocity_mps };
        let ramp_s = LimitedMotion::new(begin, choice.velocity_mps, rules.acceleration_mps2).ramp_s();
        check(id, "ramp", ramp_s, number(&expect["t_a"]));
        let whole_s = ramp_s + rules.speed_mps / (2.0 * rules.acceleration_mps2);
        check(id, "duration", whole_s, number(&expect["T"]));
    }
}

#[test]
fn sek_diffdrive() {
    let file = omni("sek_diffdrive");
    let params = &file["schema"]["params"];
    let edges_mm = numbers(&params["edges_mm"]);
    let rules = HeadingRules {
        speed_mps: 1e-3 * number(&params["v_max"]),
        acceleration_mps2: 1e-3 * number(&params["alpha"]),
        turn_radps: number(&params["w_max"]),
        turn_acceleration_radps2: number(&params["alpha_w"]),
        gain_per_s: number(&params["k_theta"]),
        step_s: number(&params["dt"]),
        horizon_s: number(&params["T"]),
        clearance_m: 0.1,
        side_change_rad: 0.0,
        deviation_rad: [0.0, TAU],
    };
    for case in cases(&file) {
        let id = &case["id"];
        let [x, y, theta, speed, turn] = numbers(&case["state"])[..] else { panic!("{id}: state") };
        let start = Rollout::new(Vector2::new(1e-3 * x, 1e-3 * y), theta, 1e-3 * speed, turn);
        let heading_rad = number(&case["target_heading"]);
        let states: Vec<Rollout> = roll_out(start, heading_rad, &rules).collect();
        assert_eq!(states.len() as f64, number(&case["steps"]), "{id}");
        let after = |seconds: f64| states[(seconds / rules.step_s).round() as usize - 1];
        let last = states[states.len() - 1];
        for (key, state) in
            [("at_0_5s", after(0.5)), ("at_1s", after(1.0)), ("at_2s", after(2.0)), ("final", last)]
        {
            let p = 1e3 * state.position_m;
            let ours = [p.x, p.y, state.theta_rad, 1e3 * state.speed_mps, state.turn_radps];
            for (ours, theirs) in ours.into_iter().zip(numbers(&case[key])) {
                check(id, key, ours, theirs);
            }
        }
        let free = free_distances(&case["obstacle_a"], &edges_mm);
        check_clearance(id, heading::min_clearance_m(&free, start, heading_rad, &rules), &case["min_clear"]);
    }
}
