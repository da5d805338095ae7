//! The JSON schema of rig files of every kind.

use serde_json::Value;

use super::{can, virtual_wrist};

/// The schema as JSON text: what `ramphold schema rig` prints and `protocols/rig.schema.json` holds.
pub fn schema_text() -> String {
    format!("{:#}\n", schema())
}

/// A virtual rig, or a motor on a CAN bus; `kind` says which.
fn schema() -> Value {
    let mut schema = virtual_wrist::rig_schema();
    let mut can = can::file::schema().clone();
    if let Some(members) = can.as_object_mut() {
        // The dialect stands once, for the whole schema.
        members.remove("$schema");
        if let (Some(Value::Object(own)), Some(all)) =
            (members.remove("$defs"), schema["$defs"].as_object_mut())
        {
            all.extend(own);
        }
    }
    if let Some(kinds) = schema["oneOf"].as_array_mut() {
        kinds.push(can);
    }
    schema
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use serde_json::json;

    use super::*;
    use crate::rig::virtual_wrist::RigFile;

    #[test]
    fn the_schema_of_rigs_beside_the_protocols_is_that_of_the_types() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("protocols/rig.schema.json");
        let hint = "write it anew with: ramphold schema rig > protocols/rig.schema.json";
        if std::env::var_os("UPDATE_EXPECT").is_some() {
            fs::write(&path, schema_text()).unwrap();
        }
        assert!(fs::read_to_string(path).unwrap_or_default() == schema_text(), "{hint}");
    }

    #[test]
    fn virtual_rigs_and_can_rigs_are_valid_by_the_schema_and_rigs_with_a_mistake_are_not() {
        let validator = jsonschema::validator_for(&schema()).unwrap();
        let is_valid = |rig: &Value| validator.is_valid(rig);
        assert!(is_valid(&serde_json::to_value(RigFile::default()).unwrap()));
        assert!(!is_valid(&json!({ "kind": "virtual", "id": 3 })));
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/can/rigs");
        for name in ["plain", "packed", "packed-sensor", "transducer", "odrive", "mit"] {
            let text = fs::read_to_string(folder.join(format!("{name}.json"))).unwrap();
            let rig: Value = serde_json::from_str(&text).unwrap();
            let errors: Vec<String> = validator.iter_errors(&rig).map(|error| error.to_string()).collect();
            assert!(errors.is_empty(), "{name}: {errors:?}");
            type Change = fn(&mut Value);
            let changes: [Change; 5] = [
                |rig| rig["bus"] = json!("can0"),
                |rig| rig["bit_rate"] = json!(123_456),
                |rig| rig["motor"]["kind"] = json!("servo"),
                |rig| rig["motor"]["speed"] = json!(1),
                |rig| drop(rig.as_object_mut().unwrap().remove("lever")),
            ];
            for (at, change) in changes.into_iter().enumerate() {
                let mut wrong = rig.clone();
                change(&mut wrong);
                assert!(!is_valid(&wrong), "{name}: mistake {at} is valid");
            }
        }
    }
}
