//! The diagnosis of a session: misfit within the trials, then across the trials, and the verdict.

use super::across_trials::covariate_regression::{CovariateEffect, covariate_effects, table_without_effect};
use super::across_trials::elastic_limit_law::{ElasticLimitLaw, elastic_limit_law};
use super::across_trials::outliers::outliers;
use super::across_trials::stiffness_table::{MIN_DEGREES_OF_FREEDOM, StiffnessTable};
use super::base_model::not_described;
use super::cause::{Cause, CauseEvidence};
use super::mains_hum::DetectedHum;
use super::preprocessing::DiagnosisInput;
use super::within_trial::cross_validation::hum_removal_gain;
use super::within_trial::forward_selection::{AddedMechanismEvidence, ForwardSelection};
use super::within_trial::null_distribution::{MISFIT_LEVEL, MisfitStatistics};
use super::within_trial::residual_terms::{ResidualDescription, residual_term};
use super::within_trial::score_test::UndetectableMechanism;
use crate::fit::{Fit, Model, Observations, Weighting};
use crate::wrist::mechanisms::{EvidenceSource, MechanismKind};

/// Verdict of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// No misfit beyond the measured noise.
    Adequate,
    /// Every cause is distinguished from all other candidates.
    Named,
    /// At least one cause is not distinguished from another candidate.
    Ambiguous,
    /// Misfit remains that no candidate explains.
    Unexplained,
}

/// Result of a diagnosis.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// Misfit statistics of the model as given.
    pub misfit: MisfitStatistics,
    /// Probability of a misfit at least as large, within and across the trials, if the model were right.
    pub p_value: f64,
    /// The causes, the largest improvement first.
    pub causes: Vec<Cause>,
    /// Probability of the remaining misfit if the extended model were right.
    pub remaining_p_value: f64,
    /// Description of the remaining residuals if they are more than noise. It is not a mechanism.
    pub residual_term: Option<ResidualDescription>,
    /// Mechanisms that this session cannot show.
    pub undetectable: Vec<UndetectableMechanism>,
    /// Dependence of the elastic limit on velocity and torque.
    pub elastic_limit_law: Option<ElasticLimitLaw>,
    /// The fit of the model as given.
    pub before: Fit,
    /// The fit of the extended model.
    pub after: Fit,
    /// Remarks for the reader.
    pub remarks: Vec<String>,
}

/// Significance level of the test for misfit that remains after two added mechanisms. Higher than `MISFIT_LEVEL`, since misfit is
/// established by then, and two mechanisms can describe much that neither causes. Assumed.
const MISFIT_LEVEL_AFTER_TWO: f64 = 0.05;

impl Diagnosis {
    /// The diagnosis of a session about which nothing can be said, for the reason in `remarks`.
    fn without_causes(fit: Fit, remarks: Vec<String>) -> Self {
        Self {
            verdict: Verdict::Unexplained,
            misfit: MisfitStatistics { largest: f64::NAN, excess: f64::NAN, scatter: f64::NAN },
            p_value: f64::NAN,
            causes: Vec::new(),
            remaining_p_value: f64::NAN,
            residual_term: None,
            undetectable: Vec::new(),
            elastic_limit_law: None,
            before: fit.clone(),
            after: fit,
            remarks,
        }
    }
}

