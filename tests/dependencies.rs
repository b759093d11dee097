//! Dependencies point one way: core <- {behaviors, sensors, arbiter} <- cli; no behavior depends on another part.

use std::collections::BTreeMap;
use std::process::Command;

use serde_json::Value;

/// Folders of the crates that each crate's library may depend on. All behaviors share one entry, and so do all sensors.
const LAYERS: [(&str, &[&str]); 16] = [
    ("core/parameters", &[]),
    ("core/geometry", &[]),
    ("core/mcap", &[]),
    ("core/drawing", &["core/geometry"]),
    ("core/vision", &["core/geometry", "core/parameters", "core/drawing"]),
    ("core", &["core/geometry", "core/parameters"]),
    ("core/host", &["core", "core/parameters"]),
    ("behaviors", &["core", "core/vision", "core/drawing"]),
    ("sensors", &["core", "core/vision", "core/mcap"]),
    // A program of its own, which decodes messages as recordings do.
    ("sensors/ros2", &["core", "core/host", "sensors"]),
    ("arbiter", &["core"]),
    ("arbiter/runtime", &["core", "core/parameters", "core/host", "core/mcap", "core/drawing", "arbiter"]),
    // It shows what the runtime's client and its recordings tell.
    ("arbiter/view", &["core", "core/host", "core/mcap", "arbiter", "arbiter/runtime"]),
    ("arbiter/learning", ANY_BUT_CLI),
    ("arbiter/cli", ANY_BUT_CLI),
    ("tests", ANY),
];
const ANY: &[&str] = &["*"];
const ANY_BUT_CLI: &[&str] = &["*", "!arbiter/cli"];

/// Returns the entry of [`LAYERS`] for a crate in `folder`.
fn layer(folder: &str) -> &'static str {
    let named = LAYERS.iter().map(|(name, _)| *name);
    let inside = |name: &&str| folder == *name || folder.starts_with(&format!("{name}/"));
    // The most specific entry counts: `core/vision` is not `core`.
    let found = named.filter(inside).max_by_key(|name| name.len());
    found.unwrap_or_else(|| panic!("{folder}: no entry in LAYERS"))
}

fn may_depend(from: &str, on: &str) -> bool {
    let (_, allowed) = LAYERS.iter().find(|(name, _)| *name == from).unwrap();
    let forbidden = format!("!{on}");
    (allowed.contains(&on) || allowed.contains(&"*")) && !allowed.contains(&forbidden.as_str())
}

#[test]
fn dependencies_point_one_way() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(root)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let folder = |package: &Value| {
        let manifest = std::path::Path::new(package["manifest_path"].as_str().unwrap());
        manifest.parent().unwrap().strip_prefix(root).unwrap().to_str().unwrap().to_owned()
    };
    let layers: BTreeMap<&str, &str> =
        packages.iter().map(|package| (package["name"].as_str().unwrap(), layer(&folder(package)))).collect();

    let mut count = 0;
    for package in packages {
        let name = package["name"].as_str().unwrap();
        for dependency in package["dependencies"].as_array().unwrap() {
            // Tests and benches may depend on the simulator; libraries may not.
            let shipped = dependency["kind"] != "dev";
            let on = dependency["name"].as_str().unwrap();
            let Some(&on_layer) = layers.get(on) else { continue };
            assert!(!shipped || may_depend(layers[name], on_layer), "{name} must not depend on {on}");
            count += 1;
        }
    }
    assert!(count > 20, "only {count} dependencies inside the workspace");
}

#[test]
fn only_the_bus_names_iceoryx2() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut files = 0;
    for folder in ["core", "behaviors", "sensors", "arbiter"] {
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

/// Files that start processes: programs that a task file names by `exec` (description and run), this program itself, and the
/// program whose output is a camera.
const STARTERS: [&str; 4] = [
    "arbiter/cli/src/commands/plugin.rs",
    "arbiter/runtime/src/supervisor/spawn.rs",
    "core/host/src/process/query.rs",
    "sensors/camera/src/program.rs",
];

#[test]
fn programs_are_started_in_four_places_only() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut starters = Vec::new();
    for folder in ["core", "behaviors", "sensors", "arbiter"] {
        visit(&root.join(folder), &mut |path, text| {
            let path = path.strip_prefix(root).unwrap().to_str().unwrap().to_owned();
            let is_source = path.contains("/src/") && !path.contains("/target/");
            // Unit tests follow their attribute, at the end of a file.
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

fn visit(folder: &std::path::Path, visitor: &mut dyn FnMut(&std::path::Path, &str)) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            visit(&path, visitor);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            visitor(&path, &std::fs::read_to_string(&path).unwrap());
        }
    }
}
