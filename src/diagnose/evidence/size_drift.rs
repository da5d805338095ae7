//! How sizes may change over a session: in proportion to the order of the trials, torque and velocity. So may that of a mechanism, and the
//! deviation of a constant that rig trials measured.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::angle_error::{SMALLEST_SHIFT, change_against_record, with_other_constants};
use super::gaussian::log_determinant;
use super::rig_knowledge::RigKnowledge;
use crate::diagnose::predicted_torque::torques;
use crate::fit::{Fit, Observations, TrialObservation};
use crate::statistics::{log_determinant_of_factor, probabilities};
use crate::wrist::mechanisms::{MechanismKind, SIZE_DRIFT_SD};

/// Number of quantities with which a size may change: the order of the trials, torque and velocity.
pub const SIZE_DRIFTS: usize = 3;

/// Where the order of the trials stands among them.
const ORDER: usize = 0;

/// What rig trials see of the order: they come before the session, at the value that the first of its trials has.
const ORDER_OF_RIG_TRIALS: f64 = -1.0;

/// Order, torque and velocity of each trial, each from -1 to 1 over the session and 0 where all trials are alike.
pub fn drift_covariates(observations: &Observations) -> Vec<[f64; SIZE_DRIFTS]> {
    let scaled = |value: fn(&TrialObservation) -> f64| -> Vec<f64> {
        let all: Vec<f64> = observations.trials.iter().map(value).collect();
        let (low, high) = all.iter().fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
        let half = 0.5 * (high - low);
        all.iter().map(|x| if half > 1e-9 { (x - 0.5 * (low + high)) / half } else { 0.0 }).collect()
    };
    let order = scaled(|trial| trial.input.covariates.progress);
    let torque = scaled(|trial| trial.torque_nm);
    let velocity = scaled(|trial| trial.velocity_rad_s);
    (0..order.len()).map(|trial| [order[trial], torque[trial], velocity[trial]]).collect()
}

/// Standard deviations of the relative change of a mechanism's size, each over half the range of order, torque and velocity.
pub fn drift_sds(kind: MechanismKind) -> [f64; SIZE_DRIFTS] {
    [SIZE_DRIFT_SD, kind.torque_scaling_sd(), SIZE_DRIFT_SD]
}

/// What the logarithm of a model's evidence gains since a mechanism's size may also be the same in all trials, with probability 1/2. `sizes`
/// are the places of each mechanism's drifts among the unknowns, `values` the most probable ones, with their precision in the prior and
/// their covariance after the session.
///
/// The odds of no drift against some, of normal prior, are those of the density at zero after the session and before it (Dickey 1971).
pub fn gain_of_constant_sizes(
    sizes: &[Range<usize>],
    values: &DVector<f64>,
    (precision, covariance): (&DMatrix<f64>, &DMatrix<f64>),
) -> f64 {
    let odds_where_constant = |which: usize| {
        let constant = (0..sizes.len()).filter(|size| which & (1 << size) != 0);
        let places: Vec<usize> = constant.flat_map(|size| sizes[size].clone()).collect();
        if places.is_empty() {
            return Some(0.0);
        }
        let block = |of: &DMatrix<f64>| {
            DMatrix::from_fn(places.len(), places.len(), |i, j| of[(places[i], places[j])])
        };
        let at_zero = DVector::from_iterator(places.len(), places.iter().map(|place| values[*place]));
        let after = block(covariance).cholesky()?;
        let distance = at_zero.dot(&after.solve(&at_zero));
        Some(
            -0.5 * (distance
                + log_determinant_of_factor(after.l_dirty())
                + log_determinant(block(precision))?),
        )
    };
    let log_odds: Vec<f64> = (0..1 << sizes.len()).filter_map(odds_where_constant).collect();
    probabilities(&log_odds).1 - sizes.len() as f64 * std::f64::consts::LN_2
}

