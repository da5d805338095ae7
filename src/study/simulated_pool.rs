//! A pool of virtual subjects, simulated and fitted once. Studies are drawn from the pool, so that a study costs one test and no
//! simulation.

use rayon::prelude::*;

use super::error::UnitError;
use super::plan::{Study, Unit};
use super::study_file::StudyFit;
use super::unit_session::{UnitEstimates, fit_repetitions};
use crate::fit::QUANTITIES;

/// A subject of the pool: means in each cell, with some numbers of repetitions.
#[derive(Debug, Clone)]
pub struct PooledSubject {
    /// What each number of repetitions gives.
    cells: Vec<SubjectCells>,
}

/// The means of a subject's first repetitions.
#[derive(Debug, Clone)]
struct SubjectCells {
    repetitions: u32,
    /// The fit that they are from.
    fit: StudyFit,
    /// Means by quantity and cell; `None` without a usable trial.
    means: Vec<Vec<Option<f64>>>,
}

/// The fits that the values of a pool are from, for one number of repetitions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PoolFit {
    /// Number of repetitions.
    pub repetitions: u32,
    /// The fit of the values that count.
    pub fit: StudyFit,
    /// Number of sessions whose values are of the other fit, which do not count: a study leaves such sessions out of its tables.
    pub left_out: usize,
    /// Number of sessions.
    pub of: usize,
}

impl PoolFit {
    /// The fit of the values of `pool`, and how many sessions have another one: that of the session if any has it, as in the tables of a study.
    pub fn of<'a>(pool: impl Iterator<Item = &'a PooledSubject>, repetitions: u32) -> Self {
        let fits: Vec<StudyFit> = pool.filter_map(|subject| Some(subject.own(repetitions)?.fit)).collect();
        let together = fits.iter().filter(|fit| **fit == StudyFit::Session).count();
        let (fit, left_out) = match together {
            0 => (StudyFit::Independent, 0),
            _ => (StudyFit::Session, fits.len() - together),
        };
        Self { repetitions, fit, left_out, of: fits.len() }
    }

    /// What must be said of a study that asks for the fit `asked`; `None` if all its values are of that fit.
    pub fn remark(&self, asked: StudyFit) -> Option<String> {
        let Self { repetitions, fit, left_out, of } = *self;
        let repetitions = repetitions_in_words(repetitions);
        if fit != asked {
            return Some(format!(
                "{repetitions}: no session has a model of its own, so that all values are those of each trial alone, which are \
                 biased differently at each velocity"
            ));
        }
        (left_out > 0).then(|| {
            format!(
                "{repetitions}: {left_out} of {of} sessions have no model of their own and are left out, as a study leaves \
                 them out of its tables"
            )
        })
    }
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
        let of_quantity = |of: &UnitEstimates, quantity| {
            conditions.iter().map(|condition| mean(of, quantity, *condition)).collect()
        };
        let all =
            |of: &UnitEstimates| (0..QUANTITIES.len()).map(|quantity| of_quantity(of, quantity)).collect();
        let cells = |(repetitions, of): (&u32, &UnitEstimates)| SubjectCells {
            repetitions: *repetitions,
            fit: of.fit,
            means: all(of),
        };
        Self { cells: repetitions.iter().zip(estimates).map(cells).collect() }
    }

    fn own(&self, repetitions: u32) -> Option<&SubjectCells> {
        self.cells.iter().find(|own| own.repetitions == repetitions)
    }

    /// The means of a quantity in all cells over the first repetitions of `fit`; `None` if a cell has no mean, or the subject's values are of
    /// the other fit.
    pub fn all(&self, quantity: usize, fit: &PoolFit) -> Option<Vec<f64>> {
        let own = self.own(fit.repetitions).filter(|own| own.fit == fit.fit)?;
        own.means[quantity].iter().copied().collect()
    }

    /// The mean of a quantity over all cells; `None` as [`PooledSubject::all`].
    pub fn mean(&self, quantity: usize, fit: &PoolFit) -> Option<f64> {
        self.all(quantity, fit).map(|all| all.iter().sum::<f64>() / all.len() as f64)
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

/// A number of repetitions in words.
pub fn repetitions_in_words(repetitions: u32) -> String {
    format!("{repetitions} {}", if repetitions == 1 { "repetition" } else { "repetitions" })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn subject(fits: [StudyFit; 2]) -> PooledSubject {
        let estimates = fits.map(|fit| UnitEstimates { trials: Vec::new(), fit });
        PooledSubject::of(&estimates, &[], &[1, 5])
    }

    #[test]
    fn values_of_both_fits_are_not_mixed_in_one_pool() {
        use StudyFit::{Independent, Session};
        let pool = [[Independent, Session], [Independent, Independent], [Independent, Session]].map(subject);
        let [few, many] = [1, 5].map(|repetitions| PoolFit::of(pool.iter(), repetitions));
        assert_eq!(few, PoolFit { repetitions: 1, fit: Independent, left_out: 0, of: 3 });
        assert_eq!(many, PoolFit { repetitions: 5, fit: Session, left_out: 1, of: 3 });
        assert!(pool[1].all(0, &many).is_none() && pool[1].all(0, &few).is_some());
        assert!(pool[0].all(0, &many).is_some());
        assert!(few.remark(Session).unwrap().contains("1 repetition: no session has a model of its own"));
        assert!(many.remark(Session).unwrap().contains("5 repetitions: 1 of 3 sessions"));
        assert_eq!(few.remark(Independent), None);
    }
}
