//! A diagnosis: within the trace, then across the trials, and what both come to.

use super::across_trials::covariate_regression::{Trend, strongest_trend};
use super::across_trials::elastic_limit_law::{LimitLaw, limit_law};
use super::across_trials::outliers::outliers;
use super::across_trials::stiffness_table::Stiffnesses;
use super::cause::{Cause, Evidence};
use super::mains_hum::Hum;
use super::preprocessing::Look;
use super::within_trial::cross_validation::gain_of_cleaning;
use super::within_trial::forward_selection::{AddedCause, Steps};
use super::within_trial::null_distribution::{Finding, SIGNIFICANT};
use super::within_trial::residual_terms::{ResidualTerm, residual_term};
use super::within_trial::score_test::Unseen;
use crate::fit::{Fit, Model, Observations, Weighting};
use crate::wrist::mechanisms::{EvidenceSource, MechanismKind};

/// What the diagnosis comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// No misfit beyond the measured noise.
    Adequate,
    /// Every cause told apart from every other candidate.
    Named,
    /// Some cause could be another.
    Ambiguous,
    /// Misfit remains that no candidate explains.
    Unexplained,
}

/// A diagnosis.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// What it comes to.
    pub verdict: Verdict,
    /// Misfit of the model as given: the larger of the catalogue's best score and the nameless pattern's excess.
    pub misfit: Finding,
    /// Probability of such a misfit where there is none, within the trace and across the trials.
    pub p_value: f64,
    /// The causes, by what they gain.
    pub causes: Vec<Cause>,
    /// Probability of the misfit that is left.
    pub left_over_p_value: f64,
    /// The pattern of what is left, if it is more than noise: no mechanism, a description.
    pub residual_term: Option<ResidualTerm>,
    /// What this session cannot tell about.
    pub unseen: Vec<Unseen>,
    /// How the elastic limit goes with velocity and torque.
    pub limit_law: Option<LimitLaw>,
    /// The fit of the model as given.
    pub before: Fit,
    /// The fit of the extended model.
    pub after: Fit,
    /// Remarks for a person.
    pub remarks: Vec<String>,
}

/// The same for what two causes within the trace leave: that something is wrong is known then, and two mechanisms can describe much
/// that neither of them is. Assumed.
const SIGNIFICANT_AFTER_TWO: f64 = 0.05;

