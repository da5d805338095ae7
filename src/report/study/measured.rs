//! The quantities that a study has.

use crate::report::fitted::{SHOWN, Shown};
use crate::study::StudyResults;

/// The quantities of which any subject has a value: each with its index.
pub fn measured(study: &StudyResults) -> impl Iterator<Item = (usize, &'static Shown)> {
    SHOWN.iter().enumerate().filter(|(quantity, _)| study.summary.measured[*quantity])
}
