//! Known answers of azimuths: the profile, its matching, triangulation, the map and the way around obstacles.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod vectors {
    use serde_json::Value;
    use std::path::PathBuf;
    use yamabico_core::geometry::wrap_angle;
    use yamabico_core::vision::azimuth_profile::{AzimuthProfile, EdgePoint, EdgeSign, ProfileRule};

    fn read(name: &str) -> Value {
        let folder = std::env::var_os("YAMABICO_VECTORS").map_or_else(
            || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/vectors")),
            PathBuf::from,
        );
        let path = folder.join("omni").join(name).with_extension("json");
        let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        serde_json::from_str(&text).unwrap()
    }

    fn for_each_case(name: &str, mut check: impl FnMut(&Value, &str)) {
        let file = read(name);
        let cases = file["cases"].as_array().unwrap();
        assert!(!cases.is_empty(), "{name} has no case");
        for case in cases {
            check(case, case["id"].as_str().unwrap());
        }
    }

    fn number(value: &Value) -> f64 {
        value.as_f64().unwrap_or_else(|| panic!("a number, not {value}"))
    }

    fn list(value: &Value) -> &[Value] {
        value.as_array().unwrap_or_else(|| panic!("a list, not {value}"))
    }

    fn sign(value: &Value) -> EdgeSign {
        if number(value) > 0.0 { EdgeSign::Brighter } else { EdgeSign::Darker }
    }

    /// Fails where `actual` is farther from `expected` than the tolerance, relative to numbers above 1.
    fn close(actual: f64, expected: &Value, tolerance: f64, what: &str) {
        let expected = number(expected);
        let error = (actual - expected).abs();
        assert!(error <= tolerance * (1.0 + expected.abs()), "{what}: {actual}, not {expected}");
    }

    #[test]
    fn copis_azimuth() {
        for_each_case("copis_azimuth", |case, id| {
            let rule = ProfileRule { least_length_px: 8.0, ..ProfileRule::default() };
            let mut profile = AzimuthProfile::new(rule);
            for pixel in list(&case["pixels"]) {
                let weight = number(&pixel[2]);
                profile.add(&EdgePoint {
                    azimuth_rad: number(&pixel[0]),
                    sign: sign(&pixel[1]),
                    length_px: weight,
                    weight,
                });
            }
            let edges = profile.find();
            let expected = list(&case["segments"]);
            assert_eq!(edges.len(), expected.len(), "{id}");
            for (edge, expected) in edges.iter().zip(expected) {
                let error = wrap_angle(edge.azimuth_rad - number(&expected["azimuth"]));
                assert!(error.abs() < 1e-9, "{id}: off by {error}");
                close(edge.weight, &expected["weight"], 1e-9, id);
                close(edge.length_px, &expected["weight"], 1e-9, id);
                assert_eq!(edge.sign, sign(&expected["sign"]), "{id}");
                assert_eq!(edge.bins as u64, expected["bins"].as_u64().unwrap(), "{id}");
            }
        });
    }
}
