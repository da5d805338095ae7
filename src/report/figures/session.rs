//! Figures of the session: order of the trials, gate times, lateness.

use super::{colour, distinct};
use crate::dataset::{Session, Status, Trial};
use crate::report::chart::{Chart, Mark, Sign};
use crate::report::figure::Figure;
use crate::report::input::LatenessSummary;
use crate::report::scale::Axis;

/// Draws the velocity and torque of the trials in the order in which they were run; rejected trials are crosses.
pub fn order(session: &Session) -> Figure {
    let torques = distinct(session.trials.iter().map(|trial| trial.torque_nm));
    let position =
        |trial: &Trial| session.trials.iter().position(|own| own.number == trial.number).unwrap_or(0);
    let (mut marks, mut legend) = (Vec::new(), Vec::new());
    for (index, torque) in torques.iter().enumerate() {
        let own =
            session.trials.iter().filter(|trial| trial.torque_nm == *torque && trial.status == Status::Ok);
        // Single points: a line between trials has no meaning.
        marks.extend(own.map(|trial| {
            Mark::Points(colour(index), vec![(position(trial) as f64 + 1.0, trial.velocity_rad_s, None)])
        }));
        legend.push((colour(index), Sign::Point, format!("{torque} N m")));
    }
    let lost: Vec<(f64, f64)> = session
        .trials
        .iter()
        .filter(|trial| trial.status != Status::Ok)
        .map(|trial| (position(trial) as f64 + 1.0, trial.velocity_rad_s))
        .collect();
    if !lost.is_empty() {
        marks.push(Mark::Crosses(0, lost));
        legend.push((0, Sign::Cross, "rejected or aborted".into()));
    }
    let panel = Chart {
        title: "trials in the order in which they were run".into(),
        x: Axis::new("position in the session", 0.0, session.trials.len() as f64 + 1.0),
        y: Axis::around("velocity (rad/s)", session.trials.iter().map(|trial| trial.velocity_rad_s)),
        marks,
        legend,
    };
    Figure {
        id: "session-order".into(),
        title: "Order of the trials".into(),
        caption: "Velocity by position in the session. Colour and shape: target torque.".into(),
        panels: vec![panel.panel()],
        columns: 1,
    }
}

/// Draws the time from target to open gate of each trial.
pub fn gates(gates: &[(u32, f64)], needed_s: Option<f64>) -> Figure {
    let bars = gates.iter().map(|(trial, time_s)| {
        let x = f64::from(*trial);
        (x - 0.5, x + 0.5, *time_s)
    });
    let last = gates.iter().map(|(trial, _)| *trial).max().unwrap_or(1);
    let mut marks = Vec::new();
    if let Some(needed_s) = needed_s {
        marks.push(Mark::Reference(0.0, needed_s));
    }
    marks.push(Mark::Bars(1, bars.collect()));
    let panel = Chart {
        title: "from target shown to gate open".into(),
        x: Axis::new("trial", 0.0, f64::from(last) + 1.0),
        y: Axis::from_zero("time (s)", gates.iter().map(|(_, time_s)| *time_s)),
        marks,
        legend: Vec::new(),
    };
    Figure {
        id: "session-gates".into(),
        title: "Gate times".into(),
        caption: "Time that the subject took to bring the torque to the target and hold it there. Grey line: the hold time \
                  that the gate requires."
            .into(),
        panels: vec![panel.panel()],
        columns: 1,
    }
}

/// Draws the histogram of the lateness of the control cycle, on logarithmic axes.
pub fn lateness(lateness: &LatenessSummary) -> Figure {
    let bars: Vec<(f64, f64, f64)> = lateness
        .buckets
        .iter()
        .map(|(upper, count)| {
            let right = libm::log10((*upper).max(1) as f64);
            (right - 0.05, right, libm::log10(*count as f64 + 1.0))
        })
        .collect();
    let panel = Chart {
        title: "lateness of the cycle".into(),
        x: Axis::around("log10 of lateness in µs", bars.iter().flat_map(|bar| [bar.0, bar.1])),
        y: Axis::from_zero("log10 of cycles + 1", bars.iter().map(|bar| bar.2)),
        marks: vec![Mark::Bars(2, bars)],
        legend: Vec::new(),
    };
    Figure {
        id: "session-lateness".into(),
        title: "Lateness".into(),
        caption: format!(
            "Delay between the scheduled and the actual start of a cycle: median {} µs, 99th percentile {} µs, maximum {} µs.",
            lateness.p50_us, lateness.p99_us, lateness.longest_us
        ),
        panels: vec![panel.panel()],
        columns: 1,
    }
}
