//! The posterior of one model: its optimum, spreads by marginal likelihood, and its evidence by Laplace's approximation.

use std::ops::Range;

use nalgebra::DVector;

use super::gaussian::log_normal_distribution;
use super::linearisation::{LinearTrial, Unknowns, linearise};
use super::session_equations::{
    Design, Point, Products, Quadratic, REGRESSORS, ResidualProducts, Spreads, cost,
};
use super::session_prior::{AddedColumns, SessionPrior};
use super::size_drift::gain_of_constant_sizes;
use super::used_freedom::{Freedom, UsedFreedom, p_value_of};
use crate::diagnose::interval::Interval;
use crate::fit::{Fit, Observations, Solution, mechanism_ranges};
use crate::random::Stream;
use crate::statistics::HALF_INTERVAL_95;
use crate::wrist::BASE_PARAMETERS;
use crate::wrist::mechanisms::MechanismKind;

/// Largest number of linearisations.
const MAX_LINEARISATIONS: usize = 40;

/// Largest number of steps of expectation maximisation for one linearisation, and the change of a variance's logarithm that ends them.
const MAX_SPREAD_STEPS: usize = 6;
const SPREAD_TOLERANCE: f64 = 0.02;

/// A predicted decrease of the cost, in units of log likelihood, below which the optimum is reached.
const COST_TOLERANCE: f64 = 0.1;

/// Number of linearisations after which a model is given up if it does not promise to be worth it.
const LINEARISATIONS_TO_PROMISE: usize = 3;

/// Number of linearisations whose progress says how far the others would lead. In a flat, curved valley each step promises more than it
/// brings.
const LINEARISATIONS_TO_PROGRESS: usize = 6;

/// Longest step of a logarithm.
const LONGEST_LOG_STEP: f64 = 0.5;

/// Damping of a step that did not decrease the cost, its growth, and its decay with each step that did.
const FIRST_DAMPING: f64 = 10.0;
const DAMPING_GROWTH: f64 = 10.0;
const DAMPING_DECAY: f64 = 0.1;
const SMALLEST_DAMPING: f64 = 5.0;
const LARGEST_DAMPING: f64 = 1e6;

/// A predicted decrease above which a point is no optimum.
const TRUSTED_DECREASE: f64 = 2.0;

/// Logarithms of the evidence below which a model is not worth its time.
#[derive(Debug, Clone, Copy)]
pub struct LeastEvidence {
    /// What the first steps must promise.
    pub promised: f64,
    /// What the progress of later steps must lead to.
    pub reached: f64,
}

impl LeastEvidence {
    /// For a model that is followed to its optimum, whatever it is worth.
    pub const NONE: Self = Self { promised: f64::NEG_INFINITY, reached: f64::NEG_INFINITY };
}

/// The way to an optimum.
#[derive(Default)]
struct WayToOptimum {
    /// The logarithm of the evidence at each point, were it the optimum.
    evidence: Vec<f64>,
    /// What the next step promises, and as much again for what is curved.
    promised: f64,
}

impl WayToOptimum {
    fn add(&mut self, quadratic: &Quadratic) {
        self.evidence.push(quadratic.log_evidence - quadratic.decrease);
        self.promised = quadratic.log_evidence + quadratic.decrease;
    }

    /// Whether neither what is promised nor what the last steps brought leads to the evidence `least`.
    fn falls_short_of(&self, least: LeastEvidence) -> bool {
        let steps = self.evidence.len() - 1;
        if steps >= LINEARISATIONS_TO_PROMISE && self.promised < least.promised {
            return true;
        }
        if steps < LINEARISATIONS_TO_PROGRESS {
            return false;
        }
        let (now, before) = (self.evidence[steps], self.evidence[steps - LINEARISATIONS_TO_PROGRESS]);
        let left = (MAX_LINEARISATIONS - steps) as f64 / LINEARISATIONS_TO_PROGRESS as f64;
        self.promised.max(now + left * (now - before).max(0.0)) < least.reached
    }
}

