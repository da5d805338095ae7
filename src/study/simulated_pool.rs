//! Many virtual persons, simulated and fitted once, out of whom studies are drawn: a study drawn costs a test and no session.

use rayon::prelude::*;

use super::error::UnitError;
use super::plan::{Study, Unit};
use super::unit_session::{self, Kept};
use crate::fit::{QUANTITIES, TrialEstimate};

/// A person of the pool: means in each cell over the first repetitions, as if the session had only had those.
#[derive(Debug, Clone)]
pub struct Pooled {
    /// By number of repetitions less one, quantity and cell; `None` without a usable trial.
    cells: Vec<Vec<Vec<Option<f64>>>>,
}

impl Pooled {
    /// What `estimates` say in the cells at `conditions`.
    pub fn of(estimates: &[TrialEstimate], conditions: &[(f64, f64)], repetitions: u32) -> Self {
        let mean = |quantity: usize, (velocity, torque): (f64, f64), most: u32| {
            let own = estimates.iter().filter(|estimate| {
                estimate.converged
                    && estimate.repetition <= most
                    && (estimate.velocity_rad_s, estimate.torque_nm) == (velocity, torque)
            });
            let values: Vec<f64> = own.filter_map(|estimate| estimate.quantities()[quantity]).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let of_quantity =
            |quantity, most| conditions.iter().map(|condition| mean(quantity, *condition, most)).collect();
        let of_repetitions =
            |most| (0..QUANTITIES.len()).map(|quantity| of_quantity(quantity, most)).collect();
        Self { cells: (1..=repetitions).map(of_repetitions).collect() }
    }

    /// The means of a quantity in all cells, with the first `repetitions`; `None` where one is missing.
    pub fn all(&self, quantity: usize, repetitions: u32) -> Option<Vec<f64>> {
        self.cells.get(repetitions as usize - 1)?[quantity].iter().copied().collect()
    }

    /// The mean over all cells.
    pub fn mean(&self, quantity: usize, repetitions: u32) -> Option<f64> {
        self.all(quantity, repetitions).map(|all| all.iter().sum::<f64>() / all.len() as f64)
    }
}

/// Simulates and fits units, as many at once as there are cores; `done` is called after each.
///
/// # Errors
/// The first unit's that fails: a pool with holes would not be a sample of the population.
pub fn pool(
    study: &Study,
    units: &[Unit],
    conditions: &[(f64, f64)],
    repetitions: u32,
    done: impl Fn() + Sync,
) -> Result<Vec<Pooled>, UnitError> {
    let fitted: Vec<Result<Pooled, UnitError>> = units
        .par_iter()
        .map(|unit| {
            let estimates = unit_session::fit(study, unit, Kept::No)?;
            done();
            Ok(Pooled::of(&estimates, conditions, repetitions))
        })
        .collect();
    fitted.into_iter().collect()
}
