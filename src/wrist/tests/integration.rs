//! The exact steps against Runge-Kutta steps that are far smaller, and the order of both.

use super::*;
use crate::wrist::integrate::{HermiteSegment, Integrator};
use crate::wrist::mechanisms::{DataRequirement, EvidenceSource, MechanismParameter, Prior, ProbeContext};
use crate::wrist::{Mechanics, NoAddedDynamics, Plant, steps_per_sample, trace};

/// What priors may depend on.
const SESSION: ProbeContext = ProbeContext { lever: Some(LEVER), highest_torque_nm: 5.0, window_s: 0.05 };

/// The unfiltered torque by `substeps` Runge-Kutta steps a sample, N m.
fn by_runge_kutta(
    lever: Option<Lever>,
    trial: &TrialInput,
    parameters: &[f64; 6],
    (period_s, samples): (f64, usize),
    substeps: usize,
) -> Vec<f64> {
    let mechanics = Mechanics::new(Plant::base(lever, parameters));
    let mut integrator = Integrator::at_rest();
    let mut torque_nm = Vec::new();
    for knots in trial.motion[trial.onset..=trial.onset + samples].windows(2) {
        let segment = HermiteSegment::new(knots[0], knots[1], period_s);
        let torque = integrator.advance(&mechanics, &NoAddedDynamics, &segment, 0.0, period_s, substeps);
        torque_nm.push(torque);
    }
    torque_nm
}

/// The largest error of a model with mechanisms by the steps that it asks for, N m, against `fine` Runge-Kutta steps a sample; and the steps.
fn error_with_mechanisms(
    lever: Option<Lever>,
    kinds: &[MechanismKind],
    trial: &TrialInput,
    parameters: &[f64],
    (period_s, samples): (f64, usize),
    fine: usize,
) -> (f64, usize) {
    let steps = steps_per_sample(lever, kinds, trial, parameters, period_s);
    let of = settings(kinds, &[], &[]);
    let own = SimulationSettings { lever, substeps: steps, period_s, samples, lead_samples: 0, ..of };
    let reference = trace(&SimulationSettings { substeps: fine, ..own }, trial, parameters);
    let reference: Vec<f64> = reference.iter().map(|instant| instant.torques.measured).collect();
    (largest_difference(&run(&own, trial, parameters).torque_nm, &reference), steps)
}

/// The unfiltered torque by `substeps` exact steps a sample, N m.
fn by_exact_steps(
    lever: Option<Lever>,
    trial: &TrialInput,
    parameters: &[f64; 6],
    (period_s, samples): (f64, usize),
    substeps: usize,
) -> Vec<f64> {
    let settings = SimulationSettings {
        lever,
        substeps,
        period_s,
        samples,
        lead_samples: 0,
        width: VectorWidth::One,
        ..settings(&[], &[], &[])
    };
    run(&settings, trial, parameters).torque_nm
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    // A value that is not a number is infinitely far off.
    let off = |(a, b): (&f64, &f64)| if (a - b).is_nan() { f64::INFINITY } else { (a - b).abs() };
    a.iter().zip(b).map(off).fold(0.0, f64::max)
}

/// Log-uniform between two positive limits.
fn between(stream: &mut Stream, (low, high): (f64, f64)) -> f64 {
    low * libm::exp(stream.uniform() * libm::log(high / low))
}

/// Over everything that parameters.md calls plausible, and twice that on either side. The elastic limit is crossed at any time, at
/// once or never.
fn draw(stream: &mut Stream) -> [f64; 6] {
    [(1e-3, 1e-2), (0.15, 6.0), (50.0, 1000.0), (7.5, 46.0), (4.5, 40.0), (0.002, 0.2)]
        .map(|range| between(stream, range))
}

/// No lever, that of the design, and one that is light or heavy, soft or stiff.
fn levers(stream: &mut Stream) -> [Option<Lever>; 3] {
    let drawn = Lever {
        inertia_kg_m2: between(stream, (4e-4, 5e-3)),
        damping_nm_s_per_rad: between(stream, (0.04, 4.0)),
        stiffness_nm_per_rad: between(stream, (300.0, 5000.0)),
    };
    [None, Some(LEVER), Some(drawn)]
}

