//! The diagnosis of a session: probabilities of causes from the comparison of models, checks of the best one, and the verdict.

use nalgebra::DVector;

use super::across_trials::covariate_regression::with_effect_in_parameters;
use super::across_trials::elastic_limit_law::{ElasticLimitLaw, elastic_limit_law};
use super::across_trials::exchangeability::remaining_correlation;
use super::across_trials::stiffness_table::MIN_DEGREES_OF_FREEDOM;
use super::applicability::missing;
use super::base_model::{UNTRUSTED_ANGLE_ERROR, not_described};
use super::cause::{Cause, CauseEvidence};
use super::evidence::answer::{
    CauseProbabilities, NAMED_PROBABILITY, most_probable_model, most_probable_of_likely_causes,
};
use super::evidence::found_law::FoundLaw;
use super::evidence::model_posterior::ModelPosterior;
use super::evidence::model_prior::compared;
use super::evidence::model_search::{ComparedModel, ModelSearch};
use super::evidence::rig_knowledge::RigKnowledge;
use super::evidence::session_prior::SessionPrior;
use super::evidence::used_freedom::{Freedom, UsedFreedom, smallest_p_value};
use super::fit_chain::FitChain;
use super::interval::Interval;
use super::mains_hum::{DetectedHum, hum_probability};
use super::preprocessing::{CoarseEncoder, DiagnosisInput};
use super::within_trial::cross_validation::hum_removal_gain;
use super::within_trial::null_distribution::{MISFIT_LEVEL, MisfitStatistics};
use super::within_trial::residual_terms::{ResidualDescription, residual_term};
use super::within_trial::score_test::{UndetectableMechanism, probe_context};
use super::within_trial::tested_fit::TestedFit;
use crate::fit::{Fit, Model, Observations, Weighting, X_E, coarse_angle, onset_warnings};
use crate::random::Stream;
use crate::wrist::mechanisms::{EvidenceSource, MechanismClass, MechanismKind};

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

impl Verdict {
    /// That of these causes, where they leave no misfit.
    fn of(causes: &[Cause]) -> Self {
        let is_sure = |cause: &Cause| cause.alternatives.is_empty() && cause.probability >= NAMED_PROBABILITY;
        match causes {
            [] => Self::Adequate,
            causes if causes.iter().all(is_sure) => Self::Named,
            _ => Self::Ambiguous,
        }
    }
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
    /// Probability of each cause, of none, and of a cause in no catalogue; `None` if no cause was looked for.
    pub probabilities: Option<CauseProbabilities>,
    /// The causes, the largest improvement first.
    pub causes: Vec<Cause>,
    /// Probability of the remaining misfit if the model with the causes were right.
    pub remaining_p_value: f64,
    /// The unknown law that explains the session better than the catalogue, and what else it could be.
    pub free_law: Option<FoundLaw>,
    /// Description of the remaining residuals if they are more than noise. It is not a mechanism.
    pub residual_term: Option<ResidualDescription>,
    /// Mechanisms that this session cannot show.
    pub undetectable: Vec<UndetectableMechanism>,
    /// Dependence of the elastic limit on velocity and torque.
    pub elastic_limit_law: Option<ElasticLimitLaw>,
    /// The fit of the model as given.
    pub before: Fit,
    /// The fit of the model with the causes.
    pub after: Fit,
    /// Remarks for the reader.
    pub remarks: Vec<String>,
}

