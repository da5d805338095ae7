//! The paper's Fig. 4: a recording and its fit, at both time scales.

use crate::report::bias::Biases;
use crate::report::chart::{Chart, Mark, Panel, Sign, Stroke};
use crate::report::emg::TrialEmg;
use crate::report::figure::Figure;
use crate::report::fitted::condition_name;
use crate::report::scale::{Axis, milliseconds};
use crate::report::traces::{FurtherTrace, Trace};
use crate::wrist::FurtherChannel;

/// Draws one trial.
pub fn trial(trace: &Trace, window_s: f64, biases: &Biases) -> Figure {
    let name = condition_name(trace.label.as_ref(), trace.velocity_rad_s, trace.torque_nm);
    let vaf = trace.fit.as_ref().and_then(|fit| fit.values.get("vaf").copied().flatten());
    let remarks: String =
        trace.fit.iter().flat_map(|fit| &fit.remarks).map(|remark| format!(" Remark: {remark}.")).collect();
    let mirrored =
        if trace.velocity_rad_s < 0.0 { " C and D are mirrored, so that the ramp is positive." } else { "" };
    let fitted = match (trace.instants.is_empty(), vaf) {
        (true, _) => "There is no fit to compare with.".to_owned(),
        (_, Some(vaf)) => format!("Variance accounted for: {vaf:.5}."),
        _ => String::new(),
    };
    let responses = match trace.emg.as_ref().map(|emg| (emg.onset_s, emg.shows_onsets)) {
        Some((Some(onset_s), _)) => {
            format!(" E: rectified EMG; the stretched muscle responds after {} ms.", milliseconds(onset_s))
        }
        Some((None, false)) => {
            " E: rectified EMG; it has too few samples a second to show when a response begins.".to_owned()
        }
        Some((None, true)) => " E: rectified EMG; no response of the stretched muscle stands out.".to_owned(),
        None => String::new(),
    };
    let further = match trace.further.as_slice() {
        [] => "",
        _ => " Last: the further channels of the session, filtered as the torque, as a change from the hold.",
    };
    let biased = format!(" {}", biases.short_note(&["x_t_s"]));
    Figure {
        id: format!("trial-{:03}", trace.number),
        title: format!("Trial {}: {name}, repetition {}", trace.number, trace.repetition),
        caption: format!(
            "A, B: motor angle and filtered torque as recorded; the shaded area is the analysed window of {} ms. C, D: the same \
             stretch as a change from the hold, with what the fitted wrist does.{mirrored}{responses}{further} {fitted}{remarks}{biased}",
            milliseconds(window_s)
        ),
        panels: [
            whole(trace, window_s, "A  angle", "motor angle (mrad)", |p| p.1 * 1e3),
            whole(trace, window_s, "B  torque", "torque (N m)", |p| p.2),
            angles(trace, window_s, biases),
            torques(trace, window_s),
        ]
        .into_iter()
        .chain(trace.emg.as_ref().map(|own| emg(own, window_s)))
        .chain(trace.further.iter().enumerate().map(|(place, own)| {
            further_channel(own, LETTERS[place + usize::from(trace.emg.is_some())], window_s)
        }))
        .collect(),
        columns: 2,
    }
}

fn whole(
    trace: &Trace,
    window_s: f64,
    title: &str,
    unit: &str,
    value: impl Fn(&(f64, f64, f64)) -> f64,
) -> Panel {
    let points: Vec<(f64, f64)> = trace.whole.iter().map(|p| (p.0 * 1e3, value(p))).collect();
    let (first, last) = (points.first().map_or(0.0, |p| p.0), points.last().map_or(1.0, |p| p.0));
    Chart {
        title: title.into(),
        x: Axis::new("time from the onset (ms)", first, last),
        y: Axis::around(unit, points.iter().map(|p| p.1)),
        marks: vec![Mark::Window(0.0, window_s * 1e3), Mark::Line(0, Stroke::Solid, points)],
        legend: Vec::new(),
    }
    .panel()
}

fn near_axis(trace: &Trace, window_s: f64) -> Axis {
    let first = trace.near.first().map_or(-0.25 * window_s, |p| p.0);
    Axis::new("time from the onset (ms)", first * 1e3, 1.3 * window_s * 1e3)
}

fn angles(trace: &Trace, window_s: f64, biases: &Biases) -> Panel {
    let motor: Vec<_> = trace.near.iter().map(|p| (p.0 * 1e3, p.1 * 1e3)).collect();
    let of = |angle: fn(&crate::wrist::TraceSample) -> f64| -> Vec<(f64, f64)> {
        trace.instants.iter().map(|i| (i.time_s * 1e3, angle(i) * 1e3)).collect()
    };
    let (handle, joint) = (of(|i| i.state.theta_l), of(|i| i.state.theta_j));
    let mut legend = vec![(0, Sign::Line(Stroke::Solid), "θm motor".to_owned())];
    let mut marks = vec![Mark::Window(0.0, window_s * 1e3), Mark::Line(0, Stroke::Solid, motor.clone())];
    if !trace.instants.is_empty() {
        // A rigid lever has no angle of its own.
        if handle.iter().any(|p| p.1 != 0.0) {
            marks.push(Mark::Line(2, Stroke::Dashed, handle));
            legend.push((2, Sign::Line(Stroke::Dashed), "θl lever".into()));
        }
        marks.push(Mark::Line(1, Stroke::Solid, joint.clone()));
        legend.push((1, Sign::Line(Stroke::Solid), "θj joint".into()));
        if let Some(x_t) = trace.fit.as_ref().and_then(|fit| fit.values.get("x_t_s").copied().flatten()) {
            marks.push(Mark::At(x_t * 1e3, format!("x_t {:.1} ms{}", x_t * 1e3, biases.sign("x_t_s"))));
        }
    }
    Chart {
        title: "C  angles".into(),
        x: near_axis(trace, window_s),
        y: Axis::around("change of angle (mrad)", motor.iter().chain(&joint).map(|p| p.1)),
        marks,
        legend,
    }
    .panel()
}

