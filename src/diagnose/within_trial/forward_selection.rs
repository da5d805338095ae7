//! Forward selection of mechanisms within the trials until no significant misfit remains. Once a second is added, the first is chosen
//! again.

use super::candidates::{Candidate, RankedCandidates, candidates};
use super::confusability::{clear_lead, indistinguishable_candidates};
use super::cross_validation::{Gain, gain};
use super::discrepancy::misfit_from_discrepancy;
use super::null_distribution::{
    MISFIT_LEVEL, MisfitPValues, MisfitStatistics, NullDistribution, misfit_statistics,
};
use super::residual_projection::ResidualProjection;
use super::score_test::{Probe, UndetectableMechanism, probes};
use crate::fit::{Fit, Observations};
use crate::wrist::mechanisms::MechanismKind;

/// Result of the forward selection.
pub struct ForwardSelection {
    /// The added mechanisms, in the order of selection.
    pub causes: Vec<AddedMechanismEvidence>,
    /// The fit with all added mechanisms.
    pub fit: Fit,
    /// Misfit statistics of the model as given.
    pub misfit: MisfitStatistics,
    /// Probability of a misfit at least as large if the model as given were right.
    pub p_value: f64,
    /// Probability of the remaining misfit if the extended model were right.
    pub remaining_p_value: f64,
    /// Ratio of the residual variance between repetitions to that of the noise, if significantly above one.
    pub scatter: Option<f64>,
    /// Mechanisms that this session cannot show.
    pub undetectable: Vec<UndetectableMechanism>,
    /// Fitted elastic limits of the trials in each session simulated with `fit`, rad.
    pub simulated_limits: Vec<Vec<f64>>,
}

/// A mechanism that was added to the model, and the evidence for it.
pub struct AddedMechanismEvidence {
    /// The mechanism.
    pub kind: MechanismKind,
    /// Probability of a misfit at least as large as before the mechanism was added, if the model were right.
    pub p_value: f64,
    /// Mechanisms that the data do not rule out in its place.
    pub indistinguishable: Vec<MechanismKind>,
    /// The fit before the mechanism was added.
    pub before: Fit,
    /// The fit with the mechanism.
    pub after: Fit,
    /// Decrease of the whitened sum of squares by the mechanism (chi-square units).
    pub chi_square_gain: f64,
    /// Improvement on trials left out of the fit.
    pub gain: Gain,
}

/// Largest number of mechanisms that are added. Three or four could describe nearly any misfit that none of them causes: if misfit
/// remains after two, a cause outside the catalogue is more likely.
const MAX_ADDED_MECHANISMS: usize = 2;

/// Smallest decrease of chi-square, less 2 per fitted parameter, with which a mechanism is added.
const MIN_PENALISED_GAIN: f64 = 8.0;

impl ForwardSelection {
    /// Adds mechanisms to the model of `before`. `stage` is called with the name of each step as it starts.
    pub fn run(observations: &Observations, before: &Fit, seed: u64, stage: &dyn Fn(&'static str)) -> Self {
        let seen_by = |fit: &Fit| {
            stage("comparing the misfit with simulated sessions");
            TestedFit::new(observations, fit, seed)
        };
        let mut seen = seen_by(before);
        let (misfit, p_value, undetectable) = (seen.finding, seen.p_values.any(), seen.undetectable.clone());
        let mut steps: Vec<SelectedMechanism> = Vec::new();
        let mut beside = None;
        // No mechanism explains misfit that differs between repetitions.
        while 2.0 * seen.p_values.common() <= MISFIT_LEVEL && steps.len() < MAX_ADDED_MECHANISMS {
            let Some(step) = seen.step(observations, steps.last(), seed, stage) else { break };
            steps.push(step);
            if let ([first, second], None) = (steps.as_slice(), &beside) {
                stage("choosing the first cause again");
                let second_kind = second.own.kind;
                let rivals = first.rivals_given(observations, second);
                let best = rivals.candidates[0].kind;
                if best != first.own.kind {
                    steps = vec![first.with_first(observations, best, seed)];
                }
                beside = Some((second_kind, rivals));
            }
            seen = seen_by(&steps[steps.len() - 1].own.fit);
        }
        if let ([first, second], Some((kind, rivals))) = (steps.as_mut_slice(), beside)
            && second.own.kind == kind
        {
            first.shortlist = rivals;
        }
        stage("simulating sessions with each rival as the cause");
        Self {
            causes: steps.into_iter().map(|step| step.cause(observations, seed)).collect(),
            misfit,
            p_value,
            remaining_p_value: seen.p_values.any(),
            scatter: (2.0 * seen.p_values.between_repetitions() < MISFIT_LEVEL)
                .then_some(seen.p_values.scatter),
            undetectable,
            simulated_limits: seen.simulated_limits,
            fit: seen.fit,
        }
    }
}

/// A fit with the tests of its residuals.
struct TestedFit {
    fit: Fit,
    probes: Vec<Probe>,
    undetectable: Vec<UndetectableMechanism>,
    finding: MisfitStatistics,
    p_values: MisfitPValues,
    simulated_limits: Vec<Vec<f64>>,
    tangent: ResidualProjection,
}

impl TestedFit {
    fn new(observations: &Observations, fit: &Fit, seed: u64) -> Self {
        let tangent = ResidualProjection::new(observations, fit);
        let (probes, undetectable) = probes(observations, fit, &tangent);
        let finding = misfit_statistics(observations, &tangent, &probes, &tangent.residuals());
        let simulated = NullDistribution::new(observations, fit, &tangent, &probes, seed);
        let p_values = simulated.p_values(&finding);
        tracing::debug!(?finding, ?p_values, causes = ?fit.kinds);
        Self {
            fit: fit.clone(),
            tangent,
            probes,
            undetectable,
            finding,
            p_values,
            simulated_limits: simulated.limits,
        }
    }

