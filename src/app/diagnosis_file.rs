//! The diagnosis in a session's folder.

use std::path::Path;

use serde_json::Value;

use crate::files::{Folder, limits};
use crate::json_file;

use super::failure::Failure;

/// Reads `results/diagnosis.json` of a session.
pub fn read_diagnosis(session: &Path) -> Result<Value, Failure> {
    const DIAGNOSIS: &str = "results/diagnosis.json";
    let folder = Folder::open(session);
    let path = session.join(DIAGNOSIS);
    let bytes = folder.and_then(|folder| folder.read_if_there(DIAGNOSIS, limits::DIAGNOSIS_BYTES));
    let unreadable = |source| Failure::Read { file: path.display().to_string(), source };
    let Some(bytes) = bytes.map_err(unreadable)? else {
        let session = session.display();
        return Err(Failure::Usage(format!(
            "{session}: has no diagnosis yet; get it with: ramphold diagnose {session}"
        )));
    };
    Ok(json_file::parse(&String::from_utf8_lossy(&bytes), &path, "the file of a diagnosis")?)
}

/// The causes of a diagnosis: for each its entry, and the ids of the mechanisms that it can be, the best first.
pub fn named_causes(diagnosis: &Value) -> impl Iterator<Item = (&Value, Vec<&str>)> {
    diagnosis["causes"].as_array().into_iter().flatten().map(|cause| {
        let rivals = cause["indistinguishable"].as_array().into_iter().flatten().filter_map(Value::as_str);
        (cause, cause["mechanism"].as_str().into_iter().chain(rivals).collect())
    })
}
