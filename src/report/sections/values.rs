//! What the sections on the fit share.

use crate::report::derived::is_difference;
use crate::report::fitted::{ConditionFit, Values, condition_name};
use crate::report::table::Cell;

/// What stands in place of a section without a fit.
pub const NO_FIT: &str = "There is no fit yet. Run: ramphold fit SESSION";

/// A value by its name.
pub fn value(values: &Values, name: &str) -> Option<f64> {
    values.get(name).copied().flatten()
}

/// The name of a condition.
pub fn name(condition: &ConditionFit) -> String {
    condition_name(condition.condition.as_ref(), condition.velocity_rad_s, condition.torque_nm)
}

/// Mean and standard deviation as a cell. Values that are all the same, such as a parameter that trials share, have no deviation.
pub fn spread_of(mean_sd: Option<(f64, Option<f64>)>, factor: f64) -> Cell {
    let sd = mean_sd
        .and_then(|(_, sd)| sd)
        .zip(mean_sd)
        .filter(|(sd, (mean, _))| is_difference(*sd, *mean))
        .map(|own| own.0);
    Cell::Spread(mean_sd.map(|(mean, _)| mean * factor), sd.map(|sd| sd * factor))
}
