//! Known answers of the wire-frame localization.

use nalgebra::{Matrix2, Matrix3, Point3, Vector2, Vector3};
use serde_json::Value;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::time::Time;
use yamabico_map_localizer::belief::{Belief, Update, gate_distance};
use yamabico_map_localizer::history::{CAPACITY, History, HistoryError};
use yamabico_map_localizer::motion::{Increment, MotionNoise};
use yamabico_map_localizer::wire_frame::association::{Association, AssociationRule, Candidate};
use yamabico_map_localizer::wire_frame::projected_line::{LineCamera, vertical_edge_column};
use yamabico_testkit::vectors::perspective;
use yamabico_vision::map::Edge;

fn cases(file: &Value) -> impl Iterator<Item = (&Value, &Value, String)> {
    let cases = file["cases"].as_array().unwrap();
    assert!(!cases.is_empty());
    cases.iter().map(|case| (&case["input"], &case["expect"], case["id"].to_string()))
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| value[i].as_f64().unwrap_or_else(|| panic!("{N} numbers in {value}")))
}

fn pose(value: &Value) -> Pose2 {
    let [x, y, theta] = numbers(value);
    Pose2::new(x, y, theta)
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| value[i][j].as_f64().unwrap())
}

fn camera(input: &Value) -> (Intrinsics, Mount) {
    let of = |key: &str| input["camera"][key].as_f64().unwrap();
    let on = |key: &str| input["mount"][key].as_f64().unwrap();
    let intrinsics = Intrinsics {
        fx: of("fx"),
        fy: of("fy"),
        cx: of("cx"),
        cy: of("cy"),
        width: of("w") as u32,
        height: of("h") as u32,
    };
    let mount =
        Mount { x: on("x"), y: on("y"), z: on("z"), pan: on("pan"), tilt: on("tilt"), roll: on("roll") };
    (intrinsics, mount)
}

fn edge(model: &Value) -> Edge {
    Edge::between(Point3::from(numbers::<3>(&model[0])), Point3::from(numbers::<3>(&model[1])))
}

/// Asserts that `actual` is within the tolerance of `expected`, absolute below 1 and relative above.
fn close(actual: f64, expected: f64, tolerance: f64, what: &str) {
    let error = (actual - expected).abs();
    assert!(error <= tolerance * (1.0 + expected.abs()), "{what}: {actual}, not {expected}");
}

fn close_pose(actual: &Pose2, expected: &Pose2, tolerance: f64, what: &str) {
    close(actual.x, expected.x, tolerance, what);
    close(actual.y, expected.y, tolerance, what);
    close(angle_difference(actual.theta, expected.theta), 0.0, tolerance, what);
}

fn close_matrix(actual: &Matrix3<f64>, expected: &Value, tolerance: f64, what: &str) {
    let expected = matrix(expected);
    for (a, e) in actual.iter().zip(expected.iter()) {
        close(*a, *e, tolerance, what);
    }
}

#[test]
fn association() {
    let file = perspective("association");
    let of = |key: &str| file["params"][key].as_f64().unwrap();
    let rule = AssociationRule { gate: of("gate"), ambiguity: of("ambiguity") };
    let mut association = Association::default();
    for (input, expect, id) in cases(&file) {
        let mut candidates = Vec::new();
        for (i, row) in input["d2"].as_array().unwrap().iter().enumerate() {
            for (j, distance) in row.as_array().unwrap().iter().enumerate() {
                if let Some(distance_squared) = distance.as_f64() {
                    candidates.push(Candidate { edge: i, line: j, distance_squared });
                }
            }
        }
        let pairs = association.pair(&candidates, &rule);
        let pairs: Vec<[usize; 2]> = pairs.iter().map(|pair| [pair.edge, pair.line]).collect();
        assert_eq!(serde_json::json!(pairs), expect["pairs"], "{id}");
        let edges: Vec<usize> = association.ambiguous_edges(&rule).collect();
        let lines: Vec<usize> = association.ambiguous_lines(&rule).collect();
        assert_eq!(serde_json::json!(edges), expect["ambiguous_model"], "{id}");
        assert_eq!(serde_json::json!(lines), expect["ambiguous_detected"], "{id}");
    }
}

#[test]
fn ekf_line_update() {
    let file = perspective("ekf_line_update");
    for (input, expect, id) in cases(&file) {
        let (intrinsics, mount) = camera(input);
        let camera = LineCamera::new(&intrinsics, &mount);
        let mut belief = Belief { pose: pose(&input["prior"]), covariance: matrix(&input["P"]) };
        let sigma = input["sigma_endpoint"].as_f64().unwrap();
        let noise = Matrix2::identity() * sigma * sigma;
        let gate = input["gate_d2"].as_f64().unwrap();
        const TOLERANCE: f64 = 1e-8;
        let steps = expect["steps"].as_array().unwrap();
        for (line, step) in input["lines"].as_array().unwrap().iter().zip(steps) {
            let projected = camera.at(&belief.pose).project(&edge(&line["model"])).unwrap();
            let ends = [0, 1].map(|i| Vector2::from(numbers::<2>(&line["detected"][i])));
            let residual = projected.residual(ends);
            // The sign of a residual and its derivatives is free, jointly.
            let expected: [f64; 2] = numbers(&step["residual"]);
            let sign = if residual.distance_px[0] * expected[0] < 0.0 { -1.0 } else { 1.0 };
            for i in 0..2 {
                close(sign * residual.distance_px[i], expected[i], TOLERANCE, &id);
                for (k, expected) in numbers::<3>(&step["H"][i]).into_iter().enumerate() {
                    close(sign * residual.jacobian[(i, k)], expected, TOLERANCE, &id);
                }
            }
            let distance = gate_distance(&residual, &belief.covariance, &noise);
            close(distance, step["d2"].as_f64().unwrap(), TOLERANCE, &id);
            let update = belief.update(&residual, &noise, gate);
            let is_accepted = matches!(update, Update::Applied(_));
            assert_eq!(is_accepted, step["accepted"].as_bool().unwrap(), "{id}");
            if let Some(posterior) = step.get("posterior").filter(|posterior| posterior.is_array()) {
                close_pose(&belief.pose, &pose(posterior), TOLERANCE, &id);
            }
        }
        close_pose(&belief.pose, &pose(&expect["posterior"]), TOLERANCE, &id);
        close_matrix(&belief.covariance, &expect["P"], TOLERANCE, &id);
    }
}

