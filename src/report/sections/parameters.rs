//! The estimated parameters, derived quantities, and standard errors.

use super::ReportSection;
use crate::report::derived::{ElasticWork, mean_sd, overtaking_s, strain, stretch_nm};
use crate::report::figures::{self, by_condition};
use crate::report::fitted::{
    ConditionFit, Fitted, FittedTrial, IndependentFit, Optimum, SHOWN, Values, condition_name, estimated,
};
use crate::report::input::ReportInput;
use crate::report::table::{Cell, HtmlTable};
use crate::report::traces::Trace;

const NO_FIT: &str = "There is no fit yet. Run: ramphold fit SESSION";

/// The section with Fig. 5: parameters by condition, and their tables.
pub fn parameters(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("parameters", "Parameters (Fig. 5 of the paper)");
    let Some(fitted) = &input.fitted else {
        section.absent(NO_FIT);
        return section;
    };
    section.figure(figures::parameters(fitted));
    section.html += &against_paper(fitted).html();
    section.html += &by_condition_table(fitted).html();
    together_and_alone(&mut section, fitted);
    let lost: Vec<String> =
        fitted.trials.iter().filter(|trial| !trial.converged).map(|trial| trial.trial.to_string()).collect();
    if !lost.is_empty() {
        section.absent(&format!("The optimisation did not converge in trials {}.", lost.join(", ")));
    }
    section
}