/// The posterior of a model near one optimum.
#[derive(Debug, Clone)]
pub struct ModelPosterior {
    /// The mechanisms that the model adds to the one that was given.
    pub added: Vec<MechanismKind>,
    /// The model at its optimum, with the free laws by which those of its mechanisms may deviate.
    pub fit: Fit,
    /// Which coordinates are whose.
    pub unknowns: Unknowns,
    /// The optimum.
    pub point: Point,
    /// The estimated variances.
    pub spreads: Spreads,
    /// The approximation at the optimum.
    pub quadratic: Quadratic,
    /// The session, linear about the optimum.
    pub linear: Vec<LinearTrial>,
    /// Its products.
    pub products: Products,
    /// What does not depend on the data.
    pub design: Design,
    /// Logarithm of the evidence.
    pub log_evidence: f64,
    /// Number of linearisations.
    pub steps: usize,
    /// What it may do with a declared standard deviation, with the places among the common unknowns.
    freedoms: Vec<(Freedom, Range<usize>)>,
}

impl ModelPosterior {
    /// The posterior that is reached from the parameters of `start`, a fit whose model has the mechanisms `added`, with their laws as
    /// catalogued. `None` if the approximation fails there. The search ends early where it does not promise the evidence `least`; what it has
    /// reached by then is returned.
    pub fn with_exact_laws(
        observations: &Observations,
        prior: &SessionPrior,
        start: &Fit,
        added: &[MechanismKind],
        spreads: Option<&Spreads>,
        least: LeastEvidence,
    ) -> Option<Self> {
        Self::settled(observations, prior, start.clone(), added, spreads, None, least)
    }

    /// This posterior where the laws of the mechanisms may deviate from the catalogued ones; `None` if none of them can, or if the
    /// approximation fails.
    pub fn with_deviating_laws(&self, observations: &Observations, prior: &SessionPrior) -> Option<Self> {
        let fit = prior.with_deviations(observations, &self.fit, &self.added);
        if fit.kinds.len() == self.fit.kinds.len() {
            return None;
        }
        let least = LeastEvidence::NONE;
        Self::settled(observations, prior, fit, &self.added, Some(&self.spreads), None, least)
    }

    /// This posterior where trials have other variances about their condition.
    pub fn with_variance_factors(
        &self,
        observations: &Observations,
        prior: &SessionPrior,
        variance_factor: &[f64],
    ) -> Option<Self> {
        let fit = self.fit.clone();
        let least = LeastEvidence::NONE;
        Self::settled(
            observations,
            prior,
            fit,
            &self.added,
            Some(&self.spreads),
            Some(variance_factor),
            least,
        )
    }

    fn settled(
        observations: &Observations,
        prior: &SessionPrior,
        fit: Fit,
        added: &[MechanismKind],
        spreads: Option<&Spreads>,
        variance_factor: Option<&[f64]>,
        least: LeastEvidence,
    ) -> Option<Self> {
        let unknowns = Unknowns::of(&fit);
        let effect = |kind: MechanismKind| prior.effect_nm(observations, &fit, kind);
        let columns = AddedColumns::new(prior, observations, &fit, added, &effect);
        let mut design = prior.design(observations, &fit, &unknowns, &columns);
        if let Some(factors) = variance_factor {
            design.variance_factor = factors.to_vec();
        }
        let law = design.law.as_ref().map_or(1.0, |law| law.variance);
        let mut spreads = spreads
            .filter(|own| own.trial.len() == design.own)
            .cloned()
            .unwrap_or_else(|| Spreads::start(design.own, law));
        spreads.law = law;
        let mut here = Here::new(observations, fit.clone(), &unknowns, &columns, &design, None)?;
        let (mut quadratic, mut held) = here.quadratic(&unknowns, &design, &mut spreads)?;
        let mut damping = 0.0;
        let mut progress = WayToOptimum::default();
        progress.add(&quadratic);
        let mut steps = 0;
        while quadratic.decrease > COST_TOLERANCE && steps < MAX_LINEARISATIONS {
            steps += 1;
            let context = (observations, &unknowns, &columns, &held);
            let Some(next) = here.stepped(context, &spreads, &quadratic, &mut damping) else { break };
            here = next;
            (quadratic, held) = here.quadratic(&unknowns, &design, &mut spreads)?;
            progress.add(&quadratic);
            if progress.falls_short_of(least) {
                break;
            }
        }
        // Where the search stopped early, the minimum of the quadratic is no optimum: the evidence is at least that of the point.
        let shortfall = if quadratic.decrease > TRUSTED_DECREASE { quadratic.decrease } else { 0.0 };
        let sided = one_sided(prior, &here, &unknowns, &design, added);
        let log_evidence = match sided.as_slice() {
            [] => quadratic.log_evidence - shortfall,
            _ if shortfall > 0.0 => quadratic.log_evidence - shortfall,
            // Their integral ends at the bound, wherever the minimum is.
            places => {
                let free = design.quadratic(&spreads, &here.point, &here.products)?;
                let variances = free.common_covariance().diagonal();
                let above = |place: &usize| {
                    let mean = here.point.common[*place] + free.step.common[*place];
                    above_bound(mean - design.common_mean[*place], variances[*place])
                };
                free.log_evidence + places.iter().map(above).sum::<f64>()
            }
        };
        let Here { fit, point, linear, products } = here;
        let freedoms = columns.freedoms(&fit, &unknowns);
        let sizes = freedoms.iter().filter(|(freedom, _)| matches!(freedom, Freedom::Size(_)));
        let sizes: Vec<Range<usize>> = sizes.map(|(_, places)| places.clone()).collect();
        let values = &point.common + &quadratic.step.common - &design.common_mean;
        let before_and_after = (&design.common_precision, &quadratic.common_covariance());
        let log_evidence = log_evidence + gain_of_constant_sizes(&sizes, &values, before_and_after);
        Some(Self {
            added: added.to_vec(),
            fit,
            unknowns,
            point,
            spreads,
            quadratic,
            linear,
            products,
            design,
            log_evidence,
            steps,
            freedoms,
        })
    }

