//! Where a replay is not as the record.

use std::fmt;

use crate::session::Phase;

/// First difference between a replay and the record.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Which start of the session, from 1: it was resumed in between.
    pub start: usize,
    /// Sample since then.
    pub sample: u64,
    /// State in which it was met.
    pub phase: Phase,
    /// Number of the trial under way.
    pub trial: Option<u32>,
    /// Entry in the journal.
    pub recorded: String,
    /// Outcome of the replay.
    pub replayed: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "sample {}", self.sample)?;
        if self.start > 1 {
            write!(out, " after resume number {}", self.start - 1)?;
        }
        write!(out, ", in state {}", self.phase.name())?;
        if let Some(trial) = self.trial {
            write!(out, " (trial {trial})")?;
        }
        write!(out, ": recorded {}, replayed {}", self.recorded, self.replayed)
    }
}
