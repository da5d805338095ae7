//! The residual map: residuals by time and condition.

use std::fmt::Write;

use serde_json::Value;

use super::by_condition;
use crate::files::limits;
use crate::report::chart::{HEIGHT, Panel, WIDTH};
use crate::report::derived::mean_sd;
use crate::report::figure::Figure;
use crate::report::fitted::condition_name;
use crate::report::scale::{Axis, escape, significant};
use crate::report::traces::Trace;

/// Mean residuals by condition.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ResidualMap {
    /// Times from the onset, s.
    pub time_s: Vec<f64>,
    /// Names of the conditions.
    pub names: Vec<String>,
    /// With the model as fitted, N m, by condition.
    pub before_nm: Vec<Vec<f64>>,
    /// With the causes in the model; `None` where there are none.
    pub after_nm: Vec<Option<Vec<f64>>>,
}

impl ResidualMap {
    /// From the fit alone.
    pub fn of_fit(traces: &[Trace]) -> Self {
        let mut map = Self::default();
        for own in by_condition(traces) {
            let samples = own.iter().map(|trace| trace.residual_nm.len()).min().unwrap_or(0);
            if samples == 0 {
                continue;
            }
            map.time_s = own[0].fitted_nm.iter().take(samples).map(|(time_s, _)| *time_s).collect();
            map.names.push(condition_name(own[0].label.as_ref(), own[0].velocity_rad_s, own[0].torque_nm));
            let mean = |i: usize| {
                mean_sd(own.iter().map(|trace| Some(trace.residual_nm[i]))).map_or(f64::NAN, |m| m.0)
            };
            map.before_nm.push((0..samples).map(mean).collect());
            map.after_nm.push(None);
        }
        map
    }

    /// From the block `residual_map` of a diagnosis; what is wrong with it if it cannot be drawn.
    pub fn of_diagnosis(block: &Value) -> Result<Self, String> {
        let numbers =
            |value: &Value| -> Option<Vec<f64>> { value.as_array()?.iter().map(Value::as_f64).collect() };
        let mut map = Self {
            time_s: numbers(&block["time_s"]).ok_or("time_s is not a list of numbers")?,
            ..Self::default()
        };
        let conditions = block["conditions"].as_array().ok_or("conditions is not a list")?;
        let [most_conditions, most_samples] = limits::RESIDUAL_MAP;
        if conditions.len() > most_conditions || map.time_s.len() > most_samples {
            return Err(format!("more than {most_conditions} conditions or {most_samples} samples"));
        }
        for (index, condition) in conditions.iter().enumerate() {
            let row = |name: &str| -> Result<Vec<f64>, String> {
                let row = numbers(&condition[name])
                    .ok_or_else(|| format!("conditions[{index}].{name} is not a list of numbers"))?;
                let (found, expected) = (row.len(), map.time_s.len());
                (found == expected).then_some(row).ok_or_else(|| {
                    format!("conditions[{index}].{name} has {found} values, time_s has {expected}")
                })
            };
            let before = row("mean_nm")?;
            let after = if condition["after_nm"].is_null() { None } else { Some(row("after_nm")?) };
            let label = condition["condition"].as_str().map(str::to_owned);
            let number = |name: &str| condition[name].as_f64().unwrap_or(f64::NAN);
            map.names.push(condition_name(label.as_ref(), number("velocity_rad_s"), number("torque_nm")));
            map.before_nm.push(before);
            map.after_nm.push(after);
        }
        Ok(map)
    }

    /// The map of the model as fitted alone.
    pub fn without_causes(self) -> Self {
        Self { after_nm: vec![None; self.before_nm.len()], ..self }
    }

    fn largest(&self) -> f64 {
        let after = self.after_nm.iter().flatten();
        self.before_nm.iter().chain(after).flatten().fold(0.0, |most, value| f64::max(most, value.abs()))
    }
}

/// Draws the map of the model as fitted and, where there are causes, of the model with these.
pub fn residual_map(map: &ResidualMap) -> Option<Figure> {
    if map.before_nm.is_empty() {
        return None;
    }
    let largest = map.largest();
    let mut panels = vec![panel("the model as fitted", map, &map.before_nm, largest)];
    let after: Option<Vec<Vec<f64>>> = map.after_nm.iter().cloned().collect();
    let what = match after {
        Some(after) => {
            panels.push(panel("with the causes in the model", map, &after, largest));
            "with the model as fitted, and with the causes that the diagnosis names"
        }
        None => "with the model as fitted",
    };
    Some(Figure {
        id: "residual-map".into(),
        title: "Residual map".into(),
        caption: format!(
            "Measured less fitted torque, mean over repetitions, {what}. Blue: measured less than fitted; orange: more. \
             Full colour is {} mN m.",
            significant(largest * 1e3, 2)
        ),
        columns: panels.len(),
        panels,
    })
}