    /// Changes of each trial's whitened prediction as the size of a mechanism changes with the order of the trials, torque and velocity.
    pub fn size_changes(&self) -> Vec<Vec<DVector<f64>>> {
        let change = |place: usize| -> Vec<DVector<f64>> {
            self.linear.iter().map(|trial| trial.common.column(place).into_owned()).collect()
        };
        let sizes = self.freedoms.iter().filter(|(freedom, _)| matches!(freedom, Freedom::Size(_)));
        sizes.flat_map(|(_, places)| places.clone()).map(change).collect()
    }

    /// What use the session makes of each freedom of the model.
    pub fn used_freedom(&self) -> Vec<UsedFreedom> {
        let values = &self.point.common + &self.quadratic.step.common - &self.design.common_mean;
        let (precision, covariance) = (&self.design.common_precision, self.quadratic.common_covariance());
        let used = |(freedom, places): &(Freedom, Range<usize>)| {
            let p_value = p_value_of(places, &values, precision, &covariance)?;
            Some(UsedFreedom { freedom: *freedom, p_value })
        };
        self.freedoms.iter().filter_map(used).collect()
    }

    /// Errors of each trial's own coordinates in `count` sessions that differ from this one by their noise alone.
    pub fn simulated_errors(&self, count: usize, stream: &mut Stream) -> Vec<Vec<DVector<f64>>> {
        let sd = libm::sqrt(self.spreads.noise);
        let residuals = |_| -> Vec<DVector<f64>> {
            let noise =
                |trial: &LinearTrial| DVector::from_fn(trial.residual.len(), |_, _| sd * stream.normal());
            self.linear.iter().map(noise).collect()
        };
        self.most_probable_changes((0..count).map(residuals)).into_iter().map(|change| change.own).collect()
    }

    /// Most probable values of the common unknowns, relative to their prior, if the session differed from its model's prior mean by
    /// `residuals`.
    pub fn most_probable_common(&self, residuals: &[DVector<f64>]) -> Option<DVector<f64>> {
        self.most_probable_changes([residuals]).pop().map(|change| change.common)
    }

    /// Most probable values of the unknowns, relative to their prior, for each of some sessions that differ from the prior mean of this
    /// one's model by such residuals.
    fn most_probable_changes<R: AsRef<[DVector<f64>]>>(
        &self,
        sessions: impl IntoIterator<Item = R>,
    ) -> Vec<Point> {
        let about = Point {
            common: self.design.common_mean.clone(),
            coefficients: DVector::zeros(self.point.coefficients.len()),
            means: self.point.means.iter().map(|own| own * 0.0).collect(),
            own: self.point.own.iter().map(|own| own * 0.0).collect(),
        };
        let design = self.design.without_ratio();
        let Some(factor) = design.factor(&self.spreads, &self.products) else { return Vec::new() };
        let change = |residuals: R| {
            let products = ResidualProducts::new(&self.linear, residuals.as_ref());
            design.step(&factor, &self.spreads, &about, &products)
        };
        sessions.into_iter().filter_map(change).collect()
    }