/// How the fit of the session differs from that of each trial on its own, and why.
fn together_and_alone(section: &mut ReportSection, fitted: &Fitted) {
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
            "trial",
            "velocity (rad/s)",
            "torque (N m)",
            "k_srs together (N m/rad)",
            "on its own",
            "x_e together (mrad)",
            "on its own",
            "why",
        ]
        .map(String::from)
        .to_vec(),
        rows: fitted.trials.iter().filter_map(differing_row).collect(),
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
    const HALF_WIDTH_95: f64 = 1.96;
    let own = trial.independent.as_ref()?;
    let differs = |name: &str| {
        let log_ratio = libm::log(value(&trial.values, name)? / value(&own.values, name)?).abs();
        Some(log_ratio > HALF_WIDTH_95 * value(&own.se_relative, name)?)
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

fn value(values: &Values, name: &str) -> Option<f64> {
    values.get(name).copied().flatten()
}

fn against_paper(fitted: &Fitted) -> HtmlTable {
    let row = |shown: &crate::report::fitted::Shown| {
        let means = fitted.conditions.iter().filter_map(|condition| value(&condition.mean, shown.name));
        let means = figures::distinct(means.map(|mean| mean * shown.factor));
        let digits = if shown.name == "vaf" { 4 } else { 3 };
        let all = mean_sd(fitted.trials.iter().map(|trial| value(&trial.values, shown.name)));
        vec![
            Cell::text(format!("{}, {}", shown.with_unit(), shown.meaning)),
            Cell::Spread(
                all.map(|(mean, _)| mean * shown.factor),
                all.and_then(|(_, sd)| sd).map(|sd| sd * shown.factor),
            ),
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
    }
}

fn by_condition_table(fitted: &Fitted) -> HtmlTable {
    let mut head = vec!["condition".to_owned(), "n".to_owned()];
    head.extend(SHOWN.iter().map(|shown| shown.with_unit()));
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
    }
}

fn name(condition: &ConditionFit) -> String {
    condition_name(condition.condition.as_ref(), condition.velocity_rad_s, condition.torque_nm)
}

/// The section with Fig. 6: inertial and elastic torque, and elastic work.
pub fn balance(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("balance", "Inertia and elasticity (Fig. 6 of the paper)");
    let window_s = input.window_s();
    let Some(figure) = figures::balance(&input.traces, window_s) else {
        section.absent(NO_FIT);
        return section;
    };
    section.figure(figure);
    let k_srs = |trace: &Trace| trace.fit.as_ref().and_then(|fit| value(&fit.values, "k_srs_nm_per_rad"));
    let row = |own: &[Trace]| {
        let overtaking = mean_sd(own.iter().map(|trace| overtaking_s(&trace.instants, window_s)));
        let work: Vec<Option<ElasticWork>> =
            own.iter().map(|trace| ElasticWork::of(&trace.instants, window_s, k_srs(trace)?)).collect();
        let cell =
            |of: fn(&ElasticWork) -> f64| spread(mean_sd(work.iter().map(|work| work.as_ref().map(of))), 1e3);
        vec![
            Cell::text(condition_name(own[0].label.as_ref(), own[0].velocity_rad_s, own[0].torque_nm)),
            spread(overtaking, 1e3),
            cell(|work| work.taken_up_j),
            cell(|work| work.given_back_j),
            cell(ElasticWork::dissipated_j),
        ]
    };
    let table = HtmlTable {
        caption:
            "Time at which elastic torque exceeds inertial torque (paper: 23 ms), and elastic work in the window"
                .into(),
        head: [
            "condition",
            "elastic torque exceeds inertial torque at (ms)",
            "elastic work (mJ)",
            "recoverable (mJ)",
            "dissipated (mJ)",
        ]
        .map(String::from)
        .to_vec(),
        rows: by_condition(&input.traces).into_iter().map(row).collect(),
    };
    section.html += &table.html();
    section.paragraph(
        "ElasticWork taken up is the area under elastic torque against joint angle. Given back is what the short range stiffness \
         would return if the joint were unloaded at the end of the window, T²/(2 k_srs); the difference is dissipated by the \
         yield. A dash: elastic torque does not overtake within the window.",
    );
    section
}

fn spread(mean_sd: Option<(f64, Option<f64>)>, factor: f64) -> Cell {
    Cell::Spread(mean_sd.map(|(mean, _)| mean * factor), mean_sd.and_then(|(_, sd)| sd).map(|sd| sd * factor))
}

/// The section with Fig. 3: stiffness by angle, and the elastic limit as strain.
pub fn stiffness(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("stiffness", "Stiffness and strain (Fig. 3 of the paper)");
    let Some(fitted) = &input.fitted else {
        section.absent(NO_FIT);
        return section;
    };
    match figures::stiffness(&fitted.conditions) {
        Some(figure) => section.figure(figure),
        None => section.absent("No condition has k_srs, k_dec and x_e."),
    }
    let row = |condition: &ConditionFit| {
        let own: Vec<_> = fitted
            .trials
            .iter()
            .filter(|trial| match &condition.condition {
                Some(label) => trial.condition.as_ref() == Some(label),
                None => {
                    trial.velocity_rad_s == condition.velocity_rad_s && trial.torque_nm == condition.torque_nm
                }
            })
            .map(|trial| (value(&trial.values, "x_e_rad"), value(&trial.values, "x_t_s")))
            .collect();
        let speed = |(x_e, x_t): &(Option<f64>, Option<f64>)| Some(strain((*x_e)?) / (*x_t)?);
        vec![
            Cell::text(name(condition)),
            spread(mean_sd(own.iter().map(|own| own.0)), 1e3),
            spread(mean_sd(own.iter().map(|own| own.0.map(stretch_nm))), 1.0),
            spread(mean_sd(own.iter().map(|own| own.0.map(strain))), 100.0),
            spread(mean_sd(own.iter().map(speed)), 100.0),
        ]
    };
    let table = HtmlTable {
        caption: "Elastic limit as strain (the paper: 0.5 to 1.2 % L₀, 17 to 40 % L₀/s)".into(),
        head: ["condition", "x_e (mrad)", "per half-sarcomere (nm)", "strain (% L₀)", "strain rate (% L₀/s)"]
            .map(String::from)
            .to_vec(),
        rows: fitted.conditions.iter().map(row).collect(),
    };
    section.html += &table.html();
    section.paragraph(
        "Converted as in section 4.1 of the paper: 0.066 rad of wrist rotation stretch each half-sarcomere of the wrist \
         flexors by 17 ± 4 nm, and L₀ is 2.8 µm. It holds for the wrist; for another joint the columns beyond x_e mean \
         nothing.",
    );
    section
}

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
            Cell::text(shown.sign),
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
            "measured noise, median",
            "worst",
            "ratio of medians",
            "determined in",
        ]
        .map(String::from)
        .to_vec(),
        rows: estimated().iter().map(row).collect(),
    };
    section.html += &table.html();
    section.paragraph(
        "Eq. 9 of the paper counts every sample of the window as independent, and the filter leaves only some five of them \
         so; the standard errors beside it come from the covariance of the noise in each trial's own hold. A parameter \
         that ended at its bound, or that the data do not determine, has none.",
    );
    section
}
