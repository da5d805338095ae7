//! Full refits of the shortlist, and which of them the data cannot tell apart.

use rayon::prelude::*;

use super::calibrate::simulated;
use super::screen::{Probe, Score, torques};
use crate::fit::{FirstLook, Fit, Model, NoiseMaker, Prepared, Weighting};
use crate::random::Stream;
use crate::wrist::mechanisms::{Kind, Parameter};

/// A mechanism added to a fit, all parameters fitted anew.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Which.
    pub kind: Kind,
    /// The fit with it.
    pub fit: Fit,
    /// What the sum of squares lost, in units of the noise.
    pub worth: f64,
}

impl Candidate {
    /// The worth less what as many free parameters gain from noise alone.
    pub fn merit(&self) -> f64 {
        self.worth - 2.0 * fitted_count(self.kind) as f64
    }

    /// The values of its parameters.
    pub fn values(&self) -> &[f64] {
        let own = &self.fit.parameters[0];
        &own[own.len() - self.kind.parameter_count()..]
    }
}

fn fitted_count(kind: Kind) -> usize {
    kind.parameters().iter().filter(|parameter| parameter.fitted).count()
}

/// The mechanisms that were fitted, the best first.
pub struct Shortlist {
    /// They.
    pub candidates: Vec<Candidate>,
    /// Variance of the residuals over what the noise says, at the best of them; at least one.
    pub unit: f64,
}

/// A mechanism that was fitted roughly is fitted with all care if it comes this near to the best, in units of the noise, or as
/// a part of what the best is worth: yields that a rough fit leaves in the wrong place cost as much.
const WITHIN_REACH: f64 = 120.0;
const PART_OF_BEST: f64 = 0.1;

/// Every mechanism that was probed, fitted in full; the best with all care. The best first.
///
/// What screening promises tells where to start, not whom to leave out: a model that lacks something large has gone to where
/// the step to the right mechanism is not straight.
pub fn candidates(prepared: &Prepared, fit: &Fit, scored: &[(Probe, Score)], freedom: f64) -> Shortlist {
    let mut kinds: Vec<Kind> = scored.iter().map(|(probe, _)| probe.kind).collect();
    kinds.dedup();
    let before = cost(fit);
    let first = FirstLook::new(prepared, Weighting::MeasuredNoise);
    let candidate = |fit: Fit, kind| Candidate { kind, worth: 2.0 * (before - cost(&fit)), fit };
    let mut rough: Vec<Candidate> = kinds
        .into_par_iter()
        .filter_map(|kind| {
            let starts = scored.iter().filter(|(probe, _)| probe.kind == kind);
            let fits =
                starts.map(|(probe, score)| fit.rival(prepared, &first, &model_with(fit, probe, score)));
            Some(candidate(fits.min_by(|a, b| cost(a).total_cmp(&cost(b)))?, kind))
        })
        .collect();
    rough.sort_by(|a, b| b.worth.total_cmp(&a.worth));
    let best = rough.first().map_or(0.0, |own| own.worth);
    rough.retain(|own| own.worth > best - WITHIN_REACH.max(PART_OF_BEST * best));
    let mut settled: Vec<Candidate> =
        rough.into_par_iter().map(|own| candidate(own.fit.settled(prepared), own.kind)).collect();
    let best = settled.iter().map(|own| 2.0 * cost(&own.fit)).fold(f64::INFINITY, f64::min);
    let unit = (best / freedom).clamp(1.0, f64::MAX);
    settled.iter_mut().for_each(|own| own.worth /= unit);
    settled.sort_by(|a, b| b.merit().total_cmp(&a.merit()));
    Shortlist { candidates: settled, unit }
}

/// Half the sum of squares of all trials.
pub fn cost(fit: &Fit) -> f64 {
    fit.solution.outcomes.iter().map(|outcome| outcome.cost).sum()
}

/// The model of `fit` with a probe's mechanism, which starts as [`start`] says.
fn model_with(fit: &Fit, probe: &Probe, score: &Score) -> Model {
    let mut model = fit.model.clone().with(probe.kind);
    if let Some(added) = model.mechanisms.last_mut() {
        for ((treatment, parameter), value) in
            added.parameters.iter_mut().zip(probe.kind.parameters()).zip(&probe.values)
        {
            treatment.value = Some(start(parameter, *value, score.multiple));
        }
    }
    model
}

/// Where a parameter starts: at the value probed, or on the other side of the one without effect if that is where the probe
/// points and it may go there. How far it will go is for the fit to find: a step to it is seldom straight.
fn start(parameter: &Parameter, probed: f64, multiple: f64) -> f64 {
    let Some(absent) = parameter.absent.filter(|_| multiple < 0.0) else { return probed };
    let mirrored = absent + absent - probed;
    if (parameter.low..=parameter.high).contains(&mirrored) { mirrored } else { probed }
}

/// How many sessions are simulated from each rival: one win is 5 %.
const SIMULATIONS: usize = 19;

/// A rival that would have to be this much worse to be ruled out without simulation.
const FAR_BEHIND: f64 = 60.0;

/// The rivals of the first candidate that the data do not rule out.
///
/// For each, sessions are simulated in which the rival is the truth, and both are fitted to them: if the first candidate
/// wins by as much as it did in one of twenty, the rival may be the truth.
pub fn not_ruled_out(prepared: &Prepared, shortlist: &Shortlist, seed: u64) -> Vec<Kind> {
    let unit = shortlist.unit;
    let Some((first, rivals)) = shortlist.candidates.split_first() else { return Vec::new() };
    let lead = |rival: &Candidate| first.worth - rival.worth;
    rivals
        .iter()
        .filter(|rival| rival.worth > 0.0 && lead(rival) < FAR_BEHIND)
        .filter(|rival| {
            let predicted = torques(prepared, &rival.fit.kinds, &rival.fit.parameters);
            let noise = NoiseMaker::of(&prepared.noises);
            let wins: usize = (0..SIMULATIONS)
                .into_par_iter()
                .map(|number| {
                    let name = format!("confusion/{}/{}/{number}", first.kind.id(), rival.kind.id());
                    let mut stream = Stream::new(seed, &name);
                    let simulated = simulated(prepared, &predicted, &noise, &mut stream);
                    let again = |fit: &Fit| fit.extended(&simulated, &fit.model);
                    let (a, b) = (again(&first.fit), again(&rival.fit));
                    let simulated_lead = 2.0 * (cost(&b) - cost(&a)) / unit;
                    usize::from(simulated_lead >= lead(rival))
                })
                .sum();
            wins > 0
        })
        .map(|rival| rival.kind)
        .collect()
}