    /// Place among the common unknowns of a parameter that all trials share.
    pub fn place_of_parameter(&self, parameter: usize) -> Option<usize> {
        let is_it = |index: &usize| self.fit.parameterisation.coordinates[*index].parameter == parameter;
        self.unknowns.common.iter().position(is_it)
    }

    /// Parameters of the mechanism `kind` with their 95 % intervals.
    pub fn intervals(&self, kind: MechanismKind) -> Vec<Interval> {
        let Some(place) = self.fit.kinds.iter().position(|own| *own == kind) else { return Vec::new() };
        let variances = self.quadratic.common_covariance().diagonal();
        // A coordinate at its bound is held there: what the session leaves open follows from the posterior that is free of the bounds.
        let free = self.design.quadratic(&self.spreads, &self.point, &self.products);
        let free = free.map(|own| (own.common_covariance().diagonal(), own.step.common));
        let interval = |parameter: usize| {
            let value = self.fit.parameters[0][parameter];
            let Some(place) = self.place_of_parameter(parameter) else {
                return Interval { value, low: Some(value), high: Some(value) };
            };
            let coordinate = &self.fit.parameterisation.coordinates[self.unknowns.common[place]];
            let at = self.point.common[place];
            let real = |end: f64| if coordinate.logarithmic { libm::exp(end) } else { end };
            if at <= coordinate.low || at >= coordinate.high {
                let Some((variances, step)) = &free else { return Interval { value, low: None, high: None } };
                let sd = libm::sqrt(variances[place].max(0.0));
                if at <= coordinate.low && step[place] < 0.0 {
                    let end = (at + limit_from_bound(step[place], sd)).min(coordinate.high);
                    return Interval { value, low: Some(real(at)), high: Some(real(end)) };
                }
                if at >= coordinate.high && step[place] > 0.0 {
                    let end = (at - limit_from_bound(-step[place], sd)).max(coordinate.low);
                    return Interval { value, low: Some(real(end)), high: Some(real(at)) };
                }
            }
            let half = HALF_INTERVAL_95 * libm::sqrt(variances[place].max(0.0));
            let [low, high] = [-half, half].map(|by| real((at + by).clamp(coordinate.low, coordinate.high)));
            Interval { value, low: Some(low), high: Some(high) }
        };
        mechanism_ranges(&self.fit.kinds)[place].clone().map(interval).collect()
    }
}

/// A point of the search, with the session linear about it.
struct Here {
    fit: Fit,
    point: Point,
    linear: Vec<LinearTrial>,
    products: Products,
}

impl Here {
    fn new(
        observations: &Observations,
        fit: Fit,
        unknowns: &Unknowns,
        columns: &AddedColumns,
        design: &Design,
        point: Option<Point>,
    ) -> Option<Self> {
        let point = point.unwrap_or_else(|| start_point(&fit, unknowns, columns, design));
        let mut linear = linearise(observations, &fit, unknowns);
        columns.add_to(&fit, unknowns, &point.common, &mut linear);
        let finite = linear.iter().all(|trial| trial.residual.iter().all(|value| value.is_finite()));
        let products = Products::new(&linear);
        finite.then_some(Self { fit, point, linear, products })
    }

    /// The quadratic here, after the spreads were estimated. Coordinates at a bound that the minimum lies beyond are held there.
    fn quadratic(
        &self,
        unknowns: &Unknowns,
        design: &Design,
        spreads: &mut Spreads,
    ) -> Option<(Quadratic, Design)> {
        let mut held = Vec::new();
        let mut quadratic = design.quadratic(spreads, &self.point, &self.products)?;
        loop {
            let beyond = self.beyond_bounds(unknowns, &quadratic, &held);
            if beyond.is_empty() {
                break;
            }
            held.extend(beyond);
            quadratic = design.holding(&held, &self.point).quadratic(spreads, &self.point, &self.products)?;
        }
        let design = design.holding(&held, &self.point);
        for _ in 0..MAX_SPREAD_STEPS {
            let expected = quadratic.expected_squares(&design, spreads, &self.point, &self.products);
            let (next, change) = expected.spreads(design.law.as_ref(), spreads);
            *spreads = next;
            quadratic = design.quadratic(spreads, &self.point, &self.products)?;
            if change < SPREAD_TOLERANCE {
                break;
            }
        }
        Some((quadratic, design))
    }

