//! Dependencies point one way: core <- {behaviors, sensors, arbiter} <- cli, and no behavior knows another part.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::process::Command;

use serde_json::Value;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Layer {
    Core,
    Behavior,
    Sensor,
    Arbiter,
    Cli,
    Tests,
}

/// What each layer's library may name.
fn may_depend(from: Layer, on: Layer) -> bool {
    match from {
        Layer::Core => false,
        Layer::Behavior | Layer::Sensor | Layer::Arbiter => on == Layer::Core,
        Layer::Cli => on != Layer::Cli && on != Layer::Tests,
        Layer::Tests => on != Layer::Tests,
    }
}

fn layer(manifest: &str) -> Layer {
    let folders: Vec<_> = manifest.rsplit('/').skip(1).take(2).collect();
    match folders.as_slice() {
        ["core", _] => Layer::Core,
        [_, "behaviors"] => Layer::Behavior,
        [_, "sensors"] => Layer::Sensor,
        ["arbiter", _] => Layer::Arbiter,
        ["cli", "arbiter"] => Layer::Cli,
        ["tests", _] => Layer::Tests,
        other => panic!("{manifest}: no layer for {other:?}"),
    }
}

#[test]
fn dependencies_point_one_way() {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let layers: BTreeMap<&str, Layer> = packages
        .iter()
        .map(|package| (package["name"].as_str().unwrap(), layer(package["manifest_path"].as_str().unwrap())))
        .collect();

    let mut seen = 0;
    for package in packages {
        let name = package["name"].as_str().unwrap();
        for dependency in package["dependencies"].as_array().unwrap() {
            // Tests, examples and benches may bring in a simulator; what is shipped may not.
            let shipped = dependency["kind"] != "dev";
            let on = dependency["name"].as_str().unwrap();
            let Some(&on_layer) = layers.get(on) else { continue };
            assert!(!shipped || may_depend(layers[name], on_layer), "{name} must not depend on {on}");
            seen += 1;
        }
    }
    assert!(seen > 5, "only {seen} dependencies inside the workspace were seen");
}

#[test]
fn only_the_bus_names_iceoryx2() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut files = 0;
    for folder in ["core/src", "behaviors", "sensors", "arbiter"] {
        visit(&root.join(folder), &mut |path, text| {
            files += 1;
            let bus = path.components().any(|part| part.as_os_str() == "bus");
            let bench =
                path.components().any(|part| part.as_os_str() == "benches" || part.as_os_str() == "target");
            assert!(bus || bench || !text.contains("iceoryx2::"), "{} names iceoryx2", path.display());
        });
    }
    assert!(files > 20, "only {files} files were read");
}

/// Where programs are started: the one that a table names by `exec`, asked what it is and run, and this very one.
const STARTERS: [&str; 3] =
    ["core/src/config/exec.rs", "arbiter/src/supervisor/spawn.rs", "arbiter/cli/src/commands/plugin.rs"];

#[test]
fn programs_are_started_in_three_places_only() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut starters = Vec::new();
    for folder in ["core/src", "behaviors", "sensors", "arbiter"] {
        visit(&root.join(folder), &mut |path, text| {
            let path = path.strip_prefix(root).unwrap().to_str().unwrap().to_owned();
            let is_source = path.contains("/src/") && !path.contains("/target/");
            // What tests do is behind their attribute, at the end of a file.
            let shipped = text.split("#[cfg(test)]").next().unwrap();
            let words = [
                "process::Command",
                "process::{Child, Command",
                "Command::new(",
                "libc::exec",
                "libc::fork",
                "libc::system",
            ];
            if is_source && words.iter().any(|word| shipped.contains(word)) {
                starters.push(path);
            }
        });
    }
    starters.sort();
    let mut expected = STARTERS.map(str::to_owned);
    expected.sort();
    assert_eq!(starters, expected);
}

fn visit(folder: &std::path::Path, see: &mut dyn FnMut(&std::path::Path, &str)) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            visit(&path, see);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            see(&path, &std::fs::read_to_string(&path).unwrap());
        }
    }
}
