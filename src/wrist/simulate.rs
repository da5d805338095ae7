//! Whole trials through the model, several at once, with derivatives.

use super::group::{self, Job, MOST_SLOPES};
use super::mechanisms::{Covariates, Kind};
use super::number::Plain;
use super::plant::{BASE_PARAMETERS, Knot, Lever};
use crate::signal::Section;

/// What the model needs to know of a trial.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The recorded motor angle as a change from the hold, with speeds, at every sample from well before the onset.
    pub motion: Vec<Knot<f64>>,
    /// Index of the onset in `motion`.
    pub onset: usize,
    /// What else is known of it.
    pub covariates: Covariates,
}

/// Trials to simulate alike.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The lever; `None` for a rigid one.
    pub lever: Option<Lever>,
    /// Mechanisms switched on.
    pub kinds: &'a [Kind],
    /// Time between samples, s.
    pub period_s: f64,
    /// How many samples from the onset on are wanted.
    pub samples: usize,
    /// How many samples before the onset the simulation starts.
    pub lead: usize,
    /// How many samples, the onset's the last, make the level that is taken off the prediction; none if zero.
    pub level: usize,
    /// Runge-Kutta steps a sample.
    pub substeps: usize,
    /// The filter that the predicted torque goes through.
    pub filter: &'a [Section],
    /// Which parameters derivatives are wanted for.
    pub wanted: &'a [usize],
    /// Which vector instructions to use.
    pub width: Width,
}

impl Request<'_> {
    /// Length of a trial's parameter vector: the base parameters, then those of the mechanisms.
    pub fn parameter_count(&self) -> usize {
        BASE_PARAMETERS.len() + self.kinds.iter().map(|kind| kind.parameter_count()).sum::<usize>()
    }
}

/// How many trials go through the model at once. The results have the same bits whichever it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Width {
    /// One at a time, on any processor.
    One,
    /// Four at a time (AVX2).
    #[cfg(target_arch = "x86_64")]
    Four,
    /// Eight at a time (AVX-512).
    #[cfg(target_arch = "x86_64")]
    Eight,
}

impl Width {
    /// The widths that this processor can do, the fastest first.
    pub fn available() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        {
            let mut widths = Vec::new();
            if has_avx_512() {
                widths.push(Self::Eight);
            }
            if is_x86_feature_detected!("avx2") {
                widths.push(Self::Four);
            }
            widths.push(Self::One);
            widths
        }
        #[cfg(not(target_arch = "x86_64"))]
        vec![Self::One]
    }

    /// The fastest that this processor can do.
    pub fn fastest() -> Self {
        static FASTEST: std::sync::OnceLock<Width> = std::sync::OnceLock::new();
        *FASTEST.get_or_init(|| Self::available()[0])
    }
}

/// Predicted torques and their derivatives.
#[derive(Debug, Clone, Default)]
pub struct Response {
    /// Measured torque as predicted, N m: trial by trial, sample by sample from the onset on.
    pub torque_nm: Vec<f64>,
    /// Its derivatives: trial by trial, sample by sample, in the order of [`Request::wanted`].
    pub slopes: Vec<f64>,
}

/// Simulates `trials`; `parameters` holds a vector of [`Request::parameter_count`] for each, one after the other.
///
/// # Panics
/// If `parameters` has another length, or a trial's motion does not reach `samples` beyond its onset. Before the first of its
/// knots the motor stands still.
pub fn simulate(request: &Request, trials: &[&Trial], parameters: &[f64], response: &mut Response) {
    let count = request.parameter_count();
    assert_eq!(parameters.len(), count * trials.len(), "one parameter vector a trial");
    for trial in trials {
        assert!(trial.motion.len() >= trial.onset + request.samples, "motion too short");
    }
    response.torque_nm.clear();
    response.torque_nm.resize(trials.len() * request.samples, 0.0);
    response.slopes.clear();
    response.slopes.resize(trials.len() * request.samples * request.wanted.len(), 0.0);
    let count = trials.len();
    let given = Trials { request, trials, parameters };
    match request.width {
        Width::One => given.each_group::<f64>(0..count, response, group_of_one),
        #[cfg(target_arch = "x86_64")]
        Width::Four => {
            assert!(is_x86_feature_detected!("avx2"), "this processor has no AVX2");
            given.each_group::<super::vector::Four>(0..count, response, |job, response| {
                // SAFETY: the processor has AVX2, as asserted above.
                unsafe { group_of_four(job, response) }
            });
        }
        #[cfg(target_arch = "x86_64")]
        Width::Eight => {
            assert!(has_avx_512(), "this processor has no AVX-512");
            // What is left over and fills no more than half a vector goes through one of half the width.
            let rest = count % 8;
            let whole = if rest <= 4 { count - rest } else { count };
            given.each_group::<super::vector::Eight>(0..whole, response, |job, response| {
                // SAFETY: the processor has AVX-512, as asserted above.
                unsafe { group_of_eight(job, response) }
            });
            given.each_group::<super::vector::Four>(whole..count, response, |job, response| {
                // SAFETY: the processor has AVX-512, as asserted above.
                unsafe { half_a_group_of_eight(job, response) }
            });
        }
    }
}

/// Whether the processor has all that the widest vectors are compiled for.
#[cfg(target_arch = "x86_64")]
fn has_avx_512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bw")
}

/// What is to be simulated.
struct Trials<'a> {
    request: &'a Request<'a>,
    trials: &'a [&'a Trial],
    parameters: &'a [f64],
}

impl Trials<'_> {
    /// Runs the trials in `range` in groups of as many as `P` has lanes.
    fn each_group<P: Plain>(
        &self,
        range: std::ops::Range<usize>,
        response: &mut Response,
        run: impl Fn(&Job, &mut Response),
    ) {
        let Self { request, trials, parameters } = self;
        let count = request.parameter_count();
        for first in range.clone().step_by(P::LANES) {
            let last = (first + P::LANES).min(range.end);
            let mut begin = 0;
            loop {
                let end = (begin + MOST_SLOPES).min(request.wanted.len());
                let job = Job {
                    request,
                    trials: &trials[first..last],
                    parameters: &parameters[first * count..last * count],
                    first,
                    wanted: begin..end,
                };
                run(&job, response);
                begin = end;
                if begin == request.wanted.len() {
                    break;
                }
            }
        }
    }
}

fn group_of_one(job: &Job, response: &mut Response) {
    group::run::<f64>(job, response);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn group_of_four(job: &Job, response: &mut Response) {
    group::run::<super::vector::Four>(job, response);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw")]
fn group_of_eight(job: &Job, response: &mut Response) {
    group::run::<super::vector::Eight>(job, response);
}

/// Four trials with the registers of the widest vectors.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw")]
fn half_a_group_of_eight(job: &Job, response: &mut Response) {
    group::run::<super::vector::Four>(job, response);
}