/// Most columns that are drawn; of finer maps, neighbours share one.
const COLUMNS: usize = 64;

fn panel(title: &str, map: &ResidualMap, rows: &[Vec<f64>], largest: f64) -> Panel {
    const TOP: f64 = 30.0;
    const BOTTOM: f64 = 44.0;
    let longest = map.names.iter().map(|name| name.chars().count()).max().unwrap_or(0) as f64;
    let left = (8.0 + 5.9 * longest).min(170.0);
    let (width, height) = (WIDTH - left - 14.0, HEIGHT - TOP - BOTTOM);
    let row_height = height / rows.len() as f64;
    let samples = map.time_s.len();
    let stride = samples.div_ceil(COLUMNS).max(1);
    let columns = samples.div_ceil(stride);
    let cell = width / columns.max(1) as f64;
    let mut svg = format!("<text class=\"title\" x=\"8\" y=\"17\">{}</text>", escape(title));
    for (index, (row, name)) in rows.iter().zip(&map.names).enumerate() {
        let y = TOP + row_height * index as f64;
        for (column, values) in row.chunks(stride).enumerate() {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let part = if largest > 0.0 { mean.abs() / largest } else { 0.0 };
            let colour = if mean < 0.0 { 1 } else { 2 };
            if part < 0.02 {
                continue;
            }
            let _ = write!(
                svg,
                "<rect class=\"cell c{colour}\" x=\"{:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill-opacity=\"{part:.2}\"/>",
                left + cell * column as f64,
                cell + 0.1,
                (row_height - 1.0).max(0.5)
            );
        }
        // With many conditions, only as many names as there is room for.
        if index % (11.0 / row_height).ceil().max(1.0) as usize == 0 {
            let y = y + row_height / 2.0 + 3.5;
            let _ = write!(
                svg,
                "<text class=\"tick\" text-anchor=\"end\" x=\"{:.1}\" y=\"{y:.1}\">{}</text>",
                left - 5.0,
                escape(&name.chars().take(27).collect::<String>())
            );
        }
    }
    let last_ms = map.time_s.last().map_or(1.0, |time_s| time_s * 1e3);
    let axis = Axis::new("time from the onset (ms)", map.time_s.first().map_or(0.0, |t| t * 1e3), last_ms);
    let bottom = TOP + height;
    for tick in axis.ticks() {
        let x = left + width * axis.place(tick);
        let (label, y) = (axis.tick_label(tick), bottom + 15.0);
        let _ = write!(
            svg,
            "<text class=\"tick\" text-anchor=\"middle\" x=\"{x:.1}\" y=\"{y:.1}\">{label}</text>"
        );
    }
    let _ = write!(
        svg,
        "<path class=\"frame\" d=\"M{left:.1} {TOP}V{bottom:.1}h{width:.1}\"/>\
         <text class=\"axis\" text-anchor=\"middle\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
        left + width / 2.0,
        HEIGHT - 8.0,
        axis.label
    );
    Panel { label: format!("residual torque by time and condition, {title}"), svg }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_block_that_does_not_fit_together_is_said_and_not_drawn() {
        let block = json!({ "time_s": [0.0, 0.001], "conditions": [{ "mean_nm": [0.1], "after_nm": null }] });
        let message = ResidualMap::of_diagnosis(&block).unwrap_err();
        assert_eq!(message, "conditions[0].mean_nm has 1 values, time_s has 2");
        assert!(ResidualMap::of_diagnosis(&json!({})).is_err());
    }

    #[test]
    fn both_maps_are_drawn_on_one_scale() {
        let block = json!({ "time_s": [0.0, 0.001], "conditions": [
            { "velocity_rad_s": 1.3, "torque_nm": 0.9, "mean_nm": [0.0, -0.2], "after_nm": [0.05, 0.0] }] });
        let figure = residual_map(&ResidualMap::of_diagnosis(&block).unwrap()).unwrap();
        assert_eq!(figure.panels.len(), 2);
        assert!(
            figure.panels[0].svg.contains("c1") && figure.panels[0].svg.contains("fill-opacity=\"1.00\"")
        );
        assert!(
            figure.panels[1].svg.contains("c2") && figure.panels[1].svg.contains("fill-opacity=\"0.25\"")
        );
    }
}
