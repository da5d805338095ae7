//! Warm starts: fits of another model, or to other trials, that start at the optimum of a fit.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::fit::Fit;
use crate::fit::data::observations::Observations;
use crate::fit::linalg::invert_scaled;
use crate::fit::model::specification::{Model, mechanism_ranges};
use crate::fit::parameters::coordinate::Transform;
use crate::fit::parameters::parameterisation::Parameterisation;
use crate::fit::parameters::starting_values::StartingValues;
use crate::fit::solver::levenberg_marquardt::{Solution, solve};
use crate::fit::solver::options::SolverOptions;
use crate::wrist::mechanisms::MechanismKind;

/// Options of a fit that starts at the optimum of another fit.
pub(in crate::fit) const WARM_START: SolverOptions =
    SolverOptions { max_iterations: 40, tolerance: 1e-4, max_log_step: 0.7 };

/// The same where the optimum itself is wanted.
const TO_THE_END: SolverOptions = SolverOptions { max_iterations: 100, tolerance: 1e-9, max_log_step: 0.7 };

impl Fit {
    /// This fit to the same session with other constants of the rig, from its optimum, with the same bounds, priors and weights.
    pub fn refitted_to(&self, observations: &Observations) -> Self {
        let start = &self.solution.coordinates;
        let solution =
            solve(observations, &self.parameterisation, &self.kinds, &self.objective, start, TO_THE_END);
        Self { other_optima: Vec::new(), ..self.at_solution(solution) }
    }

    /// Fits `model`, which adds mechanisms to the model of this fit, from the optimum of this fit.
    pub fn extended(&self, observations: &Observations, model: &Model) -> Self {
        self.extended_by(observations, model, WARM_START)
    }

    /// Fits `model` to the trials `trials` of this fit, from its optimum; `subset` are the observations of these trials.
    pub fn extended_on_subset(&self, subset: &Observations, trials: &[usize], model: &Model) -> Self {
        self.restricted_to(trials).extended(subset, model)
    }

    /// This fit with the mechanism `kind` removed from its model; the other parameters stay nearly where they are.
    ///
    /// # Panics
    /// If the model does not have the mechanism.
    pub fn without(&self, observations: &Observations, kind: MechanismKind) -> Self {
        let index = self.kinds.iter().position(|own| *own == kind).expect("a mechanism of this fit");
        let removed = mechanism_ranges(&self.kinds)[index].clone();
        let mut model = self.model.clone();
        model.mechanisms.remove(index);
        let mut reduced = self.clone();
        reduced.parameters.iter_mut().for_each(|parameters| drop(parameters.drain(removed.clone())));
        reduced.extended_by(observations, &model, SolverOptions { max_iterations: 1, ..WARM_START })
    }

    /// Fits `model` from the optimum of this fit, with `options`.
    pub(in crate::fit) fn extended_by(
        &self,
        observations: &Observations,
        model: &Model,
        options: SolverOptions,
    ) -> Self {
        let (parameterisation, start) = self.start_of(observations, model);
        self.optimised_from(observations, model, parameterisation, &start, options)
    }

    /// `model` with the parameters of this fit, not fitted. What this fit does not have takes the starting values of the model.
    pub fn with_model(&self, observations: &Observations, model: &Model) -> Self {
        let (parameterisation, coordinates) = self.start_of(observations, model);
        let outcomes = Vec::new();
        let fit = Self {
            model: model.clone(),
            kinds: model.kinds(),
            parameterisation,
            other_optima: Vec::new(),
            ..self.clone()
        };
        fit.at_solution(Solution { coordinates, outcomes })
    }

    /// This fit with the mechanism `kind` removed from its model, not fitted; unchanged if it does not have it.
    pub fn with_mechanism_removed(&self, observations: &Observations, kind: MechanismKind) -> Self {
        let Some(index) = self.kinds.iter().position(|own| *own == kind) else { return self.clone() };
        let removed = mechanism_ranges(&self.kinds)[index].clone();
        let mut model = self.model.clone();
        model.mechanisms.remove(index);
        let mut reduced = self.clone();
        reduced.parameters.iter_mut().for_each(|parameters| drop(parameters.drain(removed.clone())));
        reduced.with_model(observations, &model)
    }

    /// The parameterisation of `model`, and the coordinates that correspond to the parameters of this fit.
    fn start_of(&self, observations: &Observations, model: &Model) -> (Parameterisation, Vec<f64>) {
        let starting_values = StartingValues::from_parameters(observations, &self.parameters);
        let mut parameterisation = Parameterisation::new(observations, model, &starting_values);
        if let Some(target) = &self.shrinkage_target {
            parameterisation.shrink_towards(target);
        }
        let mut start = parameterisation.start();
        let mut laws: BTreeMap<usize, Law> = BTreeMap::new();
        for (transforms, parameters) in parameterisation.transforms.iter().zip(&self.parameters) {
            for (transform, value) in transforms.iter().zip(parameters) {
                let (coordinate, at) = match transform {
                    Transform::Logarithmic { coordinate, factor } => (*coordinate, libm::log(value / factor)),
                    Transform::Sum(terms) if terms.len() == 1 => (terms[0].0, value / terms[0].1),
                    Transform::Sum(terms) => {
                        laws.entry(terms[0].0).or_default().push((terms.clone(), *value));
                        continue;
                    }
                    Transform::Fixed(_) => continue,
                };
                let bounds = &parameterisation.coordinates[coordinate];
                start[coordinate] = at.clamp(bounds.low, bounds.high);
            }
        }
        for law in laws.values() {
            for (coordinate, at) in coefficients(law) {
                start[coordinate] = at;
            }
        }
        (parameterisation, start)
    }

    /// Fits `model` with its `parameterisation` and the objective of this fit from the coordinates `start`.
    pub(in crate::fit) fn optimised_from(
        &self,
        observations: &Observations,
        model: &Model,
        parameterisation: Parameterisation,
        start: &[f64],
        options: SolverOptions,
    ) -> Self {
        let kinds = model.kinds();
        let solution = solve(observations, &parameterisation, &kinds, &self.objective, start, options);
        let fit =
            Self { model: model.clone(), kinds, parameterisation, other_optima: Vec::new(), ..self.clone() };
        fit.at_solution(solution)
    }

    /// The optimum of this fit in `trials` only, as the starting point of a fit to these trials.
    pub(in crate::fit) fn restricted_to(&self, trials: &[usize]) -> Self {
        let parameters = trials.iter().map(|trial| self.parameters[*trial].clone()).collect();
        let shrinkage_target = self.shrinkage_target.as_ref().map(|target| target.subset(trials));
        Self { parameters, shrinkage_target, ..self.clone() }
    }
}

/// The trials of a law: for each, the coefficients (as coordinates) with their factors, and the value of the parameter.
type Law = Vec<(Vec<(usize, f64)>, f64)>;

/// The coefficients of a law that describe the values of its trials best, by coordinate; none if the trials do not determine them.
fn coefficients(law: &Law) -> Vec<(usize, f64)> {
    let terms = &law[0].0;
    let factors = DMatrix::from_fn(law.len(), terms.len(), |trial, term| law[trial].0[term].1);
    let values = DVector::from_iterator(law.len(), law.iter().map(|(_, value)| *value));
    match invert_scaled(factors.tr_mul(&factors)) {
        Some(inverse) => {
            let found = inverse * factors.tr_mul(&values);
            terms.iter().zip(found.iter()).map(|((coordinate, _), value)| (*coordinate, *value)).collect()
        }
        None => Vec::new(),
    }
}
