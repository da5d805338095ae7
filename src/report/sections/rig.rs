//! The constants of the rig: what was measured, and what errors of assumed ones would do.

use super::ReportSection;
use super::values::{NO_FIT, value};
use crate::dataset::{RigQuantity, is_doubtful_misfit};
use crate::fit::RigConstants;
use crate::report::fitted::{Fitted, FittedTrial, Values, estimated};
use crate::report::input::ReportInput;
use crate::report::known_rig::{
    CalibrationOfFit, ConstantOfFit, KnownRig, WhatIfConstant, days_before, in_words,
};
use crate::report::scale::{p_value, significant};
use crate::report::table::{Cell, HtmlTable};
use crate::statistics::upper_median;

/// The section.
pub fn rig(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("rig", "The rig");
    let Some(fitted) = &input.fitted else {
        section.absent(NO_FIT);
        return section;
    };
    let Some(known) = &fitted.rig else {
        section.absent("An older program fitted this session and did not write what was known of the rig. Run: ramphold fit SESSION");
        return section;
    };
    match &known.calibration {
        Some(calibration) => {
            measured(&mut section, input, calibration);
            section.html += &constants(input, fitted, calibration).html();
            section.html += &parts(fitted).html();
            section.paragraph(
                "An error of a constant is common to all trials: it does not become smaller with more repetitions. The standard errors \
                 on this page contain it; profile intervals and the bootstrap do not.",
            );
        }
        None if known.lever == "rigid" => section.paragraph(
            "The session states a rigid lever, and no calibration: that both channels are right is assumed. The standard errors on this \
             page do not contain errors of the channels.",
        ),
        None => section.paragraph(
            "The constants of the lever are assumed: the session states them, and no calibration measured them. The standard errors on \
             this page do not contain their errors, nor errors of the channels.",
        ),
    }
    if !known.assumed.is_empty() {
        section.html += &assumed(known).html();
    }
    section
}

/// Where the calibration is from, when, and whether it describes its own trials.
fn measured(section: &mut ReportSection, input: &ReportInput, calibration: &CalibrationOfFit) {
    let when = calibration.measured_utc.as_deref();
    let started = input.card.about.started_utc.as_deref();
    let plural = |days: i64| if days == 1 { "day" } else { "days" };
    let age = match days_before(when, started) {
        Some(0) => "on the day of the session".to_owned(),
        Some(days) if days > 0 => format!("{days} {} before the session, not on its day", plural(days)),
        Some(days) => format!("{} {} after the session, not on its day", -days, plural(-days)),
        None => "it is not known how long before the session".to_owned(),
    };
    let when = when.map_or("at a time that it does not say".to_owned(), |when| format!("at {when}"));
    section.paragraph(&format!(
        "The constants of the rig were measured in the rig trials of {}, {when}: {age}. The fit uses the measured values.",
        calibration.session
    ));
    if let Some(p) = calibration.p_value_of_misfit.filter(|p| is_doubtful_misfit(*p)) {
        section.html += "<p class=\"verdict\"><b>The calibration does not describe its own rig trials.</b> ";
        section.html += &format!(
            "Residuals as large as theirs are improbable if the rig's model is right (p {}): its errors are larger than stated.</p>",
            p_value(p)
        );
    }
}

/// A change below this is numerical, %.
const NEGLIGIBLE_PERCENT: f64 = 1e-6;

/// The constants, with what one standard error of each does.
fn constants(input: &ReportInput, fitted: &Fitted, calibration: &CalibrationOfFit) -> HtmlTable {
    let stated = RigConstants::stated(input.session.lever);
    let number = |own: Option<f64>| Cell::number(own, 4);
    let row = |own: &ConstantOfFit| {
        let (name, unit) = in_words(&own.name);
        let percent = |parameter: &str| {
            let changes = fitted.trials.iter().filter_map(|trial| {
                value(trial.change_by_se_of_constant.get(&own.name)?, parameter).map(|change| 100.0 * change)
            });
            // What is less than rounding is nothing: an offset is taken out with the hold.
            Cell::number(
                upper_median(changes).map(|own| if own.abs() < NEGLIGIBLE_PERCENT { 0.0 } else { own }),
                2,
            )
        };
        let remark = match (&own.reason, own.value) {
            (Some(reason), None) => format!("not known: {reason}"),
            _ if !own.used => "not used: it acts on what is recorded in any case".to_owned(),
            _ => String::new(),
        };
        vec![
            Cell::text(if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") }),
            number(RigQuantity::named(&own.name).and_then(|own| stated.value(own))),
            Cell::Spread(own.value, own.se),
            percent("k_srs_nm_per_rad"),
            percent("x_e_rad"),
            Cell::text(remark),
        ]
    };
    HtmlTable {
        caption: "Constants of the rig, and the change of the estimates by one standard error of each (median over the trials)".into(),
        head: ["constant", "stated", "measured", "k_srs (%)", "x_e (%)", "remark"].map(String::from).to_vec(),
        rows: calibration.quantities.iter().map(row).collect(),
        note: None,
    }
}

/// Which part of the standard errors comes from the constants.
fn parts(fitted: &Fitted) -> HtmlTable {
    let row = |shown: &crate::report::fitted::Shown| {
        let of = |values: fn(&FittedTrial) -> &Values| {
            upper_median(
                fitted.trials.iter().filter_map(|trial| Some(100.0 * value(values(trial), shown.name)?)),
            )
        };
        let (whole, of_rig) = (of(|trial| &trial.se_relative), of(|trial| &trial.se_of_rig_relative));
        let of_noise = whole.zip(of_rig).map(|(whole, rig)| (whole * whole - rig * rig).max(0.0).sqrt());
        let share = whole.zip(of_rig).map(|(whole, rig)| 100.0 * (rig * rig) / (whole * whole));
        vec![
            Cell::text(shown.sign),
            Cell::number(of_noise, 2),
            Cell::number(of_rig, 2),
            Cell::number(whole, 2),
            Cell::number(share, 2),
        ]
    };
    HtmlTable {
        caption: "Relative standard errors of a trial by source (%, median over the trials)".into(),
        head: ["parameter", "noise", "constants of the rig", "together", "variance from the rig (%)"]
            .map(String::from)
            .to_vec(),
        rows: estimated().iter().map(row).collect(),
        note: None,
    }
}

/// What errors of assumed constants would do.
fn assumed(known: &KnownRig) -> HtmlTable {
    let error = significant(100.0 * known.assumed_error, 2);
    let row = |own: &WhatIfConstant| {
        let (name, unit) = in_words(&own.constant);
        let [k_less, k_more] = own.k_srs_percent.map(|own| Cell::number(own, 2));
        let [x_less, x_more] = own.x_e_percent.map(|own| Cell::number(own, 2));
        let assumed = format!("{} {unit}", significant(own.assumed, 4)).trim_end().to_owned();
        vec![Cell::text(name), Cell::text(assumed), k_less, k_more, x_less, x_more]
    };
    HtmlTable {
        caption: format!("If a constant that nobody measured is off by {error} %: change of the means over the trials (%)"),
        head: vec![
            "constant".into(),
            "assumed".into(),
            format!("k_srs, {error} % less"),
            format!("k_srs, {error} % more"),
            format!("x_e, {error} % less"),
            format!("x_e, {error} % more"),
        ],
        rows: known.assumed.iter().map(row).collect(),
        note: Some(
            "Each number is from a fit of this session with the constant changed. Rig trials measure the constants: ramphold calibrate.".into(),
        ),
    }
}