    /// Places of the common coordinates that are at a bound of a mechanism's parameter and would go beyond it.
    fn beyond_bounds(&self, unknowns: &Unknowns, quadratic: &Quadratic, held: &[usize]) -> Vec<usize> {
        let is_beyond = |place: &usize| {
            let own = &self.fit.parameterisation.coordinates[unknowns.common[*place]];
            let (at, step) = (self.point.common[*place], quadratic.step.common[*place]);
            own.parameter >= BASE_PARAMETERS.len()
                && !held.contains(place)
                && (at <= own.low && step < 0.0 || at >= own.high && step > 0.0)
        };
        (0..unknowns.common.len()).filter(is_beyond).collect()
    }

    /// The next point on the way to the minimum of `quadratic`, with a `damping` that grows until the cost decreases; `None` if it does
    /// not.
    fn stepped(
        &self,
        context: (&Observations, &Unknowns, &AddedColumns, &Design),
        spreads: &Spreads,
        quadratic: &Quadratic,
        damping: &mut f64,
    ) -> Option<Self> {
        let (_, unknowns, _, design) = context;
        if *damping > 0.0 {
            *damping *= DAMPING_DECAY;
            if *damping < SMALLEST_DAMPING {
                *damping = 0.0;
            }
        }
        while *damping <= LARGEST_DAMPING {
            let damped;
            let step = if *damping > 0.0 {
                damped = design.damped_step(spreads, &self.point, &self.products, *damping)?;
                &damped
            } else {
                &quadratic.step
            };
            let part = (LONGEST_LOG_STEP / self.longest_log_step(unknowns, step)).min(1.0);
            let next = self.moved(context, step, part);
            if let Some(next) = next {
                let there =
                    cost(design, spreads, &next.point, next.products.squares(), next.products.count());
                if there < quadratic.cost {
                    return Some(next);
                }
            }
            *damping = (*damping * DAMPING_GROWTH).max(FIRST_DAMPING);
        }
        None
    }

    fn longest_log_step(&self, unknowns: &Unknowns, step: &Point) -> f64 {
        let logarithmic = |place: &usize| {
            let own = unknowns.common.get(*place);
            own.is_some_and(|own| self.fit.parameterisation.coordinates[*own].logarithmic)
        };
        let common = (0..step.common.len()).filter(logarithmic);
        let own = step.own.iter().map(|own| own.amax());
        own.chain(common.map(|place| step.common[place].abs())).fold(0.0, f64::max)
    }

    /// The point after `part` of a step, within the bounds of mechanisms' parameters.
    fn moved(
        &self,
        (observations, unknowns, columns, design): (&Observations, &Unknowns, &AddedColumns, &Design),
        step: &Point,
        part: f64,
    ) -> Option<Self> {
        let mut point = self.point.moved(step, part);
        let mut coordinates = self.fit.solution.coordinates.clone();
        for (own, values) in unknowns.own.iter().zip(&point.own) {
            own.iter().zip(values.iter()).for_each(|(index, value)| coordinates[*index] = *value);
        }
        for (place, index) in unknowns.common.iter().enumerate() {
            let own = &self.fit.parameterisation.coordinates[*index];
            if own.parameter >= BASE_PARAMETERS.len() {
                point.common[place] = point.common[place].clamp(own.low, own.high);
            }
            coordinates[*index] = point.common[place];
        }
        let fit = self.fit.at_solution(Solution { coordinates, outcomes: Vec::new() });
        Self::new(observations, fit, unknowns, columns, design, Some(point))
    }
}

