//! Known answers: thresholds, regions, passages and the state machine.

use serde_json::Value;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_stationary_obstacle_avoider::halt_state_machine::{Machine, Rules, Tick, VisionResult};
use yamabico_stationary_obstacle_avoider::obstacle_regions::{Sensitivity, nearest};
use yamabico_stationary_obstacle_avoider::regions::Regions;
use yamabico_stationary_obstacle_avoider::safe_passage::{Interval, PLANE_M, SafePassage, region_on_plane};
use yamabico_stationary_obstacle_avoider::threshold_learning::{Validity, learn, sweep};
use yamabico_testkit::vectors::perspective;
use yamabico_vision::bit_image::BitImage;

fn f(value: &Value, field: &str) -> f64 {
    value[field].as_f64().unwrap_or_else(|| panic!("{field} is not a number in {value}"))
}

fn flag(value: &Value, field: &str) -> bool {
    value[field].as_bool().unwrap_or_else(|| panic!("{field} is not a bool in {value}"))
}

fn rules(params: &Value) -> Rules {
    let count = |field: &str| f(params, field) as u32;
    Rules {
        clean_readings: count("NCL"),
        release_readings: count("NREL"),
        standing_mps: f(params, "VSTOP"),
        min_bearing_rad: f(params, "TMIN"),
        aligned_rad: f(params, "TAL"),
        passing_m: f(params, "DPASS"),
        relook_timeout_s: f(params, "TWAIT"),
        off_path_m: f(params, "LATJ"),
        on_path_m: f(params, "LATOK"),
        on_heading_rad: f(params, "HDOK"),
        search_looks: count("NSEARCH"),
        ..Rules::default()
    }
}

fn look(value: &Value) -> Option<VisionResult> {
    (!value.is_null()).then(|| VisionResult {
        image_s: f(value, "t_img"),
        valid: flag(value, "valid"),
        clear: flag(value, "clear"),
        bearing: value["bearing"].as_f64(),
    })
}

#[test]
fn halt_fsm() {
    let file = perspective("halt_fsm");
    let (rules, gate_m) = (rules(&file["params"]), f(&file["params"], "GATE"));
    let cases = file["cases"].as_array().expect("cases");
    let mut steps = 0;
    for case in cases {
        let id = case["id"].as_str().unwrap_or("?");
        let ticks = case["input"]["ticks"].as_array().expect("ticks");
        let outputs = case["expect"]["outputs"].as_array().expect("outputs");
        assert_eq!(ticks.len(), outputs.len(), "{id}");
        let mut machine = Machine::new(&rules);
        for (tick, expected) in ticks.iter().zip(outputs) {
            let sonar = tick["sonar"].as_array().expect("sonar");
            let is_echo = |range: &Value| range.as_f64().is_some_and(|range_m| range_m < gate_m);
            let (next, order) = machine.step(
                &Tick {
                    now_s: f(tick, "t"),
                    echo: sonar.is_empty() || sonar.iter().any(is_echo),
                    beside: false,
                    speed_mps: f(tick, "speed"),
                    heading: f(tick, "heading"),
                    lateral_m: f(tick, "lateral"),
                    path_heading_error: f(tick, "path_heading_error"),
                    progress_m: f(tick, "progress"),
                    pose_ok: flag(tick, "pose_ok"),
                    vision: look(&tick["vision"]),
                },
                &rules,
            );
            machine = next;
            let at = format!("{id} at {} s", tick["t"]);
            assert_eq!(Some(order.state.as_str()), expected["state"].as_str(), "{at}");
            assert_eq!(order.v_zero, flag(expected, "v_zero"), "{at}");
            match (order.target_heading, expected["target_heading"].as_f64()) {
                (Some(target), Some(expected)) => {
                    assert!((target - expected).abs() < 1e-9, "{at}: {target}");
                }
                (target, expected) => assert_eq!(target, expected, "{at}"),
            }
            steps += 1;
        }
    }
    assert!(steps > 0, "no step was run");
}

fn list<'a>(value: &'a Value, field: &str) -> &'a Vec<Value> {
    value[field].as_array().unwrap_or_else(|| panic!("{field} is not a list in {value}"))
}

fn numbers(value: &Value, field: &str) -> Vec<f64> {
    list(value, field).iter().map(|x| x.as_f64().expect("a number")).collect()
}

fn close(got: f64, expected: f64, at: &str) {
    assert!((got - expected).abs() < 1e-9, "{at}: {got}, not {expected}");
}

