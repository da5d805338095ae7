//! The estimated parameters by condition, and what differs when trials are fitted on their own.

use super::ReportSection;
use super::values::{NO_FIT, name, spread_of, value};
use crate::report::bias::Biases;
use crate::report::derived::mean_sd;
use crate::report::figures;
use crate::report::fitted::{ConditionFit, Fitted, FittedTrial, IndependentFit, Optimum, SHOWN, Values};
use crate::report::input::ReportInput;
use crate::report::table::{Cell, HtmlTable};
use crate::statistics::HALF_INTERVAL_95;

/// The section with Fig. 5: parameters by condition, and their tables.
pub fn parameters(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("parameters", "Parameters (Fig. 5 of the paper)");
    let Some(fitted) = &input.fitted else {
        section.absent(NO_FIT);
        return section;
    };
    let biases = &input.biases;
    section.figure(figures::parameters(&fitted.conditions, fitted.is_together(), biases));
    section.html += &against_paper(fitted, biases).html();
    section.html += &by_condition_table(fitted, biases).html();
    together_and_alone(&mut section, fitted, biases);
    let lost: Vec<String> =
        fitted.trials.iter().filter(|trial| !trial.converged).map(|trial| trial.trial.to_string()).collect();
    if !lost.is_empty() {
        section.absent(&format!("The optimisation did not converge in trials {}.", lost.join(", ")));
    }
    section
}

/// How the fit of the session differs from that of each trial on its own, and why.
fn together_and_alone(section: &mut ReportSection, fitted: &Fitted, biases: &Biases) {
    match &fitted.session_model {
        Some(model) if model.used => {}
        Some(model) => {
            let reason = model.reason.as_deref().unwrap_or("no reason is given");
            section.paragraph(&format!("Each trial was fitted on its own: {reason}."));
            return;
        }
        None => return,
    }
    section.paragraph(
        "All trials were fitted together: the parameters of each vary around a regression on velocity and torque. The table lists the trials \
         whose fit on their own, as in the paper, differs by more than its own 95 % interval, or has another optimum within the \
         noise: two places of the yield explain these 40 ms, and the other trials tell which one.",
    );
    let table = HtmlTable {
        caption: "Trials that differ when they are fitted on their own".into(),
        head: [
            "trial".to_owned(),
            "velocity (rad/s)".to_owned(),
            "torque (N m)".to_owned(),
            format!("k_srs together (N m/rad){}", biases.sign("k_srs_nm_per_rad")),
            format!("k_srs on its own{}", biases.sign("k_srs_nm_per_rad")),
            format!("x_e together (mrad){}", biases.sign("x_e_rad")),
            format!("x_e on its own{}", biases.sign("x_e_rad")),
            "why".to_owned(),
        ]
        .to_vec(),
        rows: fitted.trials.iter().filter_map(differing_row).collect(),
        note: biases.note(&["k_srs_nm_per_rad", "x_e_rad"]),
    };
    if table.rows.is_empty() {
        section.paragraph("No trial differs.");
    } else {
        section.html += &table.html();
    }
}

/// The other optima that a trial has on its own, in words.
fn other_optima(own: &IndependentFit) -> String {
    let in_words = |optimum: &Optimum| {
        let x_e = value(&optimum.values, "x_e_rad").map_or(f64::NAN, |x_e| 1e3 * x_e);
        format!("x_e {x_e:.1} mrad as well ({:.0} %)", 100.0 * optimum.probability)
    };
    own.other_optima.iter().map(in_words).collect::<Vec<_>>().join(", ")
}

/// A row for a trial whose two fits differ.
fn differing_row(trial: &FittedTrial) -> Option<Vec<Cell>> {
    let own = trial.independent.as_ref()?;
    let differs = |name: &str| {
        let log_ratio = libm::log(value(&trial.values, name)? / value(&own.values, name)?).abs();
        Some(log_ratio > HALF_INTERVAL_95 * value(&own.se_relative, name)?)
    };
    let is_beyond = ["k_srs_nm_per_rad", "k_dec_nm_per_rad", "x_e_rad"]
        .into_iter()
        .any(|name| differs(name) == Some(true));
    let why = match (is_beyond, own.other_optima.len()) {
        (false, 0) => return None,
        (true, 0) => "beyond its own interval".to_owned(),
        (_, _) => other_optima(own),
    };
    let cell = |values: &Values, name: &str, factor: f64| {
        Cell::number(value(values, name).map(|own| own * factor), 3)
    };
    Some(vec![
        Cell::Number(trial.trial.to_string()),
        Cell::number(Some(trial.velocity_rad_s), 3),
        Cell::number(Some(trial.torque_nm), 3),
        cell(&trial.values, "k_srs_nm_per_rad", 1.0),
        cell(&own.values, "k_srs_nm_per_rad", 1.0),
        cell(&trial.values, "x_e_rad", 1e3),
        cell(&own.values, "x_e_rad", 1e3),
        Cell::text(why),
    ])
}

fn against_paper(fitted: &Fitted, biases: &Biases) -> HtmlTable {
    let row = |shown: &crate::report::fitted::Shown| {
        let means = fitted.conditions.iter().filter_map(|condition| value(&condition.mean, shown.name));
        let means = figures::distinct(means.map(|mean| mean * shown.factor));
        let digits = if shown.name == "vaf" { 4 } else { 3 };
        let all = mean_sd(fitted.trials.iter().map(|trial| trial.determined(shown.name)));
        vec![
            Cell::text(format!("{}{}, {}", shown.with_unit(), biases.sign(shown.name), shown.meaning)),
            spread_of(all, shown.factor),
            Cell::number(means.first().copied(), digits),
            Cell::number(means.last().copied(), digits),
            Cell::text(shown.paper_says),
        ]
    };
    HtmlTable {
        caption: "This session and the paper".into(),
        head: ["quantity", "all trials", "lowest condition", "highest condition", "the paper"]
            .map(String::from)
            .to_vec(),
        rows: SHOWN.iter().map(row).collect(),
        note: biases.note(&SHOWN.map(|shown| shown.name)),
    }
}

fn by_condition_table(fitted: &Fitted, biases: &Biases) -> HtmlTable {
    let mut head = vec!["condition".to_owned(), "n".to_owned()];
    head.extend(SHOWN.iter().map(|shown| format!("{}{}", shown.with_unit(), biases.sign(shown.name))));
    let row = |condition: &ConditionFit| {
        let mut row = vec![Cell::text(name(condition)), Cell::Number(condition.repetitions.to_string())];
        row.extend(SHOWN.iter().map(|shown| {
            let of = |values: &Values| value(values, shown.name).map(|value| value * shown.factor);
            let spread =
                condition.spread(shown.name, fitted.is_together()).map(|spread| spread * shown.factor);
            Cell::Spread(of(&condition.mean), spread)
        }));
        row
    };
    HtmlTable {
        caption: if fitted.is_together() {
            "By condition: mean over repetitions ± its standard error".into()
        } else {
            "By condition: mean ± SD over repetitions".into()
        },
        head,
        rows: fitted.conditions.iter().map(row).collect(),
        note: biases.note(&SHOWN.map(|shown| shown.name)),
    }
}
