//! Known answers of the slip test.

use nalgebra::Matrix3;
use serde_json::Value;
use yamabico_core::geometry::Pose2;
use yamabico_map_localizer::belief::Belief;
use yamabico_map_localizer::motion::SlipNoise;
use yamabico_map_localizer::slip::{Angle, SlipGates};
use yamabico_testkit::vectors::{cases, evidence, number};

fn close(actual: f64, expected: &Value, tolerance: f64, what: &str) {
    let expected = number(expected);
    assert!(
        (actual - expected).abs() <= tolerance * (1.0 + expected.abs()),
        "{what}: {actual}, not {expected}"
    );
}

fn belief(motion: &Value, covariance: &Value) -> Belief {
    let [x, y, theta] = [0, 1, 2].map(|i| number(&motion[i]));
    Belief { pose: Pose2::new(x, y, theta), covariance: Matrix3::from_fn(|i, k| number(&covariance[i][k])) }
}

#[test]
fn slip_test() {
    let file = evidence("slip_test");
    let (of, tolerance) = (|key: &str| number(&file["params"][key]), number(&file["tolerance"]));
    let gates = SlipGates { yaw: of("gate_1dof"), motion: of("gate_3dof") };
    let braking = SlipNoise { from_mps2: of("brake_from"), gain: of("brake_gain") };
    let mut count = [0, 0];
    for case in cases(&file) {
        let (input, expect, id) = (&case["input"], &case["expect"], case["id"].to_string());
        let is_slip = expect["slip"].as_bool().unwrap();
        if input.get("motion_odometry").is_some() {
            let odometry = belief(&input["motion_odometry"], &input["covariance_odometry"]);
            let camera = belief(&input["motion_vision"], &input["covariance_vision"]);
            let test = gates.compare_motion(&odometry, &camera).unwrap();
            close(test.distance_squared, &expect["d2"], tolerance, &id);
            assert_eq!(test.has_slipped, is_slip, "{id}");
            let fused = belief(&expect["motion"], &expect["covariance"]);
            assert!(fused.pose.distance(&test.fused.pose) < tolerance, "{id}");
            assert!((fused.pose.theta - test.fused.pose.theta).abs() < tolerance, "{id}");
            assert!((fused.covariance - test.fused.covariance).abs().max() < tolerance, "{id}");
            count[1] += 1;
        } else {
            let variance = |key: &str| number(&input[key]).powi(2);
            let odometry = Angle {
                rad: number(&input["yaw_odometry"]),
                variance: variance("sigma_odometry") + braking.variance(number(&input["acceleration"])),
            };
            let camera = Angle { rad: number(&input["yaw_vision"]), variance: variance("sigma_vision") };
            close(odometry.variance, &expect["variance_odometry"], tolerance, &id);
            let test = gates.compare_yaw(&odometry, &camera);
            close(test.distance_squared, &expect["d2"], tolerance, &id);
            assert_eq!(test.has_slipped, is_slip, "{id}");
            close(test.fused.rad, &expect["yaw"], tolerance, &id);
            close(test.fused.variance, &expect["variance"], tolerance, &id);
            count[0] += 1;
        }
    }
    assert!(count.iter().all(|count| *count > 0), "cases of both forms: {count:?}");
}
