//! The check of the day: once the rig trials of a session are run, and before a person sits down, they are compared with the calibration
//! that the session was given.

use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::calibrate::{RigComparison, compare};
use crate::console::lower_thread_priority;
use crate::dataset::{RigCalibration, RigTrials, load_rig_trials};
use crate::protocol::significant;
use crate::session::{Progress, Step, StepConsumer};

use super::calibration::UsedCalibration;
use super::failure::Failure;

/// Longest wait until the last rig trial is on the disk.
const LONGEST_WAIT: Duration = Duration::from_secs(30);

/// Time between two looks at the disk.
const LOOK_PERIOD: Duration = Duration::from_millis(200);

/// How the operator hears of the outcome.
type Tell = Box<dyn FnOnce(&str) + Send>;

/// Watches a session until its rig trials are over, and then compares them on a thread of its own.
pub struct DayCheck {
    folder: PathBuf,
    /// The calibration, and how to tell; `None` without one and once the comparison began.
    ready: Option<(RigCalibration, Tell)>,
    comparison: Option<JoinHandle<()>>,
}

impl DayCheck {
    /// The check of the session in `folder`. It does nothing if the rig trials are over or there is no calibration.
    ///
    /// # Errors
    /// If the calibration in the folder cannot be read.
    pub fn of_session(folder: &Path, progress: &Progress, tell: Tell) -> Result<Self, Failure> {
        let used = match progress.rig_trials_due() {
            true => UsedCalibration::of_session(None, folder)?,
            false => None,
        };
        let ready = used.map(|own| (own.calibration, tell));
        Ok(Self { folder: folder.to_owned(), ready, comparison: None })
    }

    /// Waits for the outcome, if the comparison has begun.
    pub fn finish(&mut self) {
        if let Some(comparison) = self.comparison.take() {
            // If the thread panicked, it has said so.
            let _ = comparison.join();
        }
    }
}

impl StepConsumer for DayCheck {
    type Error = Infallible;

    fn consume(&mut self, _: &Step, progress: &Progress) -> Result<(), Infallible> {
        // Called for every sample of the session, and seldom with anything to do.
        let are_over = self.ready.is_some()
            && progress.rig_trials_due()
            && progress.current_rig_trial().is_none()
            && progress.rig_queue().len() == 0;
        if are_over && let Some((calibration, tell)) = self.ready.take() {
            let (folder, count) = (self.folder.clone(), progress.rig_attempts().len());
            let compared = thread::Builder::new().name("check of the day".to_owned()).spawn(move || {
                lower_thread_priority();
                tell(&outcome(&folder, count, &calibration));
            });
            self.comparison = compared.ok();
        }
        Ok(())
    }
}

/// What the rig trials in `folder`, `count` of them, say of the calibration.
fn outcome(folder: &Path, count: usize, calibration: &RigCalibration) -> String {
    let compared = match written(folder, count) {
        Ok(trials) => compare(&trials, calibration).map_err(|error| error.to_string()),
        Err(error) => Err(error),
    };
    match compared {
        Ok(comparison) => text(&comparison, calibration),
        Err(error) => format!("the rig was not compared with its calibration: {error}"),
    }
}

/// The rig trials once all of them are on the disk.
fn written(folder: &Path, count: usize) -> Result<RigTrials, String> {
    let since = Instant::now();
    loop {
        match load_rig_trials(folder) {
            Ok(trials) if trials.trials.len() >= count => return Ok(trials),
            Err(error) if since.elapsed() >= LONGEST_WAIT => return Err(error.to_string()),
            Ok(trials) if since.elapsed() >= LONGEST_WAIT => {
                return Err(format!("{} of {count} rig trials are in the folder", trials.trials.len()));
            }
            _ => thread::sleep(LOOK_PERIOD),
        }
    }
}

/// The outcome, for the operator.
fn text(comparison: &RigComparison, calibration: &RigCalibration) -> String {
    let trials = comparison.trials;
    let of = format!("{trials} trials with the empty handle and the calibration of {}", calibration.session);
    if comparison.changed.is_empty() {
        return format!("check of the day: {of} agree (p = {:.3})", comparison.p_value);
    }
    let differs = |name: &crate::dataset::RigQuantity| {
        let own = comparison.quantities.iter().find(|own| own.name == *name);
        let by = own.map_or(String::new(), |own| {
            format!(
                " by {} from {} (standard error {}, p = {:.4})",
                significant(own.difference),
                significant(own.calibrated),
                significant(own.se),
                own.p_value
            )
        });
        format!("{}{by}", name.name())
    };
    let names: Vec<String> = comparison.changed.iter().map(differs).collect();
    format!(
        "check of the day: {of} differ: {}; find out why, or calibrate again, before a person sits down",
        names.join(", or ")
    )
}
