//! Writing an imported session.

use std::io::ErrorKind;
use std::path::Path;

use serde_json::json;

use super::error::ImportError;
use super::mapping::Mapping;
use super::picture::picture;
use super::session_build::ImportedSession;
use crate::dataset::{Digits, PROGRAM, write_session};
use crate::json_file;

/// Name of the picture of the first trials.
pub const PICTURE: &str = "import.svg";

impl ImportedSession {
    /// Writes the session into the new folder `folder`, with the mapping, the sources and a picture of the first trials.
    ///
    /// # Errors
    /// If the folder is there already, or cannot be written.
    pub fn write(&self, mapping: &Mapping, folder: &Path) -> Result<(), ImportError> {
        let picture = picture(&self.session);
        let kept = json!({ "program": PROGRAM, "mapping": mapping, "sources": self.sources, "left_out": self.left_out });
        let kept = json_file::pretty(&kept);
        let beside = [(PICTURE, picture.as_bytes()), ("import.json", kept.as_bytes())];
        write_session(&self.session, Digits::OfRecording, &beside, folder).map_err(|error| {
            let reason = match error.kind() {
                ErrorKind::AlreadyExists => {
                    "exists already and is not overwritten; give another --out".to_owned()
                }
                _ => format!("cannot be written: {error}"),
            };
            ImportError::Write { path: folder.into(), reason }
        })
    }
}
