//! The JSON schema of the rig files of CAN motors, generated from the types.

use std::sync::LazyLock;

use schemars::schema_for;
use serde_json::{Value, json};

use super::rig_file::CanRigFile;
use crate::rig::can::bus::BusSpec;
use crate::rig::can::canopen::Object;

static RIG_SCHEMA: LazyLock<Value> = LazyLock::new(|| {
    let mut schema = schema_for!(CanRigFile).to_value();
    // Editors find the schema by this key; it means nothing to the rig.
    schema["properties"]["$schema"] =
        json!({ "description": "Where an editor finds this schema.", "type": "string" });
    // A rigid lever is said, not left out.
    if let Some(required) = schema["required"].as_array_mut() {
        required.push(json!("lever"));
    }
    schema
});

/// The schema of the rig files of CAN motors. Ranges, and what must fit together, are checked by the program only.
pub fn schema() -> &'static Value {
    &RIG_SCHEMA
}

/// What is wrong with a text of one of the schema's formats.
pub(super) fn format_error(format: &str, text: &str) -> Option<String> {
    match format {
        "bus" => text.parse::<BusSpec>().err().map(|error| error.to_string()),
        "can-object" => text.parse::<Object>().err(),
        _ => None,
    }
}

/// A text of one of the schema's formats.
pub(super) fn format_example(format: &str) -> Option<&'static str> {
    match format {
        "bus" => Some("socketcan:can0"),
        "can-object" => Some("2E00h:01"),
        _ => None,
    }
}