impl Diagnosis {
    /// The diagnosis of a session about which nothing can be said, for the reason in `remarks`.
    fn without_causes(fit: Fit, remarks: Vec<String>) -> Self {
        Self {
            verdict: Verdict::Unexplained,
            misfit: MisfitStatistics { largest: f64::NAN, excess: f64::NAN, scatter: f64::NAN },
            p_value: f64::NAN,
            probabilities: None,
            causes: Vec::new(),
            remaining_p_value: f64::NAN,
            free_law: None,
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
    remarks.extend(onset_warnings(observations.stated_onsets_late_s(), observations.stated_onsets_early_s()));
    if let Some(reason) = not_described(observations, &before) {
        remarks.push(format!("no cause was looked for: {reason}"));
        return Diagnosis::without_causes(before, remarks);
    }
    remarks.extend(remarks_on_angle(look, &before));
    let Some(Comparison { search, given, single }) = compared_models(look, &before, seed, stage) else {
        remarks.push("no cause was looked for: the likelihood of the model cannot be approximated".into());
        return Diagnosis::without_causes(before, remarks);
    };
    let models = &search.models;
    stage("comparing the misfit with noise");
    let AnsweredModel { probabilities, nothing, sizeless, explains, best } =
        AnsweredModel::of(models, &given);
    remarks.extend(sizeless.iter().map(|kind| without_size(*kind)));
    if let Some(reason) = not_told(look, &models[best]) {
        remarks.push(format!("no cause is named: {reason}"));
        return Diagnosis::without_causes(before, remarks);
    }
    let free = (!nothing && !explains).then(|| FoundLaw::of(&search, &probabilities)).flatten();
    let (extended, tested) = match single {
        (index, fit, test) if index == best => (fit, (best > 0).then_some(test)),
        _ => {
            let fit = fit_with_causes(&search, &models[best]);
            let test = (best > 0).then(|| tested(&search, &models[best], &fit, seed));
            (fit, test)
        }
    };
    let left = tested.as_ref().unwrap_or(&given);
    if !given.is_finite() || !left.is_finite() {
        remarks.push(
            "no cause is named: the misfit cannot be compared with noise, since the model diverges".into(),
        );
        return Diagnosis::without_causes(before, remarks);
    }
    let remaining = RemainingMisfit::of(observations, &models[best].posterior, left, seed);
    let is_left = remaining.p_value < MISFIT_LEVEL;
    remarks.extend(remaining.remarks);
    let probabilities =
        if nothing { probabilities.where_nothing_is_seen(given.p_values.any()) } else { probabilities };
    let probabilities = if is_left {
        probabilities.where_misfit_is_left(remaining.p_value, search.model_prior.of_unknown_law())
    } else {
        probabilities
    };
    stage("measuring the gain on data left out");
    let chain = FitChain { search: &search, probabilities: &probabilities, seed };
    let mut causes = if nothing { Vec::new() } else { chain.causes(best) };
    causes.extend(look.hum.iter().map(|found| hum_cause(observations, &before, found, seed)));
    causes.sort_by(|a, b| ratio_of(a).total_cmp(&ratio_of(b)));
    remarks.extend(causes.iter().filter_map(warning));
    remarks.extend(causes.iter().filter_map(|cause| changed_after_rig_trials(cause, &search.prior.rig)));
    let is_unknown = free.is_some() || !explains && !sizeless.is_empty();
    let verdict = if is_unknown || is_left { Verdict::Unexplained } else { Verdict::of(&causes) };
    let residual_term =
        (verdict == Verdict::Unexplained).then(|| residual_term(observations, &extended)).flatten();
    // What rig trials tell is corrected before the model is tested, so that it leaves no misfit of the model.
    let leaves_misfit = |cause: &&Cause| !matches!(cause.evidence, CauseEvidence::RigTrials { .. });
    let p_of_causes =
        causes.iter().filter(leaves_misfit).filter_map(|cause| cause.p_value).fold(1.0, f64::min);
    Diagnosis {
        verdict,
        misfit: given.misfit,
        p_value: (2.0 * given.p_values.any()).min(p_of_causes).min(1.0),
        probabilities: Some(probabilities),
        causes,
        remaining_p_value: remaining.p_value,
        free_law: free,
        residual_term,
        undetectable: given.undetectable.clone(),
        elastic_limit_law: limit_law(&search, &models[best], seed),
        before: search.without_deviations(&models[0].posterior),
        after: extended,
        remarks,
    }
}

/// What a reader must know of the recorded angle.
fn remarks_on_angle(look: &DiagnosisInput, before: &Fit) -> Vec<String> {
    let in_steps = look.coarse_encoder.map(|CoarseEncoder { ratio, step_rad }| {
        format!(
            "the error of the recorded angle (steps of {:.2} mrad) has {ratio:.1} times the variance of the torque's noise: the motions are \
             taken as known only between these steps, which hides causes of a small effect; measure with a finer encoder",
            1e3 * step_rad
        )
    });
    let coarse = coarse_angle(&look.observations, before).map(|reason| {
        format!("{reason}; a cause that is named, and misfit that remains, may be the encoder's")
    });
    in_steps.into_iter().chain(coarse).collect()
}

/// The model that is answered with.
struct AnsweredModel {
    /// Probabilities of the causes, by all models.
    probabilities: CauseProbabilities,
    /// No cause is seen.
    nothing: bool,
    /// Causes of the most probable model that have no size.
    sizeless: Vec<MechanismKind>,
    /// The catalogue explains the session more probably than a law that it does not have.
    explains: bool,
    /// Index of the model.
    best: usize,
}

impl AnsweredModel {
    fn of(models: &[ComparedModel], given: &TestedFit) -> Self {
        let probabilities = CauseProbabilities::of(models);
        let most_probable = most_probable_model(models);
        let model = &models[most_probable];
        // What acts within the trials, and is not in their constants already, must also leave a misfit there; what acts across them leaves none.
        let acts_within =
            |kind: &MechanismKind| kind.evidence() == EvidenceSource::Trace && model.fits(*kind);
        let is_seen = !model.causes.iter().all(acts_within) || given.p_values.any() < SEEN_LEVEL;
        let nothing = probabilities.none > 1.0 - NAMED_PROBABILITY || !is_seen;
        let sizeless = if nothing { Vec::new() } else { sizeless_causes(model) };
        let probabilities = probabilities.where_law_has_no_size(&sizeless);
        let explains = probabilities.none_of_these < 0.5;
        let best = if nothing {
            0
        } else if explains && sizeless.is_empty() {
            most_probable
        } else {
            most_probable_of_likely_causes(models, &probabilities)
        };
        Self { probabilities, nothing, sizeless, explains, best }
    }
}

/// The misfit that a model leaves, within the trials and across them.
struct RemainingMisfit {
    /// Probability of a misfit as large if the model were right.
    p_value: f64,
    /// What a reader must know of the checks.
    remarks: Vec<String>,
}

impl RemainingMisfit {
    fn of(observations: &Observations, model: &ModelPosterior, left: &TestedFit, seed: u64) -> Self {
        let across = remaining_correlation(observations, model, seed);
        let used = model.used_freedom();
        tracing::debug!(?used, "freedom of the best model");
        let smallest = left.p_values.any().min(across.unwrap_or(1.0)).min(smallest_p_value(&used));
        let mut remarks = Vec::new();
        if across.is_none() {
            remarks.push(format!(
                "too few repetitions to compare trials with each other; at least {MIN_DEGREES_OF_FREEDOM} more trials than conditions are \
                 needed"
            ));
        }
        remarks.extend(
            used.iter().filter(|own| CHECKS * used.len() as f64 * own.p_value < MISFIT_LEVEL).map(beyond),
        );
        if CHECKS * left.p_values.between_repetitions() < MISFIT_LEVEL {
            remarks.push(format!(
                "the variance of the residuals about their mean pattern is {:.1} times that of the noise: the ramps contain a \
                 disturbance that differs between repetitions, is absent in the holds and is described by no mechanism, such as an \
                 unsteady clock or a coarse converter",
                left.p_values.scatter
            ));
        }
        Self { p_value: (CHECKS * smallest).min(1.0), remarks }
    }
}

/// Why a cause without a size is not named.
fn without_size(kind: MechanismKind) -> String {
    format!(
        "{} is not named: its size is not told from none (95 % interval), so that what it explains is something else that differs between \
         trials",
        kind.id()
    )
}

/// Why the causes of `model` are not named; `None` if they can be. What is wrong in the rig shows as the errors of the angle do, all the more
/// where these are large.
fn not_told(look: &DiagnosisInput, model: &ComparedModel) -> Option<String> {
    let coarse = look.coarse_encoder.filter(|own| own.ratio > UNTRUSTED_ANGLE_ERROR)?;
    let is_of_rig = |kind: &&MechanismKind| {
        matches!(kind.class(), MechanismClass::Rig | MechanismClass::Sensor) && model.fits(**kind)
    };
    let kind = model.causes.iter().find(is_of_rig)?;
    Some(format!(
        "{} is the most probable one, but behind steps of {:.2} mrad a cause in the rig or its sensors is not told from another; measure with \
         a finer encoder, or calibrate the rig",
        kind.id(),
        1e3 * coarse.step_rad
    ))
}

/// The causes of `model` whose sizes may as well be those of no effect. A law is uncertain, and where its size is none, all that it explains is
/// how far it may be off.
fn sizeless_causes(model: &ComparedModel) -> Vec<MechanismKind> {
    let is_sizeless = |kind: &MechanismKind| {
        let values = model.posterior.intervals(*kind);
        let mut sizes =
            kind.parameters().iter().zip(&values).filter_map(|(own, value)| Some((own.absent?, value)));
        let holds = |(absent, value): (f64, &Interval)| {
            value.low.is_some_and(|low| low <= absent) && value.high.is_some_and(|high| absent <= high)
        };
        sizes.next().is_some_and(holds) && sizes.all(holds)
    };
    model.causes.iter().copied().filter(|kind| model.fits(*kind) && is_sizeless(kind)).collect()
}

/// The models that are compared, each with its evidence.
struct Comparison<'a> {
    search: ModelSearch<'a>,
    /// The test of the model as given.
    given: TestedFit,
    /// The best model of one cause, or that of none: its index, its fit and the test of it.
    single: (usize, Fit, TestedFit),
}

/// Fits and compares the models.
fn compared_models<'a>(
    look: &'a DiagnosisInput,
    before: &'a Fit,
    seed: u64,
    stage: &dyn Fn(&'static str),
) -> Option<Comparison<'a>> {
    let observations = &look.observations;
    let kinds = compared(|kind| before.kinds.contains(&kind) || missing(observations, kind).is_some());
    let prior = SessionPrior::new(observations, before, probe_context(observations), look.rig.clone());
    let mut search = ModelSearch::new(observations, before, prior, &kinds)?;
    let mut given = TestedFit::new(observations, before, Vec::new(), &[], &search.prior, seed);
    stage("fitting the mechanisms of the catalogue");
    if search.add_single_causes(&kinds, given.p_values.any() < SEEN_LEVEL) {
        let none = &search.models[0];
        given = tested(&search, none, &fit_with_causes(&search, none), seed);
    }
    stage("fitting unknown laws");
    search.add_free_laws();
    stage("fitting pairs of mechanisms");
    let single = search.best_with(1);
    let best = if search.models[single].log_odds > 0.0 { single } else { 0 };
    let fit = fit_with_causes(&search, &search.models[best]);
    let tested = tested(&search, &search.models[best], &fit, seed);
    search.add_pairs(&kinds, tested.p_values.any() < MISFIT_LEVEL);
    stage("looking for trials that do not belong");
    if let Some(kind) = kinds.iter().copied().find(|kind| kind.evidence() == EvidenceSource::SingleTrials) {
        search.add_outliers(kind);
    }
    search.add_told_causes();
    Some(Comparison { search, given, single: (best, fit, tested) })
}