/// Diagnoses a session as seen by `model`; `stage` hears what is being done.
pub fn diagnose(look: &Look, model: &Model, seed: u64, stage: &dyn Fn(&'static str)) -> Diagnosis {
    let prepared = &look.prepared;
    stage("fitting the model");
    let before = Fit::new(prepared, model, Weighting::MeasuredNoise).with_shrinkage(prepared);
    let mut remarks = Vec::new();
    if look.usable > prepared.trials.len() {
        remarks.push(format!(
            "{} of {} trials were looked at, spread evenly over the conditions and their repetitions",
            prepared.trials.len(),
            look.usable
        ));
    }
    let mut causes: Vec<Cause> =
        look.hum.iter().map(|found| hum_cause(prepared, &before, found, seed)).collect();
    let p_hum = causes.first().map_or(1.0, |cause| cause.p_value);
    let within = Steps::taken(prepared, &before, seed, stage);
    causes.extend(within.causes.into_iter().map(added_cause));
    if let Some(ratio) = within.scatter {
        remarks.push(format!(
            "residuals scatter with {ratio:.1} times the variance of the noise, otherwise in each repetition: something on the \
             ramps that the noise does not show and that no mechanism describes, such as an unsteady clock or a coarse converter"
        ));
    }
    stage("comparing the trials with each other");
    let (across, p_across, left_across) = across_trials(prepared, &within.fit, seed, &mut remarks);
    causes.extend(across);
    causes.sort_by(|a, b| ratio_of(a).total_cmp(&ratio_of(b)));
    let left_over_p_value = (2.0 * within.left_p_value.min(left_across)).min(1.0);
    let added = within.fit.kinds.len() - before.kinds.len();
    let significant = if added < 2 { SIGNIFICANT } else { SIGNIFICANT_AFTER_TWO };
    let verdict = if left_over_p_value < significant {
        Verdict::Unexplained
    } else if causes.iter().any(|cause| !cause.indistinguishable.is_empty()) {
        Verdict::Ambiguous
    } else if causes.is_empty() {
        Verdict::Adequate
    } else {
        Verdict::Named
    };
    let residual_term =
        (verdict == Verdict::Unexplained).then(|| residual_term(prepared, &within.fit)).flatten();
    Diagnosis {
        verdict,
        misfit: within.misfit,
        p_value: (2.0 * within.p_value.min(p_across)).min(p_hum).min(1.0),
        causes,
        left_over_p_value,
        residual_term,
        unseen: within.unseen,
        limit_law: limit_law(prepared, &within.fit, &within.simulated_limits),
        before,
        after: within.fit,
        remarks,
    }
}

/// The mechanism of the catalogue that stands for what the hold or single trials show.
fn cause_shown_in(evidence: EvidenceSource) -> MechanismKind {
    MechanismKind::shown_in(evidence)
        .expect("the catalogue has a mechanism for the hold and one for single trials")
}

fn added_cause(own: AddedCause) -> Cause {
    Cause {
        kind: own.kind,
        p_value: own.p_value,
        indistinguishable: own.indistinguishable,
        evidence: Evidence::Trace {
            before: Box::new(own.before),
            after: Box::new(own.after),
            worth: own.worth,
            gain: own.gain,
        },
    }
}

fn hum_cause(
    clean: &Observations,
    fit: &Fit,
    (hum, as_it_was): &(Hum, Box<Observations>),
    seed: u64,
) -> Cause {
    let before = Fit::new(as_it_was, &fit.model, Weighting::MeasuredNoise).with_shrinkage(as_it_was);
    let gain = gain_of_cleaning((as_it_was, &before), (clean, fit), seed);
    let (before, after) = (Box::new(before), Box::new(fit.clone()));
    Cause {
        kind: cause_shown_in(EvidenceSource::Hold),
        p_value: hum.p_value,
        indistinguishable: Vec::new(),
        evidence: Evidence::Hold { hum: *hum, before, after, gain },
    }
}

/// Looks for outliers and trends; returns the causes, the probability of the first finding and of what is left.
fn across_trials(
    prepared: &Observations,
    fit: &Fit,
    seed: u64,
    remarks: &mut Vec<String>,
) -> (Vec<Cause>, f64, f64) {
    let Some(all) = Stiffnesses::new(prepared, fit, &[]) else {
        remarks.push(
            "too few repetitions to compare trials with each other: at least six more trials than conditions are needed"
                .into(),
        );
        return (Vec::new(), 1.0, 1.0);
    };
    let mut causes = Vec::new();
    let (found, p_outliers) = outliers(&all);
    let except: Vec<usize> = found.iter().map(|outlier| outlier.trial).collect();
    let kept = Stiffnesses::new(prepared, fit, &except);
    let trends = kept.as_ref().and_then(|data| strongest_trend(prepared, fit, data, seed));
    let p_trend = trends.as_ref().map_or(1.0, |(_, p)| *p);
    if !found.is_empty() {
        causes.push(Cause {
            kind: cause_shown_in(EvidenceSource::SingleTrials),
            p_value: (2.0 * p_outliers).min(1.0),
            indistinguishable: Vec::new(),
            evidence: Evidence::Outliers(found),
        });
    }
    if let Some((trends, p)) = trends.filter(|(_, p)| 4.0 * p < SIGNIFICANT)
        && let Some((first, rivals)) = trends.split_first()
    {
        // Two covariates that go together are told apart by how much better one fits; likelihoods within this factor are not.
        let near = |rival: &&Trend| first.t * first.t - rival.t * rival.t < NOT_TOLD_APART;
        causes.push(Cause {
            kind: first.kind,
            p_value: (2.0 * p).min(1.0),
            indistinguishable: rivals.iter().filter(near).map(|rival| rival.kind).collect(),
            evidence: Evidence::Trend(first.clone()),
        });
    }
    let p = (2.0 * p_outliers.min(p_trend)).min(1.0);
    (causes, p, 1.0)
}

/// Difference of squared t values below which two trends are not told apart (95 % of chi-square with one degree).
const NOT_TOLD_APART: f64 = 3.84;

/// What a cause leaves of the misfit, for the order of the list.
fn ratio_of(cause: &Cause) -> f64 {
    match &cause.evidence {
        Evidence::Trace { gain, .. } | Evidence::Hold { gain, .. } => gain.held_out_rmse_ratio.value,
        Evidence::Trend(trend) => trend.left_out_ratio,
        Evidence::Outliers(_) => 1.0,
    }
}
