//! Session folders: reading what was measured, writing what was run.

mod amendments;
mod audit;
mod background_recorder;
mod calibrated_range;
mod calibration_misfit;
mod channel_ranges;
mod csv_input;
mod description_json;
mod disk;
mod error;
mod even_times;
mod folder;
mod given_rig_trials;
mod given_session;
mod hexadecimal;
mod journal;
mod load;
mod manifest;
mod memory_recorder;
mod normal_error;
mod ramp_times;
mod record_csv;
mod record_splitter;
mod recorded_rig;
mod recorder;
mod recovery;
mod replay;
mod resume;
mod rig_calibration;
mod rig_calibration_check;
mod rig_calibration_range;
mod rig_trial_csv_reader;
mod rig_trial_row;
mod rig_trials;
mod session_about;
mod session_clock;
mod session_digest;
mod session_files;
mod session_folders;
mod session_schema;
mod stored_protocol;
mod stream_files;
mod stream_stamps;
mod tables;
mod trial_csv_reader;
mod trial_csv_writer;
mod utc;
mod xdf_chunk;

use std::collections::BTreeMap;

pub use crate::session::Status;
pub use crate::wrist::FurtherChannel;
pub use amendments::{AMENDMENTS, Amendment, Amendments, record_sha256};
pub use audit::{ActionOrigin, AuditEntry, LONGEST_NOTE, OperatorAction, Wrist, stamps_from_clock};
pub use background_recorder::{AuditSender, BackgroundRecorder};
pub use calibrated_range::LARGEST_NONLINEARITY;
pub use calibration_misfit::is_doubtful_misfit;
pub use csv_input::open_session;
pub use disk::Disk;
pub(crate) use error::EVENLY;
pub use error::{DatasetError, FilePlace};
pub(crate) use even_times::{UnevenTime, grain, uneven_step, uneven_time};
pub use folder::{NewSession, PROGRAM};
pub use given_rig_trials::{GivenRigTrial, given_rig_trials, write_rig_trials};
pub use given_session::{check_given, write_session};
pub use hexadecimal::sha256;
pub use journal::{Damage, JOURNAL, JOURNAL_FORMAT, JournalEntry, JournalLine, JournalText, RecordSum};
pub use load::{load, load_amended};
pub use manifest::{Change, MANIFEST, Manifest};
pub use memory_recorder::MemoryRecorder;
pub use normal_error::{corner_frequency_hz, time_constant_s};
pub use ramp_times::{RampTime, ramp_times};
pub use record_csv::{Digits, record_csv};
pub use recorded_rig::{RIG_FILE, RecordedRig, recorded_rig};
pub use recorder::{RecordError, Recorder};
pub use recovery::operator_actions;
pub use replay::{Difference, Garbage, Replay, StepObserver, replay, replay_watched};
pub use resume::{Resumable, ResumeError, Resumed, every_trial_is_done};
pub use rig_calibration::{
    AngleAgainstTarget, CalibratedQuantity, CalibrationFit, CalibrationLoad, CalibrationNoise,
    CalibrationSource, NoiseSpectrum, RIG_CALIBRATION, RIG_CALIBRATION_FORMAT, ROUNDING_STEPS,
    RigCalibration, RigCalibrationError, RigQuantity,
};
pub use rig_trial_csv_reader::{RIG_TRIAL_REST_S, RigTrialSignals};
pub use rig_trial_row::RigTrialMotion;
pub use rig_trials::{RIG_TRIALS_TABLE, RigTrial, RigTrials, load_rig_trials};
pub use session_about::{SessionAbout, SessionCard, SubjectCard};
pub use session_clock::{SessionClock, StampedSample, utc_text_us};
pub use session_schema::session_schema_text;

use serde::{Deserialize, Serialize};
pub use session_files::session_files;
pub use session_folders::{is_session, session_folders};
pub use stored_protocol::{PROTOCOL, protocol_of_session, stored_protocol};
pub use stream_files::{STREAMS, StreamFileName, stream_file_name, stream_files};
pub use stream_stamps::samples_with_stamps_off;
pub use utc::{utc_day, utc_seconds, utc_text};
pub use xdf_chunk::{
    XDF_MAGIC, XdfTag, xdf_chunk, xdf_chunks, xdf_file_header, xdf_footer, xdf_stream_chunk,
};

use crate::files::is_plain_name;
use crate::signal::FilterSpec;
use crate::wrist::Lever;

/// The version of the session format that this program reads and writes.
pub const SESSION_FORMAT: &str = "ramphold-session/1";

