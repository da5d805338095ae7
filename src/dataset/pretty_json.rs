//! JSON for people to read, as the files of a session have it.

use serde::Serialize;

/// A value as JSON, with an end of line.
pub(super) fn pretty(value: &impl Serialize) -> Vec<u8> {
    // Values made by this program always have a JSON form.
    let mut bytes = serde_json::to_vec_pretty(value).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}
