//! The paper's Fig. 5 and Fig. 3 over the subjects of a study, and the means as a table.

use super::measured::measured;
use crate::report::bias::Biases;
use crate::report::figures;
use crate::report::fitted::{ConditionFit, SHOWN, Values};
use crate::report::sections::{ReportSection, spread_of};
use crate::report::table::{Cell, HtmlTable};
use crate::statistics::MeanVariance;
use crate::study::StudyResults;

/// The section.
pub fn over_subjects(study: &StudyResults) -> ReportSection {
    let mut section = ReportSection::new("means", "Means over subjects (Fig. 5 and Fig. 3 of the paper)");
    let conditions = conditions(study);
    let unbiased = Biases::default();
    let mut figure = figures::parameters(&conditions, false, &unbiased);
    figure.caption = figure.caption.replace("over repetitions", "over subjects");
    section.figure(figure);
    if let Some(figure) = figures::stiffness(&conditions, &unbiased) {
        section.figure(figure);
    }
    section.html += &table(study).html();
    section
}

/// Each condition with its means and standard deviations over subjects.
fn conditions(study: &StudyResults) -> Vec<ConditionFit> {
    let summary = &study.summary;
    let condition = |(cell, (velocity_rad_s, torque_nm)): (usize, &(f64, f64))| {
        let samples = || SHOWN.iter().zip(&summary.cells).map(|(shown, cells)| (shown.name, &cells[cell]));
        let values = |value: &dyn Fn(&MeanVariance) -> Option<f64>| -> Values {
            samples().map(|(name, sample)| (name.to_owned(), value(sample))).collect()
        };
        ConditionFit {
            condition: None,
            velocity_rad_s: *velocity_rad_s,
            torque_nm: *torque_nm,
            repetitions: samples().map(|(_, sample)| sample.count()).max().unwrap_or(0),
            mean: values(&|sample| (sample.count() > 0).then(|| sample.mean())),
            sd: values(&|sample| sample.variance().map(f64::sqrt)),
            se_relative: Values::new(),
        }
    };
    summary.grid.conditions.iter().enumerate().map(condition).collect()
}

fn table(study: &StudyResults) -> HtmlTable {
    let mut head = vec!["condition".to_owned(), "subjects".to_owned()];
    head.extend(measured(study).map(|(_, shown)| shown.with_unit()));
    let row = |(cell, condition): (usize, ConditionFit)| {
        let name = crate::report::fitted::condition_name(None, condition.velocity_rad_s, condition.torque_nm);
        let mut row = vec![Cell::text(name), Cell::Number(condition.repetitions.to_string())];
        row.extend(measured(study).map(|(quantity, shown)| {
            let sample = &study.summary.cells[quantity][cell];
            let mean = (sample.count() > 0).then(|| (sample.mean(), sample.variance().map(f64::sqrt)));
            spread_of(mean, shown.factor)
        }));
        row
    };
    HtmlTable {
        caption: "By condition: mean ± SD over subjects".into(),
        head,
        rows: conditions(study).into_iter().enumerate().map(row).collect(),
        note: None,
    }
}
