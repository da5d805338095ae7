//! How the elastic limit goes with velocity and torque.

use nalgebra::{DMatrix, DVector};

use crate::fit::{Fit, Prepared};

/// How x_e goes with velocity and torque.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct LimitLaw {
    /// x_0 of x_e = x_0 + v x_t, rad, with its standard error.
    pub x_0_rad: (f64, f64),
    /// x_t, s, with its standard error.
    pub x_t_s: (f64, f64),
    /// Change with torque, rad/(N m), with its standard error.
    pub per_torque_rad_per_nm: (f64, f64),
}

/// The regression of the elastic limits on velocity and torque; `None` if either does not vary, or too few are determined.
pub fn limit_law(prepared: &Prepared, fit: &Fit) -> Option<LimitLaw> {
    let limits: Vec<(f64, f64, f64)> = (0..prepared.trials.len())
        .filter(|trial| !fit.at_bound(*trial, 5))
        .map(|t| {
            (fit.parameters[t][5], prepared.trials[t].velocity_rad_s.abs(), prepared.trials[t].torque_nm)
        })
        .collect();
    let count = limits.len();
    if count < 9 {
        return None;
    }
    let mean_torque = limits.iter().map(|l| l.2).sum::<f64>() / count as f64;
    let design = DMatrix::from_fn(count, 3, |row, column| match column {
        0 => 1.0,
        1 => limits[row].1,
        _ => limits[row].2 - mean_torque,
    });
    let own = DVector::from_iterator(count, limits.iter().map(|l| l.0));
    let inverse = design.tr_mul(&design).try_inverse()?;
    let coefficients = &inverse * design.tr_mul(&own);
    let left = &own - &design * &coefficients;
    let variance = left.norm_squared() / (count as f64 - 3.0);
    let value = |i: usize| (coefficients[i], libm::sqrt(variance * inverse[(i, i)]));
    Some(LimitLaw { x_0_rad: value(0), x_t_s: value(1), per_torque_rad_per_nm: value(2) })
}
