//! Power against the number of persons.

use super::colour;
use crate::report::chart::{Chart, Mark, Sign, Stroke};
use crate::report::figure::Figure;
use crate::report::scale::Axis;

/// A curve: how often studies of a size find an effect.
#[derive(Debug, Clone, PartialEq)]
pub struct PowerCurve {
    /// What tells it from the others.
    pub label: String,
    /// Persons, share, and the ends of its interval.
    pub points: Vec<(f64, f64, f64, f64)>,
}

/// The curves as an SVG file.
pub fn power(title: &str, caption: &str, curves: &[PowerCurve]) -> String {
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
    let persons = curves.iter().flat_map(|curve| &curve.points).map(|point| point.0);
    let chart = Chart {
        title: "share of studies that find it".into(),
        x: Axis::around("persons", persons.chain([0.0])),
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
