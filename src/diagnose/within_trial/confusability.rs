//! Which candidate mechanisms the data do not distinguish from the best one: a parametric-bootstrap Cox test.

use rayon::prelude::*;

use super::candidates::{Candidate, RankedCandidates};
use super::discrepancy::AddedTorque;
use super::null_distribution::simulated;
use crate::fit::{Fit, NoiseSampler, Observations};
use crate::random::Stream;
use crate::statistics::MeanVariance;
use crate::wrist::mechanisms::MechanismKind;

/// Number of sessions simulated with each rival as the truth: one that reaches the observed lead means p = 0.05.
const CONFUSABILITY_SIMULATIONS: usize = 19;

/// Number of simulated sessions after which the test may stop early.
const EARLY_STOP_SIMULATIONS: usize = 6;
/// Standard deviations above the mean of the first simulated leads beyond which the test stops early: Student's t with probability 0.005
/// of being exceeded by one more session.
const EARLY_STOP_T: f64 = 4.4;

/// Lead (difference in decrease of chi-square) from which a rival is ruled out without simulation.
const CLEAR_LEAD: f64 = 60.0;
/// Alternative to `CLEAR_LEAD`, as a fraction of the first candidate's decrease of chi-square; the larger lead applies.
const CLEAR_LEAD_FRACTION: f64 = 0.04;

/// Lead from which a rival is ruled out without simulation, for a first candidate with the decrease of chi-square `chi_square_gain`.
pub fn clear_lead(chi_square_gain: f64) -> f64 {
    CLEAR_LEAD.max(CLEAR_LEAD_FRACTION * chi_square_gain)
}

/// Lead below which a rival is never ruled out: the 95 % quantile of chi-square with one degree of freedom.
const NEGLIGIBLE_LEAD: f64 = 3.84;

/// The rivals of the first candidate that the data do not rule out.
///
/// For each rival, sessions are simulated in which the rival is the truth, with a law that deviates a little from the catalogue's, and
/// both candidates are fitted. If the first candidate leads by as much as observed in one of twenty sessions, the rival is kept.
pub fn indistinguishable_candidates(
    observations: &Observations,
    shortlist: &RankedCandidates,
    seed: u64,
) -> Vec<MechanismKind> {
    let unit = shortlist.unit;
    let Some((first, rivals)) = shortlist.candidates.split_first() else { return Vec::new() };
    let lead = |rival: &Candidate| first.chi_square_gain - rival.chi_square_gain;
    let noise = NoiseSampler::new(&observations.noise_covariances);
    let may_be_true = |rival: &&Candidate| {
        if lead(rival) < NEGLIGIBLE_LEAD {
            return true;
        }
        let added = AddedTorque::new(observations, rival);
        is_reached(lead(rival), |number| {
            let name = format!("confusion/{}/{}/{number}", first.kind.id(), rival.kind.id());
            let mut stream = Stream::new(seed, &name);
            let true_law = added.draw_alternative_law(&mut stream);
            let simulated = simulated(observations, &true_law, &noise, &mut stream);
            let again = |fit: &Fit| fit.extended(&simulated, &fit.model);
            let (a, b) = (again(&first.fit), again(&rival.fit));
            2.0 * (b.cost() - a.cost()) / unit
        })
    };
    rivals
        .iter()
        .filter(|rival| rival.chi_square_gain > 0.0 && lead(rival) < clear_lead(first.chi_square_gain))
        .filter(may_be_true)
        .map(|rival| rival.kind)
        .collect()
}

/// Whether any simulated session reaches the lead; stops early if the first sessions are far below it.
fn is_reached(lead: f64, lead_in: impl Fn(usize) -> f64 + Sync) -> bool {
    let some: Vec<f64> = (0..EARLY_STOP_SIMULATIONS).into_par_iter().map(&lead_in).collect();
    let sample: MeanVariance = some.iter().copied().collect();
    let furthest = sample.mean() + EARLY_STOP_T * libm::sqrt(sample.variance().unwrap_or(0.0));
    some.iter().any(|own| *own >= lead)
        || lead < furthest
            && (EARLY_STOP_SIMULATIONS..CONFUSABILITY_SIMULATIONS)
                .into_par_iter()
                .any(|number| lead_in(number) >= lead)
}
