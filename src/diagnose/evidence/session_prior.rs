//! Priors of everything unknown in a session, and the unknowns beside the coordinates of a fit: errors of the angle that trials share,
//! and sizes that are not quite the same in all trials.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::angle_error::AngleErrors;
use super::free_laws::FreeLawRanges;
use super::gaussian::smooth_precision;
use super::linearisation::{LinearTrial, Unknowns};
use super::rig_knowledge::RigKnowledge;
use super::session_equations::{Design, FreeLawPrior, REGRESSORS};
use super::size_drift::{ConstantDrifts, SIZE_DRIFTS, drift_covariates, drift_sds};
use super::used_freedom::Freedom;
use crate::diagnose::predicted_torque::torques;
use crate::fit::{DECREMENT_RATIO, Fit, I_J, K_DEC, K_SRS, Observations, mechanism_ranges};
use crate::statistics::group_indices;
use crate::wrist::BASE_PARAMETERS;
use crate::wrist::mechanisms::{FREE_LAWS, MechanismKind, Place, Prior, ProbeContext};

/// Standard deviation of I_j from repetition to repetition, as logarithm: the hand sits anew in the handle. Assumed.
const INERTIA_SD: f64 = 0.03;

/// Standard deviation of the prior of the logarithm of a parameter about which nothing is known.
const VAGUE_LOG_SD: f64 = 3.0;

/// A deviation of a law below this is not looked for, N m: the numerical error of the model has this size.
const LEAST_DEVIATION_NM: f64 = 1e-5;

/// Length over which the coefficients of a free law are alike, in knots.
const SMOOTHNESS_KNOTS: f64 = 1.5;

/// What is known of a session before its torques.
pub struct SessionPrior {
    /// What priors and probes may depend on.
    pub context: ProbeContext,
    /// Range of each free law's argument.
    pub ranges: FreeLawRanges,
    conditions: Vec<Vec<usize>>,
    regressors: Vec<[f64; REGRESSORS]>,
    /// Order, torque and velocity of each trial, between -1 and 1.
    drifts: Vec<[f64; SIZE_DRIFTS]>,
    /// Errors of the angle and of the rig's constants that trials share.
    pub angle_errors: AngleErrors,
    /// Changes of the rig's measured constants over the session.
    pub constant_drifts: ConstantDrifts,
    /// What is known of the rig.
    pub rig: RigKnowledge,
    /// Coordinates of the model as given, about which vague priors lie.
    given: Vec<(usize, f64)>,
}

impl SessionPrior {
    /// The priors for a session that was fitted by `fit`, the model as given.
    pub fn new(observations: &Observations, fit: &Fit, context: ProbeContext, rig: RigKnowledge) -> Self {
        let count = observations.trials.len();
        let groups = group_indices(count, |trial| observations.trials[trial].condition);
        let conditions: Vec<Vec<usize>> = groups.into_values().collect();
        let logs: Vec<[f64; 2]> = conditions
            .iter()
            .map(|trials| {
                let own = &observations.trials[trials[0]];
                [own.velocity_rad_s, own.torque_nm].map(|size| libm::log(size.abs().max(1e-3)))
            })
            .collect();
        let mean = [0, 1].map(|which| logs.iter().map(|own| own[which]).sum::<f64>() / logs.len() as f64);
        let regressors = logs.iter().map(|own| [1.0, own[0] - mean[0], own[1] - mean[1]]).collect();
        let drifts = drift_covariates(observations);
        let coordinates = fit.parameterisation.coordinates.iter().zip(&fit.solution.coordinates);
        Self {
            context,
            ranges: FreeLawRanges::of(observations, fit),
            conditions,
            regressors,
            constant_drifts: ConstantDrifts::of(observations, fit, &rig, &drifts),
            drifts,
            angle_errors: AngleErrors::of(observations, fit, &rig),
            rig,
            given: coordinates.map(|(own, value)| (own.parameter, *value)).collect(),
        }
    }

