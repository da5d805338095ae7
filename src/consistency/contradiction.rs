//! A contradiction, with what was measured, what was stated, the likely mistake and the remedy.

use std::fmt;

use serde::Serialize;

use super::signal_check::SignalCheck;
use super::trial_list::trial_list;

/// What the signals of a session say against its table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contradiction {
    /// The check that found it.
    pub check: SignalCheck,
    /// File and column or field that it concerns.
    pub place: String,
    /// The trials that it concerns, by number; none if it concerns the session as a whole.
    pub trials: Vec<u32>,
    /// What was measured.
    pub measured: String,
    /// What the table states, or what is possible.
    pub stated: String,
    /// The mistake that would explain it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub likely_mistake: Option<String>,
    /// What to do.
    pub remedy: String,
}

impl fmt::Display for Contradiction {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { check, place, trials, measured, stated, .. } = self;
        write!(formatter, "{check}: {}.", measured_and_expected(place, trials, measured, stated))?;
        if let Some(mistake) = &self.likely_mistake {
            write!(formatter, " {mistake}")?;
        }
        write!(formatter, " {}", self.remedy)
    }
}

/// Where something was measured, in which trials, what it was, and what was expected.
pub fn measured_and_expected(place: &str, trials: &[u32], measured: &str, expected: &str) -> String {
    let trials = if trials.is_empty() { String::new() } else { format!(", {}", trial_list(trials)) };
    format!("{place}{trials}: {measured}; expected {expected}")
}

/// The contradictions for which a session is refused.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contradictions(pub Vec<Contradiction>);

impl std::error::Error for Contradictions {}

impl fmt::Display for Contradictions {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "the signals contradict what the session states")?;
        for one in &self.0 {
            write!(formatter, "\n  {one}")?;
        }
        let mut checks: Vec<&str> = self.0.iter().map(|one| one.check.name()).collect();
        checks.dedup();
        write!(
            formatter,
            "\nNothing was analysed. Correct the files; if they are right, add --accept {}, which is kept in the results",
            checks.join(",")
        )
    }
}