/// Changes of the constants that rig trials measured, over the session: a constant that is off may be off by more or less than the rig
/// trials saw. The value of each is a relative change of its distance from what the session states.
#[derive(Debug, Clone)]
pub struct ConstantDrifts {
    /// For each trial, change of its whitened prediction by each drift.
    pub columns: Vec<DMatrix<f64>>,
    /// Variance of each drift.
    pub variances: DVector<f64>,
    drifts: Vec<ConstantDrift>,
    /// The session where the distance of each constant is larger by [`SIZE_DRIFT_SD`] of it. It does not depend on the model.
    moved: Arc<Vec<Observations>>,
}

/// The change of one constant with one quantity.
#[derive(Debug, Clone)]
struct ConstantDrift {
    /// The cause that is about the constant.
    kind: MechanismKind,
    /// Place of the constant among the moved sessions.
    constant: usize,
    /// The quantity in each trial, relative to the rig trials.
    by: Vec<f64>,
    sd: f64,
}

impl ConstantDrift {
    /// Change of a trial's whitened prediction, where the larger distance of the constant has `changes`.
    fn column(&self, trial: usize, changes: &[DVector<f64>]) -> DVector<f64> {
        &changes[trial] * (self.by[trial] / SIZE_DRIFT_SD)
    }
}

impl ConstantDrifts {
    /// The drifts of a session about the model of `fit`. `covariates` are those of its trials.
    pub fn of(
        observations: &Observations,
        fit: &Fit,
        rig: &RigKnowledge,
        covariates: &[[f64; SIZE_DRIFTS]],
    ) -> Self {
        let constants = rig.with_larger_deviations(SIZE_DRIFT_SD);
        let moved = constants.iter().map(|(_, own)| with_other_constants(observations, own));
        let moved: Arc<Vec<Observations>> = Arc::new(moved.collect());
        let changes = changes(observations, &moved, fit);
        let of_rig_trials: [f64; SIZE_DRIFTS] =
            std::array::from_fn(|which| if which == ORDER { ORDER_OF_RIG_TRIALS } else { 0.0 });
        let mut drifts = Vec::new();
        for (constant, (kind, _)) in constants.iter().enumerate() {
            for (which, sd) in drift_sds(*kind).into_iter().enumerate() {
                let by = covariates.iter().map(|own| own[which] - of_rig_trials[which]).collect();
                let drift = ConstantDrift { kind: *kind, constant, by, sd };
                let square = |trial: usize| drift.column(trial, &changes[constant]).norm_squared();
                let shift = sd * libm::sqrt((0..covariates.len()).map(square).sum());
                if shift > SMALLEST_SHIFT {
                    drifts.push(drift);
                }
            }
        }
        let variances = DVector::from_iterator(drifts.len(), drifts.iter().map(|own| own.sd * own.sd));
        let columns = columns(observations, fit, &drifts, &changes);
        Self { columns, variances, drifts, moved }
    }

    /// The same drifts about another model.
    pub fn about(&self, observations: &Observations, fit: &Fit) -> Self {
        if self.drifts.is_empty() {
            return self.clone();
        }
        let changes = changes(observations, &self.moved, fit);
        Self { columns: columns(observations, fit, &self.drifts, &changes), ..self.clone() }
    }

    /// Changes of each trial's whitened prediction by each drift of the constants that `kinds` are about.
    pub fn of_constants(&self, kinds: &[MechanismKind]) -> Vec<Vec<DVector<f64>>> {
        let own = (0..self.drifts.len()).filter(|place| kinds.contains(&self.drifts[*place].kind));
        own.map(|place| self.columns.iter().map(|trial| trial.column(place).into_owned()).collect()).collect()
    }
}

/// For each moved session, change of each trial's whitened prediction under `fit`.
fn changes(observations: &Observations, moved: &[Observations], fit: &Fit) -> Vec<Vec<DVector<f64>>> {
    let from = torques(observations, &fit.kinds, &fit.parameters);
    moved.iter().map(|moved| change_against_record(observations, moved, fit, &from)).collect()
}