    /// `start` with a free law beside each of its mechanisms `added` whose law is uncertain, at zero.
    pub fn with_deviations(&self, observations: &Observations, start: &Fit, added: &[MechanismKind]) -> Fit {
        let mut model = start.model.clone();
        for kind in added {
            let Some(law) = deviation_of(*kind).filter(|law| !model.kinds().contains(law)) else { continue };
            let sd = kind.law_space().sd * self.effect_nm(observations, start, *kind);
            if sd > LEAST_DEVIATION_NM {
                model = self.ranges.with_free_law(model, law);
                if let Some(lags) = lags_of_law(start, added, law) {
                    self.ranges.restrict_to_lags(&mut model, law, lags);
                }
            }
        }
        if model.mechanisms.len() == start.model.mechanisms.len() {
            return start.clone();
        }
        start.with_model(observations, &model)
    }

    /// Root mean square of what a mechanism of `fit` does to the torque, N m.
    pub fn effect_nm(&self, observations: &Observations, fit: &Fit, kind: MechanismKind) -> f64 {
        let Some(place) = fit.kinds.iter().position(|own| *own == kind) else { return 0.0 };
        let range = mechanism_ranges(&fit.kinds)[place].clone();
        let mut kinds = fit.kinds.clone();
        kinds.remove(place);
        let mut parameters = fit.parameters.clone();
        parameters.iter_mut().for_each(|own| drop(own.drain(range.clone())));
        let with = torques(observations, &fit.kinds, &fit.parameters);
        let without = torques(observations, &kinds, &parameters);
        root_mean_square(with.iter().flatten().zip(without.iter().flatten()).map(|(a, b)| a - b))
    }

    /// The design of the model of `fit`, whose common unknowns are its common coordinates and then `columns`.
    pub fn design(
        &self,
        observations: &Observations,
        fit: &Fit,
        unknowns: &Unknowns,
        columns: &AddedColumns,
    ) -> Design {
        let common = unknowns.common.len() + columns.count();
        let (mut mean, mut precision) = (DVector::zeros(common), DMatrix::zeros(common, common));
        let inertias: Vec<usize> = self.places_of(fit, unknowns, |parameter| parameter == I_J);
        let shared = shared_level_precision(inertias.len(), INERTIA_SD, VAGUE_LOG_SD);
        for (i, one) in inertias.iter().enumerate() {
            mean[*one] = self.given_value(I_J);
            for (j, other) in inertias.iter().enumerate() {
                precision[(*one, *other)] = shared[(i, j)];
            }
        }
        let mut law = None;
        for (kind, range) in fit.kinds.iter().zip(mechanism_ranges(&fit.kinds)) {
            let places = self.places_of(fit, unknowns, |parameter| range.contains(&parameter));
            if kind.is_free_law() {
                let (smooth, log_determinant) = smooth_precision(places.len(), SMOOTHNESS_KNOTS);
                let variance = self.ranges.typical_size(*kind) * self.ranges.typical_size(*kind);
                let Some(first) = places.first() else { continue };
                match columns.deviation_sd(*kind) {
                    Some(sd) => {
                        let mut own = precision.view_mut((*first, *first), smooth.shape());
                        own.copy_from(&(smooth / (sd * sd)));
                    }
                    None => {
                        law = Some(FreeLawPrior {
                            first: *first,
                            precision: smooth,
                            log_determinant,
                            variance,
                        });
                    }
                }
                continue;
            }
            for place in places {
                let coordinate = &fit.parameterisation.coordinates[unknowns.common[place]];
                let own = kind.prior(coordinate.parameter - range.start, &self.context);
                let absent = kind.parameters()[coordinate.parameter - range.start].absent.unwrap_or(0.0);
                let (centre, sd) = in_coordinate(own, absent, coordinate.logarithmic);
                mean[place] = centre;
                precision[(place, place)] = 1.0 / (sd * sd);
            }
        }
        for place in
            self.places_of(fit, unknowns, |parameter| parameter != I_J && parameter < BASE_PARAMETERS.len())
        {
            let coordinate = &fit.parameterisation.coordinates[unknowns.common[place]];
            mean[place] = self.given_value(coordinate.parameter);
            let sd = if coordinate.logarithmic { VAGUE_LOG_SD } else { VAGUE_LOG_SD * coordinate.scale };
            precision[(place, place)] = 1.0 / (sd * sd);
        }
        let first = unknowns.common.len();
        let own = columns.precision();
        precision.view_mut((first, first), own.shape()).copy_from(&own);
        let position = |parameter: usize| unknowns.parameters.iter().position(|own| *own == parameter);
        let ratio = position(K_DEC)
            .zip(position(K_SRS))
            .map(|(above, below)| (above, below, libm::log(DECREMENT_RATIO.0), DECREMENT_RATIO.1));
        Design {
            conditions: self.conditions.clone(),
            regressors: self.regressors.clone(),
            own: unknowns.parameters.len(),
            common_mean: mean,
            common_precision: precision,
            ratio,
            law,
            variance_factor: vec![1.0; observations.trials.len()],
        }
    }

