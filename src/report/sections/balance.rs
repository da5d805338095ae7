//! Inertial and elastic torque, and elastic work.

use super::ReportSection;
use super::values::{NO_FIT, spread_of, value};
use crate::report::derived::{ElasticWork, mean_sd, overtaking_s};
use crate::report::figures::{self, by_condition};
use crate::report::fitted::condition_name;
use crate::report::input::ReportInput;
use crate::report::table::{Cell, HtmlTable};
use crate::report::traces::Trace;

/// The section with Fig. 6: inertial and elastic torque, and elastic work.
pub fn balance(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("balance", "Inertia and elasticity (Fig. 6 of the paper)");
    let window_s = input.window_s();
    let Some(figure) = figures::balance(&input.traces, window_s, &input.biases) else {
        section.absent(NO_FIT);
        return section;
    };
    section.figure(figure);
    let k_srs = |trace: &Trace| trace.fit.as_ref().and_then(|fit| value(&fit.values, "k_srs_nm_per_rad"));
    let row = |own: &[Trace]| {
        let overtaking = mean_sd(own.iter().map(|trace| overtaking_s(&trace.instants, window_s)));
        let work: Vec<Option<ElasticWork>> =
            own.iter().map(|trace| ElasticWork::of(&trace.instants, window_s, k_srs(trace)?)).collect();
        let cell = |of: fn(&ElasticWork) -> f64| {
            spread_of(mean_sd(work.iter().map(|work| work.as_ref().map(of))), 1e3)
        };
        vec![
            Cell::text(condition_name(own[0].label.as_ref(), own[0].velocity_rad_s, own[0].torque_nm)),
            spread_of(overtaking, 1e3),
            cell(|work| work.taken_up_j),
            cell(|work| work.given_back_j),
            cell(ElasticWork::dissipated_j),
        ]
    };
    let sign = input.biases.sign("k_srs_nm_per_rad");
    let table = HtmlTable {
        caption:
            "Time at which elastic torque exceeds inertial torque (paper: 23 ms), and elastic work in the window"
                .into(),
        head: [
            "condition".to_owned(),
            format!("elastic torque exceeds inertial torque at (ms){sign}"),
            format!("elastic work (mJ){sign}"),
            format!("recoverable (mJ){sign}"),
            format!("dissipated (mJ){sign}"),
        ]
        .to_vec(),
        rows: by_condition(&input.traces).into_iter().map(row).collect(),
        note: input.biases.note(&["k_srs_nm_per_rad", "k_dec_nm_per_rad", "x_e_rad"]),
    };
    section.html += &table.html();
    section.paragraph(
        "Elastic work is the area under elastic torque against joint angle. The recoverable part is what the short range stiffness \
         would return if the joint were unloaded at the end of the window, T²/(2 k_srs); the difference is dissipated by the \
         yield. A dash: elastic torque does not overtake within the window.",
    );
    section
}