/// Diagnoses a session under `model`. `seed` seeds the simulated sessions; `stage` is called with the name of each step as it starts.
pub fn diagnose(look: &DiagnosisInput, model: &Model, seed: u64, stage: &dyn Fn(&'static str)) -> Diagnosis {
    let observations = &look.observations;
    stage("fitting the model");
    let before = Fit::new(observations, model, Weighting::MeasuredNoise).with_shrinkage(observations);
    let mut remarks = Vec::new();
    if look.usable_trials > observations.trials.len() {
        remarks.push(format!(
            "{} of {} trials were analysed, spread evenly over the conditions and their repetitions",
            observations.trials.len(),
            look.usable_trials
        ));
    }
    if let Some(reason) = not_described(observations, &before) {
        remarks.push(format!("no cause was looked for: {reason}"));
        return Diagnosis::without_causes(before, remarks);
    }
    let mut causes: Vec<Cause> =
        look.hum.iter().map(|found| hum_cause(observations, &before, found, seed)).collect();
    let p_hum = causes.first().map_or(1.0, |cause| cause.p_value);
    let within = ForwardSelection::run(observations, &before, seed, stage);
    if !within.misfit.is_finite() {
        remarks.push("no cause was looked for: the misfit is not a finite number".into());
        return Diagnosis::without_causes(before, remarks);
    }
    causes.extend(within.causes.into_iter().map(added_cause));
    if let Some(ratio) = within.scatter {
        remarks.push(format!(
            "the variance of the residuals about their mean pattern is {ratio:.1} times that of the noise: the ramps contain a \
             disturbance that differs between repetitions, is absent in the holds and is described by no mechanism, such as an \
             unsteady clock or a coarse converter"
        ));
    }
    stage("comparing the trials with each other");
    let (across, p_across, left_across) = across_trials(observations, &within.fit, seed, &mut remarks);
    causes.extend(across);
    causes.sort_by(|a, b| ratio_of(a).total_cmp(&ratio_of(b)));
    let remaining_p_value = (2.0 * within.remaining_p_value.min(left_across)).min(1.0);
    let added = within.fit.kinds.len() - before.kinds.len();
    let significant = if added < 2 { MISFIT_LEVEL } else { MISFIT_LEVEL_AFTER_TWO };
    let verdict = if remaining_p_value < significant {
        Verdict::Unexplained
    } else if causes.iter().any(|cause| !cause.indistinguishable.is_empty()) {
        Verdict::Ambiguous
    } else if causes.is_empty() {
        Verdict::Adequate
    } else {
        Verdict::Named
    };
    let residual_term =
        (verdict == Verdict::Unexplained).then(|| residual_term(observations, &within.fit)).flatten();
    Diagnosis {
        verdict,
        misfit: within.misfit,
        p_value: (2.0 * within.p_value.min(p_across)).min(p_hum).min(1.0),
        causes,
        remaining_p_value,
        residual_term,
        undetectable: within.undetectable,
        elastic_limit_law: elastic_limit_law(observations, &within.fit, &within.simulated_limits),
        before,
        after: within.fit,
        remarks,
    }
}

/// The mechanism of the catalogue whose evidence is in the hold or in single trials.
fn cause_shown_in(evidence: EvidenceSource) -> MechanismKind {
    MechanismKind::shown_in(evidence)
        .expect("the catalogue has a mechanism for the hold and one for single trials")
}

fn added_cause(own: AddedMechanismEvidence) -> Cause {
    Cause {
        kind: own.kind,
        p_value: own.p_value,
        indistinguishable: own.indistinguishable,
        evidence: CauseEvidence::WithinTrial {
            before: Box::new(own.before),
            after: Box::new(own.after),
            chi_square_gain: own.chi_square_gain,
            gain: own.gain,
        },
    }
}

fn hum_cause(
    clean: &Observations,
    fit: &Fit,
    (hum, as_it_was): &(DetectedHum, Box<Observations>),
    seed: u64,
) -> Cause {
    let before = Fit::new(as_it_was, &fit.model, Weighting::MeasuredNoise).with_shrinkage(as_it_was);
    let gain = hum_removal_gain((as_it_was, &before), (clean, fit), seed);
    let (before, after) = (Box::new(before), Box::new(fit.clone()));
    Cause {
        kind: cause_shown_in(EvidenceSource::Hold),
        p_value: hum.p_value,
        indistinguishable: Vec::new(),
        evidence: CauseEvidence::Hold { hum: *hum, before, after, gain },
    }
}

/// Largest number of covariates that are named.
const MAX_COVARIATES: usize = 2;

/// Tests for outliers and covariate effects. Returns the causes, the p-value before and that of what remains after they are named.
fn across_trials(
    observations: &Observations,
    fit: &Fit,
    seed: u64,
    remarks: &mut Vec<String>,
) -> (Vec<Cause>, f64, f64) {
    let Some(all) = StiffnessTable::new(observations, fit, &[]) else {
        remarks.push(
            "too few repetitions to compare trials with each other; at least six more trials than conditions are needed"
                .into(),
        );
        return (Vec::new(), 1.0, 1.0);
    };
    let mut causes = Vec::new();
    let (found, p_outliers) = outliers(&all);
    let except: Vec<usize> = found.iter().map(|outlier| outlier.trial).collect();
    let mut left = all.without(&except);
    if !found.is_empty() {
        causes.push(Cause {
            kind: cause_shown_in(EvidenceSource::SingleTrials),
            p_value: (2.0 * p_outliers).min(1.0),
            indistinguishable: Vec::new(),
            evidence: CauseEvidence::Outliers(found),
        });
    }
    let (mut p_first_trend, mut p_trend_left) = (1.0, 1.0);
    for number in 0..=MAX_COVARIATES {
        // Too few trials may be left beside the outliers.
        if left.freedom() < MIN_DEGREES_OF_FREEDOM {
            break;
        }
        let Some((trends, p)) = covariate_effects(observations, fit, &left, seed) else { break };
        p_trend_left = p;
        if number == 0 {
            p_first_trend = p;
        }
        if 4.0 * p >= MISFIT_LEVEL || number == MAX_COVARIATES {
            break;
        }
        let Some((first, rivals)) = trends.split_first() else { break };
        // Correlated covariates are distinguished only by how much better one of them fits.
        let near =
            |rival: &&CovariateEffect| first.t * first.t - rival.t * rival.t < INDISTINGUISHABLE_T_SQUARED;
        causes.push(Cause {
            kind: first.kind,
            p_value: (2.0 * p).min(1.0),
            indistinguishable: rivals.iter().filter(near).map(|rival| rival.kind).collect(),
            evidence: CauseEvidence::AcrossTrials(first.clone()),
        });
        left = table_without_effect(observations, fit, &left, first);
    }
    let p_outliers_left = if causes.is_empty() { 1.0 } else { outliers(&left).1 };
    let p = (2.0 * p_outliers.min(p_first_trend)).min(1.0);
    (causes, p, (2.0 * p_outliers_left.min(p_trend_left)).min(1.0))
}

/// Difference of squared t values (a log-likelihood ratio) below which two covariates are not distinguished: the 95 % quantile of
/// chi-square with one degree of freedom.
const INDISTINGUISHABLE_T_SQUARED: f64 = 3.84;

/// Ratio of the residual with a cause to that without, by which the list is ordered.
fn ratio_of(cause: &Cause) -> f64 {
    match &cause.evidence {
        CauseEvidence::WithinTrial { gain, .. } | CauseEvidence::Hold { gain, .. } => {
            gain.held_out_rmse_ratio.value
        }
        CauseEvidence::AcrossTrials(covariate_effect) => covariate_effect.left_out_ratio,
        CauseEvidence::Outliers(_) => 1.0,
    }
}
