//! Each quantity against torque and against velocity: the mean over subjects, with the curve of each subject.

use super::measured::measured;
use crate::report::chart::{COLOURS, Chart, Mark, Panel, Sign, Stroke};
use crate::report::derived::is_difference;
use crate::report::figure::Figure;
use crate::report::fitted::{SPOKEN_OF, Shown};
use crate::report::scale::Axis;
use crate::report::sections::ReportSection;
use crate::study::{StudyResults, SubjectMeans};

/// Place of the variance accounted for, which tells of the fit and not of the subject.
const VAF: usize = 8;

/// The factors of a study: their index, the label of their axis, and what is averaged over.
const FACTORS: [(usize, &str, &str); 2] =
    [(1, "target torque (N m)", "mean over velocities"), (0, "velocity (rad/s)", "mean over torques")];

/// The section: a figure for each quantity.
pub fn individuals(study: &StudyResults) -> ReportSection {
    let mut section =
        ReportSection::new("individuals", "Single subjects: each quantity against torque and velocity");
    let (drawn, all) = (study.summary.individuals.len() as u64, study.summary.subjects);
    let which =
        if drawn < all { format!(" {drawn} of the {all} subjects are drawn.") } else { String::new() };
    let mut quantities: Vec<(usize, &Shown)> = measured(study).filter(|own| varies(study, own.0)).collect();
    // What the study is about comes first.
    quantities.sort_by_key(|(quantity, _)| {
        SPOKEN_OF.iter().position(|own| own == quantity).unwrap_or(SPOKEN_OF.len())
    });
    for (quantity, shown) in quantities {
        let panels: Vec<Panel> =
            FACTORS.iter().filter_map(|factor| panel(study, quantity, shown, *factor)).collect();
        if panels.is_empty() {
            continue;
        }
        section.figure(Figure {
            id: format!("study-{}", shown.sign.to_lowercase().replace('_', "-")),
            title: format!("{}, {}", shown.sign, shown.meaning),
            caption: format!(
                "Thin lines: single subjects. Black: mean over the subjects with all conditions, with the standard deviation between \
                 them.{which}"
            ),
            panels,
            columns: 2,
        });
    }
    section
}

/// Whether a quantity that is estimated differs between the conditions of any subject: one that a session has once has no curve.
fn varies(study: &StudyResults, quantity: usize) -> bool {
    let differs = |own: &SubjectMeans| {
        let cells = 0..study.summary.grid.conditions.len();
        let values: Vec<f64> = cells.filter_map(|cell| own.cells.mean(quantity, cell)).collect();
        values.iter().any(|value| is_difference(value - values[0], *value))
    };
    quantity != VAF && study.summary.individuals.iter().any(differs)
}

/// The levels of a factor.
fn levels(study: &StudyResults, factor: usize) -> &[f64] {
    if factor == 0 { &study.summary.grid.velocities_rad_s } else { &study.summary.grid.torques_nm }
}

fn panel(
    study: &StudyResults,
    quantity: usize,
    shown: &Shown,
    (factor, axis, averaged): (usize, &str, &str),
) -> Option<Panel> {
    let levels = levels(study, factor);
    // A factor with one level has no curve.
    let (first, last) = (*levels.first()?, *levels.last()?);
    if levels.len() < 2 {
        return None;
    }
    let mut ends = Vec::new();
    let mut marks = Vec::new();
    for (place, own) in study.summary.individuals.iter().enumerate() {
        let points: Vec<(f64, f64)> = levels
            .iter()
            .enumerate()
            .map(|(level, at)| {
                (*at, of_subject(study, own, quantity, factor, level).map_or(f64::NAN, |m| m * shown.factor))
            })
            .collect();
        ends.extend(points.iter().map(|point| point.1));
        marks.push(Mark::Line(1 + place % COLOURS, Stroke::Thin, points));
    }
    let moments = &study.summary.complete[quantity];
    let mean = |(level, at): (usize, &f64)| {
        let contrast = moments.contrast(&study.summary.grid.level_weights(factor, level))?;
        let sd = contrast.se * (moments.count() as f64).sqrt();
        Some((*at, contrast.estimate * shown.factor, Some(sd * shown.factor)))
    };
    let means: Vec<(f64, f64, Option<f64>)> = levels.iter().enumerate().filter_map(mean).collect();
    ends.extend(means.iter().flat_map(|(_, mean, sd)| [mean - sd.unwrap_or(0.0), mean + sd.unwrap_or(0.0)]));
    let mut legend = vec![(1, Sign::Line(Stroke::Thin), "single subjects".to_owned())];
    if !means.is_empty() {
        marks.push(Mark::Line(0, Stroke::Solid, means.iter().map(|point| (point.0, point.1)).collect()));
        marks.push(Mark::Points(0, means));
        legend.push((0, Sign::Point, "mean ± SD".to_owned()));
    }
    let room = 0.06 * (last - first);
    Some(
        Chart {
            title: format!(
                "{} by {}, {averaged}",
                shown.sign,
                if factor == 0 { "velocity" } else { "torque" }
            ),
            x: Axis::new(axis, first - room, last + room),
            y: Axis::around(&shown.with_unit(), ends),
            marks,
            legend,
        }
        .panel(),
    )
}

/// The mean of a subject at a level of a factor; `None` if a condition there has no value.
fn of_subject(
    study: &StudyResults,
    own: &SubjectMeans,
    quantity: usize,
    factor: usize,
    level: usize,
) -> Option<f64> {
    let at = levels(study, factor)[level];
    let conditions = study.summary.grid.conditions.iter().enumerate();
    let cells =
        conditions.filter(|(_, condition)| (if factor == 0 { condition.0 } else { condition.1 }) == at);
    let means: Option<Vec<f64>> = cells.map(|(cell, _)| own.cells.mean(quantity, cell)).collect();
    let means = means.filter(|means| !means.is_empty())?;
    Some(means.iter().sum::<f64>() / means.len() as f64)
}
