//! Recorder that keeps a session in memory instead of a folder.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

use super::record_splitter::RecordSplitter;
use super::tables::{self, amplitude_rad, rest_s};
use super::trial_csv_writer::TrialCsvWriter;
use super::{FurtherChannel, Record, Session, Subject, Trial};
use crate::rig::Sample;
use crate::session::{Attempt, Progress, RecordTarget, Settings, Step, StepConsumer};
use crate::wrist::Lever;

/// Records the trials of a running session in memory.
///
/// Samples arrive rounded to the resolution of the CSV files, so that memory and folder hold the same bits.
#[derive(Debug)]
pub struct MemoryRecorder {
    settings: Arc<Settings>,
    /// The record of each attempt; `None` for practice and for a record that was taken.
    records: Vec<Option<Record>>,
    splitter: RecordSplitter,
}

impl MemoryRecorder {
    /// A recorder without trials.
    pub fn new(settings: Arc<Settings>) -> Self {
        Self { settings, records: Vec::new(), splitter: RecordSplitter::new() }
    }

    /// Takes the last trial out of the recorder; `None` while it is under way, and for practice.
    pub fn take_last_trial(&mut self, progress: &Progress) -> Option<Trial> {
        let attempt = progress.attempts().last()?;
        let record = self.records.get_mut(progress.attempts().len() - 1)?.take()?;
        trial(attempt, record, progress, &self.settings, &TrialCsvWriter::new(self.settings.sample_rate_hz))
    }

    /// The session as [`super::load`] would read it from a folder.
    pub fn session(self, progress: &Progress, subject: &str, lever: Option<Lever>) -> Session {
        let settings = &self.settings;
        let rows = TrialCsvWriter::new(settings.sample_rate_hz);
        let trials = progress.attempts().iter().zip(self.records);
        Session {
            subject: Subject { id: subject.to_owned() },
            sample_rate_hz: settings.sample_rate_hz,
            lever,
            recorded_filter: None,
            channel_ranges: Default::default(),
            trials: trials
                .filter(|(attempt, _)| !attempt.planned.key.practice)
                .filter_map(|(attempt, record)| {
                    trial(attempt, record.unwrap_or_default(), progress, settings, &rows)
                })
                .collect(),
        }
    }

    fn begin(&mut self, progress: &Progress) {
        self.records.resize_with(progress.attempts().len(), || None);
        if let (Some(last), Some(attempt)) = (self.records.last_mut(), progress.current()) {
            // Practice is not analysed.
            *last = (!attempt.planned.key.practice).then(Record::default);
        }
    }

    fn keep(&mut self, sample: &Sample) {
        let Some(Some(record)) = self.records.last_mut() else { return };
        // A CSV record has no negative zero.
        record.theta_m_rad.push(sample.theta_m_rad + 0.0);
        record.torque_l_nm.push(sample.torque_l_nm + 0.0);
        for (channel, value) in
            [(&mut record.emg_fcr_mvc, sample.emg_fcr_mvc), (&mut record.emg_ecr_mvc, sample.emg_ecr_mvc)]
        {
            if let Some(value) = value {
                channel.get_or_insert_default().push(value + 0.0);
            }
        }
        for (channel, value) in FurtherChannel::ALL.into_iter().zip(sample.further) {
            if let Some(value) = value {
                record.further_mut(channel).get_or_insert_default().push(value + 0.0);
            }
        }
    }
}

fn trial(
    attempt: &Attempt,
    record: Record,
    progress: &Progress,
    settings: &Settings,
    rows: &TrialCsvWriter,
) -> Option<Trial> {
    let (status, reason) = attempt.ended?;
    let planned = &attempt.planned;
    let extra = [
        ("reason", reason.name().to_owned()),
        ("position", planned.key.position.to_string()),
        ("amplitude_rad", amplitude_rad(planned).to_string()),
        ("rest_s", rest_s(attempt, settings).to_string()),
        ("torque_offset_nm", progress.offset_nm().to_string()),
    ];
    Some(Trial {
        number: attempt.number,
        file: tables::trial_file(attempt),
        velocity_rad_s: planned.velocity_rad_s,
        torque_nm: planned.torque_nm,
        repetition: planned.repetition,
        condition: None,
        onset_s: attempt.onset_sample.map(|sample| rows.time_s(sample)),
        status,
        extra: extra.into_iter().map(|(name, value)| (name.to_owned(), value)).collect::<BTreeMap<_, _>>(),
        record,
    })
}

impl StepConsumer for MemoryRecorder {
    type Error = Infallible;

    fn consume(&mut self, step: &Step, progress: &Progress) -> Result<(), Infallible> {
        let split = self.splitter.split(step.record);
        if let (RecordTarget::Trial, Some(sample)) = (split.open, &step.measured) {
            self.keep(sample);
        }
        if split.begins == Some(RecordTarget::Trial) {
            self.begin(progress);
            if let Some(sample) = &step.measured {
                self.keep(sample);
            }
        }
        Ok(())
    }
}
