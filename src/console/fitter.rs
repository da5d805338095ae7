//! Thread that fits each trial when it ends, so that the operator sees at once whether it is usable.
//!
//! A trial is fitted together with those before it, as the session is in the end; the first few are fitted alone.

use std::collections::VecDeque;
use std::sync::mpsc;
use std::thread;

use super::thread_priority::lower_thread_priority;
use crate::dataset::{Session, Status, Subject, Trial};
use crate::fit::{
    Fit, Model, Observations, PreprocessingSettings, SessionFit, TrialEstimate, Weighting,
    estimates_without_profiles, predictions, session_estimates,
};
use crate::signal::FilterSpec;
use crate::wrist::Lever;

/// What the fit of a trial needs beside the trial.
#[derive(Debug, Clone)]
pub struct TrialFitContext {
    /// Identifier of the subject.
    pub subject: String,
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// The lever of the rig.
    pub lever: Option<Lever>,
    /// The filter that both channels passed before they were recorded.
    pub recorded_filter: Option<FilterSpec>,
    /// Window and filter of the analysis.
    pub preprocessing: PreprocessingSettings,
}

/// A trial and its fit.
#[derive(Debug)]
pub struct TrialFit {
    /// Estimated parameters and their standard errors.
    pub estimate: TrialEstimate,
    /// Filtered torque in the window, minus its level before the ramp, N m.
    pub measured_nm: Vec<f64>,
    /// Torque predicted by the model, N m.
    pub predicted_nm: Vec<f64>,
    /// The fit of all trials that it was fitted together with; `None` if it was fitted alone.
    pub session: Option<SessionSoFar>,
}

/// The fit of several trials together.
#[derive(Debug)]
pub struct SessionSoFar {
    estimates: Vec<TrialEstimate>,
    session: SessionFit,
}

impl SessionSoFar {
    /// The estimate of a trial, if it is one of those.
    pub fn estimate(&self, trial: u32) -> Option<&TrialEstimate> {
        self.estimates.iter().find(|estimate| estimate.trial == trial)
    }

    /// Covariance of the logarithms of a base parameter in two trials; `None` if one of them is not one of those.
    pub fn log_covariance(&self, parameter: usize, one: u32, other: u32) -> Option<f64> {
        let place = |trial| self.estimates.iter().position(|estimate| estimate.trial == trial);
        self.session.log_covariance(parameter, place(one)?, place(other)?)
    }
}

/// The model of a session has three coefficients for each parameter: before there are more trials, it says nothing.
const LEAST_TRIALS: usize = 4;

/// Most trials that are fitted together, the latest: a fit must be done before the next trial is over.
const MOST_TRIALS: usize = 48;

/// Number of a trial, and its fit or the reason why there is none.
pub type TrialFitOutcome = (u32, Result<Box<TrialFit>, String>);

/// Work for the fitting thread.
#[derive(Debug)]
enum FitterJob {
    Fit(Box<Trial>),
    /// The trial does not count any more, and is no part of later fits.
    Forget(u32),
}

/// The fitting thread and its channels.
#[derive(Debug)]
pub struct Fitter {
    window_s: f64,
    jobs: mpsc::Sender<FitterJob>,
    outcomes: mpsc::Receiver<TrialFitOutcome>,
}

impl Fitter {
    /// Starts the thread; it ends when this is dropped.
    pub fn start(context: TrialFitContext) -> Self {
        let window_s = context.preprocessing.window_s;
        let (jobs, todo) = mpsc::channel::<FitterJob>();
        let (done, outcomes) = mpsc::channel();
        thread::spawn(move || {
            lower_thread_priority();
            let mut trials = VecDeque::<Trial>::new();
            for job in todo {
                let trial = match job {
                    FitterJob::Fit(trial) => *trial,
                    FitterJob::Forget(number) => {
                        trials.retain(|trial| trial.number != number);
                        continue;
                    }
                };
                let number = trial.number;
                trials.push_back(trial);
                if trials.len() > MOST_TRIALS {
                    trials.pop_front();
                }
                let fitted = fit(&context, trials.make_contiguous());
                if fitted.is_err() {
                    trials.pop_back();
                }
                let outcome = (number, fitted);
                if done.send(outcome).is_err() {
                    return;
                }
            }
        });
        Self { window_s, jobs, outcomes }
    }

    /// The analysed window after the onset, s.
    pub fn window_s(&self) -> f64 {
        self.window_s
    }

    /// Queues a trial for the fit, if its status is ok. Returns whether there will be an outcome.
    pub fn fit(&self, trial: Trial) -> bool {
        trial.status == Status::Ok && self.jobs.send(FitterJob::Fit(Box::new(trial))).is_ok()
    }

    /// Leaves a trial out of later fits: it does not count any more.
    pub fn forget(&self, number: u32) {
        // The thread ends when this is dropped, and not before.
        let _ = self.jobs.send(FitterJob::Forget(number));
    }

    /// The next finished fit, if there is one.
    pub fn outcome(&self) -> Option<TrialFitOutcome> {
        self.outcomes.try_recv().ok()
    }
}

/// Fits the last of `trials` with what the others have shown.
fn fit(context: &TrialFitContext, trials: &[Trial]) -> Result<Box<TrialFit>, String> {
    let Some(last) = trials.last() else { return Err("there is no trial".into()) };
    let observe = |trials: &[Trial]| {
        let session = Session {
            subject: Subject { id: context.subject.clone() },
            sample_rate_hz: context.sample_rate_hz,
            lever: context.lever,
            recorded_filter: context.recorded_filter,
            channel_ranges: Default::default(),
            trials: trials.to_vec(),
        };
        Observations::new(&session, context.preprocessing).map_err(|error| error.to_string())
    };
    let used = if trials.len() < LEAST_TRIALS { std::slice::from_ref(last) } else { trials };
    let observations = observe(used)?;
    let independent = Fit::new(&observations, &Model::paper(), Weighting::default());
    let session =
        if used.len() > 1 { SessionFit::while_running(&observations, &independent).ok() } else { None };
    let estimates = match &session {
        Some(session) => session_estimates(&observations, session).0,
        None => estimates_without_profiles(&observations, &independent),
    };
    let place = estimates.iter().position(|estimate| estimate.trial == last.number);
    let place = place.ok_or("the trial could not be prepared")?;
    let mut estimate = estimates[place].clone();
    estimate.remarks.push(match session {
        Some(_) => format!("fitted together with the {} trials before it", estimates.len() - 1),
        None => "fitted alone: the session has shown too little yet".into(),
    });
    let fit = session.as_ref().map_or(&independent, |session| &session.fit);
    let measured_nm = observations.torque_of(&observations.trials[place].measured_nm).to_vec();
    let residual_nm = &predictions(&observations, fit)[place].residual_nm;
    let predicted_nm = measured_nm.iter().zip(residual_nm).map(|(measured, left)| measured - left).collect();
    let session = session.map(|session| SessionSoFar { estimates, session });
    Ok(Box::new(TrialFit { estimate, measured_nm, predicted_nm, session }))
}
