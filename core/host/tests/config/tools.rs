//! Descriptions, schemas and graphs of plugins and tasks.

use std::path::Path;

use yamabico_host::config::{describe, graph, list, schema, schema_with_programs};

use super::fakes::{check, plugins};

#[test]
fn a_plugin_is_described_with_units_ranges_and_defaults() {
    insta::assert_snapshot!(
        serde_json::to_string_pretty(&describe("wall-follower", &plugins()).unwrap()).unwrap()
    );
    insta::assert_snapshot!(
        serde_json::to_string_pretty(&describe("sim/camera", &plugins()).unwrap()).unwrap()
    );
    assert_eq!(describe("localizer", &plugins()).unwrap().parameters.len(), 8);
    let error = describe("wall-folower", &plugins()).unwrap_err();
    assert_eq!(error, "unknown name `wall-folower`; did you mean `wall-follower`?");
    let error = describe("foo", &plugins()).unwrap_err();
    assert!(error.starts_with("unknown name `foo`; available: `arbiter`, "), "{error}");
    let axes = |name: &str| describe(name, &plugins()).unwrap().axes.unwrap();
    assert_eq!(axes("sonar-halt"), "none; it only halts or limits the motion of others");
    assert_eq!(axes("wall-follower"), "linear+angular");
}

#[test]
fn everything_that_is_listed_can_be_described() {
    let listing = list(&plugins());
    assert_eq!(listing.behaviors.len(), 4);
    assert_eq!(listing.devices.len(), 7);
    for listed in listing.behaviors.iter().chain(&listing.devices) {
        let description = describe(&listed.name, &plugins()).unwrap();
        assert_eq!((description.what, &description.summary), (listed.what, &listed.summary));
    }
}

#[test]
fn every_reference_of_the_schema_resolves() {
    let schema = schema(&plugins());
    assert_references_resolve(&schema["task"]);
    assert_references_resolve(&schema["robot"]);
    insta::assert_snapshot!(
        serde_json::to_string_pretty(&schema["task"]["properties"]["behaviors"]).unwrap()
    );
}

fn assert_references_resolve(schema: &serde_json::Value) {
    let mut references = Vec::new();
    collect(schema, &mut references);
    assert!(references.len() > 5, "{}: {references:?}", schema["title"]);
    for reference in references {
        assert!(
            schema.pointer(reference.trim_start_matches('#')).is_some(),
            "{}: {reference}",
            schema["title"]
        );
    }
}

fn collect(json: &serde_json::Value, found: &mut Vec<String>) {
    match json {
        serde_json::Value::Object(object) => {
            for (key, value) in object {
                match value.as_str() {
                    Some(target) if key == "$ref" => found.push(target.to_owned()),
                    _ => collect(value, found),
                }
            }
        }
        serde_json::Value::Array(values) => values.iter().for_each(|value| collect(value, found)),
        _ => {}
    }
}

#[test]
fn the_schema_of_robots_has_the_keys_of_an_external_driver() {
    let with = |path: &str| schema_with_programs(None, Some(Path::new(path)), &plugins());
    let schema = with("tests/valid/external_robot.toml").unwrap();
    for kind in ["robot", "robot_part"] {
        let schema = &schema[kind];
        assert_references_resolve(schema);
        let mast = &schema["properties"]["devices"]["properties"]["mast"];
        assert_eq!(mast["unevaluatedProperties"], false, "{mast}");
        let own = |name: &str| &schema["$defs"][name]["properties"];
        assert_eq!(own("program.mast")["port"]["type"], "string");
        assert_eq!(own("program.mast.sensor.lidar")["beams"]["minimum"], 1);
        assert_eq!(own("program.mast.drive.tracks")["gear"]["type"], "integer");
    }
    insta::assert_snapshot!(serde_json::to_string_pretty(&schema["robot"]["$defs"]["sensor.any"]).unwrap());
    let task = with("tests/valid/hallway.toml").unwrap_err();
    assert!(task.contains("this is a task file, not a robot file"), "{task}");
    let missing = with("tests/valid/missing.toml").unwrap_err();
    assert!(missing.contains("file tests/valid/missing.toml does not exist"), "{missing}");
}

#[test]
fn the_graph_shows_sensors_priorities_and_wires() {
    let graph = graph(&check("tests/valid/hallway.toml").unwrap());
    insta::assert_snapshot!(graph.mermaid());
    insta::assert_snapshot!(graph.dot());
}
