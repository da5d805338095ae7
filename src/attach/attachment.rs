//! `attachment.json`: what is known of a recording that was attached, and its files.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::consistency::{check_frozen, measured_and_expected};
use crate::dataset::{Disk, Manifest, RecordError};
use crate::files::Folder;
use crate::json_file;
use crate::rig::ChannelDetails;

use super::emg_warning::EmgWarning;
use super::error::AttachError;

/// Folder of the attachments in a session.
pub const ATTACHED: &str = "attached";

/// Format and version of `attachment.json`.
const ATTACHMENT_FORMAT: &str = "ramphold-attachment/1";

/// A recording of another device beside the raw data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Attachment {
    /// Format and version.
    pub format: String,
    /// The program that aligned it, with its version.
    pub program: String,
    /// Path of the recording's file from this folder, as it came.
    pub source: String,
    /// SHA-256 of it.
    pub source_sha256: String,
    /// The table or stream that was attached.
    pub table: String,
    /// Its columns, as they came: names and values are those of the recording.
    pub columns: Vec<String>,
    /// How the ramps were found: `trigger`, `marker` or `correlation`, and in what.
    pub aligned_by: String,
    /// The column that is the EMG of the flexor carpi radialis, if one was named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emg_fcr: Option<String>,
    /// The column that is the EMG of the extensor carpi radialis, if one was named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emg_ecr: Option<String>,
    /// Mean rectified EMG of the flexor at maximal effort, in the unit of its column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emg_fcr_at_mvc: Option<f64>,
    /// Mean rectified EMG of the extensor at maximal effort, in the unit of its column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emg_ecr_at_mvc: Option<f64>,
    /// How the clocks compare.
    pub clock: ClockComparison,
    /// Where the two clocks step against each other, such as where samples were lost.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub clock_steps: Vec<StepBetweenTrials>,
    /// The stream that it is, if it was recorded with the session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stream: Option<AttachedStream>,
    /// The trials, in the order in which they were run.
    pub trials: Vec<AttachmentTrial>,
    /// Trials that are not in the recording, and why.
    pub left_out: Vec<LeftOut>,
    /// EMG that does not go on changing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frozen_emg: Vec<FrozenEmg>,
    /// What else to know of the EMG before it is trusted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub emg_warnings: Vec<EmgWarning>,
    /// Gaps in the time of the recording, where the ramps were found by markers, which have times of their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gaps: Option<RecordingGaps>,
}

/// Gaps in the time of a recording whose ramps were found by markers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingGaps {
    /// How many there are.
    pub gaps: usize,
    /// Time without a sample in the longest, s.
    pub longest_s: f64,
    /// The last trial whose ramp is before the longest; `None` if none is.
    pub after_trial: Option<u32>,
}

impl fmt::Display for RecordingGaps {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = self
            .after_trial
            .map_or("before the first ramp".to_owned(), |trial| format!("after the ramp of trial {trial}"));
        let gaps =
            if self.gaps == 1 { "1 gap".to_owned() } else { format!("{} gaps, the longest", self.gaps) };
        write!(
            formatter,
            "the recording has {gaps} of {:.3} s {place}; samples were lost there, or its clock jumped, which looks the same. The trials \
             after a gap are aligned by the markers alone: if the clock jumped, they are off by as much. A trigger or a shared signal in the \
             recording would tell (--trigger, --signal)",
            self.longest_s
        )
    }
}

/// A column of EMG that keeps one value for longer than a muscle and its amplifier do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrozenEmg {
    /// The column.
    pub column: String,
    /// The trials in which it does.
    pub trials: Vec<u32>,
    /// The longest stretch.
    pub measured: String,
    /// How long one by chance would be.
    pub expected: String,
}

impl FrozenEmg {
    /// The column, if it is so in one of the trials, whose numbers and values are given.
    pub(super) fn of(column: &str, trials: &[(u32, &[f64])], rate_hz: f64) -> Option<Self> {
        let found = check_frozen(column, trials, rate_hz)?;
        let column = column.to_owned();
        Some(Self { column, trials: found.trials, measured: found.measured, expected: found.stated })
    }
}

impl fmt::Display for FrozenEmg {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = format!("EMG in column {:?}", self.column);
        let told = measured_and_expected(&place, &self.trials, &self.measured, &self.expected);
        write!(formatter, "{told}; had the amplifier stopped, or was an electrode off?")
    }
}

/// The clock of a recording beside that of the session.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ClockComparison {
    /// Samples a second of the recording, by its own clock.
    pub rate_hz: f64,
    /// How much faster the clock of the recording runs than that of the session, parts per million; `null` where no two ramps could
    /// be compared.
    pub drift_ppm: Option<f64>,
    /// Root mean square of what the ramps are off the straight line between the clocks, s.
    pub residual_rms_s: Option<f64>,
    /// The largest of it, s.
    pub residual_largest_s: Option<f64>,
    /// Lowest correlation coefficient of a trial, where the alignment is by a shared signal.
    pub lowest_correlation: Option<f64>,
    /// Share of random assignments of the holds before the ramps to the trials under which they are at least as much alike, where the
    /// alignment is by a shared signal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold_chance: Option<f64>,
}

/// A stream of Lab Streaming Layer that was recorded with the session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AttachedStream {
    /// Its name.
    pub name: String,
    /// The run of the program on the session in which it was recorded, from 1.
    pub run: usize,
    /// Unit of its channels.
    pub unit: String,
    /// Samples a second that it says it has.
    pub nominal_rate_hz: f64,
    /// How far the clock of the session's computer was ahead of that of the stream.
    pub clock_offsets: ClockOffsets,
    /// Root mean square of how late its stamps were against even times, s.
    pub stamps_late_rms_s: f64,
    /// Bytes at the end of its file that are no whole chunk: the program was killed while it wrote them.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub cut_off_bytes: usize,
    /// What is known of its channels of EMG, by their columns.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub channels: BTreeMap<String, ChannelDetails>,
}