/// Where a fit stands, with means and regression at their best for its trials.
fn start_point(fit: &Fit, unknowns: &Unknowns, columns: &AddedColumns, design: &Design) -> Point {
    let at = |index: &usize| fit.solution.coordinates[*index];
    let own: Vec<DVector<f64>> =
        unknowns.own.iter().map(|own| DVector::from_iterator(own.len(), own.iter().map(at))).collect();
    let means: Vec<DVector<f64>> = design
        .conditions
        .iter()
        .map(|trials| {
            let sum = trials.iter().fold(DVector::zeros(design.own), |sum, trial| sum + &own[*trial]);
            sum / trials.len() as f64
        })
        .collect();
    let level = means.iter().fold(DVector::zeros(design.own), |sum, mean| sum + mean) / means.len() as f64;
    let mut coefficients = DVector::zeros(REGRESSORS * design.own);
    coefficients.rows_mut(0, design.own).copy_from(&level);
    let common = unknowns.common.len();
    let mut values = DVector::zeros(common + columns.count());
    for (place, index) in unknowns.common.iter().enumerate() {
        values[place] = at(index);
    }
    Point { own, means, coefficients, common: values }
}

/// Places of the common coordinates whose prior is one-sided.
fn one_sided(
    prior: &SessionPrior,
    here: &Here,
    unknowns: &Unknowns,
    design: &Design,
    added: &[MechanismKind],
) -> Vec<usize> {
    let is_it = |place: &usize| {
        let parameter = here.fit.parameterisation.coordinates[unknowns.common[*place]].parameter;
        design.common_mean.len() > *place && prior.is_one_sided(&here.fit, parameter, added)
    };
    (0..unknowns.common.len()).filter(is_it).collect()
}

/// What a one-sided prior adds to the logarithm of the evidence: twice the density, and the part of the posterior above the bound, which
/// lies `mean` above it with this `variance`.
fn above_bound(mean: f64, variance: f64) -> f64 {
    let sd = libm::sqrt(variance.max(f64::MIN_POSITIVE));
    std::f64::consts::LN_2 + log_normal_distribution(mean / sd)
}

/// How far from its bound a quantity lies at most (95 %) whose posterior is normal, with a mean `mean` from the bound, and ends there.
fn limit_from_bound(mean: f64, sd: f64) -> f64 {
    let log_tail = |at: f64| log_normal_distribution((mean - at) / sd);
    let sought = log_tail(0.0) + libm::log(0.05);
    // Of a normal distribution whose mean is at the bound, 95 % lie within 1.96 standard deviations, and of others beyond it within fewer.
    let (mut low, mut high) = (0.0, 2.0 * sd);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if log_tail(middle) > sought { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_of_a_quantity_at_its_bound_is_in_its_unit() {
        for sd in [1e-3, 0.4] {
            assert!((limit_from_bound(0.0, sd) / sd - HALF_INTERVAL_95).abs() < 1e-3);
            // Far beyond the bound the tail is exponential, with the slope of the posterior there.
            let far = limit_from_bound(-20.0 * sd, sd) / sd;
            assert!((far - libm::log(20.0) / 20.0).abs() < 2e-3, "{far}");
        }
    }

    fn progress(evidence: impl Iterator<Item = f64>, promised: f64) -> WayToOptimum {
        WayToOptimum { evidence: evidence.collect(), promised }
    }

    #[test]
    fn a_model_is_followed_while_what_it_promises_or_brings_leads_to_what_it_must_reach() {
        let least = LeastEvidence { promised: 20.0, reached: 100.0 };
        let slow = |steps: u32| (0..=steps).map(|step| 50.0 + 0.1 * f64::from(step));
        assert!(!progress(slow(2), 0.0).falls_short_of(least), "two steps say nothing yet");
        assert!(progress(slow(3), 19.0).falls_short_of(least));
        assert!(!progress(slow(5), 60.0).falls_short_of(least), "five do not say how far others lead");
        assert!(progress(slow(6), 60.0).falls_short_of(least));
        assert!(!progress(slow(6), 110.0).falls_short_of(least), "the next step promises enough");
        let steady = (0..=6).map(|step| 50.0 + 2.0 * f64::from(step));
        assert!(!progress(steady, 60.0).falls_short_of(least), "40 such steps lead far enough");
        assert!(!progress(slow(30), 0.0).falls_short_of(LeastEvidence::NONE));
    }
}