#[test]
fn vertical_edge_jacobian() {
    let file = perspective("vertical_edge_jacobian");
    let tolerance = file["tolerance"].as_f64().unwrap();
    for (input, expect, id) in cases(&file) {
        let (intrinsics, mount) = camera(input);
        let position = Vector2::from(numbers::<2>(&input["edge_xy"]));
        let column = vertical_edge_column(position, &pose(&input["pose"]), &intrinsics, &mount);
        if expect["status"] != "ok" {
            assert!(column.is_none(), "{id}");
            continue;
        }
        let (u, jacobian) = column.unwrap();
        close(u, expect["u"].as_f64().unwrap(), tolerance, &id);
        for (k, expected) in numbers::<3>(&expect["H"]).into_iter().enumerate() {
            close(jacobian[k], expected, tolerance, &id);
        }
    }
}

#[test]
fn rho_alpha_jacobian() {
    let file = perspective("rho_alpha_jacobian");
    let tolerance = file["tolerance"].as_f64().unwrap();
    for (input, expect, id) in cases(&file) {
        let (intrinsics, mount) = camera(input);
        let view = LineCamera::new(&intrinsics, &mount).at(&pose(&input["pose"]));
        let line = view.project(&edge(&input["model"])).unwrap().hough();
        close(line.rho, expect["rho"].as_f64().unwrap(), tolerance, &id);
        close(angle_difference(line.alpha, expect["alpha"].as_f64().unwrap()), 0.0, tolerance, &id);
        let jacobians = [(line.rho_jacobian, &expect["H_rho"]), (line.alpha_jacobian, &expect["H_alpha"])];
        for (jacobian, expected) in jacobians {
            let expected = Vector3::from(numbers::<3>(expected));
            (0..3).for_each(|k| close(jacobian[k], expected[k], tolerance, &id));
        }
    }
}

#[test]
fn retroactive() {
    let file = perspective("retroactive");
    let tolerance = file["tolerance"].as_f64().unwrap();
    for (input, expect, id) in cases(&file) {
        let of = |key: &str| input["noise"][key].as_f64().unwrap();
        let noise = MotionNoise {
            distance_per_distance_m: of("k_ss"),
            turn_per_turn_rad: of("k_tt"),
            turn_per_distance: of("k_ts"),
            ..MotionNoise::default()
        };
        let capacity = input["buffer_steps"].as_u64().map_or(CAPACITY, |steps| steps as usize);
        let mut history = History::new(capacity, noise);
        let stamp = |index: usize| Time(1_000_000_000 + 10_000_000 * index as u64);
        history.start(stamp(0), Belief { pose: pose(&input["x0"]), covariance: matrix(&input["P0"]) });
        let increments = input["increments_ds_dtheta"].as_array().unwrap();
        for (i, increment) in increments.iter().enumerate() {
            let [forward_m, turn_rad] = numbers(increment);
            history.advance(stamp(i + 1), Increment { forward_m, turn_rad, slip_variance: 0.0 });
        }
        let newest = |history: &History| *history.newest().unwrap().1;
        close_pose(&newest(&history).pose, &pose(&expect["uncorrected"]), tolerance, &id);
        close_matrix(&newest(&history).covariance, &expect["uncorrected_P"], tolerance, &id);
        let results = expect["results"].as_array().unwrap();
        for (correction, result) in input["corrections"].as_array().unwrap().iter().zip(results) {
            let at = stamp(correction["index"].as_u64().unwrap() as usize);
            let posterior = Belief { pose: pose(&correction["pose"]), covariance: matrix(&correction["P"]) };
            let in_one_step = history.corrected_newest(at, &posterior);
            let status = match history.correct(at, posterior) {
                Ok(()) => "ok",
                Err(HistoryError::TooOld) => "too_old",
                Err(HistoryError::OutOfOrder) => "out_of_order",
                Err(error) => panic!("{id}: {error}"),
            };
            assert_eq!(result["status"], status, "{id}");
            if status == "ok" {
                close_pose(&newest(&history).pose, &pose(&result["pose"]), tolerance, &id);
                close_matrix(&newest(&history).covariance, &result["P"], tolerance, &id);
                let in_one_step = in_one_step.unwrap();
                close_pose(&in_one_step.pose, &pose(&result["pose"]), tolerance, &id);
                close_matrix(&in_one_step.covariance, &result["P"], tolerance, &id);
            }
        }
        close_pose(&newest(&history).pose, &pose(&expect["final"]), tolerance, &id);
        close_matrix(&newest(&history).covariance, &expect["final_P"], tolerance, &id);
    }
}
