//! Standard errors: those of Eq. 9, and those from the measured noise.

use super::ReportSection;
use super::values::{NO_FIT, value};
use crate::report::figures;
use crate::report::fitted::{SHOWN, Values, estimated};
use crate::report::input::ReportInput;
use crate::report::table::{Cell, HtmlTable};

/// The section on standard errors: those of Eq. 9 and those from the measured noise.
pub fn uncertainty(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("uncertainty", "Uncertainty of the parameters");
    let Some(fitted) = &input.fitted else {
        section.absent(NO_FIT);
        return section;
    };
    let row = |shown: &crate::report::fitted::Shown| {
        let of = |values: fn(&crate::report::fitted::FittedTrial) -> &Values| {
            let own = fitted.trials.iter().filter_map(|trial| value(values(trial), shown.name));
            let own = figures::distinct(own.map(|part| part * 100.0));
            (own.get(own.len() / 2).copied(), own.last().copied())
        };
        let known =
            fitted.trials.iter().filter(|trial| value(&trial.se_relative, shown.name).is_some()).count();
        let (eq9, eq9_worst) = of(|trial| &trial.sem_eq9_relative);
        let (honest, honest_worst) = of(|trial| &trial.se_relative);
        vec![
            Cell::text(format!("{}{}", shown.sign, input.biases.sign(shown.name))),
            Cell::number(eq9, 2),
            Cell::number(eq9_worst, 2),
            Cell::number(honest, 2),
            Cell::number(honest_worst, 2),
            Cell::number(honest.zip(eq9).map(|(honest, eq9)| honest / eq9), 2),
            Cell::Number(format!("{known} of {}", fitted.trials.len())),
        ]
    };
    let table = HtmlTable {
        caption: "Relative standard errors over all trials (%)".into(),
        head: [
            "parameter",
            "Eq. 9, median",
            "worst",
            if fitted.settings.calibration_sha256.is_some() { "noise and rig, median" } else { "measured noise, median" },
            "worst",
            "ratio of medians",
            "determined in",
        ]
        .map(String::from)
        .to_vec(),
        rows: estimated().iter().map(row).collect(),
        note: input.biases.note(&SHOWN.map(|shown| shown.name)).map(|_| {
            "† These errors hold for the model as fitted. They say nothing of the bias that the diagnosis found.".into()
        }),
    };
    section.html += &table.html();
    section.paragraph(
        "Eq. 9 of the paper counts every sample of the window as independent, and the filter leaves only some five of them \
         so; the standard errors beside it come from the covariance of the noise in each trial's own hold. A parameter \
         that ended at its bound, or that the data do not determine, has none.",
    );
    section
}
