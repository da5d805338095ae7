//! A thread that fits each trial as it ends, so that the operator sees at once whether it can be used.
//!
//! A trial is fitted alone: its parameters are what the fit of the whole session starts from, not what it ends at.

use std::sync::mpsc;
use std::thread;

use super::nice;
use crate::dataset::{Session, Status, Subject, Trial};
use crate::fit::{
    Fit, Model, Observations, PreprocessingSettings, TrialEstimate, Weighting, estimates_without_profiles,
    predictions,
};
use crate::wrist::Lever;

/// What it takes to fit a trial, beside the trial.
#[derive(Debug, Clone)]
pub struct TrialFitContext {
    /// Who is measured.
    pub subject: String,
    /// Samples a second.
    pub sample_rate_hz: f64,
    /// The lever of the rig.
    pub lever: Option<Lever>,
    /// How the analysis looks at a record.
    pub view: PreprocessingSettings,
}

/// A trial and its fit.
#[derive(Debug, Clone)]
pub struct TrialFit {
    /// What was estimated.
    pub estimate: TrialEstimate,
    /// The filtered torque of the window less the level before the ramp, N m.
    pub measured_nm: Vec<f64>,
    /// The model's, N m.
    pub predicted_nm: Vec<f64>,
}

/// What became of a trial's fit: its number, and the fit or why there is none.
pub type TrialFitOutcome = (u32, Result<Box<TrialFit>, String>);

/// The thread and what goes to and fro.
#[derive(Debug)]
pub struct Fitter {
    jobs: mpsc::Sender<Trial>,
    outcomes: mpsc::Receiver<TrialFitOutcome>,
}

impl Fitter {
    /// Starts the thread; it ends when this is dropped.
    pub fn start(circumstances: TrialFitContext) -> Self {
        let (jobs, todo) = mpsc::channel::<Trial>();
        let (done, outcomes) = mpsc::channel();
        thread::spawn(move || {
            nice();
            for trial in todo {
                let outcome = (trial.number, fit(&circumstances, trial));
                if done.send(outcome).is_err() {
                    return;
                }
            }
        });
        Self { jobs, outcomes }
    }

    /// Has a trial fitted, if it can be used.
    pub fn fit(&self, trial: Trial) {
        if trial.status == Status::Ok {
            // The thread ends only when this does.
            let _ = self.jobs.send(trial);
        }
    }

    /// The next trial that is done, if any is.
    pub fn outcome(&self) -> Option<TrialFitOutcome> {
        self.outcomes.try_recv().ok()
    }
}

fn fit(circumstances: &TrialFitContext, trial: Trial) -> Result<Box<TrialFit>, String> {
    let session = Session {
        subject: Subject { id: circumstances.subject.clone() },
        sample_rate_hz: circumstances.sample_rate_hz,
        lever: circumstances.lever,
        recorded_filter: None,
        trials: vec![trial],
    };
    let prepared = Observations::new(&session, circumstances.view).map_err(|error| error.to_string())?;
    let fit = Fit::new(&prepared, &Model::paper(), Weighting::default());
    let estimate =
        estimates_without_profiles(&prepared, &fit).pop().ok_or("the trial could not be prepared")?;
    let measured_nm = prepared.trials[0].measured_nm.clone();
    let residual_nm = &predictions(&prepared, &fit)[0].residual_nm;
    let predicted_nm = measured_nm.iter().zip(residual_nm).map(|(measured, left)| measured - left).collect();
    Ok(Box::new(TrialFit { estimate, measured_nm, predicted_nm }))
}
