//! Power curves.

use super::colour;
use crate::report::chart::{Chart, Mark, Sign, Stroke};
use crate::report::figure::Figure;
use crate::report::scale::Axis;

/// A power curve: the share of studies that find an effect, by the number of subjects.
#[derive(Debug, Clone, PartialEq)]
pub struct PowerCurve {
    /// Its label in the legend.
    pub label: String,
    /// Number of subjects, share, and the ends of its 95 % interval.
    pub points: Vec<(f64, f64, f64, f64)>,
}

/// Draws the curves as an SVG file; `subjects` says what the numbers of subjects are.
pub fn power(title: &str, caption: &str, subjects: &str, curves: &[PowerCurve]) -> String {
    let mut marks = vec![Mark::Reference(0.795, 0.805)];
    let mut legend = Vec::new();
    for (place, curve) in curves.iter().enumerate() {
        let colour = colour(place);
        marks.push(Mark::Band(
            colour,
            curve.points.iter().map(|(x, _, low, high)| (*x, *low, *high)).collect(),
        ));
        marks.push(Mark::Line(
            colour,
            Stroke::Solid,
            curve.points.iter().map(|(x, y, _, _)| (*x, *y)).collect(),
        ));
        legend.push((colour, Sign::Line(Stroke::Solid), curve.label.clone()));
    }
    let numbers = curves.iter().flat_map(|curve| &curve.points).map(|point| point.0);
    let chart = Chart {
        title: "share of studies that find the effect".into(),
        x: Axis::from_zero(subjects, numbers),
        y: Axis::new("power", 0.0, 1.0),
        marks,
        legend,
    };
    Figure {
        id: "power".into(),
        title: title.into(),
        caption: caption.into(),
        panels: vec![chart.panel()],
        columns: 1,
    }
    .file()
}
