//! Power of a study by simulation: how many subjects and repetitions are needed to find an effect, and how often a study decides
//! whether the elastic limit is a constant time or a constant angle.
//!
//! A pool of virtual subjects is simulated and fitted once. Studies of n subjects are drawn from the pool with replacement, and each is
//! tested as the real study would be. The confidence intervals cover the drawing of studies, not the drawing of the pool; repeat with
//! a larger pool to see the latter.

use std::fmt;
use std::str::FromStr;

use super::condition_grid::ConditionGrid;
use super::error::UnitError;
use super::plan::{Study, Unit};
use super::population::Population;
use super::simulated_pool::{PoolFit, PooledSubject, simulate_pool};
use crate::fit::QUANTITIES;
use crate::random::Stream;
use crate::rig::virtual_wrist::Surface;
use crate::statistics::{Contrast, MeanCovariance, MeanVariance, anova, welch, wilson};

/// A parameter that an effect changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShiftedParameter {
    /// Interface stiffness k_h.
    InterfaceStiffness,
    /// Short-range stiffness k_srs.
    ShortRangeStiffness,
    /// Stiffness decrement k_dec.
    StiffnessDecrement,
    /// Elastic limit x_e.
    ElasticLimit,
    /// Short-range period x_t, changed through x_e at every velocity.
    SrsPeriod,
}

/// Name of each parameter on the command line, and the quantity of the tables that shows its change.
const SHIFTED_PARAMETERS: [(ShiftedParameter, &str, &str); 5] = [
    (ShiftedParameter::InterfaceStiffness, "k_h", "k_h_nm_per_rad"),
    (ShiftedParameter::ShortRangeStiffness, "k_srs", "k_srs_nm_per_rad"),
    (ShiftedParameter::StiffnessDecrement, "k_dec", "k_dec_nm_per_rad"),
    (ShiftedParameter::ElasticLimit, "x_e", "x_e_rad"),
    (ShiftedParameter::SrsPeriod, "x_t", "x_t_s"),
];

/// A change of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterShift {
    /// The parameter that changes.
    pub parameter: ShiftedParameter,
    /// The change, as a fraction of the parameter; for x_t in s.
    pub by: f64,
}

/// The effect that a study looks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SoughtEffect {
    /// A difference between two groups (Welch's t-test of the subjects' means).
    Difference(ParameterShift),
    /// A change of the same subjects between two sessions (paired t-test).
    Change(ParameterShift),
}

/// How the elastic limit of a population depends on velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrueElasticLimit {
    /// As in the study's average subject; in the paper's it grows with velocity, so that x_t is constant.
    AsGiven,
    /// Constant angle: that of the average subject at the lowest velocity.
    ConstantAngle,
}

/// How studies are drawn from the pool.
#[derive(Debug, Clone)]
pub struct ResamplingPlan {
    /// Numbers of subjects per group to try.
    pub subjects: Vec<u32>,
    /// Numbers of repetitions to try, at most the protocol's.
    pub repetitions: Vec<u32>,
    /// Number of studies drawn for each number of subjects and repetitions.
    pub studies: u32,
    /// Number of subjects per group in the pool.
    pub pool: u32,
    /// Significance level of the tests.
    pub alpha: f64,
}

/// How often drawn studies found the effect.
#[derive(Debug, Clone, PartialEq)]
pub struct PowerEstimate {
    /// Number of subjects per group.
    pub subjects: u32,
    /// Number of repetitions of each condition.
    pub repetitions: u32,
    /// Number of studies that found the effect.
    pub found: u32,
    /// Number of studies drawn.
    pub studies: u32,
    /// Number of these that could not be tested, as where all subjects drawn are the same one. They count neither as found nor as not found.
    pub untested: u32,
    /// Mean of the estimated effect over the studies that were tested, in the unit of the quantity; NaN if none was.
    pub effect: f64,
}

impl PowerEstimate {
    /// Power: the proportion of the tested studies that found the effect, with its 95 % interval; NaN, and the whole range, if none was
    /// tested.
    pub fn power(&self) -> (f64, f64, f64) {
        let tested = self.studies - self.untested;
        let (low, high) = wilson(self.found, tested);
        (f64::from(self.found) / f64::from(tested), low, high)
    }
}

/// What a study concludes about the elastic limit, from the effects of velocity on x_e and on x_t.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LimitConclusion {
    /// Constant time: x_e changes with velocity, x_t does not (the paper's finding).
    ConstantTime,
    /// Constant angle: x_t changes with velocity, x_e does not.
    ConstantAngle,
    /// Both change with velocity.
    Neither,
    /// No effect of velocity is found on either.
    Undecided,
}

impl LimitConclusion {
    /// All conclusions, in the order of their counts.
    pub const ALL: [Self; 4] = [Self::ConstantTime, Self::ConstantAngle, Self::Neither, Self::Undecided];

