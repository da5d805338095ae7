//! Fit and diagnosis in a session's folder.

use std::path::Path;

use serde_json::Value;

use crate::dataset;
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
    let diagnosis: Value =
        json_file::parse(&String::from_utf8_lossy(&bytes), &path, "the file of a diagnosis")?;
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
    const STORED_FIT: &str = "results/fit.json";
    let path = session.join(STORED_FIT);
    let bytes = Folder::open(session).and_then(|folder| folder.read_if_there(STORED_FIT, limits::FIT_BYTES));
    let bytes = bytes.map_err(|source| Failure::Read { file: path.display().to_string(), source })?;
    let parse =
        |bytes: Vec<u8>| json_file::parse(&String::from_utf8_lossy(&bytes), &path, "the file of a fit");
    Ok(bytes.map(parse).transpose()?)
}

/// The causes of a diagnosis: for each its entry, and the ids of the mechanisms that it can be, the best first.
pub fn named_causes(diagnosis: &Value) -> impl Iterator<Item = (&Value, Vec<&str>)> {
    diagnosis["causes"].as_array().into_iter().flatten().map(|cause| {
        let rivals = cause["indistinguishable"].as_array().into_iter().flatten().filter_map(Value::as_str);
        (cause, cause["mechanism"].as_str().into_iter().chain(rivals).collect())
    })
}
