//! Effect of a mechanism on the torque.

use crate::report::chart::{COLOURS, Chart, Mark, Sign, Stroke};
use crate::report::figure::Figure;
use crate::report::scale::Axis;

/// Change of the torque in one condition.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectCurve {
    /// Name of the condition.
    pub label: String,
    /// Time after the onset, ms, and change of the torque, mN m.
    pub points: Vec<(f64, f64)>,
}

/// SVG file with the change of the torque by a mechanism: as it is, and after the free parameters have followed.
pub fn mechanism(id: &str, change: &[EffectCurve], residual: &[EffectCurve]) -> String {
    let panels = [("change of the torque", change), ("after the free parameters have followed", residual)];
    Figure {
        id: id.into(),
        title: id.into(),
        caption: "Change of the torque, with all other parameters fixed and after the free parameters have followed.".into(),
        panels: panels.map(|(title, curves)| chart(title, curves).panel()).into(),
        columns: 2,
    }
    .file()
}

fn chart(title: &str, curves: &[EffectCurve]) -> Chart {
    let values = curves.iter().flat_map(|curve| &curve.points).map(|point| point.1);
    let highest = values.fold(0.0, |highest: f64, value| highest.max(value.abs()));
    // What remains of an effect that the parameters absorb is rounding: it is drawn as nothing.
    let highest = highest.max(0.01);
    let mut chart = Chart {
        title: title.into(),
        x: Axis::new("time after the onset (ms)", 0.0, 40.0),
        y: Axis::around("torque (mN m)", [-highest, highest]),
        marks: Vec::new(),
        legend: Vec::new(),
    };
    for (place, curve) in curves.iter().enumerate() {
        let colour = 1 + place % COLOURS;
        chart.marks.push(Mark::Line(colour, Stroke::Solid, curve.points.clone()));
        chart.legend.push((colour, Sign::Line(Stroke::Solid), curve.label.clone()));
    }
    chart
}
