//! The JSON schema of protocol files, generated from the types.

use std::sync::LazyLock;

use schemars::schema_for;
use serde_json::{Value, json};

use super::Protocol;

/// The schema as JSON text: what `ramphold schema` prints and `protocols/protocol.schema.json` holds.
pub fn schema_text() -> String {
    format!("{:#}\n", *SCHEMA)
}

/// The schema against which the door checks the shape of a protocol.
pub(super) static SCHEMA: LazyLock<Value> = LazyLock::new(|| {
    let mut schema = schema_for!(Protocol).to_value();
    // Editors find the schema by this key; it means nothing to the experiment.
    schema["properties"]["$schema"] =
        json!({ "description": "Where an editor finds this schema.", "type": "string" });
    schema
});
