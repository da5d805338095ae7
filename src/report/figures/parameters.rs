//! The paper's Fig. 5: what was estimated, against velocity by torque.

use super::{colour, distinct};
use crate::report::bias::Biases;
use crate::report::chart::{Chart, Mark, Panel, Sign};
use crate::report::figure::Figure;
use crate::report::fitted::{ConditionFit, SHOWN, Shown, Values};
use crate::report::scale::Axis;

/// Draws all quantities, of trials that were fitted `together` or each on its own.
pub fn parameters(conditions: &[ConditionFit], together: bool, biases: &Biases) -> Figure {
    let bars = if together {
        "Means over repetitions with their standard errors, of trials that were fitted together"
    } else {
        "Means and standard deviations over repetitions"
    };
    let is_determined =
        |shown: &&Shown| conditions.iter().any(|own| own.mean.get(shown.name).copied().flatten().is_some());
    let (drawn, lacking): (Vec<&Shown>, Vec<&Shown>) = SHOWN.iter().partition(is_determined);
    let lacking: Vec<&str> = lacking.iter().map(|shown| shown.sign).collect();
    let lacking = if lacking.is_empty() {
        String::new()
    } else {
        format!(" Not drawn, since no condition determines it: {}.", lacking.join(", "))
    };
    Figure {
        id: "fig-5-parameters".into(),
        title: "Parameters by velocity and torque (Fig. 5 of the paper)".into(),
        caption: format!(
            "{bars}; points of one velocity are moved apart to be seen. Grey: what de Vlugt et al. 2011 state over their eight \
             persons (k_srs 15 to 23 N m/rad, x_e 25 to 65 mrad, x_t 29.5 ± 0.8 ms, VAF 0.994 ± 0.001).{lacking} {}",
            biases.short_note(&SHOWN.map(|shown| shown.name))
        ),
        panels: drawn
            .iter()
            .map(|shown| panel(shown, conditions, together, biases.sign(shown.name)))
            .collect(),
        columns: 3,
    }
}

fn panel(shown: &Shown, conditions: &[ConditionFit], together: bool, sign: &str) -> Panel {
    let torques = distinct(conditions.iter().map(|condition| condition.torque_nm));
    let velocities = distinct(conditions.iter().map(|condition| condition.velocity_rad_s));
    let range = velocities.last().zip(velocities.first()).map_or(1.0, |(last, first)| last - first);
    let apart = if range > 0.0 { range } else { 1.0 } * 0.018;
    let mut ends = Vec::new();
    let mut marks = Vec::new();
    if let Some((low, high)) = shown.paper {
        marks.push(Mark::Reference(low, high));
        ends.extend([low, high]);
    }
    let mut legend = Vec::new();
    for (place, torque) in torques.iter().enumerate() {
        let shift = apart * (place as f64 - (torques.len() - 1) as f64 / 2.0);
        let mut points = Vec::new();
        for condition in conditions.iter().filter(|condition| condition.torque_nm == *torque) {
            let value =
                |values: &Values| values.get(shown.name).copied().flatten().map(|value| value * shown.factor);
            let Some(mean) = value(&condition.mean) else { continue };
            let spread = condition.spread(shown.name, together).map(|spread| spread * shown.factor);
            ends.extend([mean - spread.unwrap_or(0.0), mean + spread.unwrap_or(0.0)]);
            points.push((condition.velocity_rad_s + shift, mean, spread));
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        marks.push(Mark::Points(colour(place), points));
        legend.push((colour(place), Sign::Point, format!("{torque} N m")));
    }
    let x = velocities.first().copied().unwrap_or(0.0);
    Chart {
        title: format!("{}{sign}: {}", shown.sign, shown.meaning),
        x: Axis::new("velocity (rad/s)", x - 8.0 * apart, x + range + 8.0 * apart),
        y: Axis::around(&shown.with_unit(), ends),
        marks,
        legend,
    }
    .panel()
}
