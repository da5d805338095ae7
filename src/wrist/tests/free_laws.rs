//! Free laws: nothing at rest, and the torque of the mechanisms whose laws they contain.

use super::*;
use crate::wrist::mechanisms::FreeLawKind;

/// Torque of a model with one mechanism or free law, N m.
fn torque(kind: MechanismKind, trial: &TrialInput, base: [f64; 6], parameters: &[f64]) -> Vec<f64> {
    let all: Vec<f64> = base.iter().chain(parameters).copied().collect();
    // Many steps, so that laws which are integrated in different ways differ by less than their errors.
    run(&SimulationSettings { substeps: 16, ..settings(&[kind], &[], &[]) }, trial, &all).torque_nm
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn assert_imitates(free: FreeLawKind, parameters: &[f64], kind: MechanismKind, values: &[f64]) {
    let trial = ramp(2.6);
    let own = torque(MechanismKind::Free(free), &trial, PERSON, parameters);
    let named = torque(kind, &trial, PERSON, values);
    let error = largest_difference(&own, &named);
    assert!(error < 1e-9, "{} and {}: {error:e} N m", free.id(), kind.id());
    let without = run(&settings(&[], &[], &[]), &trial, &PERSON).torque_nm;
    assert!(largest_difference(&without, &named) > 1e-2, "{} changes the torque", kind.id());
}

/// The parameters of a spline that is the straight line `slope` times its argument.
fn line(from: f64, to: f64, slope: f64) -> Vec<f64> {
    let knot = |k: i32| slope * (from + f64::from(k - 1) * (to - from) / 5.0);
    [from, to].into_iter().chain((0..8).map(knot)).collect()
}

#[test]
fn a_free_law_adds_nothing_in_the_steady_state_before_the_ramp() {
    let mut still = ramp(2.6);
    still.motion.fill(Kinematics::default());
    for kind in FREE_LAWS {
        let typical: Vec<f64> = kind.parameters().iter().map(|parameter| parameter.typical).collect();
        let torque = torque(*kind, &still, PERSON, &typical);
        // A law of time begins to act at the onset, at the first sample of the torque.
        let steady = if kind.id().ends_with("_time") { &torque[..1] } else { &torque };
        assert!(steady.iter().all(|torque| torque.abs() < 1e-14), "{}: {steady:?}", kind.id());
    }
}

#[test]
fn a_free_law_contains_the_named_laws_of_its_place() {
    use FreeLawKind::*;
    assert_imitates(JointSpeed, &line(-1.0, 6.0, 0.1), MechanismKind::JointDamping, &[0.1 + 1e-5]);
    let lag = [0.04, 0.0, 0.0, 0.0, 1.0];
    let cutoff_hz = 1.0 / (std::f64::consts::TAU * 0.04);
    assert_imitates(TorqueChannelPastTorque, &lag, MechanismKind::TorqueLag, &[cutoff_hz, 1.0]);
    assert_imitates(TorqueChannelTorque, &line(-5.0, 50.0, 0.1), MechanismKind::TorqueGain, &[1.1]);
    let gain = line(-0.1, 0.2, 1.0 / 1.1 - 1.0);
    assert_imitates(AngleChannelAngle, &gain, MechanismKind::AngleGain, &[1.1]);
}

#[test]
fn a_law_of_all_past_speed_is_a_stiffness() {
    let trial = ramp(2.6);
    let memory_s = 0.08;
    let weight = 0.05;
    let parameters: Vec<f64> = std::iter::once(memory_s).chain([weight; 8]).collect();
    let own = torque(MechanismKind::Free(FreeLawKind::JointPastSpeed), &trial, PERSON, &parameters);
    let mut stiffer = PERSON;
    stiffer[3] += weight / (memory_s / 8.0);
    // Without weights, so that both are integrated in the same way.
    let none: Vec<f64> = std::iter::once(memory_s).chain([0.0; 8]).collect();
    let want = torque(MechanismKind::Free(FreeLawKind::JointPastSpeed), &trial, stiffer, &none);
    let error = largest_difference(&own, &want);
    assert!(error < 1e-9, "{error:e} N m");
}

#[test]
fn a_free_law_is_found_by_its_id_and_is_not_in_the_catalogue() {
    for kind in FREE_LAWS {
        assert_eq!(MechanismKind::from_id(kind.id()), Some(*kind));
        assert!(kind.is_free_law() && !CATALOGUE.contains(kind));
        let law = kind.free_law().unwrap();
        assert_eq!(kind.id(), format!("free_{}_{}", law.place.id(), law.argument.id()));
        let coefficients = &kind.parameters()[law.coefficients];
        assert!(coefficients.iter().all(|coefficient| coefficient.fitted && coefficient.absent == Some(0.0)));
    }
    assert!(CATALOGUE.iter().all(|kind| kind.free_law().is_none()));
}

#[test]
fn the_curve_of_a_free_law_is_what_it_adds() {
    let curve = |kind: FreeLawKind, parameters: &[f64], u| {
        MechanismKind::Free(kind).free_law().unwrap().curve(parameters, u)
    };
    assert!((curve(FreeLawKind::JointSpeed, &line(-1.0, 6.0, 0.1), 2.0) - 0.2).abs() < 1e-14);
    let past_speed = [0.04, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
    assert_eq!(curve(FreeLawKind::JointPastSpeed, &past_speed, 0.0124), 3.0);
    assert_eq!(curve(FreeLawKind::JointPastSpeed, &past_speed, 0.05), 0.0);
    let step = curve(FreeLawKind::TorqueChannelPastTorque, &[0.04, 0.0, 0.0, 0.0, 1.0], 0.04);
    assert!((step + libm::exp(-1.0)).abs() < 1e-14);
}
