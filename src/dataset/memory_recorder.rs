//! A session kept in memory alone: what loading its folder would give, without the folder.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

use super::recorder::Step;
use super::tables::{self, amplitude_rad, rest_s};
use super::trial_csv_writer::TrialCsvWriter;
use super::{Record, Session, Subject, Trial};
use crate::rig::Sample;
use crate::session::{Attempt, Input, Machine, Output, Progress, RecordTarget, Recorder, Settings};
use crate::wrist::Lever;

/// Keeps the records of the trials while a session runs.
///
/// Samples come to it rounded to what a folder's records hold, so that both ways lead to the same bits.
#[derive(Debug)]
pub struct MemoryRecorder {
    settings: Arc<Settings>,
    progress: Progress,
    records: Vec<Option<Record>>,
    open: bool,
}

impl MemoryRecorder {
    /// Nothing is recorded yet.
    pub fn new(settings: Arc<Settings>) -> Self {
        let progress = Progress::new(&settings);
        Self::with_progress(settings, progress)
    }

    /// Nothing is recorded yet of a session of which `progress` is already done.
    pub fn with_progress(settings: Arc<Settings>, progress: Progress) -> Self {
        Self { progress, settings, records: Vec::new(), open: false }
    }

    /// What happened so far.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// The last trial with its record, which is given away; `None` while it is under way, and for practice.
    pub fn take_last_trial(&mut self) -> Option<Trial> {
        let attempt = self.progress.attempts().last()?;
        let record = self.records.get_mut(self.progress.attempts().len() - 1)?.take()?;
        trial(
            attempt,
            record,
            &self.progress,
            &self.settings,
            &TrialCsvWriter::new(self.settings.sample_rate_hz),
        )
    }

    /// The session as [`super::load`] would give it.
    pub fn session(self, subject: &str, lever: Option<Lever>) -> Session {
        let (progress, settings) = (&self.progress, &self.settings);
        let rows = TrialCsvWriter::new(settings.sample_rate_hz);
        let trials = progress.attempts().iter().zip(self.records);
        Session {
            subject: Subject { id: subject.to_owned() },
            sample_rate_hz: settings.sample_rate_hz,
            lever,
            recorded_filter: None,
            trials: trials
                .filter(|(attempt, _)| !attempt.planned.key.practice)
                .filter_map(|(attempt, record)| {
                    trial(attempt, record.unwrap_or_default(), progress, settings, &rows)
                })
                .collect(),
        }
    }

    /// Keeps a step.
    pub fn keep_step(&mut self, step: &Step) {
        if let Some(happening) = &step.happened {
            self.progress.apply(happening);
        }
        let goes_on = self.open && step.recording == RecordTarget::Trial;
        if let (true, Some(sample)) = (self.open, &step.measured) {
            // The sample that ended a record belongs to it, as in a folder.
            self.keep(sample);
        }
        self.open = step.recording == RecordTarget::Trial;
        if self.open && !goes_on {
            self.begin();
            if let Some(sample) = &step.measured {
                self.keep(sample);
            }
        }
    }

    fn begin(&mut self) {
        self.records.resize_with(self.progress.attempts().len(), || None);
        if let (Some(last), Some(attempt)) = (self.records.last_mut(), self.progress.current()) {
            // Practice is recorded too, but nobody analyses it.
            let empty = || Record {
                emg_fcr_mvc: Some(Vec::new()),
                emg_ecr_mvc: Some(Vec::new()),
                ..Record::default()
            };
            *last = (!attempt.planned.key.practice).then(empty);
        }
    }

    fn keep(&mut self, sample: &Sample) {
        let Some(Some(record)) = self.records.last_mut() else { return };
        // A record's text knows no negative zero.
        record.theta_m_rad.push(sample.theta_m_rad + 0.0);
        record.torque_l_nm.push(sample.torque_l_nm + 0.0);
        for (channel, value) in
            [(&mut record.emg_fcr_mvc, sample.emg_fcr_mvc), (&mut record.emg_ecr_mvc, sample.emg_ecr_mvc)]
        {
            if let Some(channel) = channel {
                channel.push(value + 0.0);
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

impl Recorder for MemoryRecorder {
    type Error = Infallible;

    fn take(&mut self, input: &Input, output: &Output, machine: &Machine) -> Result<(), Infallible> {
        self.keep_step(&Step::new(input, output, machine));
        Ok(())
    }
}