#[test]
fn threshold_learning() {
    let file = perspective("threshold_learning");
    let mut ran = 0;
    for case in list(&file, "cases") {
        let id = case["id"].as_str().unwrap_or("?");
        let (input, expect) = (&case["input"], &case["expect"]);
        let [width, height, tolerance_px] =
            ["width", "height", "tolerance_px"].map(|field| f(input, field) as usize);
        let rows = list(input, "gradient");
        let gradient: Vec<u8> = rows
            .iter()
            .flat_map(|row| row.as_array().expect("a row"))
            .map(|g| g.as_f64().expect("a level").round() as u8)
            .collect();
        let mut model = BitImage::new(width, height);
        for column in list(input, "model_mask_columns") {
            for v in f(column, "v0") as usize..f(column, "v1") as usize {
                model.set(f(column, "u") as usize, v);
            }
        }
        let thresholds: Vec<u8> = numbers(input, "thresholds").iter().map(|&t| t as u8).collect();
        let image = ImageView::new(&gradient, width, height, width).expect("a gradient");
        let rows = sweep(image, &model, &thresholds, tolerance_px, &Regions::new(width, 5));
        for (row, expected) in rows.iter().zip(list(expect, "rows")) {
            assert_eq!(f64::from(row.threshold), f(expected, "T"), "{id}");
            let counts: Vec<f64> = row.differing.iter().map(|&n| f64::from(n)).collect();
            assert_eq!(counts, numbers(expected, "N"), "{id} at {}", row.threshold);
            assert_eq!(f64::from(row.max_count()), f(expected, "Nm"), "{id} at {}", row.threshold);
        }
        assert_eq!(rows.len(), list(expect, "rows").len(), "{id}");
        let learned = learn(&rows).expect("rows");
        assert_eq!(f64::from(learned.t0), f(expect, "T0"), "{id}");
        assert_eq!(f64::from(learned.n0), f(expect, "N0"), "{id}");
        assert_eq!(f64::from(learned.n0_extra), f(expect, "N0_extra"), "{id}");
        let at_t0 = rows.iter().find(|row| row.threshold == learned.t0).expect("the row of T0");
        let extra: Vec<f64> = at_t0.extra.iter().map(|&n| f64::from(n)).collect();
        assert_eq!(extra, numbers(expect, "N_extra_at_T0"), "{id}");
        assert_eq!(f64::from(model.count()), f(expect, "model_pixels"), "{id}");
        match (learned.recall, expect["recall_at_T0"].as_f64()) {
            (Some(recall), Some(expected)) => close(recall, expected, id),
            (recall, expected) => assert_eq!(recall, expected, "{id}"),
        }
        let reason = match learned.validity {
            Validity::Valid => "ok",
            Validity::LowRecall => "low_recall",
            Validity::NoModel => "no_model",
        };
        assert_eq!(Some(reason), expect["reason"].as_str(), "{id}");
        assert_eq!(learned.validity == Validity::Valid, flag(expect, "valid"), "{id}");
        ran += 1;
    }
    assert!(ran > 0, "no case was run");
}

#[test]
fn obstacle_regions() {
    let file = perspective("obstacle_regions");
    let mut ran = 0;
    for case in list(&file, "cases") {
        let id = case["id"].as_str().unwrap_or("?");
        let (input, expect) = (&case["input"], &case["expect"]);
        let table = list(input, "table");
        let pose = numbers(input, "pose");
        let places = table.iter().map(|e| Pose2::new(f(e, "x"), f(e, "y"), f(e, "theta")));
        let entry = nearest(places, &Pose2::new(pose[0], pose[1], pose[2]));
        ran += 1;
        if expect["status"] == "no_entry" {
            assert_eq!(entry, None, "{id}");
            continue;
        }
        let entry = entry.unwrap_or_else(|| panic!("{id}: no entry"));
        assert_eq!(entry as f64, f(expect, "entry"), "{id}");
        let (t0, n0) = (f(&table[entry], "T0"), f(&table[entry], "N0"));
        assert_eq!((t0, n0), (f(expect, "T0"), f(expect, "N0")), "{id}");
        let sensitivity = Sensitivity { epsilon: f(input, "epsilon"), min_limit: f(input, "floor") };
        close(sensitivity.limit(n0), f(expect, "threshold"), id);
        for (count, obstacle) in list(input, "counts").iter().zip(list(expect, "obstacle")) {
            let count = count.as_u64().expect("a count") as u32;
            assert_eq!(Some(sensitivity.is_obstacle(count, n0)), obstacle.as_bool(), "{id}: {count}");
        }
    }
    assert!(ran > 0, "no case was run");
}

#[test]
fn safe_passage() {
    let file = perspective("safe_passage");
    let mut passage = SafePassage::default();
    let mut ran = 0;
    for case in list(&file, "cases") {
        let id = case["id"].as_str().unwrap_or("?");
        let (input, expect) = (&case["input"], &case["expect"]);
        assert_eq!(f(input, "assumed_distance"), PLANE_M, "{id}");
        let (half_view, half_width) = ((0.5 * f(input, "fov")).tan(), f(input, "half_width"));
        passage.begin(Interval::new(-half_view, half_view).widened(-half_width));
        let obstacles = list(input, "obstacle");
        for (i, _) in obstacles.iter().enumerate().filter(|(_, is_one)| **is_one == true) {
            passage.block(region_on_plane(i, obstacles.len(), half_view).widened(half_width));
        }
        let expected = list(expect, "free");
        assert_eq!(passage.free().len(), expected.len(), "{id}: {:?}", passage.free());
        for (gap, expected) in passage.free().iter().zip(expected) {
            close(gap.low, expected[0].as_f64().expect("low"), id);
            close(gap.high, expected[1].as_f64().expect("high"), id);
        }
        let aim = passage.choose(f(input, "goal_bearing").tan(), f(input, "margin"));
        assert_eq!(aim.is_some(), expect["status"] == "ok", "{id}");
        if let Some(aim) = aim {
            let chosen = numbers(expect, "chosen");
            close(aim.gap.low, chosen[0], id);
            close(aim.gap.high, chosen[1], id);
            close(aim.lateral_m, f(expect, "aim_lateral"), id);
            close(aim.bearing(), f(expect, "aim_bearing"), id);
            assert_eq!(aim.deviates, flag(expect, "deviates"), "{id}");
        }
        ran += 1;
    }
    assert!(ran > 0, "no case was run");
}
