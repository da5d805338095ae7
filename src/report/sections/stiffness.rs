//! Stiffness by angle, and the elastic limit as strain of the muscle.

use super::ReportSection;
use super::values::{NO_FIT, name, spread_of, value};
use crate::report::derived::{mean_sd, strain, stretch_nm};
use crate::report::figures;
use crate::report::fitted::ConditionFit;
use crate::report::input::ReportInput;
use crate::report::table::{Cell, HtmlTable};

/// The section with Fig. 3: stiffness by angle, and the elastic limit as strain.
pub fn stiffness(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("stiffness", "Stiffness and strain (Fig. 3 of the paper)");
    let Some(fitted) = &input.fitted else {
        section.absent(NO_FIT);
        return section;
    };
    match figures::stiffness(&fitted.conditions, &input.biases) {
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
            spread_of(mean_sd(own.iter().map(|own| own.0)), 1e3),
            spread_of(mean_sd(own.iter().map(|own| own.0.map(stretch_nm))), 1.0),
            spread_of(mean_sd(own.iter().map(|own| own.0.map(strain))), 100.0),
            spread_of(mean_sd(own.iter().map(speed)), 100.0),
        ]
    };
    let sign = input.biases.sign("x_e_rad");
    let table = HtmlTable {
        caption: "Elastic limit as strain (the paper: 0.5 to 1.2 % L₀, 17 to 40 % L₀/s)".into(),
        head: ["condition", "x_e (mrad)", "per half-sarcomere (nm)", "strain (% L₀)", "strain rate (% L₀/s)"]
            .map(|head| format!("{head}{}", if head == "condition" { "" } else { sign }))
            .to_vec(),
        rows: fitted.conditions.iter().map(row).collect(),
        note: input.biases.note(&["x_e_rad", "x_t_s"]),
    };
    section.html += &table.html();
    section.paragraph(
        "Converted as in section 4.1 of the paper: 0.066 rad of wrist rotation stretch each half-sarcomere of the wrist \
         flexors by 17 ± 4 nm, and L₀ is 2.8 µm. It holds for the wrist; for another joint the columns beyond x_e mean \
         nothing.",
    );
    section
}
