//! Which records have a ramp: an encoder that stands on one count has no noise, and the first count that it goes looks like motion.

use super::ramp_way::RampWay;
use crate::consistency::MeasuredTrial;
use crate::dataset::Trial;
use crate::statistics::upper_median;

/// What goes less than this part of the way of a ramp is none: the wobble of a motor that holds. The slowest ramp goes all of its way.
const WAY_SHARE: f64 = 0.3;

/// A record in which something moves.
pub struct MovingRecord {
    /// The trial that it would be.
    pub trial: Trial,
    /// What the record says by itself.
    pub measured: MeasuredTrial,
    /// The table that it is from.
    pub source: String,
}

impl MovingRecord {
    /// How far the motor goes from where it held, without sign, rad.
    fn way_rad(&self) -> f64 {
        RampWay::of(&self.trial.record.theta_m_rad, self.measured.hold_rad).length_rad()
    }
}

/// The candidates that have a ramp, and for each of the others its source and why it has none.
pub fn with_ramps(candidates: Vec<MovingRecord>) -> (Vec<MovingRecord>, Vec<String>) {
    let usual_rad = upper_median(candidates.iter().map(MovingRecord::way_rad)).unwrap_or(0.0);
    let (with, without): (Vec<_>, Vec<_>) =
        candidates.into_iter().partition(|candidate| candidate.way_rad() >= WAY_SHARE * usual_rad);
    let why = |candidate: MovingRecord| {
        format!(
            "{}: has no ramp: the motor goes {:.2e} rad, less than {WAY_SHARE} of the way of most ramps, {usual_rad:.2e} rad",
            candidate.source,
            candidate.way_rad()
        )
    };
    (with, without.into_iter().map(why).collect())
}
