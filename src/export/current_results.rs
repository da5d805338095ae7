//! Results that belong to the session as it is. Those made before it was changed are left out of an export, as a report leaves them out.

use std::collections::BTreeMap;

use serde_json::Value;

use super::error::ExportError;
use crate::files::{Folder, limits};

/// Which results of a folder were made of the session in another state.
#[derive(Debug, Clone, Copy)]
struct Outdated {
    fit: bool,
    diagnosis: bool,
}

/// The `files` of the session in `folder`, whose sum is `digest`, without those of results that were made of it in another state.
///
/// # Errors
/// If a fit or a diagnosis cannot be read.
pub fn current_files(folder: &Folder, files: Vec<String>, digest: &str) -> Result<Vec<String>, ExportError> {
    let mut known: BTreeMap<String, Outdated> = BTreeMap::new();
    let mut kept = Vec::new();
    for file in files {
        let inside = file.rsplit_once('/').filter(|_| file.starts_with("results/"));
        let Some((inside, name)) = inside else {
            kept.push(file);
            continue;
        };
        let results = inside.strip_suffix("/figures").unwrap_or(inside);
        let outdated = match known.get(results) {
            Some(outdated) => *outdated,
            None => {
                let outdated = Outdated {
                    fit: is_outdated(folder, &format!("{results}/fit.json"), limits::FIT_BYTES, digest)?,
                    diagnosis: is_outdated(
                        folder,
                        &format!("{results}/diagnosis.json"),
                        limits::DIAGNOSIS_BYTES,
                        digest,
                    )?,
                };
                known.insert(results.to_owned(), outdated);
                outdated
            }
        };
        let is_left_out = match name {
            "diagnosis.json" | "model.json" => outdated.diagnosis,
            _ if name == "report.html" || inside != results => outdated.fit || outdated.diagnosis,
            _ => outdated.fit,
        };
        if !is_left_out {
            kept.push(file);
        }
    }
    Ok(kept)
}

/// Whether the results of which `file` tells were made of another state of the session than that with the sum `digest`. One that is not
/// there, or does not say what it was made of, is not.
///
/// # Errors
/// If the file is there and cannot be read.
pub fn is_outdated(folder: &Folder, file: &str, limit: u64, digest: &str) -> Result<bool, ExportError> {
    let bytes = folder.read_if_there(file, limit).map_err(ExportError::at(folder.path_of(file)))?;
    let told: Option<Value> = bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let made_from = told.as_ref().and_then(|told| told.pointer("/made_from/session_sha256")?.as_str());
    Ok(made_from.is_some_and(|own| own != digest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_the_session_in_another_state_are_left_out() {
        let place = tempfile::tempdir().unwrap();
        let made_from = |digest: &str| format!(r#"{{ "made_from": {{ "session_sha256": "{digest}" }} }}"#);
        for (file, text) in [
            ("results/fit.json", made_from("before")),
            ("results/diagnosis.json", made_from("now")),
            ("results/window-30ms/fit.json", made_from("now")),
            ("results/window-50ms/fit.json", "{}".to_owned()),
        ] {
            let path = place.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let folder = Folder::open(place.path()).unwrap();
        let files = [
            "trials/trial-001.csv",
            "results/fit.json",
            "results/fit.csv",
            "results/report.html",
            "results/figures/trial-001.svg",
            "results/diagnosis.json",
            "results/model.json",
            "results/window-30ms/fit.csv",
            "results/window-50ms/report.html",
        ];
        let kept = current_files(&folder, files.map(str::to_owned).into(), "now").unwrap();
        let expected = [0, 5, 6, 7, 8].map(|place: usize| files[place]);
        assert_eq!(kept, expected);
        let all =
            current_files(&folder, files[..4].iter().map(|file| (*file).to_owned()).collect(), "before");
        assert_eq!(all.unwrap().len(), 3, "the page shows the diagnosis too");
    }
}
