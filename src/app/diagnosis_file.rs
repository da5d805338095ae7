//! Fit and diagnosis in a session's folder.

use std::path::Path;

use serde_json::Value;

use crate::dataset;
use crate::json_file;

use super::failure::Failure;

/// Reads `results/diagnosis.json` of a session.
pub fn read_diagnosis(session: &Path) -> Result<Value, Failure> {
    let path = session.join("results").join("diagnosis.json");
    if !path.exists() {
        let session = session.display();
        return Err(Failure::Usage(format!(
            "{session}: has no diagnosis yet; get it with: ramphold diagnose {session}"
        )));
    }
    let diagnosis: Value = json_file::read(&path, "the file of a diagnosis")?;
    if let Some(digest) = diagnosis.pointer("/made_from/session_sha256").and_then(Value::as_str)
        && digest != dataset::load(session)?.digest()
    {
        let session = session.display();
        return Err(Failure::Usage(format!(
            "{session}: its diagnosis was made before the session was changed; make it again with: ramphold diagnose {session}"
        )));
    }
    Ok(diagnosis)
}

/// The content of `results/fit.json` of a session, if it has been fitted.
pub fn read_stored_fit(session: &Path) -> Result<Option<Value>, Failure> {
    let path = session.join("results").join("fit.json");
    Ok(if path.exists() { Some(json_file::read(&path, "the file of a fit")?) } else { None })
}

/// The causes of a diagnosis: for each its entry, and the ids of the mechanisms that it can be, the best first.
pub fn named_causes(diagnosis: &Value) -> impl Iterator<Item = (&Value, Vec<&str>)> {
    diagnosis["causes"].as_array().into_iter().flatten().map(|cause| {
        let rivals = cause["indistinguishable"].as_array().into_iter().flatten().filter_map(Value::as_str);
        (cause, cause["mechanism"].as_str().into_iter().chain(rivals).collect())
    })
}
