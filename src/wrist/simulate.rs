//! Simulation of whole trials, several at once, with derivatives.

use super::batch::Batch;
use super::compiled;
use super::passes::{self, passes};
use super::simulation::{SimulatedTorque, SimulationSettings, TrialInput, VectorWidth};
#[cfg(target_arch = "x86_64")]
use super::simulation::{has_avx_2, has_avx_512};
use crate::number::Plain;

/// Simulates `trials`; `parameters` holds a vector of [`SimulationSettings::parameter_count`] for each, one after the other.
///
/// # Panics
/// If `parameters` has another length, or a trial's motion does not reach `samples` beyond its onset. Before the first
/// recorded sample the motor stands still.
pub fn simulate(
    settings: &SimulationSettings,
    trials: &[&TrialInput],
    parameters: &[f64],
    response: &mut SimulatedTorque,
) {
    let given = Trials::new(settings, trials, parameters, response);
    let count = trials.len();
    match settings.width {
        #[cfg(target_arch = "x86_64")]
        VectorWidth::One if is_x86_feature_detected!("fma") => {
            given.each_group::<f64>(0..count, response, |batch, response| {
                // SAFETY: the processor has FMA, as asked just now.
                unsafe { compiled::one_fused::simulate(batch, response) }
            });
        }
        VectorWidth::One => given.each_group::<f64>(0..count, response, compiled::one::simulate),
        #[cfg(target_arch = "x86_64")]
        VectorWidth::Four => {
            assert!(has_avx_2(), "this processor has no AVX2 or no FMA");
            given.each_group::<crate::number::Four>(0..count, response, |batch, response| {
                // SAFETY: the processor has AVX2 and FMA, as asserted above.
                unsafe { compiled::four::simulate(batch, response) }
            });
        }
        #[cfg(target_arch = "x86_64")]
        VectorWidth::Eight => {
            assert!(has_avx_512(), "this processor has no AVX-512");
            // The last trials, if they fill at most half a vector, are simulated in a vector of half the width.
            let rest = count % 8;
            let whole = if rest <= 4 { count - rest } else { count };
            given.each_group::<crate::number::Eight>(0..whole, response, |batch, response| {
                // SAFETY: the processor has AVX-512, as asserted above.
                unsafe { compiled::eight::simulate(batch, response) }
            });
            given.each_group::<crate::number::Four>(whole..count, response, |batch, response| {
                // SAFETY: it has AVX2 and FMA, too, as asserted above.
                unsafe { compiled::four::simulate(batch, response) }
            });
        }
    }
}

/// As [`simulate`], over a type of number of the caller's.
///
/// # Panics
/// As [`simulate`].
pub fn simulate_over<P: Plain>(
    settings: &SimulationSettings,
    trials: &[&TrialInput],
    parameters: &[f64],
    response: &mut SimulatedTorque,
) {
    let given = Trials::new(settings, trials, parameters, response);
    given.each_group::<P>(0..trials.len(), response, |batch, response| passes::run::<P>(batch, response));
}

/// What is to be simulated.
struct Trials<'a> {
    settings: &'a SimulationSettings<'a>,
    trials: &'a [&'a TrialInput],
    parameters: &'a [f64],
}

impl<'a> Trials<'a> {
    /// Checks what is to be simulated, and makes room for it in `response`.
    fn new(
        settings: &'a SimulationSettings<'a>,
        trials: &'a [&'a TrialInput],
        parameters: &'a [f64],
        response: &mut SimulatedTorque,
    ) -> Self {
        let count = settings.parameter_count();
        assert_eq!(parameters.len(), count * trials.len(), "one parameter vector per trial");
        for trial in trials {
            assert!(trial.motion.len() >= trial.onset + settings.samples, "motion too short");
        }
        response.torque_nm.clear();
        response.torque_nm.resize(trials.len() * settings.rows(), 0.0);
        response.slopes.clear();
        response.slopes.resize(trials.len() * settings.rows() * settings.derivatives.len(), 0.0);
        Self { settings, trials, parameters }
    }

    /// Runs the trials in `range` in groups of as many as `P` has lanes.
    fn each_group<P: Plain>(
        &self,
        range: std::ops::Range<usize>,
        response: &mut SimulatedTorque,
        run: impl Fn(&Batch, &mut SimulatedTorque),
    ) {
        let Self { settings, trials, parameters } = self;
        let count = settings.parameter_count();
        let passes = passes(settings);
        for first in range.clone().step_by(P::LANES) {
            let last = (first + P::LANES).min(range.end);
            for wanted in &passes {
                let batch = Batch {
                    settings,
                    trials: &trials[first..last],
                    parameters: &parameters[first * count..last * count],
                    first,
                    wanted: wanted.clone(),
                };
                run(&batch, response);
            }
        }
    }
}