    /// The mechanism with the largest decrease of chi-square. `None` if a discrepancy in the law of the `last` one could explain it, or if
    /// it does not improve trials left out of the fit.
    fn step(
        &self,
        observations: &Observations,
        last: Option<&SelectedMechanism>,
        seed: u64,
        stage: &dyn Fn(&'static str),
    ) -> Option<SelectedMechanism> {
        stage("fitting the mechanisms of the catalogue");
        let shortlist = candidates(observations, &self.fit, &self.fit, &self.probes, self.tangent.freedom());
        let left_by_law =
            last.map_or(0.0, |last| misfit_from_discrepancy(observations, &self.tangent, &last.own));
        tracing::debug!(left_by_law);
        let own = shortlist.candidates.first()?.clone();
        if own.penalised_gain() <= MIN_PENALISED_GAIN.max(left_by_law) {
            return None;
        }
        stage("measuring the gain on data left out");
        let (gain, loss) = gain(observations, &self.fit, &own.fit, seed);
        // Two mechanisms can describe much that neither causes: the second must also reduce the residual in N m.
        if loss <= 0.0 || last.is_some() && gain.held_out_rmse_ratio.value >= 1.0 {
            return None;
        }
        Some(SelectedMechanism {
            before: self.fit.clone(),
            own,
            p_value: self.p_values.common(),
            gain,
            shortlist,
        })
    }
}

/// A selected mechanism.
struct SelectedMechanism {
    before: Fit,
    own: Candidate,
    p_value: f64,
    gain: Gain,
    /// The mechanism (first) and its rivals.
    shortlist: RankedCandidates,
}

impl SelectedMechanism {
    /// The mechanism and its rivals, refitted beside the `second` mechanism: those that are behind by less than the second's decrease of
    /// chi-square, or could be indistinguishable. The former candidates if there are no rivals.
    fn rivals_given(&self, observations: &Observations, second: &Self) -> RankedCandidates {
        let within = second.own.chi_square_gain.max(clear_lead(self.own.chi_square_gain));
        let behind = |own: &Candidate| self.own.chi_square_gain - own.chi_square_gain;
        let near = self.shortlist.candidates.iter().filter(|own| behind(own) < within);
        let kinds: Vec<MechanismKind> = near.map(|own| own.kind).collect();
        if kinds.len() > 1 {
            let without = second.own.fit.without(observations, self.own.kind);
            let tangent = ResidualProjection::new(observations, &without);
            let (mut probes, _) = probes(observations, &without, &tangent);
            probes.retain(|probe| kinds.contains(&probe.kind));
            let found = candidates(observations, &self.before, &without, &probes, tangent.freedom());
            if !found.candidates.is_empty() {
                return found;
            }
        }
        self.shortlist.clone()
    }

    /// The selection with a rival in place of this mechanism.
    fn with_first(&self, observations: &Observations, rival: MechanismKind, seed: u64) -> Self {
        let shortlist = self.shortlist.clone().with_first(rival);
        let own = shortlist.candidates[0].clone();
        let (gain, _) = gain(observations, &self.before, &own.fit, seed);
        Self { before: self.before.clone(), own, p_value: self.p_value, gain, shortlist }
    }

    fn cause(self, observations: &Observations, seed: u64) -> AddedMechanismEvidence {
        AddedMechanismEvidence {
            kind: self.own.kind,
            p_value: self.p_value,
            indistinguishable: indistinguishable_candidates(observations, &self.shortlist, seed),
            before: self.before,
            after: self.own.fit,
            chi_square_gain: self.own.chi_square_gain,
            gain: self.gain,
        }
    }
}
