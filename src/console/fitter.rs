//! Thread that fits each trial when it ends, so that the operator sees at once whether it is usable.
//!
//! Each trial is fitted alone; the fit of the whole session starts from such values and ends at others.

use std::sync::mpsc;
use std::thread;

use super::thread_priority::lower_thread_priority;
use crate::dataset::{Session, Status, Subject, Trial};
use crate::fit::{
    Fit, Model, Observations, PreprocessingSettings, TrialEstimate, Weighting, estimates_without_profiles,
    predictions,
};
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
    /// Window and filter of the analysis.
    pub preprocessing: PreprocessingSettings,
}

/// A trial and its fit.
#[derive(Debug, Clone)]
pub struct TrialFit {
    /// Estimated parameters and their standard errors.
    pub estimate: TrialEstimate,
    /// Filtered torque in the window, minus its level before the ramp, N m.
    pub measured_nm: Vec<f64>,
    /// Torque predicted by the model, N m.
    pub predicted_nm: Vec<f64>,
}

/// Number of a trial, and its fit or the reason why there is none.
pub type TrialFitOutcome = (u32, Result<Box<TrialFit>, String>);

/// The fitting thread and its channels.
#[derive(Debug)]
pub struct Fitter {
    jobs: mpsc::Sender<Trial>,
    outcomes: mpsc::Receiver<TrialFitOutcome>,
}

impl Fitter {
    /// Starts the thread; it ends when this is dropped.
    pub fn start(context: TrialFitContext) -> Self {
        let (jobs, todo) = mpsc::channel::<Trial>();
        let (done, outcomes) = mpsc::channel();
        thread::spawn(move || {
            lower_thread_priority();
            for trial in todo {
                let outcome = (trial.number, fit(&context, trial));
                if done.send(outcome).is_err() {
                    return;
                }
            }
        });
        Self { jobs, outcomes }
    }

    /// Queues a trial for the fit, if its status is ok.
    pub fn fit(&self, trial: Trial) {
        if trial.status == Status::Ok {
            // The thread ends only after the sender is dropped.
            let _ = self.jobs.send(trial);
        }
    }

    /// The next finished fit, if there is one.
    pub fn outcome(&self) -> Option<TrialFitOutcome> {
        self.outcomes.try_recv().ok()
    }
}

fn fit(context: &TrialFitContext, trial: Trial) -> Result<Box<TrialFit>, String> {
    let session = Session {
        subject: Subject { id: context.subject.clone() },
        sample_rate_hz: context.sample_rate_hz,
        lever: context.lever,
        recorded_filter: None,
        trials: vec![trial],
    };
    let prepared = Observations::new(&session, context.preprocessing).map_err(|error| error.to_string())?;
    let fit = Fit::new(&prepared, &Model::paper(), Weighting::default());
    let estimate =
        estimates_without_profiles(&prepared, &fit).pop().ok_or("the trial could not be prepared")?;
    let measured_nm = prepared.trials[0].measured_nm.clone();
    let residual_nm = &predictions(&prepared, &fit)[0].residual_nm;
    let predicted_nm = measured_nm.iter().zip(residual_nm).map(|(measured, left)| measured - left).collect();
    Ok(Box::new(TrialFit { estimate, measured_nm, predicted_nm }))
}
