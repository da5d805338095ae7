//! Forward steps within the trace, a cause each, until nothing is left over; the first of two is then chosen again.

use super::candidates::{Candidate, Shortlist, candidates};
use super::confusability::{far_behind, not_ruled_out};
use super::cross_validation::{Gain, gain};
use super::discrepancy::may_leave;
use super::null_distribution::{Chance, Finding, SIGNIFICANT, Simulated, screen};
use super::residual_projection::Tangent;
use super::score_test::{Probe, Unseen, probes};
use crate::fit::{Fit, Observations};
use crate::wrist::mechanisms::MechanismKind;

/// What the steps lead to.
pub struct Steps {
    /// The causes, in the order in which they were found.
    pub causes: Vec<AddedCause>,
    /// The fit with all of them.
    pub fit: Fit,
    /// The misfit of the model as given, and the probability of such a one where there is none.
    pub misfit: Finding,
    pub p_value: f64,
    /// The probability of the misfit that is left.
    pub left_p_value: f64,
    /// Variance of what repetitions do not have in common over that of the noise, if it is more.
    pub scatter: Option<f64>,
    /// What this session cannot tell about.
    pub unseen: Vec<Unseen>,
    /// The trials' elastic limits in sessions simulated with `fit`, rad.
    pub simulated_limits: Vec<Vec<f64>>,
}

/// A mechanism that was added to the model, and the evidence for it.
pub struct AddedCause {
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
    pub worth: f64,
    /// Improvement on trials left out of the fit.
    pub gain: Gain,
}

/// Most mechanisms that are added one after the other. With three or four of them nearly anything can be described that none
/// of them is: if two leave something over, it is more believable that the catalogue lacks the cause.
const MOST_STEPS: usize = 2;

/// Least loss of the sum of squares, beyond what its parameters gain from noise, for which a mechanism is added.
const WORTH_ADDING: f64 = 8.0;

impl Steps {
    /// Adds to the model of `before` what it lacks; `stage` hears what is being done.
    pub fn taken(prepared: &Observations, before: &Fit, seed: u64, stage: &dyn Fn(&'static str)) -> Self {
        let seen_by = |fit: &Fit| {
            stage("comparing the misfit with simulated sessions");
            Seen::new(prepared, fit, seed)
        };
        let mut seen = seen_by(before);
        let (misfit, p_value, unseen) = (seen.finding, seen.chance.of_any(), seen.unseen.clone());
        let mut steps: Vec<Step> = Vec::new();
        let mut beside = None;
        // What differs from repetition to repetition no mechanism explains.
        while 2.0 * seen.chance.of_common() <= SIGNIFICANT && steps.len() < MOST_STEPS {
            let Some(step) = seen.step(prepared, steps.last(), seed, stage) else { break };
            steps.push(step);
            if let ([first, second], None) = (steps.as_slice(), &beside) {
                stage("choosing the first cause again");
                let second_kind = second.own.kind;
                let rivals = first.rivals_beside(prepared, second);
                let best = rivals.candidates[0].kind;
                if best != first.own.kind {
                    steps = vec![first.led_by(prepared, best, seed)];
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
            causes: steps.into_iter().map(|step| step.cause(prepared, seed)).collect(),
            misfit,
            p_value,
            left_p_value: seen.chance.of_any(),
            scatter: (2.0 * seen.chance.of_own() < SIGNIFICANT).then_some(seen.chance.scatter),
            unseen,
            simulated_limits: seen.simulated_limits,
            fit: seen.fit,
        }
    }
}

/// A fit, and what screening makes of what it leaves.
struct Seen {
    fit: Fit,
    probes: Vec<Probe>,
    unseen: Vec<Unseen>,
    finding: Finding,
    chance: Chance,
    simulated_limits: Vec<Vec<f64>>,
    tangent: Tangent,
}

impl Seen {
    fn new(prepared: &Observations, fit: &Fit, seed: u64) -> Self {
        let tangent = Tangent::new(prepared, fit);
        let (probes, unseen) = probes(prepared, fit, &tangent);
        let finding = screen(prepared, &tangent, &probes, &tangent.residuals());
        let simulated = Simulated::new(prepared, fit, &tangent, &probes, seed);
        let chance = simulated.chance(&finding);
        tracing::debug!(?finding, ?chance, causes = ?fit.kinds);
        Self {
            fit: fit.clone(),
            tangent,
            probes,
            unseen,
            finding,
            chance,
            simulated_limits: simulated.limits,
        }
    }

    /// The mechanism that mends most, unless it could be what another law of the `last` one leaves, or describes only the
    /// trials that it was fitted to.
    fn step(
        &self,
        prepared: &Observations,
        last: Option<&Step>,
        seed: u64,
        stage: &dyn Fn(&'static str),
    ) -> Option<Step> {
        stage("fitting the catalogue");
        let shortlist = candidates(prepared, &self.fit, &self.fit, &self.probes, self.tangent.freedom());
        let left_by_law = last.map_or(0.0, |last| may_leave(prepared, &self.tangent, &last.own));
        tracing::debug!(left_by_law);
        let own = shortlist.candidates.first()?.clone();
        if own.merit() <= WORTH_ADDING.max(left_by_law) {
            return None;
        }
        stage("measuring the gain on data left out");
        let (gain, loss) = gain(prepared, &self.fit, &own.fit, seed);
        // Two can describe much that neither is: the second must gain in N m as well.
        if loss <= 0.0 || last.is_some() && gain.held_out_rmse_ratio.value >= 1.0 {
            return None;
        }
        Some(Step { before: self.fit.clone(), own, p_value: self.chance.of_common(), gain, shortlist })
    }
}

/// A mechanism that was added.
struct Step {
    before: Fit,
    own: Candidate,
    p_value: f64,
    gain: Gain,
    /// It, first, and those that could stand in its place.
    shortlist: Shortlist,
}

impl Step {
    /// It and its rivals with what the `second` step added, which can make another look like the first: those that are behind
    /// by less than the second is worth, or could be indistinguishable. As they were without it if there are none.
    fn rivals_beside(&self, prepared: &Observations, second: &Self) -> Shortlist {
        let within = second.own.worth.max(far_behind(self.own.worth));
        let behind = |own: &Candidate| self.own.worth - own.worth;
        let near = self.shortlist.candidates.iter().filter(|own| behind(own) < within);
        let kinds: Vec<MechanismKind> = near.map(|own| own.kind).collect();
        if kinds.len() > 1 {
            let without = second.own.fit.without(prepared, self.own.kind);
            let tangent = Tangent::new(prepared, &without);
            let (mut probes, _) = probes(prepared, &without, &tangent);
            probes.retain(|probe| kinds.contains(&probe.kind));
            let found = candidates(prepared, &self.before, &without, &probes, tangent.freedom());
            if !found.candidates.is_empty() {
                return found;
            }
        }
        self.shortlist.clone()
    }

    /// The step to a rival instead.
    fn led_by(&self, prepared: &Observations, rival: MechanismKind, seed: u64) -> Self {
        let shortlist = self.shortlist.clone().led_by(rival);
        let own = shortlist.candidates[0].clone();
        let (gain, _) = gain(prepared, &self.before, &own.fit, seed);
        Self { before: self.before.clone(), own, p_value: self.p_value, gain, shortlist }
    }

    fn cause(self, prepared: &Observations, seed: u64) -> AddedCause {
        AddedCause {
            kind: self.own.kind,
            p_value: self.p_value,
            indistinguishable: not_ruled_out(prepared, &self.shortlist, seed),
            before: self.before,
            after: self.own.fit,
            worth: self.own.worth,
            gain: self.gain,
        }
    }
}
