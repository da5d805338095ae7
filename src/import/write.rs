//! Writing an imported session.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::json;

use super::error::ImportError;
use super::mapping::Mapping;
use super::picture::picture;
use super::session_build::ImportedSession;
use crate::dataset::{Digits, Disk, PROGRAM, SESSION_FORMAT, record_csv};
use crate::files::{self, Folder};

/// Name of the picture of the first trials.
pub const PICTURE: &str = "import.svg";

impl ImportedSession {
    /// Writes the session into the new folder `folder`, with the mapping, the sources and a picture of the first trials.
    ///
    /// # Errors
    /// If the folder is there already, or cannot be written.
    pub fn write(&self, mapping: &Mapping, folder: &Path) -> Result<(), ImportError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |error: std::io::Error| ImportError::Write {
                path,
                reason: format!("cannot be written: {error}"),
            }
        };
        if files::exists(folder) {
            let reason = "exists already and is not overwritten; give another --out".to_owned();
            return Err(ImportError::Write { path: folder.into(), reason });
        }
        let open = || {
            files::make_folders(folder)?;
            let opened = Folder::open(folder)?;
            opened.make_folder("trials")?;
            Ok(opened)
        };
        let opened = open().map_err(failed(folder))?;
        let disk = Disk::default();
        let put = |name: &str, text: &str| {
            disk.write(&opened, name, text.as_bytes()).map_err(failed(&opened.path_of(name)))
        };
        for trial in &self.session.trials {
            put(&trial.file, &record_csv(&trial.record, self.session.sample_rate_hz, Digits::OfRecording))?;
        }
        put("trials.csv", &self.table())?;
        put(PICTURE, &picture(&self.session))?;
        let kept = json!({ "program": PROGRAM, "mapping": mapping, "sources": self.sources, "left_out": self.left_out });
        put("import.json", &format!("{kept:#}\n"))?;
        // The description comes last: a folder without it is no session.
        let session = &self.session;
        let description = json!({
            "format": SESSION_FORMAT,
            "subject": { "id": session.subject.id },
            "sample_rate_hz": session.sample_rate_hz,
            "rig": { "lever": session.lever },
            "recorded_filter": session.recorded_filter,
        });
        put("session.json", &format!("{description:#}\n"))
    }

    /// Text of `trials.csv`.
    fn table(&self) -> String {
        let mut text = "trial,file,velocity_rad_s,torque_nm,repetition,onset_s,status\n".to_owned();
        for trial in &self.session.trials {
            let onset = trial.onset_s.map_or(String::new(), |onset_s| format!("{onset_s:.6}"));
            // Writing into memory does not fail.
            let _ = writeln!(
                text,
                "{},{},{},{},{},{onset},{}",
                trial.number,
                trial.file,
                trial.velocity_rad_s,
                trial.torque_nm,
                trial.repetition,
                trial.status.name()
            );
        }
        text
    }
}
