//! A pool of virtual subjects, simulated and fitted once. Studies are drawn from the pool, so that a study costs one test and no
//! simulation.

use rayon::prelude::*;

use super::error::UnitError;
use super::plan::{Study, Unit};
use super::unit_session::{SessionStorage, fit_unit};
use crate::fit::{QUANTITIES, TrialEstimate};

/// A subject of the pool: means in each cell over the first repetitions, as if the session had had no more repetitions.
#[derive(Debug, Clone)]
pub struct PooledSubject {
    /// Means, indexed by number of repetitions less one, quantity and cell; `None` without a usable trial.
    cells: Vec<Vec<Vec<Option<f64>>>>,
}

impl PooledSubject {
    /// The means of `estimates` in the cells at `conditions` (velocity, rad/s; torque, N m), for 1 to `repetitions` repetitions.
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

    /// The means of a quantity in all cells over the first `repetitions`; `None` if a cell has no mean.
    pub fn all(&self, quantity: usize, repetitions: u32) -> Option<Vec<f64>> {
        self.cells.get(repetitions as usize - 1)?[quantity].iter().copied().collect()
    }

    /// The mean of a quantity over all cells; `None` if a cell has no mean.
    pub fn mean(&self, quantity: usize, repetitions: u32) -> Option<f64> {
        self.all(quantity, repetitions).map(|all| all.iter().sum::<f64>() / all.len() as f64)
    }
}

/// Simulates and fits `units` in parallel; `done` is called after each.
///
/// # Errors
/// The error of the first unit that fails: a pool without the failed subjects would be a biased sample of the population.
pub fn simulate_pool(
    study: &Study,
    units: &[Unit],
    conditions: &[(f64, f64)],
    repetitions: u32,
    done: impl Fn() + Sync,
) -> Result<Vec<PooledSubject>, UnitError> {
    let fitted: Vec<Result<PooledSubject, UnitError>> = units
        .par_iter()
        .map(|unit| {
            let estimates = fit_unit(study, unit, SessionStorage::Memory)?;
            done();
            Ok(PooledSubject::of(&estimates, conditions, repetitions))
        })
        .collect();
    fitted.into_iter().collect()
}