    /// Places among the common unknowns of the coordinates whose parameter is wanted.
    fn places_of(&self, fit: &Fit, unknowns: &Unknowns, wanted: impl Fn(usize) -> bool) -> Vec<usize> {
        let parameter = |place: &usize| fit.parameterisation.coordinates[unknowns.common[*place]].parameter;
        (0..unknowns.common.len()).filter(|place| wanted(parameter(place))).collect()
    }

    /// Mean of the coordinates of a base parameter in the fit of the model as given.
    fn given_value(&self, parameter: usize) -> f64 {
        let own: Vec<f64> =
            self.given.iter().filter(|(of, _)| *of == parameter).map(|(_, value)| *value).collect();
        own.iter().sum::<f64>() / own.len().max(1) as f64
    }

    /// Whether the prior of a parameter of `fit` lies on one side of no effect.
    pub fn is_one_sided(&self, fit: &Fit, parameter: usize, added: &[MechanismKind]) -> bool {
        let kinds = fit.kinds.iter().zip(mechanism_ranges(&fit.kinds));
        let mut of = kinds.filter(|(kind, range)| added.contains(kind) && range.contains(&parameter));
        of.next().is_some_and(|(kind, range)| {
            !kind.is_free_law()
                && matches!(kind.prior(parameter - range.start, &self.context), Prior::HalfNormal { .. })
        })
    }
}

/// The free law at the place and of the argument of a mechanism's law, if that law is uncertain.
fn deviation_of(kind: MechanismKind) -> Option<MechanismKind> {
    if kind.is_free_law() {
        return None;
    }
    let space = kind.law_space();
    FREE_LAWS.iter().copied().find(|law| {
        law.free_law().is_some_and(|law| law.place == space.place && Some(law.argument) == space.argument)
    })
}

/// The lags at which the mechanisms `added` of `fit` need their free law `law`; `None` if one of them does at all.
fn lags_of_law(fit: &Fit, added: &[MechanismKind], law: MechanismKind) -> Option<[f64; 2]> {
    let mechanisms = fit.kinds.iter().zip(mechanism_ranges(&fit.kinds));
    let of_law = mechanisms.filter(|(kind, _)| added.contains(kind) && deviation_of(**kind) == Some(law));
    let mut lags = of_law.map(|(kind, range)| kind.law_lags_s(&fit.parameters[0][range]));
    let first = lags.next()??;
    lags.try_fold(first, |all, own| own.map(|own| [all[0].min(own[0]), all[1].max(own[1])]))
}

/// Mean and standard deviation of a prior in the coordinate of a fit.
fn in_coordinate(prior: Prior, absent: f64, logarithmic: bool) -> (f64, f64) {
    match (prior, logarithmic) {
        (Prior::LogNormal { median, log_sd }, true) => (libm::log(median), log_sd),
        (Prior::LogNormal { median, log_sd }, false) => (median, median * log_sd),
        (Prior::Normal { mean, sd }, false) => (mean, sd),
        (Prior::Normal { mean, sd }, true) => (libm::log(mean.max(1e-9)), sd / mean.abs().max(1e-9)),
        (Prior::HalfNormal { sd }, false) => (absent, sd),
        (Prior::HalfNormal { sd }, true) => (libm::log(absent.max(1e-9)), sd / absent.abs().max(1e-9)),
    }
}

