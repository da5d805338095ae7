//! Two fits of a session beside each other.

use super::ReportSection;
use crate::report::fitted::{ConditionFit, Fitted, SHOWN, condition_name};
use crate::report::input::ReportInput;
use crate::report::scale::{escape, milliseconds};
use crate::report::table::{Cell, HtmlTable};

/// Quantities that are compared, by their place in [`SHOWN`].
const COMPARED: [usize; 5] = [3, 4, 5, 7, 8];

/// The section; empty without a second fit.
pub fn comparison(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("comparison", "Two fits beside each other");
    let Some((name, other)) = &input.beside else { return section };
    let Some(own) = &input.fitted else {
        section.absent("There is no fit to compare with. Run: ramphold fit SESSION");
        return section;
    };
    section.html += &format!(
        "<p>This fit: {}. The other, {}: {}.</p>",
        escape(&settings(own)),
        escape(name),
        escape(&settings(other))
    );
    let head = ["condition", "quantity", "this fit", "the other", "difference"].map(String::from).to_vec();
    let rows = own.conditions.iter().flat_map(|condition| rows(condition, other)).collect();
    section.html += &HtmlTable { caption: "Means by condition".into(), head, rows, note: None }.html();
    section
}

/// The settings of a fit in words.
fn settings(fitted: &Fitted) -> String {
    format!(
        "window {} ms, weighting {}, {}",
        milliseconds(fitted.settings.window_s),
        fitted.settings.weighting.replace('_', " "),
        if fitted.is_together() { "all trials together" } else { "each trial on its own" }
    )
}

fn rows(own: &ConditionFit, other: &Fitted) -> Vec<Vec<Cell>> {
    let name = |fit: &ConditionFit| condition_name(fit.condition.as_ref(), fit.velocity_rad_s, fit.torque_nm);
    let Some(other) = other.conditions.iter().find(|other| name(other) == name(own)) else {
        return Vec::new();
    };
    COMPARED
        .iter()
        .map(|place| {
            let shown = &SHOWN[*place];
            let value =
                |fit: &ConditionFit| fit.mean.get(shown.name).copied().flatten().map(|x| x * shown.factor);
            let (a, b) = (value(own), value(other));
            vec![
                Cell::text(name(own)),
                Cell::text(shown.with_unit()),
                Cell::number(a, 4),
                Cell::number(b, 4),
                Cell::number(a.zip(b).map(|(a, b)| b - a), 3),
            ]
        })
        .collect()
}
