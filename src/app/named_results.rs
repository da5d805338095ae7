//! Where results go: results that were made with other settings are never replaced.

use std::io::ErrorKind;
use std::path::Path;

use serde_json::Value;

use crate::dataset::open_session;
use crate::files::{Folder, limits};
use crate::wrist::mechanisms::CATALOGUE;

use super::failure::Failure;
use super::results_folder::{RESULTS, ResultsFolder};

/// What a fit and a diagnosis must have in common to stand beside each other.
const SHARED: [&str; 3] = ["/settings/window_s", "/model", CALIBRATION];

/// What makes two fits the same.
const OF_FIT: [&str; 5] =
    ["/settings/window_s", "/model", CALIBRATION, "/settings/weighting_asked", "/settings/independent"];

/// The sum of the calibration. What an older program wrote had none.
const CALIBRATION: &str = "/settings/calibration_sha256";

/// The folder for a fit of `session`: its `results/`, or a named folder in it if that holds results of other settings.
///
/// # Errors
/// If it is no session folder.
pub fn folder_of_fit(session: &Path, fit: &Value) -> Result<ResultsFolder, Failure> {
    choose(session, fit, |folder| {
        agrees(&stored_fit(folder), fit, &OF_FIT) && agrees(&stored_diagnosis(folder), fit, &SHARED)
    })
}

/// The folder for a diagnosis of `session`, as [`folder_of_fit`].
///
/// # Errors
/// As [`folder_of_fit`].
pub fn folder_of_diagnosis(session: &Path, diagnosis: &Value) -> Result<ResultsFolder, Failure> {
    choose(session, diagnosis, |folder| {
        [stored_fit(folder), stored_diagnosis(folder)].iter().all(|stored| agrees(stored, diagnosis, &SHARED))
    })
}

fn choose(session: &Path, own: &Value, is_free: impl Fn(&Folder) -> bool) -> Result<ResultsFolder, Failure> {
    let of_session = ResultsFolder::OfSession(session.to_owned());
    // If the folder cannot be opened, the error comes where it is opened for writing.
    let Ok(results) = open_session(session)?.folder(RESULTS) else { return Ok(of_session) };
    if is_free(&results) {
        return Ok(of_session);
    }
    let name = name(own);
    for number in 1_u32.. {
        let name = if number == 1 { name.clone() } else { format!("{name}-{number}") };
        let place = ResultsFolder::Named { session: session.to_owned(), name: name.clone() };
        match results.folder(&name) {
            Ok(folder) if !is_free(&folder) => {}
            // A file or a link has the name.
            Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::NotADirectory) => {}
            Ok(_) => return Ok(place),
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(place),
            Err(source) => return Err(Failure::ResultsFolder { path: place.path(), source }),
        }
    }
    Ok(of_session)
}

/// Name of the folder for results of these settings: `window-300ms-plain`.
fn name(own: &Value) -> String {
    let window_ms = 1e3 * own.pointer("/settings/window_s").and_then(Value::as_f64).unwrap_or(0.0);
    let mut parts = vec![format!("window-{}ms", (10.0 * window_ms).round() / 10.0)];
    if own.pointer("/settings/weighting_asked").and_then(Value::as_str) == Some("plain") {
        parts.push("plain".into());
    }
    if own.pointer("/settings/independent").and_then(Value::as_bool) == Some(true) {
        parts.push("independent".into());
    }
    if own.pointer(CALIBRATION).is_some_and(Value::is_string) {
        parts.push("calibrated".into());
    }
    let mechanisms = own.pointer("/model/mechanisms").and_then(Value::as_array);
    // Ids of the catalogue only: a name comes from a file.
    let known = |mechanism: &Value| {
        let id = mechanism["mechanism"].as_str()?;
        CATALOGUE.iter().find(|kind| kind.id() == id).map(|kind| kind.id().to_owned())
    };
    parts.extend(mechanisms.into_iter().flatten().filter_map(known));
    parts.join("-")
}

/// Results in a folder.
enum Stored {
    /// None: the place is free.
    Absent,
    /// These.
    Known(Value),
    /// A file that cannot be read: nobody knows what it holds, so that it counts as results of other settings.
    Unreadable,
}

fn stored_fit(folder: &Folder) -> Stored {
    read(folder, "fit.json", limits::FIT_BYTES)
}

fn stored_diagnosis(folder: &Folder) -> Stored {
    read(folder, "diagnosis.json", limits::DIAGNOSIS_BYTES)
}

/// A JSON file of a folder.
fn read(folder: &Folder, name: &str, limit: u64) -> Stored {
    match folder.read_if_there(name, limit) {
        Ok(None) => Stored::Absent,
        Ok(Some(bytes)) => serde_json::from_slice(&bytes).map_or(Stored::Unreadable, Stored::Known),
        Err(_) => Stored::Unreadable,
    }
}

