//! Shared by tests, benches and evaluations: known answers, configurations, recorded data sets, and inputs that are wrong.
//!
//! Depends on no crate of the workspace, so that every crate can use it in its tests.

pub mod data;
pub mod fuzz;
pub mod vectors;

use std::path::{Path, PathBuf};

/// Returns the root folder of the workspace.
#[must_use]
pub fn workspace() -> &'static Path {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.ancestors().nth(2).unwrap_or(manifest)
}

/// Returns the folder `configs` of the workspace.
#[must_use]
pub fn configs() -> PathBuf {
    workspace().join("configs")
}

/// Returns the path of a file below `configs`, such as `worlds/hallway.toml`.
#[must_use]
pub fn config(name: &str) -> PathBuf {
    configs().join(name)
}

/// Reads a file below `configs` as text.
///
/// # Panics
/// If the file cannot be read.
#[must_use]
pub fn config_text(name: &str) -> String {
    let path = config(name);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
