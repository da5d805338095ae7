//! When a session that nobody watches ends, since its person fails every trial: the failed trials come again, and it would go on for ever.

use super::event::Event;
use super::io::Status;
use super::progress::Progress;

/// Trials in a row that a person may fail: one who manages a trial in twenty fails so many once in 170 times.
const MOST_FAILED_IN_A_ROW: usize = 100;

/// A person fails every trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "{failed} trials in a row failed, the last one by {}: this virtual person cannot hold the torque within the gate on this rig; make the \
     gate of the protocol wider, or noise, hum and tremor smaller",
    because.name()
)]
pub struct EveryTrialFails {
    /// Trials that failed in a row.
    pub failed: usize,
    /// What ended the last one.
    pub because: Event,
}

impl Progress {
    /// Whether so many trials in a row failed, without the first `before` attempts, that nothing else is to be expected.
    pub fn every_trial_fails(&self, before: usize) -> Option<EveryTrialFails> {
        let ended = self.attempts().iter().skip(before).rev().filter_map(|attempt| attempt.ended);
        let mut failed = ended.take_while(|(status, _)| *status != Status::Ok);
        let (_, because) = failed.next()?;
        let failed = 1 + failed.count();
        (failed >= MOST_FAILED_IN_A_ROW).then_some(EveryTrialFails { failed, because })
    }
}
