//! How the errors of a calibration reach the estimates: G C G', with G the change of the estimates per change of the constants.
//!
//! An error of a constant is common to all trials of a session, so it does not shrink with repetitions.

use nalgebra::DVector;

use crate::dataset::{RigCalibration, RigQuantity};
use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::uncertainty::inverse_normal_matrix;
use crate::fit::population::session_fit::SessionFit;
use crate::fit::solver::normal_equations::evaluate;
use crate::wrist::BASE_PARAMETERS;

/// Smallest and largest step of the central differences, as parts of a constant that no rig has at zero.
const RELATIVE_STEP: (f64, f64) = (1e-4, 0.1);

/// Smallest and largest step of a delay, s.
const DELAY_STEP_S: (f64, f64) = (1e-6, 1e-4);

/// Relative change of the six base parameters of every trial.
pub type TrialChanges = Vec<[f64; 6]>;

/// What the errors of the measured constants do to the base parameters of every trial.
#[derive(Debug, Clone)]
pub struct ConstantEffects {
    /// The constants.
    pub quantities: Vec<RigQuantity>,
    /// For each constant, the relative change of the parameters by one standard error of the constant.
    pub per_se: Vec<TrialChanges>,
    /// Correlation of the errors of the constants.
    correlation: Vec<Vec<f64>>,
}

impl ConstantEffects {
    /// Effects on the fit of each trial on its own.
    pub fn of_fit(observations: &Observations, fit: &Fit, calibration: &RigCalibration) -> Self {
        Self::new(observations, fit, calibration, |gradient| {
            change_of_coordinates(observations, fit, gradient)
        })
    }

    /// Effects on the fit of a session as a whole.
    pub fn of_session(
        observations: &Observations,
        session: &SessionFit,
        calibration: &RigCalibration,
    ) -> Self {
        let change = |gradient: &DVector<f64>| session.change_of_coordinates(gradient);
        Self::new(observations, &session.fit, calibration, change)
    }

    /// The coordinates of a fit follow a change of the gradient of its cost by `change`.
    fn new(
        observations: &Observations,
        fit: &Fit,
        calibration: &RigCalibration,
        change: impl Fn(&DVector<f64>) -> DVector<f64>,
    ) -> Self {
        let constants = observations.constants;
        let known = calibration.covariance_of.iter().filter(|own| constants.value(**own).is_some());
        let quantities: Vec<RigQuantity> = known.copied().collect();
        let se = |quantity: RigQuantity| calibration.se(quantity).unwrap_or(0.0);
        let per_se = |quantity: &RigQuantity| {
            let (value, se) = (constants.value(*quantity).unwrap_or(0.0), se(*quantity));
            let step = step(*quantity, value, se);
            let gradient =
                |by: f64| gradient(&observations.with_constants(constants.with(*quantity, value + by)), fit);
            let slope = (gradient(step) - gradient(-step)) / (2.0 * step);
            relative_changes(fit, &(change(&slope) * se))
        };
        let correlation = |one: &RigQuantity| {
            let of = |other: &RigQuantity| {
                let covariance = calibration.covariance_between(*one, *other).unwrap_or(0.0);
                covariance / (se(*one) * se(*other))
            };
            quantities.iter().map(of).collect()
        };
        Self {
            per_se: quantities.iter().map(per_se).collect(),
            correlation: quantities.iter().map(correlation).collect(),
            quantities,
        }
    }

    /// Covariance that the errors of the constants give to the logarithms of a base parameter in two trials.
    pub fn log_covariance(&self, parameter: usize, one: usize, other: usize) -> f64 {
        let all = self.per_se.iter().zip(&self.correlation);
        all.map(|(changes, correlation)| {
            let others = self.per_se.iter().zip(correlation);
            let with = others.map(|(own, correlation)| correlation * own[other][parameter]).sum::<f64>();
            changes[one][parameter] * with
        })
        .sum()
    }

    /// Standard error of a parameter of a trial from the constants alone, relative to the parameter.
    pub fn se(&self, parameter: usize, trial: usize) -> f64 {
        libm::sqrt(self.log_covariance(parameter, trial, trial).max(0.0))
    }
}

/// Step of the central differences by a constant, near its standard error `se`.
fn step(quantity: RigQuantity, value: f64, se: f64) -> f64 {
    match quantity {
        RigQuantity::TorqueDelay => se.clamp(DELAY_STEP_S.0, DELAY_STEP_S.1),
        RigQuantity::TorqueOffset | RigQuantity::TorqueNonlinearity => se,
        _ => se.clamp(RELATIVE_STEP.0 * value.abs(), RELATIVE_STEP.1 * value.abs()).max(f64::MIN_POSITIVE),
    }
}

/// Gradient of the cost by all coordinates, at those of `fit`.
fn gradient(observations: &Observations, fit: &Fit) -> DVector<f64> {
    let components: Vec<_> = fit.parameterisation.components.iter().collect();
    let at = &fit.solution.coordinates;
    let equations =
        evaluate(observations, &fit.parameterisation, &fit.kinds, &fit.objective, &components, at);
    let mut all = DVector::zeros(at.len());
    for (component, equations) in components.iter().zip(&equations) {
        for (index, value) in component.order().iter().zip(equations.gradient(component).iter()) {
            all[*index] = if fit.coordinate_at_bound(*index) { 0.0 } else { *value };
        }
    }
    all
}

/// Change of the coordinates of `fit`, to first order, where the gradient of its cost changes by `gradient`. Of a component that the data
/// do not determine, none.
fn change_of_coordinates(observations: &Observations, fit: &Fit, gradient: &DVector<f64>) -> DVector<f64> {
    let components: Vec<_> = fit.parameterisation.components.iter().collect();
    let at = &fit.solution.coordinates;
    let equations =
        evaluate(observations, &fit.parameterisation, &fit.kinds, &fit.objective, &components, at);
    let mut all = DVector::zeros(at.len());
    for (component, equations) in components.iter().zip(&equations) {
        let Some(inverse) = inverse_normal_matrix(fit, component, equations) else { continue };
        let order = component.order();
        let own = DVector::from_iterator(order.len(), order.iter().map(|index| gradient[*index]));
        for (index, value) in order.iter().zip((-inverse * own).iter()) {
            all[*index] = *value;
        }
    }
    all
}

/// Relative change of the base parameters of every trial that a change of the coordinates makes, to first order.
fn relative_changes(fit: &Fit, by: &DVector<f64>) -> TrialChanges {
    let of_trial = |(trial, parameters): (usize, &Vec<f64>)| {
        let mut changes = [0.0; BASE_PARAMETERS.len()];
        for (parameter, change) in changes.iter_mut().enumerate() {
            let value = parameters[parameter];
            fit.parameterisation.slopes(trial, parameter, value, |coordinate, slope| {
                *change += slope * by[coordinate] / value;
            });
        }
        changes
    };
    fit.parameters.iter().enumerate().map(of_trial).collect()
}
