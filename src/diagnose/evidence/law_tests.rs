//! Sessions whose mechanism follows another law than the catalogue's.

use super::rig_knowledge::RigKnowledge;
use super::session_prior::SessionPrior;
use crate::diagnose::test_session::{LEVER, session};
use crate::diagnose::within_trial::score_test::probe_context;
use crate::fit::{Fit, Model, Observations, PreprocessingSettings, Weighting, mechanism_ranges};
use crate::wrist::mechanisms::{FREE_LAWS, MechanismKind, Place};

/// The law deviated at lags of up to 16 ms, which are before most of a reflex.
#[test]
fn the_law_of_a_reflex_deviates_from_the_shortest_latency_until_the_reflex_is_over() {
    let (latency_s, time_constant_s) = (0.02, 0.005);
    let session = session(MechanismKind::StretchReflex, |_| vec![0.5, latency_s, time_constant_s]);
    let observations = Observations::new(&session, PreprocessingSettings::default()).unwrap();
    let before = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    let rig = RigKnowledge::stated(Some(LEVER));
    let prior = SessionPrior::new(&observations, &before, probe_context(&observations), rig);
    let reflex = MechanismKind::StretchReflex;
    let mut model = Model::paper().with(reflex);
    for (spec, value) in model.mechanisms[0].parameters.iter_mut().zip([0.5, latency_s, time_constant_s]) {
        spec.value = Some(value);
    }
    let start = before.with_model(&observations, &model);
    let fit = prior.with_deviations(&observations, &start, &[reflex]);
    let law = FREE_LAWS.iter().find(|law| {
        law.law_space().place == Place::Joint && law.law_space().argument == reflex.law_space().argument
    });
    let place = fit.kinds.iter().position(|kind| Some(kind) == law).unwrap();
    let parameters = &fit.parameters[0][mechanism_ranges(&fit.kinds)[place].clone()];
    let until_s = parameters[0];
    assert!((until_s - (latency_s + 3.0 * time_constant_s)).abs() < 1e-9, "{until_s} s");
    let first = mechanism_ranges(&fit.kinds)[place].start + 1;
    let is_free =
        |number: usize| fit.parameterisation.coordinates.iter().any(|own| own.parameter == first + number);
    let free: Vec<bool> = (0..8).map(is_free).collect();
    // Each is an eighth of the memory, 4.4 ms.
    assert_eq!(free, [false, false, true, true, true, true, true, true]);
}
