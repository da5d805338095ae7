//! Motions between the steps of an encoder, against the true ones.

use nalgebra::{DMatrix, DVector};

use super::load_response::LoadResponse;
use super::motion_prior::{AnswersToLoad, KnownMotions, RecordsInSteps, most_probable};
use crate::fit::data::input_averaging::AlikeTrials;
use crate::random::Stream;
use crate::signal::{Section, filter};
use crate::wrist::through;

const PERIOD_S: f64 = 0.001;
const ONSET: usize = 20;
const SAMPLES: usize = 80;
const TRIALS: usize = 9;
/// 14 bits.
const STEP_RAD: f64 = std::f64::consts::TAU / 16384.0;

/// Angle of a ramp whose speed rises in 12 ms as half a cosine, which the load holds back by `lag` of its angle.
fn angle(sample: usize, speed_rad_s: f64, lag: f64) -> f64 {
    let t = (sample as f64 - ONSET as f64) * PERIOD_S;
    let rise_s = 0.012;
    let risen = t.clamp(0.0, rise_s);
    let pi = std::f64::consts::PI;
    let rising = 0.5 * (risen - rise_s / pi * libm::sin(pi * risen / rise_s));
    speed_rad_s * (1.0 - lag) * (rising + (t - rise_s).max(0.0))
}

struct Ramps {
    truth: Vec<Vec<f64>>,
    recorded: Vec<Vec<f64>>,
    loads: Vec<Vec<f64>>,
}

/// Nine trials that rest at other places within a step and are held back by other loads.
fn ramps(seed: u64, speed_rad_s: f64) -> Ramps {
    let mut stream = Stream::new(seed, "motion in steps");
    let truth: Vec<Vec<f64>> = (0..TRIALS)
        .map(|trial| {
            let lag = 0.0005 * (trial % 3) as f64;
            let rest = STEP_RAD * stream.uniform();
            (0..SAMPLES).map(|sample| rest + angle(sample, speed_rad_s, lag)).collect()
        })
        .collect();
    let loads = vec![vec![0.0; SAMPLES]; TRIALS];
    Ramps { recorded: in_steps(&truth), truth, loads }
}

fn in_steps(truth: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let recorded =
        |own: &Vec<f64>| own.iter().map(|angle| STEP_RAD * libm::round(angle / STEP_RAD)).collect();
    truth.iter().map(recorded).collect()
}

/// Noise of the torque, N m.
const NOISE_NM: f64 = 0.01;

/// Trials of three torques, each a little stiffer or softer than its condition, whose servo of 90 Hz gives way by 1 mrad for each N m.
fn loaded_ramps(seed: u64, speed_rad_s: f64) -> Ramps {
    let mut stream = Stream::new(seed, "load in steps");
    let servo = [Section::first_order_low_pass(90.0, PERIOD_S)];
    let (mut truth, mut loads) = (Vec::new(), Vec::new());
    for trial in 0..TRIALS {
        let stiffness = (10.0 + 4.0 * (trial % 3) as f64) * (1.0 + 0.03 * stream.normal());
        let load: Vec<f64> = (0..SAMPLES).map(|sample| stiffness * angle(sample, speed_rad_s, 0.0)).collect();
        let rest = STEP_RAD * stream.uniform();
        let gives_way = filter(&servo, &load);
        truth.push(
            (0..SAMPLES)
                .map(|sample| rest + angle(sample, speed_rad_s, 0.0) - 1e-3 * gives_way[sample])
                .collect(),
        );
        loads.push(load.iter().map(|nm| nm + NOISE_NM * stream.normal()).collect());
    }
    Ramps { recorded: in_steps(&truth), truth, loads }
}

fn group(ramps: &Ramps) -> AlikeTrials {
    let mean_at = |sample: usize| ramps.recorded.iter().map(|own| own[sample]).sum::<f64>() / TRIALS as f64;
    AlikeTrials {
        trials: (0..TRIALS).collect(),
        conditions: (0..TRIALS).map(|trial| trial % 3).collect(),
        onset: ONSET,
        angles: ramps.recorded.clone(),
        loads: ramps.loads.clone(),
        mean: (0..SAMPLES).map(mean_at).collect(),
    }
}

fn without_answers() -> AnswersToLoad {
    AnswersToLoad { motions: vec![vec![0.0; SAMPLES]; TRIALS], errors: DMatrix::zeros(SAMPLES, SAMPLES) }
}

fn known(ramps: &Ramps, by_load: &AnswersToLoad, speed_rad_s: f64) -> KnownMotions {
    let records = RecordsInSteps::new(&group(ramps), by_load, STEP_RAD, PERIOD_S, speed_rad_s);
    most_probable(&[records.unwrap()]).unwrap().pop().unwrap()
}

/// The true motion of a trial from rest, in steps, from the first sample that is looked at.
fn from_rest(truth: &[f64]) -> DVector<f64> {
    let first = ONSET - RecordsInSteps::BEFORE_ONSET;
    DVector::from_iterator(SAMPLES - first, truth[first..].iter().map(|own| (own - truth[first]) / STEP_RAD))
}

fn root_mean_square<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    let squares: Vec<f64> = values.map(|own| own * own).collect();
    libm::sqrt(squares.iter().sum::<f64>() / squares.len() as f64)
}