/// A measured session, loaded and checked.
#[derive(Debug, Clone)]
pub struct Session {
    /// Who was measured.
    pub subject: Subject,
    /// Samples a second, all channels.
    pub sample_rate_hz: f64,
    /// The lever between motor and handle; `None` for a rigid one (theta_l = theta_m, T_l = T_h).
    pub lever: Option<Lever>,
    /// What the rig applied to both channels before recording.
    pub recorded_filter: Option<FilterSpec>,
    /// Lowest and highest value that a channel can show, in its unit, by the name of its column; of the channels of which it is known.
    pub channel_ranges: BTreeMap<String, [f64; 2]>,
    /// The trials in the order they were run, whatever their status.
    pub trials: Vec<Trial>,
}

impl Session {
    /// The channels besides motor angle, torque and EMG, which all records of a session have in common.
    pub fn further_channels(&self) -> Vec<FurtherChannel> {
        let recorded = self.trials.iter().find(|trial| !trial.record.theta_m_rad.is_empty());
        recorded.map_or(Vec::new(), |trial| trial.record.further_channels())
    }
}

/// Who was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Subject {
    /// Identifier, such as `S01`.
    pub id: String,
}

impl Subject {
    /// Whether a text can be a subject's identifier: letters, digits, -, _ and . such as S03.
    pub fn is_identifier(text: &str) -> bool {
        is_plain_name(text)
    }
}

/// One ramp and its record.
#[derive(Debug, Clone)]
pub struct Trial {
    /// Number in the table.
    pub number: u32,
    /// Path of the record inside the session folder, with `/`.
    pub file: String,
    /// Ramp velocity, rad/s; negative turns the other way.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// Which repetition of its condition.
    pub repetition: u32,
    /// Label of the condition where the table has such a column.
    pub condition: Option<String>,
    /// Onset of the ramp on the record's time axis, s; `None` asks the analysis to find it.
    pub onset_s: Option<f64>,
    /// What became of it.
    pub status: Status,
    /// Further columns of the table, as written.
    pub extra: BTreeMap<String, String>,
    /// The signals.
    pub record: Record,
}

/// The raw signals of a trial: unfiltered, offsets not removed, one value a sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Record {
    /// Time of the first sample, s.
    pub start_s: f64,
    /// Motor angle, rad.
    pub theta_m_rad: Vec<f64>,
    /// Torque measured in the lever, N m.
    pub torque_l_nm: Vec<f64>,
    /// Flexor carpi radialis EMG, fraction of MVC, where measured.
    pub emg_fcr_mvc: Option<Vec<f64>>,
    /// Extensor carpi radialis EMG, fraction of MVC, where measured.
    pub emg_ecr_mvc: Option<Vec<f64>>,
    /// Handle angle, rad, where measured.
    pub theta_l_rad: Option<Vec<f64>>,
    /// Angular acceleration of the handle, rad/s2, where measured.
    pub alpha_l_rad_s2: Option<Vec<f64>>,
    /// Torque between handle and hand, N m, where measured.
    pub torque_h_nm: Option<Vec<f64>>,
    /// Joint angle, rad, where measured.
    pub theta_j_rad: Option<Vec<f64>>,
}

impl Record {
    /// The samples of a further channel, where measured.
    pub fn further(&self, channel: FurtherChannel) -> Option<&Vec<f64>> {
        match channel {
            FurtherChannel::HandleAngle => self.theta_l_rad.as_ref(),
            FurtherChannel::HandleAcceleration => self.alpha_l_rad_s2.as_ref(),
            FurtherChannel::HandTorque => self.torque_h_nm.as_ref(),
            FurtherChannel::JointAngle => self.theta_j_rad.as_ref(),
        }
    }

    /// The place of the samples of a further channel.
    pub fn further_mut(&mut self, channel: FurtherChannel) -> &mut Option<Vec<f64>> {
        match channel {
            FurtherChannel::HandleAngle => &mut self.theta_l_rad,
            FurtherChannel::HandleAcceleration => &mut self.alpha_l_rad_s2,
            FurtherChannel::HandTorque => &mut self.torque_h_nm,
            FurtherChannel::JointAngle => &mut self.theta_j_rad,
        }
    }

    /// The samples of every channel that is measured, with the name of its column.
    pub fn channels(&self) -> impl Iterator<Item = (&'static str, &[f64])> {
        let own = [
            ("theta_m_rad", Some(&self.theta_m_rad)),
            ("torque_l_nm", Some(&self.torque_l_nm)),
            ("emg_fcr_mvc", self.emg_fcr_mvc.as_ref()),
            ("emg_ecr_mvc", self.emg_ecr_mvc.as_ref()),
        ];
        let further =
            FurtherChannel::ALL.into_iter().map(|channel| (channel.column(), self.further(channel)));
        own.into_iter().chain(further).filter_map(|(column, samples)| Some((column, samples?.as_slice())))
    }

    /// The further channels that are measured, in the order of [`FurtherChannel::ALL`].
    pub fn further_channels(&self) -> Vec<FurtherChannel> {
        FurtherChannel::ALL.into_iter().filter(|channel| self.further(*channel).is_some()).collect()
    }
}

#[cfg(test)]
mod tests;
