//! Known answers of the state machine.

mod vectors {
    use serde_json::Value;
    use yamabico_stationary_obstacle_avoider::halt_state_machine::{Look, Machine, Rules, Tick};

    fn load(name: &str) -> Value {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let folder = std::env::var("YAMABICO_VECTORS").unwrap_or_else(|_| "tests/vectors".into());
        let path = std::path::Path::new(root).join(folder).join("perspective").join(format!("{name}.json"));
        let text =
            std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    fn f(value: &Value, field: &str) -> f64 {
        value[field].as_f64().unwrap_or_else(|| panic!("{field} is no number in {value}"))
    }

    fn flag(value: &Value, field: &str) -> bool {
        value[field].as_bool().unwrap_or_else(|| panic!("{field} is no flag in {value}"))
    }

    fn rules(params: &Value) -> Rules {
        let count = |field: &str| f(params, field) as u32;
        Rules {
            gate_m: f(params, "GATE"),
            clean_readings: count("NCL"),
            release_readings: count("NREL"),
            standing_mps: f(params, "VSTOP"),
            smallest_bearing_rad: f(params, "TMIN"),
            aligned_rad: f(params, "TAL"),
            passing_m: f(params, "DPASS"),
            patience_s: f(params, "TWAIT"),
            off_path_m: f(params, "LATJ"),
            on_path_m: f(params, "LATOK"),
            on_heading_rad: f(params, "HDOK"),
            search_looks: count("NSEARCH"),
            ..Rules::default()
        }
    }

    fn look(value: &Value) -> Option<Look> {
        (!value.is_null()).then(|| Look {
            image_s: f(value, "t_img"),
            valid: flag(value, "valid"),
            clear: flag(value, "clear"),
            bearing: value["bearing"].as_f64(),
        })
    }

    #[test]
    fn halt_fsm() {
        let file = load("halt_fsm");
        let rules = rules(&file["params"]);
        let cases = file["cases"].as_array().expect("cases");
        let mut steps = 0;
        for case in cases {
            let id = case["id"].as_str().unwrap_or("?");
            let ticks = case["input"]["ticks"].as_array().expect("ticks");
            let outputs = case["expect"]["outputs"].as_array().expect("outputs");
            assert_eq!(ticks.len(), outputs.len(), "{id}");
            let mut machine = Machine::new(&rules);
            for (tick, expected) in ticks.iter().zip(outputs) {
                let sonar: Vec<Option<f64>> =
                    tick["sonar"].as_array().expect("sonar").iter().map(Value::as_f64).collect();
                let (next, order) = machine.step(
                    &Tick {
                        now_s: f(tick, "t"),
                        sonar_m: &sonar,
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
}
