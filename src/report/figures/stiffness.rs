//! The paper's Fig. 3 with the fitted values: joint stiffness against joint angle.

use super::{colour, distinct};
use crate::report::bias::Biases;
use crate::report::chart::{Chart, Mark, Panel, Sign, Stroke};
use crate::report::figure::Figure;
use crate::report::fitted::{ConditionFit, condition_name};
use crate::report::scale::Axis;
use crate::wrist::YIELD_SMOOTHNESS_PER_NM;

/// A condition's k_srs and k_dec in N m/rad, and x_e in rad.
fn spring(condition: &ConditionFit) -> Option<[f64; 3]> {
    let mean = |name: &str| condition.mean.get(name).copied().flatten();
    Some([mean("k_srs_nm_per_rad")?, mean("k_dec_nm_per_rad")?, mean("x_e_rad")?])
}

/// The slope of Eq. 2: k_srs, less k_dec once the angle is beyond x_e.
fn slope([k_srs, k_dec, x_e]: [f64; 3], theta_rad: f64) -> f64 {
    k_srs - k_dec / (1.0 + libm::exp(-YIELD_SMOOTHNESS_PER_NM * k_dec * (theta_rad - x_e)))
}

/// Draws a panel for each torque.
pub fn stiffness(conditions: &[ConditionFit], biases: &Biases) -> Option<Figure> {
    let torques = distinct(conditions.iter().map(|condition| condition.torque_nm));
    let springs = || conditions.iter().filter_map(spring);
    let reach_rad = springs().map(|own| own[2]).reduce(f64::max)? * 1.5;
    let highest = springs().map(|own| own[0]).reduce(f64::max)?;
    let lowest = springs().map(|own| own[0] - own[1]).reduce(f64::min)?.min(0.0);
    let panel = |torque: &f64| -> Panel {
        let (mut marks, mut legend) = (Vec::new(), Vec::new());
        let own = conditions.iter().filter(|condition| condition.torque_nm == *torque);
        for (place, condition) in own.enumerate() {
            let Some(spring) = spring(condition) else { continue };
            let points = (0..=160).map(|step| f64::from(step) / 160.0 * reach_rad);
            let points = points.map(|theta| (theta * 1e3, slope(spring, theta))).collect();
            let stroke = if place % 2 == 0 { Stroke::Solid } else { Stroke::Dashed };
            marks.push(Mark::Line(colour(place), stroke, points));
            let name = match &condition.condition {
                Some(_) => condition_name(condition.condition.as_ref(), 0.0, 0.0),
                None => format!("{} rad/s", condition.velocity_rad_s),
            };
            legend.push((colour(place), Sign::Line(stroke), name));
        }
        Chart {
            title: format!("target torque {torque} N m"),
            x: Axis::new("θj (mrad)", 0.0, reach_rad * 1e3),
            y: Axis::around("stiffness (N m/rad)", [lowest, highest]),
            marks,
            legend,
        }
        .panel()
    };
    Some(Figure {
        id: "fig-3-stiffness".into(),
        title: "Stiffness profile (Fig. 3 of the paper)".into(),
        caption: format!(
            "Slope of Eq. 2 with the mean parameters of each condition: k_srs up to the elastic limit x_e, k_after = k_srs − k_dec \
             beyond it. {}",
            biases.short_note(&["k_srs_nm_per_rad", "k_dec_nm_per_rad", "x_e_rad"])
        ),
        panels: torques.iter().map(panel).collect(),
        columns: torques.len().min(3),
    })
}
