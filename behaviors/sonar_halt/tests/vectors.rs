//! Known answers of the swept-path gate and of the time to contact.

use serde_json::Value;
use yamabico_core::message::{Beam, Twist};
use yamabico_sonar_halt::swept_gate::StoppingDistance;
use yamabico_sonar_halt::swept_path::SweptPath;
use yamabico_sonar_halt::time_to_contact::{RangeFit, time_to_contact_from_size_s};
use yamabico_testkit::vectors::{cases, evidence, number};

/// Asserts that `actual` is within the tolerance of `expected`, absolute below 1 and relative above; null is none.
fn close(actual: Option<f64>, expected: &Value, tolerance: f64, what: &str) {
    let is_close = match (actual, expected.as_f64()) {
        (Some(actual), Some(expected)) => (actual - expected).abs() <= tolerance * expected.abs().max(1.0),
        (actual, expected) => actual.is_none() && expected.is_none(),
    };
    assert!(is_close, "{what}: {actual:?}, not {expected}");
}

#[test]
fn swept_gate() {
    let file = evidence("swept_gate");
    let tolerance = number(&file["tolerance"]);
    let params = &file["params"];
    let stopping = StoppingDistance {
        reaction_s: number(&params["latency"]),
        deceleration_mps2: number(&params["deceleration"]),
        reserve_m: number(&params["stop_margin"]),
    };
    for case in cases(&file) {
        let (input, expect, id) = (&case["input"], &case["expect"], case["id"].to_string());
        let (azimuth_rad, ring_m) = (number(&input["azimuth"]), number(&input["ring_radius"]));
        let beam = Beam {
            azimuth_rad,
            cone_rad: number(&input["cone"]),
            x_m: ring_m * azimuth_rad.cos(),
            y_m: ring_m * azimuth_rad.sin(),
            ..Beam::default()
        };
        let speed_mps = number(&input["v"]);
        let twist = Twist::planar(speed_mps, number(&input["omega"]));
        let path = SweptPath::new(&twist, number(&params["robot_radius"]) + number(&params["margin"]));
        let contact_m = path.contact_with_echo_m(&beam, number(&input["range"]), number(&params["step"]));
        let stopping_m = stopping.from_speed_m(path.speed_mps());
        close(Some(stopping_m), &expect["stop_distance"], tolerance, &id);
        close(contact_m, &expect["path_length_to_contact"], tolerance, &id);
        let time_s = contact_m.filter(|_| speed_mps != 0.0).map(|contact_m| contact_m / speed_mps.abs());
        close(time_s, &expect["time_to_contact"], tolerance, &id);
        let halts = contact_m.is_some_and(|contact_m| contact_m <= stopping_m);
        assert_eq!(Some(halts), expect["halt"].as_bool(), "{id}");
    }
}

#[test]
fn time_to_contact() {
    let file = evidence("time_to_contact");
    let tolerance = number(&file["tolerance"]);
    for case in cases(&file) {
        let (input, expect, id) = (&case["input"], &case["expect"], case["id"].to_string());
        if input.get("size_current").is_some() {
            let of = |key: &str| number(&input[key]);
            let time_s = time_to_contact_from_size_s(of("size_previous"), of("size_current"), of("dt"));
            close(time_s, &expect["time_to_contact"], tolerance, &id);
            continue;
        }
        let list = |key: &str| input[key].as_array().unwrap().iter().map(number);
        let readings: Vec<(f64, f64)> = list("times").zip(list("ranges")).collect();
        let fit = RangeFit::new(readings.into_iter(), number(&input["max_range"]));
        assert_eq!(expect["status"].as_str(), Some(if fit.is_some() { "ok" } else { "too_few" }), "{id}");
        close(fit.map(|fit| fit.range_m), &expect["range"], tolerance, &id);
        close(fit.map(|fit| fit.closing_mps), &expect["closing_speed"], tolerance, &id);
        let time_s = fit.and_then(|fit| fit.time_to_contact_s());
        close(time_s, &expect["time_to_contact"], tolerance, &id);
    }
}
