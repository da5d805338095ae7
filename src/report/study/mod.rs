//! The page of a study: what it found, who was left out, and the paper's figures over its subjects.

mod effects;
mod individuals;
mod left_out;
mod measured;
mod over_subjects;

use super::sections::ReportSection;
use crate::study::StudyResults;

/// The sections of the page, in the order in which they are read.
pub fn sections(study: &StudyResults) -> Vec<ReportSection> {
    vec![
        effects::found(study),
        left_out::left_out(study),
        over_subjects::over_subjects(study),
        individuals::individuals(study),
        effects::analysis_of_variance(study),
        effects::trends(study),
    ]
}
