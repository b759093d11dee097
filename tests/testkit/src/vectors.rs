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

/// Calls `check` with each case of a file of known answers, and with its id.
///
/// # Panics
/// If there is no case, or a case without id.
pub fn for_each_case(file: &Value, mut check: impl FnMut(&Value, &str)) {
    for case in cases(file) {
        check(case, case["id"].as_str().unwrap_or_else(|| panic!("a case without id: {case}")));
    }
}

/// Returns the number `value`.
///
/// # Panics
/// If it is none.
#[must_use]
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("a number, not {value}"))
}

/// Returns the items of the list `value`.
///
/// # Panics
/// If it is none.
#[must_use]
pub fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap_or_else(|| panic!("a list, not {value}"))
}

/// Returns the FNV-1a hash (64 bits) of a mask, one byte a pixel, by which known answers name masks.
#[must_use]
pub fn hash_of_mask(pixels: impl IntoIterator<Item = bool>) -> String {
    let hash = pixels.into_iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, pixel| {
        (hash ^ u64::from(pixel)).wrapping_mul(0x0100_0000_01b3)
    });
    format!("{hash:016x}")
}

fn read(group: &str, name: &str) -> Value {
    let folder = std::env::var("YAMABICO_VECTORS").unwrap_or_else(|_| "tests/vectors".into());
    let path = crate::workspace().join(folder).join(group).join(name).with_extension("json");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
