//! A picture of the first trials: angle and torque around the onset, to see at a glance whether columns, units, signs and onsets are right.

use std::fmt::Write;

use crate::dataset::{Session, Trial};

/// Trials that are drawn.
const DRAWN: usize = 6;

/// Time that is drawn before and after the onset, s.
const AROUND_S: (f64, f64) = (0.1, 0.2);

/// Size of a panel.
const PANEL: (f64, f64) = (300.0, 120.0);

/// Room left of a panel, for its numbers; above it, for the title; below it, for the times; right of it.
const ROOM: (f64, f64, f64, f64) = (62.0, 26.0, 34.0, 18.0);

/// Times from the onset that have a number, ms.
const TIMES_MS: [f64; 4] = [-100.0, 0.0, 100.0, 200.0];

/// The picture as SVG.
pub fn picture(session: &Session) -> String {
    let trials: Vec<&Trial> = session.trials.iter().take(DRAWN).collect();
    let (column_width, row_height) = (ROOM.0 + PANEL.0 + ROOM.3, ROOM.1 + PANEL.1 + ROOM.2);
    let (width, height) = (2.0 * column_width, 24.0 + trials.len() as f64 * row_height);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"sans-serif\" font-size=\"11\">\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n\
         <text x=\"{}\" y=\"16\">red: the onset; dashed: the velocity that the table states; times in ms from the onset</text>\n",
        ROOM.0
    );
    for (row, trial) in trials.iter().enumerate() {
        let top = 24.0 + row as f64 * row_height + ROOM.1;
        let title =
            format!("trial {}: {} rad/s, {} N m", trial.number, trial.velocity_rad_s, trial.torque_nm);
        let _ =
            writeln!(svg, "<text x=\"{}\" y=\"{}\" font-weight=\"bold\">{title}</text>", ROOM.0, top - 8.0);
        let signals = [
            DrawnSignal {
                label: "angle, mrad",
                values: trial.record.theta_m_rad.iter().map(|own| 1e3 * own).collect(),
                stated_rate_per_s: Some(1e3 * trial.velocity_rad_s),
            },
            DrawnSignal {
                label: "torque, N m",
                values: trial.record.torque_l_nm.clone(),
                stated_rate_per_s: None,
            },
        ];
        for (column, signal) in signals.iter().enumerate() {
            let left = ROOM.0 + column as f64 * column_width;
            svg += &panel(trial, session.sample_rate_hz, signal, (left, top));
        }
    }
    svg + "</svg>\n"
}

/// What a panel shows.
struct DrawnSignal {
    label: &'static str,
    values: Vec<f64>,
    /// Rate of the ramp according to the table, in the unit of the values.
    stated_rate_per_s: Option<f64>,
}

fn panel(trial: &Trial, rate_hz: f64, signal: &DrawnSignal, (left, top): (f64, f64)) -> String {
    let onset = trial.onset_s.map_or(0.0, |onset_s| (onset_s - trial.record.start_s) * rate_hz);
    let first = (onset - AROUND_S.0 * rate_hz).max(0.0) as usize;
    let last = ((onset + AROUND_S.1 * rate_hz) as usize).min(signal.values.len().saturating_sub(1));
    let drawn = &signal.values[first.min(last)..=last];
    let (low, high) =
        drawn.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    // A constant signal is drawn in the middle.
    let room = if high > low { 0.08 * (high - low) } else { 1.0 };
    let (bottom_value, top_value) = (low - room, high + room);
    let x = |time_s: f64| left + PANEL.0 * (time_s + AROUND_S.0) / (AROUND_S.0 + AROUND_S.1);
    let y = |value: f64| top + PANEL.1 * (top_value - value) / (top_value - bottom_value);
    let time_s = |sample: usize| (sample as f64 - onset) / rate_hz;
    let mut svg = format!(
        "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#999\"/>",
        PANEL.0, PANEL.1
    );
    for time_ms in TIMES_MS {
        let (at, bottom) = (x(1e-3 * time_ms), top + PANEL.1);
        let _ = write!(
            svg,
            "<path d=\"M{at:.1} {bottom}v4\" stroke=\"#999\"/><text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{time_ms}</text>",
            bottom + 16.0
        );
    }
    for value in if high > low { vec![low, high] } else { vec![low] } {
        let _ = write!(
            svg,
            "<path d=\"M{left} {at:.1}h-4\" stroke=\"#999\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 7.0,
            y(value) + 4.0,
            number(value),
            at = y(value)
        );
    }
    let _ = write!(
        svg,
        "<line x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{top}\" y2=\"{}\" stroke=\"#c33\"/>",
        top + PANEL.1,
        at = x(0.0)
    );
    if let Some(rate_per_s) = signal.stated_rate_per_s.filter(|rate| *rate != 0.0) {
        // From the onset until it leaves the panel.
        let from = drawn.get((onset as usize).saturating_sub(first)).copied().unwrap_or(low);
        let end = if rate_per_s > 0.0 { top_value } else { bottom_value };
        let until_s = ((end - from) / rate_per_s).clamp(0.0, AROUND_S.1);
        let _ = write!(
            svg,
            "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"#888\" stroke-dasharray=\"4 3\"/>",
            x(0.0),
            y(from),
            x(until_s),
            y(from + rate_per_s * until_s)
        );
    }
    let points: Vec<String> = drawn
        .iter()
        .enumerate()
        .map(|(sample, value)| format!("{:.1},{:.1}", x(time_s(first + sample)), y(*value)))
        .collect();
    let _ = writeln!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"#236\" stroke-width=\"1.2\"/><text x=\"{}\" y=\"{}\">{}</text>",
        points.join(" "),
        left + 5.0,
        top + 14.0,
        signal.label
    );
    svg
}

/// Three decimals, without those that are zero; zero has no sign.
fn number(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn zero_has_no_sign_and_no_decimals_that_say_nothing() {
        assert_eq!(number(-0.0001), "0");
        assert_eq!(number(140.0), "140");
        assert_eq!(number(-1.4892), "-1.489");
    }
}
