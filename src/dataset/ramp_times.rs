//! When the ramps of a session began, on the clock of its samples.

use std::path::Path;

use super::csv_input::SessionFolder;
use super::error::DatasetError;
use super::journal::{JOURNAL, JournalEntry, JournalText};
use super::recovery::RecoveredSession;
use crate::session::{Event, TransitionDetail};

/// The beginning of a motion: that of a trial, of a practice trial or of a rig trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RampTime {
    /// Stretch of the session without a break of its samples, from 0. Nobody knows how long a break was.
    pub stretch: usize,
    /// Number of the trial; `None` for practice and for rig trials.
    pub trial: Option<u32>,
    /// Time in its stretch, s.
    pub onset_s: f64,
}

/// The beginnings of all motions of the session in `folder`, in order; `None` for a session without a journal.
///
/// # Errors
/// If the session cannot be read.
pub fn ramp_times(folder: &Path) -> Result<Option<Vec<RampTime>>, DatasetError> {
    if !SessionFolder::open(folder)?.folder().contains(JOURNAL) {
        return Ok(None);
    }
    let session = RecoveredSession::read(folder)?;
    Ok(Some(of_journal(&session.journal, session.settings.sample_rate_hz)))
}

fn of_journal(journal: &JournalText, sample_rate_hz: f64) -> Vec<RampTime> {
    let mut ramps = Vec::new();
    let mut stretch = 0;
    let mut begun: Option<(u64, Option<u32>)> = None;
    for placed in &journal.records {
        match &placed.record {
            JournalEntry::Resumed { .. } => stretch += 1,
            JournalEntry::Transition(transition) => {
                match transition.detail {
                    Some(TransitionDetail::Began { number, practice, .. }) => {
                        let is_trial = !practice && !transition.to.in_rig_trial();
                        begun = Some((transition.sample, is_trial.then_some(number)));
                    }
                    Some(TransitionDetail::Onset { trial_sample, .. })
                        if transition.event == Event::Onset =>
                    {
                        if let Some((sample, trial)) = begun {
                            let onset_s = (sample + trial_sample) as f64 / sample_rate_hz;
                            ramps.push(RampTime { stretch, trial, onset_s });
                        }
                    }
                    _ => {}
                }
                // A rig without power measures nothing, and its samples are not counted.
                stretch += usize::from(!transition.to.is_armed());
            }
            _ => {}
        }
    }
    ramps
}
