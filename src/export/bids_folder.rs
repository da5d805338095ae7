//! The folder of a BIDS dataset, and how files are put into it.

use std::io;

use serde_json::Value;

use super::bdf::{self, BdfChannel};
use super::error::ExportError;
use crate::files::Folder;

/// The folder of the dataset.
pub struct BidsFolder(Folder);

impl BidsFolder {
    /// The folder that is given.
    pub fn new(folder: Folder) -> Self {
        Self(folder)
    }

    /// Writes a text.
    pub fn put(&self, name: &str, text: &str) -> Result<(), ExportError> {
        self.put_bytes(name, text.as_bytes())
    }

    /// Writes a JSON file.
    pub fn put_json(&self, name: &str, value: &Value) -> Result<(), ExportError> {
        self.put(name, &format!("{value:#}\n"))
    }

    /// Writes a recording.
    pub fn put_bdf(
        &self,
        name: &str,
        subject: &str,
        rate_hz: f64,
        channels: &[BdfChannel],
    ) -> Result<(), ExportError> {
        let bytes =
            bdf::recording(subject, rate_hz, channels).map_err(|(place, value)| ExportError::OutOfRange {
                path: self.0.path_of(name),
                channel: channels[place].label,
                value,
                limit: bdf::LARGEST_VALUE,
            })?;
        self.put_bytes(name, &bytes)
    }

    fn put_bytes(&self, name: &str, bytes: &[u8]) -> Result<(), ExportError> {
        self.make_folder_of(name)?;
        self.0.write(name, bytes).map_err(ExportError::at(self.0.path_of(name)))
    }

    /// Copies a plain file, piece by piece.
    pub fn copy(&self, from: &Folder, file: &str, to: &str) -> Result<(), ExportError> {
        self.make_folder_of(to)?;
        let mut source = from.open_file(file).map_err(ExportError::at(from.path_of(file)))?;
        let mut copy = || {
            let mut target = self.0.begin_file(to)?;
            io::copy(&mut source, target.file())?;
            target.finish()
        };
        copy().map_err(ExportError::at(self.0.path_of(to)))
    }

    fn make_folder_of(&self, name: &str) -> Result<(), ExportError> {
        for (end, _) in name.match_indices('/') {
            self.0.folder_made(&name[..end]).map_err(ExportError::at(self.0.path_of(&name[..end])))?;
        }
        Ok(())
    }
}
