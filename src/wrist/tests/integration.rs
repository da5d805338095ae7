//! The integrator against itself with very small steps.

use super::*;
use crate::wrist::substeps;

/// Greatest difference of the unfiltered torque from that with 256 steps a sample, N m.
fn error_nm(lever: Option<Lever>, trial: &TrialInput, parameters: &[f64; 6]) -> f64 {
    let torque = |substeps| {
        run(&SimulationSettings { lever, substeps, ..settings(&[], &[], &[]) }, trial, parameters).torque_nm
    };
    let own = torque(substeps(lever, parameters, PERIOD_S));
    own.iter().zip(torque(256)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Log-uniform over everything that parameters.md calls plausible, and twice that on either side.
fn draw(stream: &mut Stream) -> [f64; 6] {
    let ranges = [(1e-3, 1e-2), (0.15, 6.0), (50.0, 1000.0), (7.5, 46.0), (4.5, 40.0), (0.0125, 0.13)];
    ranges.map(|(low, high)| low * libm::exp(stream.uniform() * libm::log(high / low)))
}

#[test]
fn the_integration_error_stays_below_ten_micronewtonmetres() {
    let mut stream = Stream::new(1, "integration");
    let mut worst: f64 = 0.0;
    for _ in 0..150 {
        let parameters = draw(&mut stream);
        let trial = ramp(1.0 + 3.0 * stream.uniform());
        for lever in [Some(LEVER), None] {
            let error = error_nm(lever, &trial, &parameters);
            assert!(error < 1e-5, "{error:e} N m at {parameters:?}, lever {lever:?}");
            worst = worst.max(error);
        }
    }
    println!("largest integration error {worst:e} N m");
}

#[test]
fn half_the_steps_make_sixteen_times_the_error() {
    let trial = ramp(2.6);
    let torque = |substeps| {
        run(&SimulationSettings { substeps, ..settings(&[], &[], &[]) }, &trial, &PERSON).torque_nm
    };
    let reference = torque(256);
    let error = |substeps| {
        let own = torque(substeps);
        own.iter().zip(&reference).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let ratio = error(2) / error(4);
    assert!((10.0..25.0).contains(&ratio), "the scheme is of fourth order: {ratio}");
}
