//! The paper's Fig. 6: inertial and elastic parts of the joint torque at the extremes.

use super::{by_condition, colour};
use crate::report::bias::Biases;
use crate::report::chart::{Chart, Mark, Panel, Sign, Stroke};
use crate::report::derived::{mean_sd, overtaking_s};
use crate::report::figure::Figure;
use crate::report::fitted::condition_name;
use crate::report::scale::Axis;
use crate::report::traces::Trace;
use crate::wrist::TraceSample;

/// The conditions at the extremes: lowest and highest velocity at lowest and highest torque; of labelled ones, those of
/// the lowest and highest velocity.
fn extremes(traces: &[Trace]) -> Vec<&[Trace]> {
    let conditions: Vec<&[Trace]> = by_condition(traces)
        .into_iter()
        .filter(|own| own.iter().any(|trace| !trace.instants.is_empty()))
        .collect();
    let key = |own: &[Trace]| (own[0].torque_nm, own[0].velocity_rad_s);
    let mut found: Vec<&[Trace]> = Vec::new();
    for pick_torque in [f64::min, f64::max] {
        for pick_velocity in [f64::min, f64::max] {
            let Some(torque) = conditions.iter().map(|own| key(own).0).reduce(pick_torque) else { continue };
            let own = conditions.iter().filter(|own| key(own).0 == torque);
            let Some(velocity) = own.map(|own| key(own).1).reduce(pick_velocity) else { continue };
            let hit = conditions.iter().find(|own| key(own) == (torque, velocity));
            if let Some(hit) = hit
                && !found.iter().any(|other| std::ptr::eq(*other, *hit))
            {
                found.push(hit);
            }
        }
    }
    found
}

/// Draws them.
pub fn balance(traces: &[Trace], window_s: f64, biases: &Biases) -> Option<Figure> {
    let extremes = extremes(traces);
    if extremes.is_empty() {
        return None;
    }
    let mut panels = vec![angles(&extremes, window_s)];
    panels.extend(extremes.iter().map(|own| torques(own, window_s)));
    panels.push(torque_angle(&extremes, window_s));
    Some(Figure {
        id: "fig-6-balance".into(),
        title: "Inertial and elastic torque in the joint (Fig. 6 of the paper)".into(),
        caption: format!(
            "Simulated with the fitted parameters; lines: means over repetitions, bands: 3 standard deviations. The \
                  dotted line is the moment from which the elastic torque is the greater one (the paper: 23 ms). The area \
                  under the last panel's curves is the work that the elastic element takes up. {}",
            biases.short_note(&["k_srs_nm_per_rad", "k_dec_nm_per_rad", "x_e_rad"])
        ),
        panels,
        columns: 3,
    })
}

/// Time, mean, lower and upper end of a band of three standard deviations, over the repetitions.
fn over_repetitions(
    own: &[Trace],
    window_s: f64,
    value: impl Fn(&TraceSample) -> f64,
) -> Vec<(f64, f64, f64, f64)> {
    let shortest =
        own.iter().filter(|trace| !trace.instants.is_empty()).map(|trace| trace.instants.len()).min();
    (0..shortest.unwrap_or(0))
        .filter_map(|sample| {
            let instants = own.iter().filter_map(|trace| trace.instants.get(sample));
            let time_s = instants.clone().next()?.time_s;
            let (mean, sd) = mean_sd(instants.map(|instant| Some(value(instant))))?;
            let room = 3.0 * sd.unwrap_or(0.0);
            Some((time_s * 1e3, mean, mean - room, mean + room))
        })
        .take_while(|point| point.0 <= window_s * 1e3 + 1e-9)
        .collect()
}

fn line_and_band(colour: usize, stroke: Stroke, points: &[(f64, f64, f64, f64)]) -> [Mark; 2] {
    [
        Mark::Band(colour, points.iter().map(|p| (p.0, p.2, p.3)).collect()),
        Mark::Line(colour, stroke, points.iter().map(|p| (p.0, p.1)).collect()),
    ]
}

fn name(own: &[Trace]) -> String {
    condition_name(own[0].label.as_ref(), own[0].velocity_rad_s, own[0].torque_nm)
}

fn stroke(place: usize) -> Stroke {
    if place.is_multiple_of(2) { Stroke::Solid } else { Stroke::Dashed }
}

fn angles(extremes: &[&[Trace]], window_s: f64) -> Panel {
    let (mut marks, mut legend, mut ends) = (Vec::new(), Vec::new(), vec![0.0]);
    for (place, own) in extremes.iter().enumerate() {
        let points = over_repetitions(own, window_s, |i| i.state.theta_j * 1e3);
        ends.extend(points.iter().flat_map(|p| [p.2, p.3]));
        marks.extend(line_and_band(colour(place), stroke(place), &points));
        legend.push((colour(place), Sign::Line(stroke(place)), name(own)));
    }
    let x = Axis::new("time from the onset (ms)", 0.0, window_s * 1e3);
    Chart { title: "joint angle θj".into(), x, y: Axis::around("θj (mrad)", ends), marks, legend }.panel()
}

fn torques(own: &[Trace], window_s: f64) -> Panel {
    let total = over_repetitions(own, window_s, |i| i.torques.interface);
    let elastic = over_repetitions(own, window_s, |i| i.elastic_nm);
    let inertial = over_repetitions(own, window_s, |i| i.inertial_nm);
    let ends = total.iter().chain(&elastic).chain(&inertial).flat_map(|p| [p.2, p.3]).chain([0.0]);
    let y = Axis::around("torque (N m)", ends);
    let mut marks: Vec<Mark> = Vec::new();
    marks.extend(line_and_band(0, Stroke::Solid, &total));
    marks.extend(line_and_band(2, Stroke::Dashed, &elastic));
    marks.extend(line_and_band(1, Stroke::Solid, &inertial));
    if let Some((mean, _)) = mean_sd(own.iter().map(|trace| overtaking_s(&trace.instants, window_s))) {
        marks.push(Mark::At(mean * 1e3, format!("{:.1} ms", mean * 1e3)));
    }
    Chart {
        title: name(own),
        x: Axis::new("time from the onset (ms)", 0.0, window_s * 1e3),
        y,
        marks,
        legend: vec![
            (0, Sign::Line(Stroke::Solid), "Th, their sum".into()),
            (2, Sign::Line(Stroke::Dashed), "elastic".into()),
            (1, Sign::Line(Stroke::Solid), "inertial".into()),
        ],
    }
    .panel()
}

fn torque_angle(extremes: &[&[Trace]], window_s: f64) -> Panel {
    let (mut marks, mut legend, mut xs, mut ys) = (Vec::new(), Vec::new(), vec![0.0], vec![0.0]);
    for (place, own) in extremes.iter().enumerate() {
        let angle = over_repetitions(own, window_s, |i| i.state.theta_j * 1e3);
        let torque = over_repetitions(own, window_s, |i| i.elastic_nm);
        let points: Vec<(f64, f64)> = angle.iter().zip(&torque).map(|(a, t)| (a.1, t.1)).collect();
        xs.extend(points.iter().map(|p| p.0));
        ys.extend(points.iter().map(|p| p.1));
        marks.push(Mark::Line(colour(place), stroke(place), points));
        legend.push((colour(place), Sign::Line(stroke(place)), name(own)));
    }
    Chart {
        title: "elastic torque against angle".into(),
        x: Axis::around("θj (mrad)", xs),
        y: Axis::around("elastic torque (N m)", ys),
        marks,
        legend,
    }
    .panel()
}