/// The test of what `fit`, that of a model, leaves. The changes of its causes' sizes over the session are explained, whatever they are.
fn tested(search: &ModelSearch, model: &ComparedModel, fit: &Fit, seed: u64) -> TestedFit {
    let prior = &search.prior;
    let told = model.causes.iter().filter(|cause| !model.fits(**cause));
    let changed: Vec<MechanismKind> = told.flat_map(|cause| prior.rig.changed_by(*cause)).collect();
    TestedFit::new(search.observations(), fit, model.posterior.size_changes(), &changed, prior, seed)
}

/// The fit of a model, with the deviations of its mechanisms' laws held at their most probable values.
fn fit_with_causes(search: &ModelSearch, model: &ComparedModel) -> Fit {
    let mut held = model.posterior.fit.model.clone();
    let ranges = held.mechanism_ranges();
    for (added, range) in held.mechanisms.iter_mut().zip(ranges) {
        if added.kind.is_free_law() && !model.causes.contains(&added.kind) {
            for (spec, value) in added.parameters.iter_mut().zip(&model.posterior.fit.parameters[0][range]) {
                *spec = crate::fit::ParameterSpec::fixed(*value);
            }
        }
    }
    // What acts across the trials is in their parameters.
    let mut fit = model.posterior.fit.with_model(search.observations(), &held);
    for kind in model.causes.iter().filter(|kind| kind.evidence() == EvidenceSource::AcrossTrials) {
        fit = with_effect_in_parameters(search.observations(), &fit, *kind);
    }
    with_least_cost(search.observations(), &fit)
}

