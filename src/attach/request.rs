//! What is asked for when a recording is attached.

use std::path::PathBuf;

use super::error::AttachError;

/// How a recording says when its samples were taken.
#[derive(Debug, Clone, PartialEq)]
pub enum ClockSource {
    /// By its format, as EDF, XDF and C3D.
    Format,
    /// By a column, in seconds.
    Column(String),
    /// By the rate of its samples, Hz.
    Rate(f64),
}

/// What recording and session have in common.
#[derive(Debug, Clone, PartialEq)]
pub enum Reference {
    /// A column with a pulse at the beginning of each ramp.
    Trigger {
        /// The column.
        column: String,
        /// Level that the pulse crosses; found if not given.
        threshold: Option<f64>,
        /// Whether the pulse begins downwards.
        falling: bool,
    },
    /// Markers with this text, or with this text and the number of the trial.
    Marker(String),
    /// The clock of the session: the recording was made with it.
    SessionClock,
    /// A column with a signal of the session.
    Signal {
        /// The column of the recording.
        column: String,
        /// The column of the trials: `theta_m_rad`, `torque_l_nm`, `emg_fcr_mvc` or `emg_ecr_mvc`.
        shared: String,
    },
}

/// A recording and how it is to be attached.
#[derive(Debug, Clone)]
pub struct AttachRequest {
    /// The session's folder.
    pub session: PathBuf,
    /// The recording.
    pub file: PathBuf,
    /// Its clock.
    pub clock: ClockSource,
    /// What it has in common with the session.
    pub reference: Reference,
    /// Part of the name of the table or stream to attach, where the recording has several.
    pub table: Option<String>,
    /// Columns of the EMG of flexor and extensor carpi radialis.
    pub emg: [Option<String>; 2],
    /// Mean rectified EMG of flexor and extensor at maximal effort, in the unit of their columns.
    pub emg_at_mvc: [Option<f64>; 2],
    /// Name of the attachment; that of the file without its ending if not given.
    pub name: Option<String>,
}

impl AttachRequest {
    /// What was found in the recording, and what was expected.
    pub(super) fn unexpected(&self, found: String, expected: impl Into<String>) -> AttachError {
        AttachError::Unexpected { file: self.file.clone(), found, expected: expected.into() }
    }

    /// Why the recording cannot be aligned.
    pub(super) fn not_aligned(&self, reason: String) -> AttachError {
        AttachError::NotAligned { file: self.file.clone(), reason }
    }

    /// Refuses a column that is named for both muscles.
    pub(super) fn refuse_one_column_for_two_muscles(&self) -> Result<(), AttachError> {
        let [Some(fcr), Some(ecr)] = &self.emg else { return Ok(()) };
        if fcr != ecr {
            return Ok(());
        }
        let found = format!("--emg-fcr and --emg-ecr both name column {fcr:?}");
        Err(self.unexpected(found, "a column for each muscle; leave out the one that was not measured"))
    }

    /// Name of the attachment.
    pub(super) fn attachment_name(&self) -> Result<String, AttachError> {
        let stem = self.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let name = self.name.clone().unwrap_or(stem);
        let is_good = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if name.is_empty() || name.starts_with('.') || !name.chars().all(is_good) {
            return Err(self.unexpected(
                format!("the name {name:?}"),
                "a name of letters, digits, -, _ and . for the attachment; give --name",
            ));
        }
        Ok(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_emg(fcr: Option<&str>, ecr: Option<&str>) -> AttachRequest {
        AttachRequest {
            session: PathBuf::new(),
            file: "emg.csv".into(),
            clock: ClockSource::Format,
            reference: Reference::SessionClock,
            table: None,
            emg: [fcr, ecr].map(|own| own.map(str::to_owned)),
            emg_at_mvc: [None, None],
            name: None,
        }
    }

    #[test]
    fn one_column_is_not_the_emg_of_two_muscles() {
        let refused = of_emg(Some("FCR"), Some("FCR")).refuse_one_column_for_two_muscles().unwrap_err();
        assert!(refused.to_string().contains("both name column \"FCR\""), "{refused}");
        for (fcr, ecr) in [(Some("FCR"), Some("ECR")), (Some("FCR"), None), (None, Some("FCR")), (None, None)]
        {
            assert!(of_emg(fcr, ecr).refuse_one_column_for_two_muscles().is_ok());
        }
    }
}