/// For each trial, the columns of `drifts`, where the larger distance of each constant has `changes`.
fn columns(
    observations: &Observations,
    fit: &Fit,
    drifts: &[ConstantDrift],
    changes: &[Vec<DVector<f64>>],
) -> Vec<DMatrix<f64>> {
    let of_trial = |trial: usize| {
        let rows = fit.objective.whitened_count(observations.noise_index[trial], observations.rows());
        let mut own = DMatrix::zeros(rows, drifts.len());
        for (mut column, drift) in own.column_iter_mut().zip(drifts) {
            column.copy_from(&drift.column(trial, &changes[drift.constant]));
        }
        own
    };
    (0..observations.trials.len()).map(of_trial).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{RigQuantity, Session};
    use crate::diagnose::test_session::{LEVER, measured_rig, session};
    use crate::diagnose::{DiagnosisInput, Verdict, diagnose};
    use crate::fit::{Model, PreprocessingSettings, RigConstants, Weighting};

    /// Delay of the torque at the beginning of the session, s, and its mean over the session.
    const FIRST_S: f64 = 0.000_72;
    const MEAN_S: f64 = 0.000_8;

    /// A session whose torque is late by more and more.
    fn ever_later() -> Session {
        session(MechanismKind::ChannelSkew, |order| vec![MEAN_S + order * (MEAN_S - FIRST_S)])
    }

    /// What rig trials that were made before it say.
    fn late_by(delay_s: f64) -> RigKnowledge {
        measured_rig(&[(RigQuantity::TorqueDelay, delay_s, 0.000_005)], None)
    }

    fn drifts(rig: &RigKnowledge) -> (Observations, Fit, ConstantDrifts) {
        let settings = PreprocessingSettings::default();
        let observations = Observations::of_rig(&ever_later(), settings, rig.constants).unwrap();
        let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
        let own = ConstantDrifts::of(&observations, &fit, rig, &drift_covariates(&observations));
        (observations, fit, own)
    }

    #[test]
    fn a_delay_changes_with_the_order_from_the_value_that_the_rig_trials_saw() {
        let rig = late_by(FIRST_S);
        let (observations, fit, own) = drifts(&rig);
        let order = own.drifts.iter().position(|own| own.by.iter().all(|by| *by >= 0.0)).unwrap();
        let of = |number: u32| observations.trials.iter().position(|trial| trial.number == number).unwrap();
        assert_eq!(own.columns[of(1)].column(order).amax(), 0.0);
        // A tenth of itself over half the session is two tenths in its last trial.
        let later = RigConstants { torque_delay_s: 1.2 * FIRST_S, ..rig.constants };
        let moved = with_other_constants(&observations, &later);
        let expected = changes(&observations, &[moved], &fit).remove(0).remove(of(12));
        let found = own.columns[of(12)].column(order) * 0.1;
        let off = (&found - &expected).norm() / expected.norm();
        assert!(off < 0.02, "{off}");
        let sd = libm::sqrt(own.variances[order]);
        assert!((sd - SIZE_DRIFT_SD).abs() < 1e-12);
        let again = own.about(&observations, &fit);
        assert_eq!(again.columns, own.columns);
    }

    /// Drifts of these values, each with this standard deviation after the session.
    fn gain_where(values: &[f64], sd: f64) -> f64 {
        let count = values.len();
        let of = |variance: f64| DMatrix::from_diagonal_element(count, count, variance);
        let sizes: Vec<Range<usize>> =
            (0..count / SIZE_DRIFTS).map(|size| SIZE_DRIFTS * size..SIZE_DRIFTS * (size + 1)).collect();
        let precision = of(1.0 / (SIZE_DRIFT_SD * SIZE_DRIFT_SD));
        gain_of_constant_sizes(&sizes, &DVector::from_row_slice(values), (&precision, &of(sd * sd)))
    }

    #[test]
    fn a_size_that_does_not_change_is_worth_what_the_drifts_lost_and_one_that_does_loses_half() {
        let half = -std::f64::consts::LN_2;
        // A session that says nothing of the drifts.
        assert!(gain_where(&[0.0; 3], SIZE_DRIFT_SD).abs() < 1e-12);
        let found = gain_where(&[0.0; 3], 0.1 * SIZE_DRIFT_SD);
        assert!((found - (half + libm::log(1.0 + 1000.0))).abs() < 1e-9, "{found}");
        let changing = gain_where(&[0.0, 0.2, 0.0], 0.1 * SIZE_DRIFT_SD);
        assert!((changing - half).abs() < 1e-9, "{changing}");
        // Of two mechanisms each is constant or not, whatever the other is.
        let of_two = gain_where(&[0.0, 0.0, 0.0, 0.0, 0.2, 0.0], 0.1 * SIZE_DRIFT_SD);
        assert!((of_two - (found + changing)).abs() < 1e-9, "{of_two}");
        assert_eq!(
            gain_of_constant_sizes(&[], &DVector::zeros(0), (&DMatrix::zeros(0, 0), &DMatrix::zeros(0, 0))),
            0.0
        );
    }

    /// The odds of no drift are those of two models of one value, with and without it.
    #[test]
    fn the_gain_of_a_constant_size_is_that_of_the_mixed_evidence() {
        let (noise, drawn) = (0.05, 0.03);
        let log_density = |variance: f64| -0.5 * (drawn * drawn / variance + libm::log(variance));
        let prior = SIZE_DRIFT_SD * SIZE_DRIFT_SD;
        let (without, with) = (log_density(noise * noise), log_density(noise * noise + prior));
        let variance = 1.0 / (1.0 / prior + 1.0 / (noise * noise));
        let mean = variance * drawn / (noise * noise);
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        let values = DVector::from_element(1, mean);
        let found = gain_of_constant_sizes(
            std::slice::from_ref(&(0..1)),
            &values,
            (&one(1.0 / prior), &one(variance)),
        );
        let mixed = libm::log(0.5 * (libm::exp(without) + libm::exp(with)));
        assert!((with + found - mixed).abs() < 1e-12, "{found}");
    }

    #[test]
    fn a_constant_that_is_as_stated_does_not_change() {
        assert_eq!(drifts(&late_by(0.0)).2.variances.len(), 0);
        assert_eq!(drifts(&RigKnowledge::stated(Some(LEVER))).2.variances.len(), 0);
    }

    /// It was a drift of the torque, and `unexplained`: what rig trials tell was not looked for in the session's trials.
    #[test]
    fn a_delay_that_came_after_the_rig_trials_is_found_and_said_to_contradict_them() {
        let view = PreprocessingSettings::default();
        let late = session(MechanismKind::ChannelSkew, |_| vec![MEAN_S]);
        // With the bound that a calibration has for a low-pass which it does not see: such a low-pass would have come after it as well.
        let rig = measured_rig(&[(RigQuantity::TorqueDelay, 0.0, 0.000_005)], Some(2000.0));
        let look = DiagnosisInput::of_rig(&late, view, &Model::paper(), rig).unwrap();
        let found = diagnose(&look, &Model::paper(), 1, &|_| {});
        let [cause] = found.causes.as_slice() else { panic!("{:?}", found.causes) };
        // A low-pass of second order that is as late is hardly another one.
        let others = cause.alternatives.iter().map(|own| (own.kind, own.values.as_slice()));
        let mut set = std::iter::once((cause.kind, cause.values.as_slice())).chain(others);
        let skew = set.find(|(kind, _)| *kind == MechanismKind::ChannelSkew);
        let (_, values) = skew.unwrap_or_else(|| panic!("{:?}", found.causes));
        assert!((values[0].value / MEAN_S - 1.0).abs() < 0.05, "{values:?}");
        let contradicts = format!("{} is not as the rig trials show it", cause.kind.id());
        assert!(found.remarks.iter().any(|remark| remark.contains(&contradicts)), "{:?}", found.remarks);
    }

    /// It was `unexplained`: a constant that rig trials had measured was the same in all trials.
    #[test]
    fn a_delay_that_grows_after_the_rig_trials_is_named() {
        let view = PreprocessingSettings::default();
        let look = DiagnosisInput::of_rig(&ever_later(), view, &Model::paper(), late_by(FIRST_S)).unwrap();
        let found = diagnose(&look, &Model::paper(), 1, &|_| {});
        let named: Vec<MechanismKind> = found.causes.iter().map(|cause| cause.kind).collect();
        assert_eq!(named, [MechanismKind::ChannelSkew], "{:?} {}", found.verdict, found.remaining_p_value);
        assert_eq!(found.verdict, Verdict::Named);
    }
}
