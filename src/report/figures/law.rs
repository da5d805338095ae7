//! An unknown law: its curve with the 95 % band, and the catalogued law at its place.

use serde_json::Value;

use crate::report::chart::{Chart, Mark, Sign, Stroke};
use crate::report::figure::Figure;
use crate::report::scale::Axis;

/// Draws the law of an entry `free_law` or `causes[].law` of `diagnosis.json`; `None` where it has no curve.
pub fn law(id: &str, title: &str, entry: &Value) -> Option<Figure> {
    let (argument_label, argument_scale) = argument(entry["argument"].as_str()?);
    let (value_label, value_scale) = value(entry["place"].as_str()?, entry["argument"].as_str()?);
    let column = |name: &str, scale: f64| -> Option<Vec<f64>> {
        entry["curve"][name].as_array()?.iter().map(|own| Some(own.as_f64()? * scale)).collect()
    };
    let at = column("at", argument_scale)?;
    let [shown, low, high] = ["value", "low", "high"].map(|name| column(name, value_scale));
    let (shown, low, high) = (shown?, low?, high?);
    let catalogued = column("catalogued", value_scale);
    let points = |values: &[f64]| at.iter().copied().zip(values.iter().copied()).collect::<Vec<_>>();
    let band = points(&low).into_iter().zip(&high).map(|((x, low), high)| (x, low, *high)).collect();
    let mut marks = vec![Mark::Band(1, band), Mark::Line(1, Stroke::Solid, points(&shown))];
    let mut legend = vec![(1, Sign::Line(Stroke::Solid), "shown by the session, with 95 % band".to_owned())];
    if let Some(catalogued) = &catalogued {
        marks.push(Mark::Line(2, Stroke::Dashed, points(catalogued)));
        legend.push((2, Sign::Line(Stroke::Dashed), "the catalogued law".to_owned()));
    }
    let all = low.iter().chain(&high).chain(catalogued.iter().flatten()).copied();
    let chart = Chart {
        title: format!("{} by {}", spoken(entry["place"].as_str()?), spoken(entry["argument"].as_str()?)),
        x: Axis::new(argument_label, *at.first()?, *at.last()?),
        y: Axis::around(value_label, all),
        marks,
        legend,
    };
    let caption = match catalogued {
        Some(_) => {
            "Solid: the law as this session shows it, without an assumed form. Dashed: as it would look if the catalogued law were right."
        }
        None => "The law that the session shows and no catalogue has.",
    };
    Some(Figure {
        id: id.into(),
        title: title.into(),
        caption: caption.into(),
        panels: vec![chart.panel()],
        columns: 1,
    })
}

fn spoken(id: &str) -> String {
    id.replace('_', " ")
}

/// Label of an axis, and the factor from SI units.
fn argument(name: &str) -> (&'static str, f64) {
    match name {
        "angle" => ("angle (mrad)", 1e3),
        "speed" => ("speed (rad/s)", 1.0),
        "angle_beyond_yield" => ("angle beyond the yield (mrad)", 1e3),
        "time" => ("time after the onset (ms)", 1e3),
        "deflection" => ("deflection (mrad)", 1e3),
        "torque" => ("torque (N m)", 1.0),
        _ => ("time back (ms)", 1e3),
    }
}

fn value(place: &str, argument: &str) -> (&'static str, f64) {
    match (place, argument) {
        (_, "past_speed") => ("torque per past speed (N m/rad)", 1.0),
        (_, "past_torque") => ("part of the past torque", 1.0),
        ("angle_channel", _) => ("angle (mrad)", 1e3),
        _ => ("torque (mN m)", 1e3),
    }
}