/// `fit` after shrinkage, which begins where the fit is or where it goes when it is freed of its priors first. There a trial that is hardly
/// determined may leave the optimum, and the target of the shrinkage follows it; or find a better one.
fn with_least_cost(observations: &Observations, fit: &Fit) -> Fit {
    let kept = fit.with_shrinkage(observations);
    let freed = fit.extended(observations, &fit.model).with_shrinkage(observations);
    if kept.cost() < freed.cost() { kept } else { freed }
}

/// Number of checks of the best model (within the trials, across them, and of its freedom): the factor of the Bonferroni correction.
const CHECKS: f64 = 3.0;

/// Level of the test of the model as given, without which no cause within the trials is named: what is allowed of false alarms.
const SEEN_LEVEL: f64 = 0.05;

/// Number of sessions of noise alone from which the errors of the elastic limits follow.
const LIMIT_SIMULATIONS: usize = 200;

/// The law of the elastic limits of a model's trials.
fn limit_law(search: &ModelSearch, model: &ComparedModel, seed: u64) -> Option<ElasticLimitLaw> {
    let posterior = &model.posterior;
    let coordinate = posterior.unknowns.parameters.iter().position(|own| *own == X_E)?;
    let mut stream = Stream::new(seed, "errors of the elastic limits");
    let limit = |(own, error): (&Vec<f64>, &DVector<f64>)| own[X_E] * libm::exp(error[coordinate]);
    let simulated: Vec<Vec<f64>> = posterior
        .simulated_errors(LIMIT_SIMULATIONS, &mut stream)
        .iter()
        .map(|errors| posterior.fit.parameters.iter().zip(errors).map(limit).collect())
        .collect();
    elastic_limit_law(search.observations(), &posterior.fit, &simulated)
}

