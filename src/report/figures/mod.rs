//! The figures of the report.

mod balance;
mod law;
mod mechanism;
mod parameters;
mod power;
mod residuals;
mod session;
mod stiffness;
mod torque_at_rest;
mod trial;

pub use balance::balance;
pub use law::law;
pub use mechanism::{EffectCurve, mechanism};
pub use parameters::parameters;
pub use power::{PowerCurve, power};
pub use residuals::{ResidualMap, residual_map};
pub use session::{gates, lateness, order};
pub use stiffness::stiffness;
pub use torque_at_rest::torque_at_rest;
pub use trial::trial;

use super::chart::COLOURS;
use super::traces::Trace;

/// The distinct values in ascending order.
pub fn distinct(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// The colour of the value at an index of a list.
fn colour(place: usize) -> usize {
    1 + place % COLOURS
}

/// The traces grouped by condition; the input is sorted by condition.
pub fn by_condition(traces: &[Trace]) -> Vec<&[Trace]> {
    let same = |a: &Trace, b: &Trace| match (&a.label, &b.label) {
        (Some(a), Some(b)) => a == b,
        _ => a.velocity_rad_s == b.velocity_rad_s && a.torque_nm == b.torque_nm,
    };
    traces.chunk_by(same).collect()
}
