//! A pool of virtual subjects, simulated and fitted once. Studies are drawn from the pool, so that a study costs one test and no
//! simulation.

use rayon::prelude::*;

use super::error::UnitError;
use super::plan::{Study, Unit};
use super::unit_session::{UnitEstimates, fit_repetitions};
use crate::fit::QUANTITIES;

/// A subject of the pool: means in each cell, with some numbers of repetitions.
#[derive(Debug, Clone)]
pub struct PooledSubject {
    /// For each number of repetitions, means by quantity and cell; `None` without a usable trial.
    cells: Vec<(u32, Vec<Vec<Option<f64>>>)>,
}

impl PooledSubject {
    /// The means in the cells at `conditions` (velocity, rad/s; torque, N m), from the `estimates` of the session with each number of
    /// `repetitions`.
    pub fn of(estimates: &[UnitEstimates], conditions: &[(f64, f64)], repetitions: &[u32]) -> Self {
        let mean = |of: &UnitEstimates, quantity: usize, condition: (f64, f64)| {
            let own = of.trials.iter().filter(|estimate| {
                estimate.converged && (estimate.velocity_rad_s, estimate.torque_nm) == condition
            });
            let values: Vec<f64> = own.filter_map(|estimate| estimate.quantities()[quantity]).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let of_quantity =
            |of, quantity| conditions.iter().map(|condition| mean(of, quantity, *condition)).collect();
        let all = |of| (0..QUANTITIES.len()).map(|quantity| of_quantity(of, quantity)).collect();
        Self { cells: repetitions.iter().copied().zip(estimates.iter().map(all)).collect() }
    }

    /// The means of a quantity in all cells over the first `repetitions`; `None` if a cell has no mean.
    pub fn all(&self, quantity: usize, repetitions: u32) -> Option<Vec<f64>> {
        let (_, own) = self.cells.iter().find(|(own, _)| *own == repetitions)?;
        own[quantity].iter().copied().collect()
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
    repetitions: &[u32],
    done: impl Fn() + Sync,
) -> Result<Vec<PooledSubject>, UnitError> {
    let fitted: Vec<Result<PooledSubject, UnitError>> = units
        .par_iter()
        .map(|unit| {
            let estimates = fit_repetitions(study, unit, repetitions)?;
            done();
            Ok(PooledSubject::of(&estimates, conditions, repetitions))
        })
        .collect();
    fitted.into_iter().collect()
}
