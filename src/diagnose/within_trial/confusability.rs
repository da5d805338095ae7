//! Which candidate mechanisms the data do not distinguish from the best one: a parametric-bootstrap Cox test.

use rayon::prelude::*;

use super::candidates::{Candidate, Shortlist};
use super::discrepancy::Added;
use super::null_distribution::simulated;
use crate::fit::{Fit, NoiseSampler, Observations};
use crate::random::Stream;
use crate::statistics::MeanVariance;
use crate::wrist::mechanisms::MechanismKind;

/// How many sessions are simulated from each rival: one win is 5 %.
const SIMULATIONS: usize = 19;

/// After so many of them, a lead that one more would reach with a probability below 0.005 (by Student's t) is taken for out of reach.
const FIRST_SIMULATIONS: usize = 6;
const OUT_OF_REACH: f64 = 4.4;

/// A rival that would have to be this much worse to be ruled out without simulation, in units of the noise or as a part of
/// what the first is worth.
const FAR_BEHIND: f64 = 60.0;
const FAR_BEHIND_PART: f64 = 0.04;

/// By how much that is, of a first that is worth so much.
pub fn far_behind(worth: f64) -> f64 {
    FAR_BEHIND.max(FAR_BEHIND_PART * worth)
}

/// A lead below this tells nothing: 95 % of chi-square with one degree of freedom.
const NO_LEAD: f64 = 3.84;

/// The rivals of the first candidate that the data do not rule out.
///
/// For each, sessions are simulated in which the rival is the truth, with a law that is not quite the catalogue's, and both
/// are fitted to them: if the first candidate wins by as much as it did in one of twenty, the rival may be the truth.
pub fn not_ruled_out(prepared: &Observations, shortlist: &Shortlist, seed: u64) -> Vec<MechanismKind> {
    let unit = shortlist.unit;
    let Some((first, rivals)) = shortlist.candidates.split_first() else { return Vec::new() };
    let lead = |rival: &Candidate| first.worth - rival.worth;
    let noise = NoiseSampler::of(&prepared.noise_covariances);
    let may_be_true = |rival: &&Candidate| {
        if lead(rival) < NO_LEAD {
            return true;
        }
        let added = Added::new(prepared, rival);
        is_reached(lead(rival), |number| {
            let name = format!("confusion/{}/{}/{number}", first.kind.id(), rival.kind.id());
            let mut stream = Stream::new(seed, &name);
            let true_law = added.under_another_law(&mut stream);
            let simulated = simulated(prepared, &true_law, &noise, &mut stream);
            let again = |fit: &Fit| fit.extended(&simulated, &fit.model);
            let (a, b) = (again(&first.fit), again(&rival.fit));
            2.0 * (b.cost() - a.cost()) / unit
        })
    };
    rivals
        .iter()
        .filter(|rival| rival.worth > 0.0 && lead(rival) < far_behind(first.worth))
        .filter(may_be_true)
        .map(|rival| rival.kind)
        .collect()
}

/// Whether any simulated session reaches a lead; a few tell where it is far out of reach.
fn is_reached(lead: f64, lead_in: impl Fn(usize) -> f64 + Sync) -> bool {
    let some: Vec<f64> = (0..FIRST_SIMULATIONS).into_par_iter().map(&lead_in).collect();
    let sample: MeanVariance = some.iter().copied().collect();
    let furthest = sample.mean() + OUT_OF_REACH * libm::sqrt(sample.variance().unwrap_or(0.0));
    some.iter().any(|own| *own >= lead)
        || lead < furthest
            && (FIRST_SIMULATIONS..SIMULATIONS).into_par_iter().any(|number| lead_in(number) >= lead)
}
