//! Parameters as a Rust type.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;

use crate::ParameterError;

/// Returns the JSON Schema of the parameters `P`.
#[must_use]
pub fn schema_of<P: JsonSchema>() -> Json {
    schemars::schema_for!(P).to_value()
}

/// Converts a table to parameters.
///
/// # Errors
/// The table does not fit the type; a table that passed the schema check does.
pub fn read<P: DeserializeOwned>(table: &toml::Table) -> Result<P, ParameterError> {
    table.clone().try_into().map_err(|error: toml::de::Error| ParameterError::new("", error.message()))
}