    /// Name in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::ConstantTime => "time",
            Self::ConstantAngle => "angle",
            Self::Neither => "neither",
            Self::Undecided => "undecided",
        }
    }
}

impl ShiftedParameter {
    /// Index in [`QUANTITIES`] of the quantity that shows the change.
    pub fn quantity(self) -> usize {
        let name = SHIFTED_PARAMETERS
            .iter()
            .find(|(own, _, _)| *own == self)
            .map_or("", |(_, _, quantity)| quantity);
        QUANTITIES.iter().position(|quantity| *quantity == name).unwrap_or(0)
    }
}

/// A short-range phase of 20 to 40 ms (de Vlugt et al. 2011) does not change by this, s: a change in ms does.
const LARGEST_X_T_CHANGE_S: f64 = 0.04;

impl FromStr for ParameterShift {
    type Err = String;

    /// Parses `NAME=CHANGE`, such as `k_srs=-0.15` or `x_t=0.002`.
    fn from_str(text: &str) -> Result<Self, String> {
        let known: Vec<&str> = SHIFTED_PARAMETERS.iter().map(|(_, word, _)| *word).collect();
        let expected = || {
            format!(
                "expected one of {} and its change, such as k_srs=-0.15 (a fraction) or x_t=0.002 (s)",
                known.join(", ")
            )
        };
        let (word, by) = text.split_once('=').ok_or_else(expected)?;
        let parameter =
            SHIFTED_PARAMETERS.iter().find(|(_, own, _)| *own == word).map(|(parameter, _, _)| *parameter);
        let by =
            by.parse::<f64>().ok().filter(|by| by.is_finite() && *by > -0.95 && *by < 10.0 && *by != 0.0);
        let (parameter, by) = (parameter.ok_or_else(expected)?, by.ok_or_else(expected)?);
        if parameter == ShiftedParameter::SrsPeriod && by.abs() >= LARGEST_X_T_CHANGE_S {
            return Err(format!(
                "x_t changes by a time in s, such as x_t=0.002; {by} s is longer than the short range lasts"
            ));
        }
        Ok(Self { parameter, by })
    }
}

impl fmt::Display for ParameterShift {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let word = SHIFTED_PARAMETERS
            .iter()
            .find(|(own, _, _)| *own == self.parameter)
            .map_or("", |(_, word, _)| word);
        write!(f, "{word}={}", self.by)
    }
}

impl ParameterShift {
    /// Changes the average subject of a population.
    fn apply(&self, population: &mut Population) {
        let person = &mut population.average;
        let scale = |surface: &mut Surface| {
            for value in [&mut surface.at_lowest, &mut surface.per_rad_s, &mut surface.per_nm] {
                *value *= 1.0 + self.by;
            }
        };
        match self.parameter {
            ShiftedParameter::InterfaceStiffness => scale(&mut person.interface_stiffness_nm_per_rad),
            ShiftedParameter::ShortRangeStiffness => scale(&mut person.short_range_stiffness_nm_per_rad),
            ShiftedParameter::StiffnessDecrement => scale(&mut person.stiffness_decrement_nm_per_rad),
            ShiftedParameter::ElasticLimit => scale(&mut person.elastic_limit_rad),
            ShiftedParameter::SrsPeriod => {
                // x_e = v (x_t - tau): a longer time is a larger angle at every velocity.
                person.elastic_limit_rad.at_lowest += 1.3 * self.by;
                person.elastic_limit_rad.per_rad_s += self.by;
            }
        }
    }
}

/// The values that are tested, of all subjects of a pool: means over all cells, `None` where a cell has none.
#[derive(Debug, Clone, PartialEq)]
pub struct PoolMeans {
    /// Number of repetitions that the means include, and the fit that they are from.
    pub fit: PoolFit,
    /// The first group, or the first session.
    pub first: Vec<Option<f64>>,
    /// The second group, or the second session of the same subjects.
    pub second: Vec<Option<f64>>,
}

/// Power of studies for all numbers of subjects and repetitions, and the pool that the studies were drawn from. `done` is called
/// after each simulated session.
///
/// # Errors
/// If a session of the pool fails.
pub fn power(
    study: &Study,
    sought: SoughtEffect,
    resampling: &ResamplingPlan,
    done: impl Fn() + Sync,
) -> Result<(Vec<PowerEstimate>, Vec<PoolMeans>), UnitError> {
    let pool = simulate_groups(study, sought, resampling, done)?;
    let with = |own: &PoolMeans| -> Vec<PowerEstimate> {
        let of = |subjects: &u32| sought.drawn_from(own, *subjects, resampling, study.seed);
        resampling.subjects.iter().map(of).collect()
    };
    let all = pool.iter().flat_map(with).collect();
    Ok((all, pool))
}