/// Precision of `count` values that scatter by `sd` about a level of their own, whose standard deviation is `level_sd`.
fn shared_level_precision(count: usize, sd: f64, level_sd: f64) -> DMatrix<f64> {
    let covariance =
        DMatrix::from_fn(count, count, |i, j| level_sd * level_sd + if i == j { sd * sd } else { 0.0 });
    covariance.cholesky().map_or_else(|| DMatrix::identity(count, count), |own| own.inverse())
}

pub fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, count), value| (sum + value * value, count + 1));
    libm::sqrt(sum / count.max(1) as f64)
}

/// A mechanism whose size may drift.
struct Drifting {
    kind: MechanismKind,
    /// Its first parameter.
    parameter: usize,
    /// The coordinate of that parameter without effect, if it has one.
    absent: Option<f64>,
    /// Standard deviations of the relative change of its size, each over half the range of order, torque and velocity.
    sd: [f64; SIZE_DRIFTS],
}

/// Unknowns beside the coordinates of a fit, in which the torque is linear.
pub struct AddedColumns<'a> {
    prior: &'a SessionPrior,
    /// Errors of the angle that trials share, about this model.
    angle_errors: AngleErrors,
    /// Changes of the rig's measured constants over the session, about this model.
    constant_drifts: ConstantDrifts,
    /// The mechanisms whose size may drift.
    drifting: Vec<Drifting>,
    /// Free laws that are deviations from a mechanism's law, with the standard deviation of their coefficients.
    deviations: Vec<(MechanismKind, f64)>,
}

impl<'a> AddedColumns<'a> {
    /// The columns of `fit`, whose mechanisms `added` are in question.
    pub fn new(
        prior: &'a SessionPrior,
        observations: &Observations,
        fit: &Fit,
        added: &[MechanismKind],
        effect: &dyn Fn(MechanismKind) -> f64,
    ) -> Self {
        let mut drifting = Vec::new();
        let mut deviations: Vec<(MechanismKind, f64)> = Vec::new();
        for (kind, range) in fit.kinds.iter().zip(mechanism_ranges(&fit.kinds)) {
            if !added.contains(kind) || kind.is_free_law() || range.is_empty() {
                continue;
            }
            if kind.law_space().place != Place::Trials {
                drifting.push(Drifting {
                    kind: *kind,
                    parameter: range.start,
                    absent: without_effect(*kind, &prior.context),
                    sd: drift_sds(*kind),
                });
            }
            if let Some(law) = deviation_of(*kind).filter(|law| fit.kinds.contains(law)) {
                let sd = kind.law_space().sd * effect(*kind) / prior.ranges.argument_size(law);
                match deviations.iter_mut().find(|(own, _)| *own == law) {
                    Some((_, known)) => *known = libm::hypot(*known, sd),
                    None => deviations.push((law, sd)),
                }
            }
        }
        Self {
            prior,
            angle_errors: prior.angle_errors.about(observations, fit),
            constant_drifts: prior.constant_drifts.about(observations, fit),
            drifting,
            deviations,
        }
    }

    /// Their number.
    pub fn count(&self) -> usize {
        self.shared_errors() + SIZE_DRIFTS * self.drifting.len()
    }

    /// Number of the first of them: errors of the angle and drifts of measured constants.
    fn shared_errors(&self) -> usize {
        self.angle_errors.variances.len() + self.constant_drifts.variances.len()
    }

