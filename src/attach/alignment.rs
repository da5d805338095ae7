//! Aligns a recording with the trials of a session.

use std::path::{Path, PathBuf};

use super::aligned_ramps::AlignedRamps;
use super::attachment::{
    self, ATTACHED, Attachment, AttachmentTrial, ClockComparison, FrozenEmg, LeftOut, RecordingGaps,
    StepBetweenTrials,
};
use super::emg_check::{emg_warnings, no_fraction_of_mvc};
use super::emg_warning::EmgWarning;
use super::error::AttachError;
use super::ramp_search::find_ramps;
use super::request::{AttachRequest, Reference};
use super::timed_table::{GAP_STEPS, TimedTable};
use crate::dataset::{self, PROGRAM, Session};
use crate::files::{self, Folder, limits};
use crate::import::{RECORDING_FILES, SourceTable, read_recording};

/// A recording that was aligned, before it is written.
#[derive(Debug, Clone)]
pub struct Aligned {
    /// What is known of it.
    pub attachment: Attachment,
    session: PathBuf,
    name: String,
    files: Vec<(String, Vec<u8>)>,
}

impl Aligned {
    /// Folder of the attachment.
    pub fn folder(&self) -> PathBuf {
        self.session.join(ATTACHED).join(&self.name)
    }

    /// Writes it beside the session's raw data.
    ///
    /// # Errors
    /// If an attachment of that name is there, or the folder cannot be written.
    pub fn write(&self) -> Result<(), AttachError> {
        if files::exists(&self.folder()) {
            return Err(AttachError::Exists(self.folder()));
        }
        attachment::write(&self.session, &self.name, &self.files, &self.attachment)
    }
}

/// Aligns a recording with a session. Nothing is written.
///
/// # Errors
/// If session or recording cannot be read, the recording's clock is not sound, or the ramps of the session cannot be found in it.
pub fn align(request: &AttachRequest) -> Result<Aligned, AttachError> {
    let name = request.attachment_name()?;
    request.refuse_one_column_for_two_muscles()?;
    let folder = request.session.join(ATTACHED).join(&name);
    if files::exists(&folder) {
        return Err(AttachError::Exists(folder));
    }
    let session = dataset::load(&request.session)?;
    if Folder::open(&request.file).is_ok() {
        let expected = format!("one recording: {RECORDING_FILES}; attach several one after the other");
        return Err(request.unexpected("a folder".to_owned(), expected));
    }
    let recording = read_recording(&request.file)?;
    let table = TimedTable::new(request, &recording)?;
    for column in request.emg.iter().flatten() {
        table.finite_column(column)?;
    }
    // Without a journal nobody knows when the ramps were; their order is known.
    let ramps = dataset::ramp_times(&request.session)?.unwrap_or_default();
    let found = find_ramps(request, &session, &ramps, &recording, &table)?;
    let bytes = files::read(&request.file, limits::RECORDING_BYTES)
        .map_err(|source| crate::import::ImportError::Unreadable { path: request.file.clone(), source })?;
    cut(request, name, &session, &table, found, RecordingSource::Copied(bytes))
}

/// Where the recording is, once it is attached.
pub enum RecordingSource {
    /// In the folder of the attachment, with these bytes.
    Copied(Vec<u8>),
    /// In the session already: its path from the folder of the attachment, and its SHA-256.
    InSession(String, String),
}