impl SoughtEffect {
    /// Power of studies of `subjects` subjects per group, drawn from a pool.
    fn drawn_from(
        self,
        pool: &PoolMeans,
        subjects: u32,
        resampling: &ResamplingPlan,
        seed: u64,
    ) -> PowerEstimate {
        let (repetitions, studies) = (pool.fit.repetitions, resampling.studies);
        let mut stream = Stream::new(seed, &format!("power/{subjects}/{repetitions}"));
        let (mut found, mut untested, mut effect) = (0, 0, MeanVariance::default());
        for _ in 0..studies {
            match self.test(pool, subjects, &mut stream).filter(|contrast| !contrast.p().is_nan()) {
                Some(contrast) => {
                    found += u32::from(contrast.p() < resampling.alpha);
                    effect.add(contrast.estimate);
                }
                None => untested += 1,
            }
        }
        let effect = if untested < studies { effect.mean() } else { f64::NAN };
        PowerEstimate { subjects, repetitions, found, studies, untested, effect }
    }

    /// Draws a study of `subjects` subjects per group and estimates the effect.
    fn test(self, pool: &PoolMeans, subjects: u32, stream: &mut Stream) -> Option<Contrast> {
        match self {
            Self::Difference(_) => {
                let (first, second) =
                    (draw(stream, &pool.first, subjects), draw(stream, &pool.second, subjects));
                welch(&second, &first)
            }
            Self::Change(_) => {
                let pairs = pool.first.iter().zip(&pool.second);
                let changes: Vec<Option<f64>> =
                    pairs.map(|(first, second)| Some((*second)? - (*first)?)).collect();
                draw(stream, &changes, subjects).contrast()
            }
        }
    }
}

/// Simulates and fits both groups, or both sessions of the same subjects; the second has the shifted parameter.
fn simulate_groups(
    study: &Study,
    sought: SoughtEffect,
    resampling: &ResamplingPlan,
    done: impl Fn() + Sync,
) -> Result<Vec<PoolMeans>, UnitError> {
    let subjects = u64::from(resampling.pool);
    let (shift, before) = match sought {
        SoughtEffect::Difference(shift) => (shift, study.clone().resized(2 * resampling.pool, 1)),
        SoughtEffect::Change(shift) => (shift, study.clone().resized(resampling.pool, 2)),
    };
    let mut changed = before.clone();
    changed.change_population(|population| shift.apply(population));
    let unit_of = |subject: u64, group: u64| match sought {
        SoughtEffect::Difference(_) => subject + group * subjects,
        SoughtEffect::Change(_) => 2 * subject + group,
    };
    let grid = condition_grid(study);
    let fit = |study: &Study, group: u64| {
        let units: Vec<Unit> = (0..subjects).map(|subject| study.unit(unit_of(subject, group))).collect();
        simulate_pool(study, &units, &grid.conditions, &resampling.repetitions, &done)
    };
    let (first, second) = (fit(&before, 0)?, fit(&changed, 1)?);
    let quantity = shift.parameter.quantity();
    let means = |pool: &[PooledSubject], fit: &PoolFit| {
        pool.iter().map(|subject| subject.mean(quantity, fit)).collect()
    };
    let groups = |repetitions: &u32| {
        let fit = PoolFit::of(first.iter().chain(&second), *repetitions);
        PoolMeans { fit, first: means(&first, &fit), second: means(&second, &fit) }
    };
    Ok(resampling.repetitions.iter().map(groups).collect())
}

/// Draws subjects with replacement from those of the pool who have a value.
fn draw(stream: &mut Stream, pool: &[Option<f64>], subjects: u32) -> MeanVariance {
    let values: Vec<f64> = pool.iter().flatten().copied().collect();
    if values.is_empty() {
        return MeanVariance::default();
    }
    (0..subjects).map(|_| values[stream.below(values.len() as u64) as usize]).collect()
}

/// What drawn studies of some number of subjects conclude about the elastic limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LimitCounts {
    /// Number of subjects.
    pub subjects: u32,
    /// Number of studies with each of [`LimitConclusion::ALL`].
    pub counts: [u32; 4],
    /// Number of studies in which one of the effects could not be tested; they conclude nothing, and are no undecided ones.
    pub untested: u32,
}

