//! Full refits of the shortlist, and which of them the data cannot tell apart.

use rayon::prelude::*;

use super::calibrate::refit;
use super::screen::{Probe, Score, torques};
use crate::fit::{Fit, NoiseMaker, Prepared, resampled};
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
}

fn fitted_count(kind: Kind) -> usize {
    kind.parameters().iter().filter(|parameter| parameter.fitted).count()
}

/// How many mechanisms are refitted in full at each step.
const SHORTLIST: usize = 6;

/// Probes worth less than this part of the best are not refitted.
const WORTH_A_REFIT: f64 = 0.2;

/// The shortlist of `scored` probes, refitted, the best first.
pub fn candidates(prepared: &Prepared, fit: &Fit, scored: &[(Probe, Score)], unit: f64) -> Vec<Candidate> {
    let mut kinds: Vec<Kind> = Vec::new();
    let mut order: Vec<&(Probe, Score)> = scored.iter().collect();
    order.sort_by(|a, b| b.1.worth.total_cmp(&a.1.worth));
    let best = order.first().map_or(0.0, |(_, score)| score.worth);
    for (probe, score) in &order {
        if score.worth > WORTH_A_REFIT * best && kinds.len() < SHORTLIST && !kinds.contains(&probe.kind) {
            kinds.push(probe.kind);
        }
    }
    let before = cost(fit);
    let mut candidates: Vec<Candidate> = kinds
        .into_par_iter()
        .map(|kind| {
            // The two best starting points of a mechanism, since some have several optima.
            let starts = order.iter().filter(|(probe, _)| probe.kind == kind).take(2);
            let fits = starts.map(|(probe, score)| extended(prepared, fit, probe, score));
            let best = fits.min_by(|a, b| cost(a).total_cmp(&cost(b)));
            let fit = best.unwrap_or_else(|| fit.clone());
            Candidate { kind, worth: 2.0 * (before - cost(&fit)) / unit, fit }
        })
        .collect();
    candidates.sort_by(|a, b| b.merit().total_cmp(&a.merit()));
    candidates
}

/// Half the sum of squares of all trials.
pub fn cost(fit: &Fit) -> f64 {
    fit.solution.outcomes.iter().map(|outcome| outcome.cost).sum()
}

/// `fit` with a probe's mechanism, from where the probe's best multiple lies.
fn extended(prepared: &Prepared, fit: &Fit, probe: &Probe, score: &Score) -> Fit {
    let mut model = fit.model.clone().with(probe.kind);
    if let Some(added) = model.mechanisms.last_mut() {
        for ((treatment, parameter), value) in
            added.parameters.iter_mut().zip(probe.kind.parameters()).zip(&probe.values)
        {
            treatment.value = Some(start(parameter, *value, score.multiple));
        }
    }
    fit.extended(prepared, &model)
}

/// Where a parameter starts: the multiple of its effect, if it has a value without effect, within its bounds.
fn start(parameter: &Parameter, probed: f64, multiple: f64) -> f64 {
    let Some(absent) = parameter.absent else { return probed };
    let to = absent + multiple.clamp(-20.0, 20.0) * (probed - absent);
    let inside = 0.02 * (probed - absent).abs();
    let (low, high) = (parameter.low.max(f64::MIN), parameter.high);
    if to <= low || to >= high { absent + inside.copysign(probed - absent) } else { to }
}

/// How many sessions are simulated from each rival: one win is 5 %.
const SIMULATIONS: usize = 19;

/// A rival that would have to be this much worse to be ruled out without simulation.
const FAR_BEHIND: f64 = 25.0;

/// The rivals of the first candidate that the data do not rule out.
///
/// For each, sessions are simulated in which the rival is the truth, and both are fitted to them: if the first candidate
/// often wins by as much as it did, the rival may be the truth.
pub fn not_ruled_out(prepared: &Prepared, candidates: &[Candidate], unit: f64, seed: u64) -> Vec<Kind> {
    let Some((first, rivals)) = candidates.split_first() else { return Vec::new() };
    let lead = |rival: &Candidate| first.worth - rival.worth;
    rivals
        .iter()
        .filter(|rival| rival.worth > 0.0 && lead(rival) < FAR_BEHIND)
        .filter(|rival| {
            let predicted = torques(prepared, &rival.fit.kinds, &rival.fit.parameters);
            let noise = NoiseMaker::new(&rival.fit);
            let wins: usize = (0..SIMULATIONS)
                .into_par_iter()
                .map(|number| {
                    let name = format!("confusion/{}/{}/{number}", first.kind.id(), rival.kind.id());
                    let mut stream = Stream::new(seed, &name);
                    let simulated = resampled(prepared, &predicted, &noise, &mut stream);
                    let (a, b) = (refit(&simulated, &first.fit), refit(&simulated, &rival.fit));
                    let simulated_lead = 2.0 * (cost(&b) - cost(&a)) / unit;
                    usize::from(simulated_lead >= lead(rival))
                })
                .sum();
            wins > 0
        })
        .map(|rival| rival.kind)
        .collect()
}
