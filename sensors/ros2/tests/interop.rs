//! Live runs against rclpy with Fast DDS, and against nodes with the wire of rmw_zenoh, each in a network namespace of its own.
//!
//! Needs a Python with `ros-jazzy-rclpy`, named by `YAMABICO_RCLPY`, for Zenoh also with `eclipse-zenoh` and `xxhash`, and the program
//! `yamabico` beside `yamabico-ros2`; skips without.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Runs a scenario of `python/scenarios.py` over `middleware` in the domain `domain`; `None` if something that it needs is missing.
fn scenario(name: &str, middleware: &str, domain: u16) -> Option<Value> {
    let skip = |what: &str| {
        println!("skipped {name} over {middleware}: {what}");
        None
    };
    let Some(python) = std::env::var_os("YAMABICO_RCLPY") else {
        return skip("YAMABICO_RCLPY names no Python with rclpy");
    };
    if middleware == "zenoh" {
        let imported = Command::new(&python).args(["-c", "import xxhash, zenoh"]).output();
        if !imported.is_ok_and(|output| output.status.success()) {
            return skip("the packages eclipse-zenoh and xxhash are not installed there");
        }
    }
    let yamabico = Path::new(env!("CARGO_BIN_EXE_yamabico-ros2")).with_file_name("yamabico");
    if !yamabico.is_file() {
        return skip("the program yamabico is not built");
    }
    let network =
        "ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo && exec \"$@\"";
    let is_allowed = Command::new("unshare").args(["-rn", "sh", "-c", network, "sh", "true"]).status();
    if !is_allowed.is_ok_and(|status| status.success()) {
        return skip("network namespaces are not allowed here");
    }
    let folder =
        PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("ros2-{middleware}-{name}-{domain}"));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/scenarios.py");
    let output = Command::new("unshare")
        .args(["-rn", "sh", "-c", network, "sh"])
        .arg(python)
        .args([script.as_path(), Path::new(name), &yamabico, &folder])
        .env("ROS_DOMAIN_ID", domain.to_string())
        .env("MIDDLEWARE", middleware)
        .output()
        .unwrap();
    let (printed, errors) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let log = std::fs::read_to_string(folder.join("log")).unwrap_or_default();
    assert!(output.status.success(), "{name}: {printed}\n{errors}\n{log}");
    let result = printed.lines().last().unwrap_or_default();
    println!("{name} over {middleware} in domain {domain}: {result}");
    Some(serde_json::from_str(result).unwrap())
}

/// The scenarios that must pass over either middleware.
macro_rules! over {
    ($($middleware:ident $feature:literal),*) => {
        $(#[cfg(feature = $feature)]
        mod $middleware {
            use super::scenario;

            #[test]
            fn a_robot_on_topics_drives_and_ends_with_zero() {
                if let Some(result) = scenario("robot", $feature, 0) {
                    assert!(result["commands"].as_u64() > Some(50), "{result}");
                }
            }

            #[test]
            fn the_drive_follows_the_type_of_the_base() {
                scenario("stamped", $feature, 42);
            }

            #[test]
            fn another_domain_is_told() {
                scenario("domains", $feature, 42);
            }

            #[test]
            fn velocities_and_a_lock_are_arbitrated_when_their_publishers_die() {
                if let Some(result) = scenario("mux", $feature, 0) {
                    assert!(result["longest_gap_s"].as_f64() < Some(0.5), "{result}");
                }
            }

            #[test]
            fn either_side_may_be_killed_and_come_back() {
                if let Some(result) = scenario("restarts", $feature, 0) {
                    assert!(result["base"]["max_s"].as_f64() < Some(15.0), "{result}");
                }
            }

            #[test]
            fn every_kind_of_measurement_arrives_with_its_values() {
                if let Some(result) = scenario("sensors", $feature, 0) {
                    assert!(result["arrived_hz"]["color"].as_f64() > Some(5.0), "{result}");
                }
            }

            #[test]
            fn simulated_time_gives_the_age_of_measurements() {
                if let Some(result) = scenario("clock", $feature, 42) {
                    assert!(result["age_s"].as_f64() > Some(0.28), "{result}");
                }
            }

            #[test]
            fn observers_get_odometry_pose_path_and_decisions() {
                if let Some(result) = scenario("observer", $feature, 42) {
                    assert!(result["corners_of_the_path"].as_u64() > Some(1), "{result}");
                }
            }
        })*
    };
}

over!(over_dds "dds", over_zenoh "zenoh");

#[cfg(feature = "dds")]
#[test]
fn mismatches_of_qos_are_told_with_the_topic() {
    if let Some(result) = scenario("qos", "dds", 43) {
        assert_eq!(result["logged"].as_array().map(Vec::len), Some(2), "{result}");
    }
}

#[cfg(feature = "zenoh")]
#[test]
fn other_types_and_definitions_are_told_by_name() {
    scenario("types", "zenoh", 42);
}

#[cfg(feature = "zenoh")]
#[test]
fn a_missing_and_a_lost_router_are_told_and_the_robot_drives_on() {
    if let Some(result) = scenario("router", "zenoh", 0) {
        assert!(result["without_router"]["gap_s"].as_f64() < Some(1.0), "{result}");
    }
}

#[cfg(feature = "zenoh")]
#[test]
fn a_client_drives_through_its_router_and_needs_one() {
    scenario("client", "zenoh", 0);
}