/// What drawn studies conclude about the elastic limit, for each number of subjects, and the fit that their values are from. `done` is
/// called after each simulated session.
///
/// # Errors
/// If a session of the pool fails.
pub fn limit_conclusions(
    study: &Study,
    limit: TrueElasticLimit,
    resampling: &ResamplingPlan,
    done: impl Fn() + Sync,
) -> Result<(Vec<LimitCounts>, PoolFit), UnitError> {
    let mut study = study.clone().resized(resampling.pool, 1);
    if limit == TrueElasticLimit::ConstantAngle {
        study.change_population(|population| population.average.elastic_limit_rad.per_rad_s = 0.0);
    }
    let grid = condition_grid(&study);
    let repetitions = resampling.repetitions.iter().copied().max().unwrap_or(1);
    let units: Vec<Unit> = (0..study.units()).map(|index| study.unit(index)).collect();
    let pool = simulate_pool(&study, &units, &grid.conditions, &[repetitions], done)?;
    let fit = PoolFit::of(pool.iter(), repetitions);
    let of = |quantity: usize| -> Vec<Option<Vec<f64>>> {
        pool.iter().map(|subject| subject.all(quantity, &fit)).collect()
    };
    let (angle, time) =
        (of(ShiftedParameter::ElasticLimit.quantity()), of(ShiftedParameter::SrsPeriod.quantity()));
    let both: Vec<(&Vec<f64>, &Vec<f64>)> =
        angle.iter().zip(&time).filter_map(|(a, t)| Some((a.as_ref()?, t.as_ref()?))).collect();
    let changes = |cells: Vec<&Vec<f64>>| {
        let moments = MeanCovariance::of(grid.conditions.len(), cells.into_iter().map(Vec::as_slice));
        let effects = anova(&moments, grid.factor_levels())?;
        let of_velocity = effects.iter().find(|effect| effect.factors == [true, false])?;
        (!of_velocity.p_gg.is_nan()).then_some(of_velocity.p_gg < resampling.alpha)
    };
    let mut all = Vec::new();
    for subjects in &resampling.subjects {
        let mut stream = Stream::new(study.seed, &format!("verdicts/{subjects}"));
        let (mut counts, mut untested) = ([0; 4], 0);
        for _ in 0..resampling.studies {
            if both.is_empty() {
                untested += 1;
                continue;
            }
            let drawn: Vec<usize> =
                (0..*subjects).map(|_| stream.below(both.len() as u64) as usize).collect();
            let x_e = changes(drawn.iter().map(|subject| both[*subject].0).collect());
            let x_t = changes(drawn.iter().map(|subject| both[*subject].1).collect());
            let Some(changing) = x_e.zip(x_t) else {
                untested += 1;
                continue;
            };
            let conclusion = match changing {
                (true, false) => LimitConclusion::ConstantTime,
                (false, true) => LimitConclusion::ConstantAngle,
                (true, true) => LimitConclusion::Neither,
                (false, false) => LimitConclusion::Undecided,
            };
            counts[conclusion as usize] += 1;
        }
        all.push(LimitCounts { subjects: *subjects, counts, untested });
    }
    Ok((all, fit))
}

/// The conditions of the study's protocol.
fn condition_grid(study: &Study) -> ConditionGrid {
    let protocol = study.protocol();
    let all = protocol.into_iter().flat_map(|protocol| {
        let torques = protocol.torques_nm.clone();
        protocol
            .velocities_rad_s
            .clone()
            .into_iter()
            .flat_map(move |v| torques.clone().into_iter().map(move |t| (v, t)))
    });
    ConditionGrid::of(all)
}

#[cfg(test)]
mod tests {
    use super::super::study_file::StudyFit;
    use super::*;

    /// In milliseconds it gave a confident number of subjects, and an effect of the other sign.
    #[test]
    fn a_change_of_x_t_that_is_no_time_in_seconds_is_refused() {
        assert!("x_t=0.002".parse::<ParameterShift>().is_ok());
        for text in ["x_t=2", "x_t=-0.5", "x_t=0.04"] {
            let told = text.parse::<ParameterShift>().unwrap_err();
            assert!(told.contains("time in s"), "{told}");
        }
    }

    #[test]
    fn a_study_that_cannot_be_tested_is_not_one_that_finds_nothing() {
        let resampling =
            ResamplingPlan { subjects: vec![2], repetitions: vec![1], studies: 400, pool: 2, alpha: 0.05 };
        let fit = PoolFit { repetitions: 1, fit: StudyFit::Session, left_out: 0, of: 4 };
        let sought = SoughtEffect::Change("k_srs=0.1".parse().unwrap());
        let with = |second: Vec<Option<f64>>| {
            let first = vec![Some(0.0); second.len()];
            sought.drawn_from(&PoolMeans { fit, first, second }, 2, &resampling, 1)
        };
        let none = with(vec![None, None]);
        assert_eq!((none.found, none.untested), (0, 400));
        assert!(none.power().0.is_nan() && none.effect.is_nan());
        // Two subjects, of whom every second study has the same one twice, without any change.
        let some = with(vec![Some(0.0), Some(1e3)]);
        assert!((50..250).contains(&some.untested), "{some:?}");
        let tested = f64::from(some.studies - some.untested);
        assert!((some.power().0 - f64::from(some.found) / tested).abs() < 1e-12);
    }
}
