//! The files that belong to a session: those that its format or its manifest names. What else lies in the folder does not.

use std::collections::BTreeSet;
use std::path::Path;

use super::csv_input::SessionFolder;
use super::error::DatasetError;
use super::manifest::{MANIFEST, Manifest};
use super::stream_files::STREAMS;
use super::tables::{RIG_FOLDER, RIG_TABLE};
use super::{AMENDMENTS, JOURNAL, RIG_CALIBRATION, Session};
use crate::files::EntryKind;

/// Files at the top of a session folder.
const OF_SESSION: [&str; 13] = [
    "session.json",
    "trials.csv",
    "familiarisation.csv",
    RIG_TABLE,
    "protocol.json",
    "schedule.csv",
    "rig.json",
    RIG_CALIBRATION,
    AMENDMENTS,
    "import.json",
    "import.svg",
    JOURNAL,
    MANIFEST,
];

/// Files of the results.
const OF_RESULTS: [&str; 8] = [
    "fit.csv",
    "conditions.csv",
    "fit-independent.csv",
    "conditions-independent.csv",
    "fit.json",
    "diagnosis.json",
    "model.json",
    "report.html",
];

/// Paths, with `/`, of the plain files in `folder` that its format or its manifest names, in alphabetical order.
///
/// # Errors
/// If the folder cannot be read, or it has a manifest that is none.
pub fn session_files(folder: &Path, session: &Session) -> Result<Vec<String>, DatasetError> {
    let opened = SessionFolder::open(folder)?;
    let mut named: BTreeSet<String> = session.trials.iter().map(|trial| normal(&trial.file)).collect();
    if opened.folder().contains(MANIFEST) {
        named.extend(Manifest::read(folder)?.files.into_keys());
    }
    let tree = opened.folder().tree().map_err(|source| opened.unreadable("", source))?;
    let plain = tree.into_iter().filter(|file| file.kind == EntryKind::File);
    let mut files: Vec<String> = plain
        .filter_map(|file| Some(file.path.to_str()?.to_owned()))
        .filter(|file| is_of_format(file) || named.contains(file))
        .collect();
    files.sort();
    Ok(files)
}

/// A path without the parts that lead nowhere, as in `./trials/trial-001.csv`.
fn normal(file: &str) -> String {
    let mut parts = Vec::new();
    for part in file.split('/') {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()),
            part => parts.push(part),
        }
    }
    parts.join("/")
}

fn is_of_format(file: &str) -> bool {
    let is_numbered = |name: &str, stem: &str, ending: &str| {
        let number = name.strip_prefix(stem).and_then(|name| name.strip_suffix(ending));
        number.is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit() || byte == b'-'))
    };
    match file.split_once('/') {
        None => OF_SESSION.contains(&file) || is_numbered(file, "bus", ".json"),
        Some(("trials" | "familiarisation", name)) => is_numbered(name, "trial-", ".csv"),
        Some((RIG_FOLDER, name)) => is_numbered(name, "rig-trial-", ".csv"),
        // Streams that were recorded with the session.
        Some((STREAMS, name)) => name.ends_with(".xdf") && !name.contains('/'),
        // A recording of another device: its file, what is known of it, and its trials.
        Some(("attached", name)) => name.split('/').count() == 2,
        Some(("before", name)) => ["offset", "effort-"].iter().any(|stem| {
            let stem_end = name.strip_suffix(".csv").and_then(|name| name.strip_prefix(stem));
            stem_end.is_some_and(|end| end.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-'))
        }),
        Some(("results", name)) => match name.split_once('/') {
            // Results of other settings have a folder of their own.
            Some((folder, name)) if folder.starts_with("window-") => is_result(name),
            _ => is_result(name),
        },
        Some(_) => false,
    }
}

/// Whether a file of a folder of results is one of them.
fn is_result(name: &str) -> bool {
    match name.split_once('/') {
        None => OF_RESULTS.contains(&name),
        Some(("figures", figure)) => figure.ends_with(".svg") && !figure.contains('/'),
        Some(_) => false,
    }
}
