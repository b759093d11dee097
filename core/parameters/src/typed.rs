//! Parameters as a Rust type: their schema, and a value from a checked table.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;

use crate::BuildError;

/// The JSON Schema of the parameters `P`.
#[must_use]
pub fn schema_of<P: JsonSchema>() -> Json {
    schemars::schema_for!(P).to_value()
}

/// The parameters in a table.
///
/// # Errors
/// A table that does not fit the type; one that has passed the type's schema does.
pub fn read<P: DeserializeOwned>(table: &toml::Table) -> Result<P, BuildError> {
    table.clone().try_into().map_err(|error: toml::de::Error| BuildError::new("", error.message()))
}
