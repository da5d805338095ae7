//! The torque at rest before each trial, and how far it drifted.

use super::ReportSection;
use crate::report::figures;
use crate::report::input::ReportInput;
use crate::report::rest_torque::{RestTorque, drift_nm, rest_torques};
use crate::report::table::{Cell, HtmlTable};

/// The section; `None` if no record begins at rest.
pub fn torque_at_rest(input: &ReportInput) -> Option<ReportSection> {
    let rests = rest_torques(&input.session, input.times.as_ref());
    rests.first()?;
    let mut section = ReportSection::new("rest", "Torque at rest");
    section.figure(figures::torque_at_rest(&rests));
    section.html += &table(&rests).html();
    if let Some(drift_nm) = drift_nm(&rests) {
        let drift = format!(
            "From the first third of the trials to the last, the torque at rest drifts by {drift_nm:.3} N m (medians)."
        );
        let targets =
            input.session.trials.iter().map(|trial| trial.torque_nm.abs()).filter(|torque| *torque > 0.0);
        let smallest_nm = targets.fold(f64::INFINITY, f64::min);
        let band_nm = input.protocol.as_ref().map(|protocol| protocol.gate.band_fraction * smallest_nm);
        match band_nm.filter(|band_nm| band_nm.is_finite()) {
            Some(band_nm) if drift_nm.abs() > band_nm => section.absent(&format!(
                "{drift} That is more than the gate lets the torque be off its smallest target, {band_nm:.3} N m: the subjects held another \
                 torque at the end than at the beginning. Let the sensor warm up, and measure the offset again."
            )),
            Some(band_nm) => section.paragraph(&format!(
                "{drift} The gate lets the torque be off its smallest target by {band_nm:.3} N m."
            )),
            None => section.paragraph(&drift),
        }
    }
    section.paragraph(
        "The offset that the gate takes off the torque is that measured once, at the beginning of the session (torque_offset_nm in trials.csv). \
         Neither it nor the torque shown here changes a number of the fit.",
    );
    Some(section)
}

/// The torque at rest, trial by trial.
fn table(rests: &[RestTorque]) -> HtmlTable {
    let row = |rest: &RestTorque| {
        vec![Cell::Number(rest.trial.to_string()), Cell::Spread(Some(rest.mean_nm), Some(rest.sd_nm))]
    };
    HtmlTable {
        caption: "Torque at rest by trial".into(),
        head: ["trial", "torque (N m), mean ± SD of the samples"].map(String::from).to_vec(),
        rows: rests.iter().map(row).collect(),
        note: None,
    }
}