/// The mechanism of the catalogue whose evidence is in the hold.
fn cause_shown_in_the_hold() -> MechanismKind {
    MechanismKind::shown_in(EvidenceSource::Hold).expect("the catalogue has a mechanism for the hold")
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
        kind: cause_shown_in_the_hold(),
        probability: hum_probability(hum),
        p_value: Some(hum.p_value),
        alternatives: Vec::new(),
        values: hum.intervals(),
        law: None,
        evidence: CauseEvidence::Hold { hum: *hum, before, after, gain },
    }
}

/// What must be said of a freedom of which a session uses more than its prior declares.
fn beyond(used: &UsedFreedom) -> String {
    let what = match used.freedom {
        Freedom::Law(kind) => format!("the laws of its mechanisms are off, by {},", kind.title()),
        Freedom::Size(kind) => format!("the size of {} changes with order, torque or velocity", kind.id()),
        Freedom::SharedErrors => {
            "the errors of the angle and the drifts of measured constants are larger".into()
        }
    };
    format!(
        "the best model is doubtful: {what} by more than was declared before the data (p = {:.1e})",
        used.p_value
    )
}

/// What must be said of a cause that makes predictions worse.
fn warning(cause: &Cause) -> Option<String> {
    match &cause.evidence {
        CauseEvidence::WithinTrial { gain, .. } => gain.warning(cause.kind.title()),
        _ => None,
    }
}

/// What must be said of a cause that contradicts the rig trials.
fn changed_after_rig_trials(cause: &Cause, rig: &RigKnowledge) -> Option<String> {
    let is_fitted = matches!(cause.evidence, CauseEvidence::WithinTrial { .. });
    (is_fitted && rig.tells(cause.kind)).then(|| {
        format!(
            "{} is not as the rig trials show it: it came or changed after them, or with the person; repeat the rig trials and ramphold calibrate",
            cause.kind.id()
        )
    })
}

/// Ratio of the residual with a cause to that without, by which the list is ordered.
fn ratio_of(cause: &Cause) -> f64 {
    match &cause.evidence {
        CauseEvidence::WithinTrial { gain, .. } | CauseEvidence::Hold { gain, .. } => {
            gain.held_out_rmse_ratio.value
        }
        CauseEvidence::AcrossTrials(covariate_effect) => covariate_effect.left_out_ratio,
        CauseEvidence::Outliers(_) | CauseEvidence::RigTrials { .. } => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::test_session::{fit_and_prior, session};
    use crate::fit::PreprocessingSettings;

    /// A refit that was freed of its priors left the posterior's optimum, and a right cause was called `unexplained`.
    #[test]
    fn the_refit_that_is_tested_is_the_better_one_of_two_starts() {
        let cases = [(MechanismKind::LeverStiffness, vec![540.0]), (MechanismKind::JointDamping, vec![0.2])];
        for (kind, values) in cases {
            let session = session(kind, |_| values.clone());
            let observations = Observations::new(&session, PreprocessingSettings::default()).unwrap();
            let (before, prior) = fit_and_prior(&observations);
            let mut search = ModelSearch::new(&observations, &before, prior, &[kind]).unwrap();
            search.add_single_causes(&[kind], true);
            let start = &search.models[search.best_with(1)].posterior.fit;
            let kept = start.with_shrinkage(&observations).cost();
            let freed = start.extended(&observations, &start.model).with_shrinkage(&observations).cost();
            let cost = with_least_cost(&observations, start).cost();
            assert!(kept != freed && cost == kept.min(freed), "{kind:?}: {cost}, {kept} and {freed}");
        }
    }
}
