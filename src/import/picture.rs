//! A picture of the first trials: angle and torque around the onset, to see at a glance whether columns, signs and onsets are right.

use crate::dataset::{Session, Trial};

/// Trials that are drawn.
const DRAWN: usize = 6;

/// Time that is drawn before and after the onset, s.
const AROUND_S: (f64, f64) = (0.1, 0.2);

/// Size of a panel, and of the margin for its labels.
const PANEL: (f64, f64) = (300.0, 120.0);
const MARGIN: (f64, f64) = (70.0, 40.0);

/// The picture as SVG.
pub fn picture(session: &Session) -> String {
    let trials: Vec<&Trial> = session.trials.iter().take(DRAWN).collect();
    let (width, height) = (2.0 * (PANEL.0 + MARGIN.0), trials.len() as f64 * (PANEL.1 + MARGIN.1) + MARGIN.1);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"11\">\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for (row, trial) in trials.iter().enumerate() {
        let top = row as f64 * (PANEL.1 + MARGIN.1) + MARGIN.1;
        let title = format!(
            "trial {}: {} rad/s, {} N m; the line is the onset",
            trial.number, trial.velocity_rad_s, trial.torque_nm
        );
        svg += &format!("<text x=\"{}\" y=\"{}\">{title}</text>\n", MARGIN.0, top - 8.0);
        let signals = [("angle, rad", &trial.record.theta_m_rad), ("torque, N m", &trial.record.torque_l_nm)];
        for (column, (label, values)) in signals.into_iter().enumerate() {
            let left = MARGIN.0 + column as f64 * (PANEL.0 + MARGIN.0);
            svg += &panel(trial, session.sample_rate_hz, values, label, (left, top));
        }
    }
    svg + "</svg>\n"
}

fn panel(trial: &Trial, rate_hz: f64, values: &[f64], label: &str, (left, top): (f64, f64)) -> String {
    let onset = trial.onset_s.map_or(0.0, |onset_s| (onset_s - trial.record.start_s) * rate_hz);
    let first = (onset - AROUND_S.0 * rate_hz).max(0.0) as usize;
    let last = ((onset + AROUND_S.1 * rate_hz) as usize).min(values.len().saturating_sub(1));
    let drawn = &values[first.min(last)..=last];
    let (low, high) =
        drawn.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    let span = if high > low { high - low } else { 1.0 };
    let x = |sample: f64| left + PANEL.0 * sample / (drawn.len().max(2) - 1) as f64;
    let points: Vec<String> = drawn
        .iter()
        .enumerate()
        .map(|(sample, value)| {
            format!("{:.1},{:.1}", x(sample as f64), top + PANEL.1 * (high - value) / span)
        })
        .collect();
    let at_onset = x(onset - first as f64);
    format!(
        "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#999\"/>\
         <line x1=\"{at_onset:.1}\" x2=\"{at_onset:.1}\" y1=\"{top}\" y2=\"{}\" stroke=\"#c33\"/>\
         <polyline points=\"{}\" fill=\"none\" stroke=\"#236\" stroke-width=\"1.2\"/>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{high:.3}</text><text x=\"{}\" y=\"{}\" text-anchor=\"end\">{low:.3}</text>\
         <text x=\"{}\" y=\"{}\">{label}</text>\n",
        PANEL.0,
        PANEL.1,
        top + PANEL.1,
        points.join(" "),
        left - 4.0,
        top + 8.0,
        left - 4.0,
        top + PANEL.1,
        left + 4.0,
        top + 14.0
    )
}