#[test]
fn the_error_of_exact_steps_stays_below_ten_micronewtonmetres_at_every_rate() {
    let mut stream = Stream::new(1, "integration");
    let mut worst: f64 = 0.0;
    for rate_hz in [1e3, 2.5e3, 5e3, 1e4] {
        let window = (1.0 / rate_hz, (0.050 * rate_hz) as usize);
        for _ in 0..40 {
            let parameters = draw(&mut stream);
            let trial = ramp_sampled(1.0 + 3.0 * stream.uniform(), window.0);
            for lever in levers(&mut stream) {
                let steps = steps_per_sample(lever, &[], &trial, &parameters, window.0);
                let own = by_exact_steps(lever, &trial, &parameters, window, steps);
                let reference = by_runge_kutta(lever, &trial, &parameters, window, 256);
                let error = largest_difference(&own, &reference);
                assert!(
                    error < 1e-5,
                    "{error:e} N m at {rate_hz} Hz, {parameters:?}, lever {lever:?}, {steps} steps"
                );
                worst = worst.max(error);
            }
        }
    }
    println!("largest integration error {worst:e} N m");
}

/// What the prior of a mechanism's parameter holds plausible; of a free law, coefficients of its typical size.
fn plausible(stream: &mut Stream, kind: MechanismKind) -> Vec<f64> {
    let parameters = kind.parameters().iter().enumerate();
    let value = |(place, own): (usize, &MechanismParameter)| {
        let normal = stream.normal();
        let value = match kind.prior(place, &SESSION) {
            _ if !own.fitted => own.typical,
            _ if kind.is_free_law() => own.typical * normal,
            Prior::LogNormal { median, log_sd } => median * libm::exp(log_sd * normal),
            Prior::Normal { mean, sd } => mean + sd * normal,
            Prior::HalfNormal { sd } => own.absent.unwrap_or(0.0) + sd * normal.abs(),
        };
        value.clamp(own.low, own.high)
    };
    parameters.map(value).collect()
}

#[test]
fn the_error_of_steps_with_a_mechanism_stays_below_a_fifth_of_a_millinewtonmetre_at_every_rate() {
    let mut stream = Stream::new(2, "integration of mechanisms");
    let within_trials =
        |kind: &&MechanismKind| kind.is_free_law() || kind.evidence() == EvidenceSource::Trace;
    for (rate_hz, kind) in [500.0, 1e3, 2.5e3, 5e3].into_iter().flat_map(|rate_hz| {
        CATALOGUE.iter().chain(FREE_LAWS).filter(within_trials).map(move |kind| (rate_hz, *kind))
    }) {
        let (period_s, samples) = (1.0 / rate_hz, (0.050 * rate_hz) as usize);
        for draw in 0..6 {
            let lever = (draw % 2 == 0 || kind.needs().contains(&DataRequirement::Lever)).then_some(LEVER);
            let base = PERSON.map(|own| own * libm::exp(0.3 * stream.normal()));
            let parameters: Vec<f64> = base.into_iter().chain(plausible(&mut stream, kind)).collect();
            let trial = ramp_sampled(1.0 + 3.0 * stream.uniform(), period_s);
            let kinds = [kind];
            let window = (period_s, samples);
            let (error, steps) = error_with_mechanisms(lever, &kinds, &trial, &parameters, window, 128);
            // A slack has two corners, at which the torque's slope jumps.
            let allowed = if kind == MechanismKind::InterfaceSlack { 1e-3 } else { 2e-4 };
            assert!(
                error < allowed,
                "{error:e} N m of {} at {rate_hz} Hz, {parameters:?}, lever {lever:?}, {steps} steps",
                kind.id()
            );
        }
    }
}