fn torques(trace: &Trace, window_s: f64) -> Panel {
    let measured: Vec<_> = trace.near.iter().map(|p| (p.0 * 1e3, p.2)).collect();
    let fitted: Vec<_> = trace.fitted_nm.iter().map(|(t, torque)| (t * 1e3, *torque)).collect();
    let hand: Vec<_> = trace.instants.iter().map(|i| (i.time_s * 1e3, i.torques.interface)).collect();
    let rest = trace.residual_nm.iter().zip(&fitted).map(|(residual, (t, _))| (*t, *residual)).collect();
    let mut legend = vec![(0, Sign::Line(Stroke::Solid), "measured".to_owned())];
    let mut marks = vec![Mark::Window(0.0, window_s * 1e3), Mark::Line(0, Stroke::Solid, measured.clone())];
    if !fitted.is_empty() {
        marks.push(Mark::Line(2, Stroke::Dashed, fitted.clone()));
        marks.push(Mark::Line(3, Stroke::Thin, hand.clone()));
        marks.push(Mark::Line(1, Stroke::Thin, rest));
        legend.push((2, Sign::Line(Stroke::Dashed), "fitted".into()));
        legend.push((3, Sign::Line(Stroke::Thin), "Th, unfiltered".into()));
        legend.push((1, Sign::Line(Stroke::Thin), "residual".into()));
    }
    let values = measured.iter().chain(&fitted).chain(&hand).map(|p| p.1);
    Chart {
        title: "D  torques".into(),
        x: near_axis(trace, window_s),
        y: Axis::around("change of torque (N m)", values.chain([0.0])),
        marks,
        legend,
    }
    .panel()
}

/// Letters of the panels after D.
const LETTERS: [char; 1 + FurtherChannel::COUNT] = ['E', 'F', 'G', 'H', 'I'];

fn further_channel(own: &FurtherTrace, letter: char, window_s: f64) -> Panel {
    // Angles are drawn in mrad, as everywhere in the report.
    let (factor, unit) = if own.channel.is_angle() { (1e3, "mrad") } else { (1.0, own.channel.unit()) };
    let drawn = |values: &[(f64, f64)]| -> Vec<(f64, f64)> {
        values.iter().map(|(t, value)| (t * 1e3, value * factor)).collect()
    };
    let (measured, fitted) = (drawn(&own.measured), drawn(&own.fitted));
    let mut legend = vec![(0, Sign::Line(Stroke::Solid), "measured".to_owned())];
    let mut marks = vec![Mark::Line(0, Stroke::Solid, measured.clone())];
    if !fitted.is_empty() {
        marks.push(Mark::Line(2, Stroke::Dashed, fitted.clone()));
        legend.push((2, Sign::Line(Stroke::Dashed), "fitted".into()));
    }
    Chart {
        title: format!("{letter}  {}", own.channel.title()),
        x: Axis::new("time from the onset (ms)", 0.0, window_s * 1e3),
        y: Axis::around(
            &format!("change of {} ({unit})", own.channel.symbol()),
            measured.iter().chain(&fitted).map(|p| p.1),
        ),
        marks,
        legend,
    }
    .panel()
}

fn emg(emg: &TrialEmg, window_s: f64) -> Panel {
    let mut marks = vec![Mark::Window(0.0, window_s * 1e3)];
    let (mut legend, mut ends) = (Vec::new(), vec![0.0]);
    for (place, name) in ["FCR flexor", "ECR extensor"].into_iter().enumerate() {
        let own: Vec<(f64, f64)> = emg
            .time_s
            .iter()
            .zip(&emg.rectified_mvc[place])
            .map(|(t, level)| (t * 1e3, level * 1e2))
            .collect();
        if own.is_empty() {
            continue;
        }
        let stroke = if place == 0 { Stroke::Solid } else { Stroke::Dashed };
        ends.extend(own.iter().map(|p| p.1));
        marks.push(Mark::Line(1 + place, stroke, own));
        legend.push((1 + place, Sign::Line(stroke), name.to_owned()));
    }
    if let Some(onset_s) = emg.onset_s {
        marks.push(Mark::At(onset_s * 1e3, format!("response {} ms", milliseconds(onset_s))));
    }
    let (first, last) = (emg.time_s.first(), emg.time_s.last());
    let ms = |time_s: Option<&f64>, otherwise: f64| time_s.map_or(otherwise, |t| t * 1e3);
    Chart {
        title: "E  EMG, rectified".into(),
        x: Axis::new("time from the onset (ms)", ms(first, 0.0), ms(last, 1.0)),
        y: Axis::around("EMG (% MVC)", ends),
        marks,
        legend,
    }
    .panel()
}