// By reference, as serde asks for it.
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// How far one clock was ahead of another, in a session.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ClockOffsets {
    /// How often it was measured.
    pub measured: usize,
    /// The first measurement, s.
    pub first_s: Option<f64>,
    /// The last measurement, s.
    pub last_s: Option<f64>,
    /// How much it grew, parts per million, by the straight line through the measurements.
    pub drift_ppm: Option<f64>,
}

impl ClockOffsets {
    /// Those of measurements: time and offset, s.
    pub(super) fn of(measured: &[(f64, f64)]) -> Self {
        let count = measured.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| measured.iter().map(of).sum::<f64>() / count;
        let (time_s, offset_s) = (mean(|own| own.0), mean(|own| own.1));
        let square: f64 = measured.iter().map(|own| (own.0 - time_s).powi(2)).sum();
        let product: f64 = measured.iter().map(|own| (own.0 - time_s) * (own.1 - offset_s)).sum();
        Self {
            measured: measured.len(),
            first_s: measured.first().map(|own| own.1),
            last_s: measured.last().map(|own| own.1),
            drift_ppm: (square > 0.0).then_some(1e6 * product / square),
        }
    }
}

/// A step between the clocks of recording and session.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StepBetweenTrials {
    /// The last trial found before it.
    pub after_trial: u32,
    /// The first trial found after it.
    pub before_trial: u32,
    /// How much later the recording has what comes after the step, s; negative where samples of the recording were lost.
    pub step_s: f64,
}

impl StepBetweenTrials {
    /// Why clocks step in its direction.
    fn cause(&self) -> &'static str {
        if self.step_s < 0.0 {
            "samples were lost"
        } else {
            "the recording's clock jumped ahead, or it has samples too many"
        }
    }

    /// Why a trial beside it is left out.
    pub(super) fn why_left_out(&self) -> String {
        format!(
            "the clocks step by {:.2} ms between the ramps of trials {} and {}, and nobody knows where: {}",
            1e3 * self.step_s,
            self.after_trial,
            self.before_trial,
            self.cause()
        )
    }
}

impl fmt::Display for StepBetweenTrials {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "between trials {} and {} the clocks step by {:.2} ms: {}; what comes after is aligned by itself",
            self.after_trial,
            self.before_trial,
            1e3 * self.step_s,
            self.cause()
        )
    }
}

/// A trial of the session in a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AttachmentTrial {
    /// Number of the trial.
    pub trial: u32,
    /// Its file in this folder: `t_s` on the axis of the trial's own record, and the columns.
    pub file: String,
    /// When the ramp began, on the clock of the recording, s.
    pub onset_s: f64,
    /// How far that is off the straight line between the clocks, s.
    pub residual_s: Option<f64>,
    /// Samples in the file.
    pub samples: usize,
}

/// A trial that is not in a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Number of the trial.
    pub trial: u32,
    /// Why.
    pub because: String,
}

impl Attachment {
    /// What is the same for all attachments of this version.
    pub(super) fn format() -> String {
        ATTACHMENT_FORMAT.to_owned()
    }
}

/// Writes an attachment into a new folder `name` of those of `session`: `files` with their bytes, and the description.
pub(super) fn write(
    session: &Path,
    name: &str,
    files: &[(String, Vec<u8>)],
    attachment: &Attachment,
) -> Result<(), AttachError> {
    let disk = Disk::default();
    let target = session.join(ATTACHED).join(name);
    let description = json_file::pretty(attachment);
    let write = || {
        let folder = Folder::open(session)?;
        let above = folder.folder_made(ATTACHED)?;
        // Made under another name: a folder with the attachment's name is a whole one.
        let beginning = format!(".{name}.{}.new", std::process::id());
        let own = disk.create_folder(&above, &beginning)?;
        for (file, bytes) in files {
            disk.write(&own, file, bytes)?;
        }
        disk.write(&own, "attachment.json", description.as_bytes())?;
        disk.rename(&above, &beginning, name)
    };
    write().map_err(RecordError::at(&target))?;
    Manifest::renew_attachments(&disk, session, ATTACHED)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn a_gap_beside_markers_is_told_with_its_length_and_place_and_that_a_jump_looks_the_same() {
        let gaps = RecordingGaps { gaps: 1, longest_s: 4.0, after_trial: Some(8) };
        let text = gaps.to_string();
        assert!(text.starts_with("the recording has 1 gap of 4.000 s after the ramp of trial 8"), "{text}");
        assert!(text.contains("its clock jumped, which looks the same"), "{text}");
        assert!(text.contains("by the markers alone"), "{text}");
    }

    #[test]
    fn emg_that_stops_in_a_trial_is_told_with_its_column_and_trial() {
        let mut stream = Stream::new(1, "emg");
        let mut trials: Vec<Vec<f64>> =
            (0..4).map(|_| (0..2000).map(|_| stream.normal()).collect()).collect();
        let found = |trials: &[Vec<f64>]| {
            let numbered: Vec<(u32, &[f64])> =
                (11..).zip(trials).map(|(number, own)| (number, own.as_slice())).collect();
            FrozenEmg::of("FCR", &numbered, 2000.0)
        };
        assert_eq!(found(&trials), None);
        trials[2][500..1501].fill(0.25);
        let text = found(&trials).unwrap().to_string();
        assert!(
            text.starts_with("EMG in column \"FCR\", trial 13: it stays at 0.25 for 0.5 s in trial 13; expected no more than 0.05 s"),
            "{text}"
        );
    }
}
