//! Known answers of the algorithms: `tests/vectors`, or the folder that `YAMABICO_VECTORS` names.

use serde_json::Value;

/// Reads the known answers `perspective/NAME.json`.
///
/// # Panics
/// If the file is missing or is not JSON.
#[must_use]
pub fn perspective(name: &str) -> Value {
    read("perspective", name)
}

/// Reads the known answers `omni/NAME.json`.
///
/// # Panics
/// If the file is missing or is not JSON.
#[must_use]
pub fn omni(name: &str) -> Value {
    read("omni", name)
}

/// Reads the known answers `corridor/NAME.json`.
///
/// # Panics
/// If the file is missing or is not JSON.
#[must_use]
pub fn corridor(name: &str) -> Value {
    read("corridor", name)
}

/// Reads the known answers `evidence/NAME.json`.
///
/// # Panics
/// If the file is missing or is not JSON.
#[must_use]
pub fn evidence(name: &str) -> Value {
    read("evidence", name)
}

/// Returns the cases of a file of known answers.
///
/// # Panics
/// If there is none.
#[must_use]
pub fn cases(file: &Value) -> &[Value] {
    let cases = file["cases"].as_array().map_or(&[] as &[Value], Vec::as_slice);
    assert!(!cases.is_empty(), "the file has no cases");
    cases
}

fn read(group: &str, name: &str) -> Value {
    let folder = std::env::var("YAMABICO_VECTORS").unwrap_or_else(|_| "tests/vectors".into());
    let path = crate::workspace().join(folder).join(group).join(name).with_extension("json");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
