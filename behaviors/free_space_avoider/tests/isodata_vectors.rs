//! Known answers of the iterative mean threshold: isodata.

use serde_json::Value;
use yamabico_free_space_avoider::navel_grid::isodata::{
    IsodataError, threshold_of_histogram, threshold_of_pixels,
};
use yamabico_testkit::vectors::{number, perspective};

fn integer(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("no integer: {value}"))
}

#[test]
fn isodata() {
    let file = perspective("isodata");
    let cases = file["cases"].as_array().expect("cases");
    assert!(!cases.is_empty(), "isodata has no cases");
    for case in cases {
        let (id, expect, tolerances) = (&case["id"], &case["expect"], &case["tol"]);
        let check = |field: &str, value: f64| {
            let expected = number(&expect[field]);
            let own = tolerances.as_f64().or_else(|| tolerances[field].as_f64());
            let limit = own.unwrap_or_else(|| number(&file["tolerance"])) * expected.abs().max(1.0);
            assert!((value - expected).abs() <= limit, "{id}: {field} is {value}, not {expected}");
        };
        let (mut histogram, mut pixels) = ([0; 256], Vec::new());
        for bin in case["input"]["histogram"].as_array().expect("bins") {
            let (value, count) = (integer(&bin["value"]) as u8, integer(&bin["count"]));
            histogram[usize::from(value)] += count;
            pixels.extend((0..count).map(|_| value));
        }
        for found in [threshold_of_histogram(&histogram), threshold_of_pixels(&pixels)] {
            match (expect["status"].as_str(), found) {
                (Some("ok"), Ok(found)) => {
                    check("threshold", found.level);
                    check("iterations", f64::from(found.rounds));
                    check("n_dark", found.dark.count as f64);
                    check("mu_dark", found.dark.mean());
                    check("mu_bright", found.bright.mean());
                }
                (Some("low_contrast"), Err(IsodataError::LowContrast { mean })) => check("mean", mean),
                (expected, found) => panic!("{id}: {expected:?}, not {found:?}"),
            }
        }
    }
}
