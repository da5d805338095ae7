//! What moved the wrist in a session.

use std::path::Path;

use serde_json::Value;

use super::csv_input::SessionFolder;
use super::description_json::parse_json;
use super::error::{DatasetError, FilePlace};
use crate::files::limits;

/// Name of the rig's file in the folder of a session that this program ran.
pub const RIG_FILE: &str = "rig.json";

/// What moved the wrist in a session that this program ran.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordedRig {
    /// A motor on a CAN bus; the file is its rig file.
    Motor,
    /// The virtual wrist; the file has its rig and its person.
    VirtualWrist,
}

/// What moved the wrist in the session in `folder`; `None` for a session that was measured elsewhere, which has no `rig.json`.
///
/// # Errors
/// If the file cannot be read, or describes neither.
pub fn recorded_rig(folder: &Path) -> Result<Option<RecordedRig>, DatasetError> {
    let folder = SessionFolder::open(folder)?;
    if !folder.folder().contains(RIG_FILE) {
        return Ok(None);
    }
    let (name, text) = (folder.name(RIG_FILE), folder.text(RIG_FILE, limits::SETTINGS_BYTES, None)?);
    let rig: Value = parse_json(&name, &text)?;
    // The rig of a virtual session is one level down, beside the virtual subject.
    match (rig.get("kind"), rig.pointer("/rig/kind").and_then(Value::as_str)) {
        (Some(_), _) => Ok(Some(RecordedRig::Motor)),
        (None, Some("virtual")) => Ok(Some(RecordedRig::VirtualWrist)),
        (None, other) => Err(DatasetError::Value {
            at: FilePlace::field(name, "rig.kind"),
            found: other.unwrap_or_default().to_owned(),
            expected: "\"virtual\", or the rig file of a motor; it is written when the session begins"
                .to_owned(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rig_file_that_is_damaged_is_neither_a_motor_nor_a_virtual_wrist() {
        let folder = tempfile::tempdir().unwrap();
        let with = |text: &str| {
            std::fs::write(folder.path().join(RIG_FILE), text).unwrap();
            recorded_rig(folder.path())
        };
        assert_eq!(recorded_rig(folder.path()).unwrap(), None);
        assert_eq!(with(r#"{"kind":"cia402"}"#).unwrap(), Some(RecordedRig::Motor));
        assert_eq!(with(r#"{"rig":{"kind":"virtual"}}"#).unwrap(), Some(RecordedRig::VirtualWrist));
        for damaged in ["", "{\"kind\":\"cia4", "{}", r#"{"rig":{"kind":"real"}}"#] {
            assert!(with(damaged).unwrap_err().to_string().contains("rig.json"), "{damaged}");
        }
    }
}
