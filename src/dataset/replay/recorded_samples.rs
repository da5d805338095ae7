//! The samples of a record, as a replay goes through them.

use super::garbage::Garbage;
use crate::dataset::error::DatasetError;
use crate::dataset::recorder::part_of;
use crate::dataset::recovery::RecoveredSession;
use crate::dataset::tables::header_of_file;
use crate::dataset::trial_csv_writer::RIG_HEADER;
use crate::dataset::{FurtherChannel, trial_csv_reader};
use crate::files::limits;
use crate::protocol::Limits;
use crate::rig::{Fault, LimitMonitor, Sample};
use crate::session::Reading;

/// The samples of the record that is being replayed, and how far it is.
#[derive(Debug, Default)]
pub(super) struct RecordedSamples {
    samples: Vec<Sample>,
    /// The angle commanded for each sample, rad; none but in the record of a rig trial.
    targets_rad: Vec<f64>,
    next: usize,
    /// The first sample that breaks a limit.
    breaks: Option<(usize, Fault)>,
}

impl RecordedSamples {
    /// The samples of a record, of which the first is the one that it began with, and is not replayed. What is in its file beside them
    /// is added to `garbage`.
    pub(super) fn read(
        session: &RecoveredSession,
        file: &str,
        limits: &Limits,
        garbage: &mut Vec<Garbage>,
    ) -> Result<Self, DatasetError> {
        let folder = &session.folder;
        let part = part_of(file);
        let is_part = folder.folder().contains(&part);
        let file = if is_part { &part } else { file };
        let text = folder.text(file, limits::RECORD_BYTES, None)?;
        let name = folder.name(file);
        // A record that is still being written may end in the middle of a row.
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        if whole.len() < text.len() {
            let bytes = (text.len() - whole.len()) as u64;
            garbage.push(Garbage { file: name.clone(), bytes, is_torn_end: is_part });
        }
        if whole.is_empty() {
            return Ok(Self::default());
        }
        let sample_rate_hz = session.settings.sample_rate_hz;
        let record = trial_csv_reader::parse(&name, whole, sample_rate_hz)?;
        let is_rig_trial = header_of_file(file) == RIG_HEADER;
        let emg_mvc = |channel: &Option<Vec<f64>>, row: usize| channel.as_ref().map(|emg| emg[row]);
        let samples: Vec<Sample> = (0..record.theta_m_rad.len())
            .map(|row| Sample {
                theta_m_rad: record.theta_m_rad[row],
                torque_l_nm: record.torque_l_nm[row],
                emg_fcr_mvc: emg_mvc(&record.emg_fcr_mvc, row),
                emg_ecr_mvc: emg_mvc(&record.emg_ecr_mvc, row),
                further: FurtherChannel::ALL.map(|channel| Some(record.further(channel)?[row])),
            })
            .collect();
        let targets_rad =
            if is_rig_trial { trial_csv_reader::parse_targets(&name, whole)? } else { Vec::new() };
        let mut monitor = LimitMonitor::new(limits.into(), sample_rate_hz);
        let breaks = samples
            .iter()
            .enumerate()
            .find_map(|(place, sample)| monitor.check_sample(sample).err().map(|fault| (place, fault)));
        Ok(Self { samples, targets_rad, next: 1, breaks })
    }

    /// How many samples were not replayed yet.
    pub(super) fn left(&self) -> usize {
        self.samples.len().saturating_sub(self.next)
    }

    /// The next sample, or the fault that it is; `None` at the end of the record. The last sample is repeated once for a record that
    /// `lacks_last`.
    pub(super) fn next_reading(&mut self, lacks_last: bool) -> Option<Reading> {
        let place = self.next;
        self.next += 1;
        if let Some((_, fault)) = self.breaks.filter(|(breaks, _)| *breaks == place) {
            return Some(Reading::Fault(fault));
        }
        let last = self.samples.last().filter(|_| lacks_last && place == self.samples.len());
        self.samples.get(place).or(last).map(|sample| Reading::Sample(*sample))
    }

    /// The target of the sample that was replayed last, rad, where the record has one.
    pub(super) fn last_target_rad(&self) -> Option<f64> {
        self.targets_rad.get(self.next.checked_sub(1)?).copied()
    }
}
