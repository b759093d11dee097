//! Descriptions, schemas and graphs of plugins and tasks.

use yamabico_host::config::{describe, graph, list, schema};

use super::fakes::{check, plugins};

#[test]
fn a_plugin_is_described_with_units_ranges_and_defaults() {
    insta::assert_snapshot!(
        serde_json::to_string_pretty(&describe("wall-follower", &plugins()).unwrap()).unwrap()
    );
    insta::assert_snapshot!(
        serde_json::to_string_pretty(&describe("sim/camera", &plugins()).unwrap()).unwrap()
    );
    assert_eq!(describe("localizer", &plugins()).unwrap().parameters.len(), 7);
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
    for file in ["task", "robot"] {
        let whole = &schema[file];
        let mut references = Vec::new();
        collect(whole, &mut references);
        assert!(references.len() > 5, "{file}: {references:?}");
        for reference in references {
            assert!(whole.pointer(reference.trim_start_matches('#')).is_some(), "{file}: {reference}");
        }
    }
    insta::assert_snapshot!(
        serde_json::to_string_pretty(&schema["task"]["properties"]["behaviors"]).unwrap()
    );
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
fn the_graph_shows_sensors_priorities_and_wires() {
    let graph = graph(&check("tests/valid/hallway.toml").unwrap());
    insta::assert_snapshot!(graph.mermaid());
    insta::assert_snapshot!(graph.dot());
}