/// Whether `stored` is not there, or has the settings of `own` at `paths`. What an older program did not write counts as equal.
fn agrees(stored: &Stored, own: &Value, paths: &[&str]) -> bool {
    let stored = match stored {
        Stored::Absent => return true,
        Stored::Unreadable => return false,
        Stored::Known(stored) => stored,
    };
    paths.iter().all(|path| match (stored.pointer(path), own.pointer(path)) {
        (Some(stored), Some(own)) => same(stored, own),
        (None, Some(own)) if *path == CALIBRATION => own.is_null(),
        _ => true,
    })
}

/// Equality of settings; a window that went through a file may differ in its last digit.
fn same(a: &Value, b: &Value) -> bool {
    match (a.as_f64(), b.as_f64()) {
        (Some(a), Some(b)) => (a - b).abs() <= 1e-9 * a.abs().max(b.abs()),
        _ => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn fit(window_s: f64, weighting: &str) -> Value {
        json!({ "settings": { "window_s": window_s, "weighting_asked": weighting, "independent": false },
                "model": { "mechanisms": [] } })
    }

    #[test]
    fn results_with_a_calibration_do_not_replace_those_without_one_or_with_another() {
        let session = tempfile::tempdir().unwrap();
        let results = session.path().join("results");
        std::fs::write(session.path().join("session.json"), "{}").unwrap();
        std::fs::create_dir_all(&results).unwrap();
        let with = |sha256: Value| {
            let mut own = fit(0.04, "measured_noise");
            own["settings"]["calibration_sha256"] = sha256;
            own
        };
        let place = |own: &Value| folder_of_fit(session.path(), own).unwrap().path();
        // An older program wrote no sum.
        std::fs::write(results.join("fit.json"), fit(0.04, "measured_noise").to_string()).unwrap();
        assert_eq!(place(&with(Value::Null)), results);
        assert_eq!(place(&with(json!("aa"))), results.join("window-40ms-calibrated"));
        std::fs::write(results.join("fit.json"), with(json!("aa")).to_string()).unwrap();
        assert_eq!(place(&with(json!("aa"))), results);
        assert_eq!(place(&with(json!("bb"))), results.join("window-40ms-calibrated"));
        assert_eq!(place(&with(Value::Null)), results.join("window-40ms"));
    }

    #[test]
    fn a_fit_with_other_settings_gets_a_folder_of_its_own() {
        let session = tempfile::tempdir().unwrap();
        let results = session.path().join("results");
        std::fs::write(session.path().join("session.json"), "{}").unwrap();
        let folder_of_fit = |fit: &Value| folder_of_fit(session.path(), fit).unwrap().path();
        assert_eq!(folder_of_fit(&fit(0.3, "plain")), results, "nothing is there yet");
        std::fs::create_dir_all(&results).unwrap();
        std::fs::write(results.join("fit.json"), fit(0.04, "measured_noise").to_string()).unwrap();
        assert_eq!(folder_of_fit(&fit(0.04, "measured_noise")), results);
        let other = folder_of_fit(&fit(0.3, "plain"));
        assert_eq!(other, results.join("window-300ms-plain"));
        let diagnosis = json!({ "settings": { "window_s": 0.3 }, "model": { "mechanisms": [] } });
        assert_eq!(
            folder_of_diagnosis(session.path(), &diagnosis).unwrap().path(),
            results.join("window-300ms")
        );
    }

    #[test]
    fn results_that_cannot_be_read_are_not_replaced() {
        let session = tempfile::tempdir().unwrap();
        let results = session.path().join("results");
        std::fs::write(session.path().join("session.json"), "{}").unwrap();
        std::fs::create_dir_all(&results).unwrap();
        let own = fit(0.04, "measured_noise");
        let place = || folder_of_fit(session.path(), &own).unwrap().path();
        std::fs::write(results.join("fit.json"), "{\"settings\": {").unwrap();
        assert_eq!(place(), results.join("window-40ms"), "broken JSON");
        let too_large = std::fs::File::create(results.join("fit.json")).unwrap();
        too_large.set_len(limits::FIT_BYTES + 1).unwrap();
        assert_eq!(place(), results.join("window-40ms"), "more than is read");
        std::fs::remove_file(results.join("fit.json")).unwrap();
        assert_eq!(place(), results);
        std::fs::write(results.join("diagnosis.json"), "no JSON").unwrap();
        std::fs::write(results.join("window-40ms"), "a file of that name").unwrap();
        assert_eq!(place(), results.join("window-40ms-2"));
    }
}