/// Cuts the recording into the spans of the trials' records.
pub fn cut(
    request: &AttachRequest,
    name: String,
    session: &Session,
    table: &TimedTable,
    found: AlignedRamps,
    source: RecordingSource,
) -> Result<Aligned, AttachError> {
    let columns = table.columns();
    let speed = found.speed.unwrap_or(1.0);
    let (mut trials, mut left_out, mut parts, mut spans) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for trial in session.trials.iter().filter(|trial| !trial.record.theta_m_rad.is_empty()) {
        let mut leave =
            |because: &str| left_out.push(LeftOut { trial: trial.number, because: because.to_owned() });
        let Some(onset_s) = trial.onset_s else {
            leave("it has no onset");
            continue;
        };
        let Some(own) = found.trials.iter().find(|own| own.trial == trial.number) else {
            leave(found.why_not_found);
            continue;
        };
        let is_beside =
            |step: &&StepBetweenTrials| [step.after_trial, step.before_trial].contains(&trial.number);
        if let Some(step) = found.clock_steps.iter().find(is_beside) {
            leave(&step.why_left_out());
            continue;
        }
        let first_s = trial.record.start_s;
        let last_s = first_s + trial.record.theta_m_rad.len() as f64 / session.sample_rate_hz;
        let in_recording = |time_s: f64| own.onset_s + (time_s - onset_s) * speed;
        let from = table.times_s.partition_point(|time_s| *time_s < in_recording(first_s));
        let to = table.times_s.partition_point(|time_s| *time_s < in_recording(last_s));
        let step_s = 1.0 / table.rate_hz;
        let (begin_s, end_s) = (table.times_s[0], table.times_s[table.times_s.len() - 1]);
        if in_recording(first_s) < begin_s - step_s || in_recording(last_s) > end_s + 1.5 * step_s {
            leave("the recording does not last from its begin to its end");
            continue;
        }
        // A recording may have gaps where no trial is.
        let is_whole = from < to
            && table.times_s[from] < in_recording(first_s) + GAP_STEPS * step_s
            && table.times_s[to - 1] > in_recording(last_s) - (1.0 + GAP_STEPS) * step_s;
        if !is_whole || table.gaps.iter().any(|gap| (from..to - 1).contains(gap)) {
            let missing_s = table.missing_within_s(in_recording(first_s)..in_recording(last_s));
            leave(&format!("the recording has a gap in it: {missing_s:.3} s without a sample"));
            continue;
        }
        let file = format!("trial-{:03}.csv", trial.number);
        let on_axis = |sample: usize| onset_s + (table.times_s[sample] - own.onset_s) / speed;
        parts.push((file.clone(), part(&columns, from..to, on_axis)));
        spans.push((trial.number, from..to));
        let samples = to - from;
        trials.push(AttachmentTrial {
            trial: trial.number,
            file,
            onset_s: own.onset_s,
            residual_s: own.residual_s,
            samples,
        });
    }
    if let (true, Some(LeftOut { trial, because })) = (trials.is_empty(), left_out.first()) {
        return Err(request.not_aligned(format!("no trial can be attached; of trial {trial}: {because}")));
    }
    let mut emg_warnings = emg_warnings(request, table, &spans);
    if let Some((measured, expected)) = no_fraction_of_mvc(request, session, table, &spans) {
        // A stream was recorded with the session: its trials are kept.
        if !matches!(request.reference, Reference::SessionClock) {
            return Err(request.unexpected(measured, expected));
        }
        emg_warnings.push(EmgWarning::NoFractionOfMvc { measured, expected });
    }
    let frozen_emg = request.emg.iter().flatten().filter_map(|column| {
        let values = table.table.column(column)?;
        let trials: Vec<(u32, &[f64])> =
            spans.iter().map(|(number, span)| (*number, &values[span.clone()])).collect();
        FrozenEmg::of(column, &trials, table.rate_hz)
    });
    let gaps = matches!(request.reference, Reference::Marker(_)).then(|| table.longest_gap()).flatten();
    let gaps = gaps.map(|(begin_s, longest_s)| {
        let before = found.trials.iter().filter(|own| own.onset_s <= begin_s);
        let last = before.max_by(|a, b| a.onset_s.total_cmp(&b.onset_s));
        RecordingGaps { gaps: table.gaps.len(), longest_s, after_trial: last.map(|own| own.trial) }
    });
    let ending = request.file.extension().unwrap_or_default().to_string_lossy().into_owned();
    let mut files = Vec::new();
    let (source, source_sha256) = match source {
        RecordingSource::InSession(path, sha256) => (path, sha256),
        RecordingSource::Copied(bytes) => {
            let (name, sha256) = (format!("source.{ending}"), dataset::sha256(&bytes));
            files.push((name.clone(), bytes));
            (name, sha256)
        }
    };
    let attachment = Attachment {
        format: Attachment::format(),
        program: PROGRAM.to_owned(),
        source,
        source_sha256,
        table: table_name(&request.file, table.table),
        columns: columns.iter().map(|(name, _)| name.clone()).collect(),
        aligned_by: found.by,
        emg_fcr: request.emg[0].clone(),
        emg_ecr: request.emg[1].clone(),
        emg_fcr_at_mvc: request.emg_at_mvc[0],
        emg_ecr_at_mvc: request.emg_at_mvc[1],
        clock: ClockComparison { rate_hz: table.rate_hz, ..found.clock },
        clock_steps: found.clock_steps,
        stream: None,
        trials,
        left_out,
        frozen_emg: frozen_emg.collect(),
        emg_warnings,
        gaps,
    };
    files.extend(parts);
    Ok(Aligned { attachment, session: request.session.clone(), name, files })
}

/// Name of a table without the path of its file.
fn table_name(file: &Path, table: &SourceTable) -> String {
    let path = file.display().to_string();
    let rest = table.name.strip_prefix(&path).unwrap_or(&table.name);
    rest.trim_start_matches([',', ' ']).to_owned()
}

/// A table of some samples, with the times that they have on the axis of a trial.
fn part(
    columns: &[&(String, Vec<f64>)],
    samples: std::ops::Range<usize>,
    time_s: impl Fn(usize) -> f64,
) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let header = std::iter::once("t_s").chain(columns.iter().map(|(name, _)| name.as_str()));
    // Writing into memory does not fail.
    let _ = writer.write_record(header);
    for sample in samples {
        let time = std::iter::once(format!("{:.9}", time_s(sample)));
        let _ = writer.write_record(time.chain(columns.iter().map(|(_, values)| values[sample].to_string())));
    }
    writer.into_inner().unwrap_or_default()
}
