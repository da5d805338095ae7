//! Figure of the torque at rest before each trial.

use crate::report::chart::{Chart, Mark};
use crate::report::figure::Figure;
use crate::report::rest_torque::RestTorque;
use crate::report::scale::Axis;

/// Draws the torque at rest before each trial.
pub fn torque_at_rest(rests: &[RestTorque]) -> Figure {
    let points = rests.iter().map(|rest| (f64::from(rest.trial), rest.mean_nm, Some(rest.sd_nm))).collect();
    let last = rests.iter().map(|rest| rest.trial).max().unwrap_or(1);
    let ends = rests.iter().flat_map(|rest| [rest.mean_nm - rest.sd_nm, rest.mean_nm + rest.sd_nm]);
    // Single points: a line between trials has no meaning.
    let panel = Chart {
        title: "torque at rest before the hold".into(),
        x: Axis::new("trial", 0.0, f64::from(last) + 1.0),
        y: Axis::around("torque (N m)", ends),
        marks: vec![Mark::Points(1, points)],
        legend: Vec::new(),
    };
    Figure {
        id: "torque-at-rest".into(),
        title: "Torque at rest".into(),
        caption: "Mean of the first 100 ms of each trial's record, before anybody reacts to the target; bars: standard deviation of the samples."
            .into(),
        panels: vec![panel.panel()],
        columns: 1,
    }
}