    /// What the model of `fit` may do with a declared standard deviation, with its places among the common unknowns.
    pub fn freedoms(&self, fit: &Fit, unknowns: &Unknowns) -> Vec<(Freedom, Range<usize>)> {
        let errors = unknowns.common.len();
        let sizes = errors + self.shared_errors();
        let law = |(kind, range): (&MechanismKind, Range<usize>)| {
            self.deviation_sd(*kind)?;
            let places = self.prior.places_of(fit, unknowns, |parameter| range.contains(&parameter));
            Some((Freedom::Law(*kind), *places.first()?..*places.last()? + 1))
        };
        let size = |(number, own): (usize, &Drifting)| {
            let first = sizes + SIZE_DRIFTS * number;
            (Freedom::Size(own.kind), first..first + SIZE_DRIFTS)
        };
        let laws = fit.kinds.iter().zip(mechanism_ranges(&fit.kinds)).filter_map(law);
        let mut freedoms: Vec<(Freedom, Range<usize>)> = laws.collect();
        freedoms.extend(self.drifting.iter().enumerate().map(size));
        freedoms.extend((sizes > errors).then_some((Freedom::SharedErrors, errors..sizes)));
        freedoms
    }

    fn deviation_sd(&self, law: MechanismKind) -> Option<f64> {
        self.deviations.iter().find(|(own, _)| *own == law).map(|(_, sd)| *sd)
    }

    fn precision(&self) -> DMatrix<f64> {
        let sizes = self.drifting.iter().flat_map(|own| own.sd.map(|sd| sd * sd));
        let shared = self.angle_errors.variances.iter().chain(self.constant_drifts.variances.iter());
        let variances: Vec<f64> = shared.copied().chain(sizes).collect();
        DMatrix::from_diagonal(&DVector::from_fn(self.count(), |place, _| 1.0 / variances[place]))
    }

    /// Adds the columns to the session that is `linear` at `fit`, and takes what they explain at `common` out of its residuals.
    pub fn add_to(&self, fit: &Fit, unknowns: &Unknowns, common: &DVector<f64>, linear: &mut [LinearTrial]) {
        let coordinates = unknowns.common.len();
        let (errors, constants) = (&self.angle_errors.columns, &self.constant_drifts.columns);
        let sizes = coordinates + self.shared_errors();
        let values = common.rows(coordinates, self.count()).into_owned();
        for (trial, own) in linear.iter_mut().enumerate() {
            let known = std::mem::replace(&mut own.common, DMatrix::zeros(0, 0));
            own.common = known.resize_horizontally(coordinates + self.count(), 0.0);
            let mut first = coordinates;
            for shared in [&errors[trial], &constants[trial]] {
                own.common.columns_mut(first, shared.ncols()).copy_from(shared);
                first += shared.ncols();
            }
            for (number, drifting) in self.drifting.iter().enumerate() {
                let place = unknowns.common.iter().position(|index| {
                    fit.parameterisation.coordinates[*index].parameter == drifting.parameter
                });
                let Some(place) = place else { continue };
                // Of a parameter that has no value without effect, such as a cut-off, the logarithm drifts.
                let size = drifting.absent.map_or(1.0, |absent| common[place] - absent);
                for (which, by) in self.prior.drifts[trial].iter().enumerate() {
                    let column = own.common.column(place) * (size * by);
                    own.common.set_column(sizes + SIZE_DRIFTS * number + which, &column);
                }
            }
            own.residual -= own.common.columns(coordinates, self.count()) * &values;
        }
    }
}

/// The value of a mechanism's first parameter at which it has no effect; `None` if it has none only in a limit.
pub fn value_without_effect(kind: MechanismKind, context: &ProbeContext) -> Option<f64> {
    match (kind.parameters().first()?.absent, kind.law_space().place, kind.prior(0, context)) {
        (Some(absent), ..) => Some(absent),
        // A constant of the lever has no effect where it is as stated, the median of its prior.
        (None, Place::Handle, Prior::LogNormal { median, .. }) => Some(median),
        _ => None,
    }
}

/// The coordinate of a mechanism's first parameter at which it has no effect.
fn without_effect(kind: MechanismKind, context: &ProbeContext) -> Option<f64> {
    let absent = value_without_effect(kind, context)?;
    Some(if kind.parameters()[0].low > 0.0 { libm::log(absent) } else { absent })
}
