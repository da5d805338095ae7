//! The unknown law that a session shows: where it acts, of what, and its curve.

use nalgebra::DMatrix;
use serde_json::{Value, json};

use super::answer::CauseProbabilities;
use super::model_posterior::ModelPosterior;
use super::model_search::{ComparedModel, ModelSearch};
use super::used_freedom::Freedom;
use crate::fit::mechanism_ranges;
use crate::statistics::HALF_INTERVAL_95;
use crate::wrist::mechanisms::{FreeLaw, MechanismKind, Place};

/// Number of points of a curve.
const CURVE_POINTS: usize = 41;

/// An unknown law with its curve.
#[derive(Debug, Clone)]
pub struct FoundLaw {
    /// The free law.
    pub kind: MechanismKind,
    /// Its probability, given that the cause is in no catalogue.
    pub probability: f64,
    /// Others that the data do not tell from it, with their probabilities.
    pub alternatives: Vec<(MechanismKind, f64)>,
    /// Values of its argument.
    pub argument: Vec<f64>,
    /// The law there: what it adds.
    pub value: Vec<f64>,
    /// Lower and upper end of its 95 % band there.
    pub band: [Vec<f64>; 2],
}

impl FoundLaw {
    /// The most probable free law of a search.
    pub fn of(search: &ModelSearch, probabilities: &CauseProbabilities) -> Option<Self> {
        let likely = probabilities.likely_free_laws();
        let (kind, probability) = *likely.first()?;
        let model = search.models.iter().find(|own| own.causes == [kind])?;
        let mut law = Self::curve(search, &model.posterior, kind)?;
        law.probability = probability;
        law.alternatives = likely[1..].to_vec();
        Some(law)
    }

    fn curve(search: &ModelSearch, posterior: &ModelPosterior, kind: MechanismKind) -> Option<Self> {
        let law = kind.free_law()?;
        let [from, to] = search.prior.ranges.range(kind)?;
        let place = posterior.fit.kinds.iter().position(|own| *own == kind)?;
        let range = mechanism_ranges(&posterior.fit.kinds)[place].clone();
        let parameters = &posterior.fit.parameters[0][range.clone()];
        let argument: Vec<f64> =
            (0..CURVE_POINTS).map(|i| from + (to - from) * i as f64 / (CURVE_POINTS - 1) as f64).collect();
        let value: Vec<f64> = argument.iter().map(|u| law.curve(parameters, *u)).collect();
        let covariance = posterior.quadratic.common_covariance();
        let sd = argument.iter().map(|u| sd_at(posterior, &covariance, &law, range.start, parameters, *u));
        let sd: Vec<f64> = sd.collect();
        let end = |sign: f64| value.iter().zip(&sd).map(|(v, sd)| v + sign * HALF_INTERVAL_95 * sd).collect();
        let band = [end(-1.0), end(1.0)];
        Some(Self { kind, probability: 0.0, alternatives: Vec::new(), argument, value, band })
    }

    /// Where it acts.
    pub fn place(&self) -> Option<Place> {
        self.kind.free_law().map(|law| law.place)
    }

    /// The entry of `diagnosis.json`.
    pub fn to_json(&self) -> Value {
        let with_probability = |(kind, probability): &(MechanismKind, f64)| {
            let mut entry = what_and_where(*kind);
            entry["probability"] = json!(probability);
            entry
        };
        let mut entry = self.law_to_json();
        entry["probability"] = json!(self.probability);
        entry["alternatives"] = self.alternatives.iter().map(with_probability).collect();
        entry
    }

    /// The law without what it could be instead.
    fn law_to_json(&self) -> Value {
        let mut entry = what_and_where(self.kind);
        entry["title"] = json!(self.kind.title());
        entry["curve"] = json!({
            "at": self.argument, "value": self.value, "low": self.band[0], "high": self.band[1],
        });
        entry
    }
}

/// The law of a named mechanism beside an unknown law at the same place and of the same argument, fitted in its stead.
#[derive(Debug, Clone)]
pub struct LawCheck {
    /// The unknown law that the session shows there.
    pub free: FoundLaw,
    /// What it would show if the catalogued law were right.
    pub catalogued: Vec<f64>,
    /// Probability of as large a difference if the catalogued law is off by no more than was declared; `None` where nothing was declared.
    pub p_value: Option<f64>,
}

impl LawCheck {
    /// The check of the mechanism `kind` of `model`; `None` where no free law acts at its place.
    pub fn of(search: &ModelSearch, model: &ComparedModel, kind: MechanismKind) -> Option<Self> {
        let space = kind.law_space();
        let acts_there = |own: &MechanismKind| {
            own.free_law().is_some_and(|law| law.place == space.place && Some(law.argument) == space.argument)
        };
        let free = search.prior.ranges.kinds().find(acts_there)?;
        let posterior = search.with_free_law_in_place_of(model, kind, free)?;
        let law = free.free_law()?;
        let place = posterior.fit.kinds.iter().position(|own| *own == free)?;
        let first = mechanism_ranges(&posterior.fit.kinds)[place].start;
        let shown = posterior.most_probable_common(&search.effect_of(model, kind)?)?;
        let mut parameters =
            posterior.fit.parameters[0][mechanism_ranges(&posterior.fit.kinds)[place].clone()].to_vec();
        for index in law.coefficients.clone() {
            parameters[index] = shown[posterior.place_of_parameter(first + index)?];
        }
        let free = FoundLaw::curve(search, &posterior, free)?;
        let catalogued = free.argument.iter().map(|u| law.curve(&parameters, *u)).collect();
        let used = model.posterior.used_freedom();
        let p_value = used.iter().find(|own| own.freedom == Freedom::Law(free.kind)).map(|own| own.p_value);
        Some(Self { free, catalogued, p_value })
    }

    /// The entry of `diagnosis.json`.
    pub fn to_json(&self) -> Value {
        let mut entry = self.free.law_to_json();
        entry["p_value"] = json!(self.p_value);
        entry["curve"]["catalogued"] = json!(self.catalogued);
        entry
    }
}

/// Id, place and argument of a free law.
fn what_and_where(kind: MechanismKind) -> Value {
    let law = kind.free_law();
    json!({
        "mechanism": kind.id(),
        "place": law.as_ref().map(|law| law.place),
        "argument": law.as_ref().map(|law| law.argument),
    })
}

/// Standard deviation of a law at `u`, which is linear in its coefficients, by the `covariance` of the common unknowns.
fn sd_at(
    posterior: &ModelPosterior,
    covariance: &DMatrix<f64>,
    law: &FreeLaw,
    first: usize,
    parameters: &[f64],
    u: f64,
) -> f64 {
    let mut unit = parameters.to_vec();
    law.coefficients.clone().for_each(|index| unit[index] = 0.0);
    let weights: Vec<(usize, f64)> = law
        .coefficients
        .clone()
        .filter_map(|index| {
            unit[index] = 1.0;
            let weight = law.curve(&unit, u);
            unit[index] = 0.0;
            Some((posterior.place_of_parameter(first + index)?, weight))
        })
        .collect();
    let products =
        weights.iter().flat_map(|(i, a)| weights.iter().map(move |(j, b)| a * b * covariance[(*i, *j)]));
    libm::sqrt(products.sum::<f64>().max(0.0))
}