#[test]
fn a_motion_between_steps_is_nearer_the_true_one_than_its_record_is() {
    for (seed, speed_rad_s) in [(1, 1.3), (2, 2.0), (3, 2.7)] {
        let ramps = ramps(seed, speed_rad_s);
        let known = known(&ramps, &without_answers(), speed_rad_s);
        let (mut of_known, mut of_record) = (Vec::new(), Vec::new());
        for (trial, truth) in ramps.truth.iter().enumerate() {
            of_known.extend((&known.motions[trial] - from_rest(truth)).iter().copied());
            of_record.extend((from_rest(&ramps.recorded[trial]) - from_rest(truth)).iter().copied());
        }
        let ratio = root_mean_square(of_known.iter()) / root_mean_square(of_record.iter());
        assert!(ratio < 0.5, "{speed_rad_s} rad/s: {ratio}");
    }
}

/// The square of `error` in units of `covariance`, by its number of values. Directions in which the covariance is smaller than a thousandth
/// of a step have that.
fn square_per_value(error: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let count = error.len();
    let regular = covariance + DMatrix::identity(count, count) * 1e-6;
    error.dot(&regular.cholesky().unwrap().solve(error)) / count as f64
}

#[test]
fn motions_between_steps_are_as_wrong_as_their_covariances_say() {
    let mut squares = Vec::new();
    for seed in 11..23 {
        let speed_rad_s = 1.2 + 0.17 * (seed - 11) as f64;
        let ramps = ramps(seed, speed_rad_s);
        let known = known(&ramps, &without_answers(), speed_rad_s);
        let errors: Vec<DVector<f64>> =
            (0..TRIALS).map(|trial| &known.motions[trial] - from_rest(&ramps.truth[trial])).collect();
        let mean = errors.iter().fold(DVector::zeros(errors[0].len()), |sum, own| sum + own) / TRIALS as f64;
        let of_mean = known.of_mean.iter().fold(DMatrix::zeros(mean.len(), mean.len()), |sum, own| sum + own)
            / TRIALS as f64;
        let covariance = &of_mean * &known.mean_covariance * of_mean.transpose() + &known.own / TRIALS as f64;
        squares.push(square_per_value(&mean, &covariance));
        let own = errors.iter().map(|own| square_per_value(&(own - &mean), &known.own)).sum::<f64>();
        squares.push(own / TRIALS as f64);
    }
    // White rounding errors have the right size in the mean over speeds, and squares of ten and more at a single one.
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((0.2..1.3).contains(&mean), "mean {mean}: {squares:?}");
    assert!(squares.iter().all(|own| *own < 4.0), "{squares:?}");
}

/// What each of `motions` has beside the mean of all.
fn beside_the_mean(motions: Vec<DVector<f64>>) -> Vec<DVector<f64>> {
    let mean = motions.iter().fold(DVector::zeros(motions[0].len()), |sum, own| sum + own) / TRIALS as f64;
    motions.into_iter().map(|own| own - &mean).collect()
}

#[test]
fn what_the_load_does_to_a_motor_is_as_wrong_as_its_covariance_says() {
    let speeds = [1.3, 2.0, 2.7];
    let ramps = [31, 32, 33].map(|seed| loaded_ramps(seed, speeds[seed as usize - 31]));
    let groups = ramps.each_ref().map(group);
    let response = LoadResponse::of(&groups, STEP_RAD, PERIOD_S);
    let places: Vec<usize> = (ONSET..SAMPLES).collect();
    let unsteadiness = DMatrix::identity(places.len(), places.len()) * (NOISE_NM * NOISE_NM);
    for ((ramps, group), speed_rad_s) in ramps.iter().zip(&groups).zip(speeds) {
        let by_load = AnswersToLoad {
            motions: response.motions(group),
            errors: response.errors(group, &unsteadiness, &places),
        };
        let truth: Vec<DVector<f64>> = ramps.truth.iter().map(|own| from_rest(own)).collect();
        let answers: Vec<DVector<f64>> = by_load.motions.iter().map(|own| from_rest(own)).collect();
        let known = known(ramps, &by_load, speed_rad_s);
        let errors = (0..TRIALS).map(|trial| &known.motions[trial] + &answers[trial] - &truth[trial]);
        let errors = beside_the_mean(errors.collect());
        let size = |signals: &[DVector<f64>]| root_mean_square(signals.iter().flatten());
        let part = size(&errors) / size(&beside_the_mean(truth));
        assert!(part < 0.3, "{speed_rad_s} rad/s: {part} of what is a trial's own");
        let squares = errors.iter().map(|own| square_per_value(own, &known.own)).sum::<f64>() / TRIALS as f64;
        assert!(squares < 2.0, "{speed_rad_s} rad/s: {squares}");
    }
}

#[test]
fn loads_that_do_not_differ_turn_no_motor() {
    let ramps = ramps(41, 2.0);
    let response = LoadResponse::of(&[group(&ramps)], STEP_RAD, PERIOD_S);
    assert!(response.motions(&group(&ramps)).iter().flatten().all(|angle| *angle == 0.0));
}

#[test]
fn a_spline_through_a_cubic_has_its_slopes() {
    let cubic = |t: f64| 3.0 * t * t - 2.0 * t * t * t;
    let angles: Vec<f64> = (0..=100).map(|sample| cubic(f64::from(sample) / 200.0)).collect();
    // At rest where it begins, without acceleration where it ends: at half its way.
    for (sample, knot) in through(&angles, 1.0 / 200.0).iter().enumerate() {
        let t = sample as f64 / 200.0;
        assert!((knot.omega - (6.0 * t - 6.0 * t * t)).abs() < 1e-9, "{sample}: {knot:?}");
    }
}