#[test]
fn a_low_pass_of_any_cutoff_and_order_is_followed_at_every_rate_and_lever() {
    let stiff = Lever { inertia_kg_m2: 0.0008, damping_nm_s_per_rad: 0.5, stiffness_nm_per_rad: 2500.0 };
    let kinds = [MechanismKind::TorqueLag];
    let MechanismParameter { low, high, .. } = MechanismKind::TorqueLag.parameters()[0];
    const CUTOFFS: u32 = 16;
    for (rate_hz, lever) in [500.0, 1e3, 2.5e3, 5e3, 1e4]
        .into_iter()
        .flat_map(|rate_hz| [Some(LEVER), Some(stiff), None].map(move |lever| (rate_hz, lever)))
    {
        let (period_s, samples) = (1.0 / rate_hz, (0.040 * rate_hz) as usize);
        let trial = ramp_sampled(3.25, period_s);
        for (number, order) in (0..CUTOFFS).flat_map(|number| [(number, 1.0), (number, 1.02), (number, 2.0)])
        {
            let cutoff_hz = low * libm::pow(high / low, f64::from(number) / f64::from(CUTOFFS - 1));
            let parameters: Vec<f64> = PERSON.into_iter().chain([cutoff_hz, order]).collect();
            let window = (period_s, samples);
            let (error, steps) = error_with_mechanisms(lever, &kinds, &trial, &parameters, window, 256);
            let what = format!("{cutoff_hz} Hz of order {order} at {rate_hz} Hz, {steps} steps");
            assert!(error < 1e-4, "{error:e} N m, {what}");
            // The second order of the same delay is faster by the square root of three.
            assert!(steps as f64 * rate_hz < 1e5 * libm::sqrt(2.0 * order - 1.0), "{what}");
        }
    }
}

/// Before the yield nothing is approximated: many exact steps are as good as one.
#[test]
fn without_a_yield_one_exact_step_is_as_good_as_many() {
    let trial = ramp(2.6);
    let mut never_yields = PERSON;
    never_yields[5] = 5.0;
    let torque = |steps| by_exact_steps(Some(LEVER), &trial, &never_yields, (PERIOD_S, SAMPLES), steps);
    let error = largest_difference(&torque(2), &torque(64));
    assert!(error < 1e-11, "{error:e} N m");
}

#[test]
fn half_the_steps_make_sixteen_times_the_error() {
    let trial = ramp(2.6);
    let window = (PERIOD_S, SAMPLES);
    let exact = |steps| by_exact_steps(Some(LEVER), &trial, &PERSON, window, steps);
    let runge_kutta = |steps| by_runge_kutta(Some(LEVER), &trial, &PERSON, window, steps);
    let reference = runge_kutta(256);
    let ratio = |coarse: Vec<f64>, fine: Vec<f64>| {
        largest_difference(&coarse, &reference) / largest_difference(&fine, &reference)
    };
    let of_runge_kutta = ratio(runge_kutta(2), runge_kutta(4));
    assert!((10.0..25.0).contains(&of_runge_kutta), "Runge-Kutta is of fourth order: {of_runge_kutta}");
    let of_exact = ratio(exact(1), exact(2));
    assert!((10.0..80.0).contains(&of_exact), "a cubic yield is at least of fourth order: {of_exact}");
}

/// By its equation, with differences of the filtered torque for its rates.
#[test]
fn a_low_pass_of_second_order_is_a_bessel_filter_of_the_same_delay() {
    const CUTOFF_HZ: f64 = 40.0;
    let (period_s, lag_s) = (2.5e-4, 1.0 / (std::f64::consts::TAU * CUTOFF_HZ));
    let trial = ramp_sampled(2.6, period_s);
    let torque = |kinds: &[MechanismKind], own: &[f64]| {
        let parameters: Vec<f64> = PERSON.iter().chain(own).copied().collect();
        let of = settings(kinds, &[], &[]);
        let settings =
            SimulationSettings { lever: None, substeps: 16, period_s, samples: 160, lead_samples: 0, ..of };
        run(&settings, &trial, &parameters).torque_nm
    };
    let passed = torque(&[], &[]);
    let highest = passed.iter().fold(0.0, |most: f64, own| most.max(own.abs()));
    for (order, squared_quality) in [(1.0, 0.0), (2.0, 1.0 / 3.0)] {
        let filtered = torque(&[MechanismKind::TorqueLag], &[CUTOFF_HZ, order]);
        for at in 8..filtered.len() - 1 {
            let rate = (filtered[at + 1] - filtered[at - 1]) / (2.0 * period_s);
            let curvature =
                (filtered[at + 1] - 2.0 * filtered[at] + filtered[at - 1]) / (period_s * period_s);
            let left = passed[at] - filtered[at] - lag_s * rate - squared_quality * lag_s * lag_s * curvature;
            assert!(left.abs() < 0.02 * highest, "order {order}, sample {at}: {left} of {highest} N m");
        }
    }
}
