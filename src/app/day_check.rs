//! The check of the day: once the rig trials of a session are run, and before a person sits down, they are compared with the calibration
//! that the session was given.

use std::convert::Infallible;
use std::fmt::Display;
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::calibrate::{RigComparison, RigVerdict, compare};
use crate::console::{OperatorNotice, lower_thread_priority};
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
type Tell = Arc<dyn Fn(OperatorNotice) + Send + Sync>;

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
            // If the comparison panicked, the thread has raised the alarm.
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
            let on_thread = tell.clone();
            let compared = thread::Builder::new().name("check of the day".to_owned()).spawn(move || {
                lower_thread_priority();
                on_thread(or_not_compared(|| outcome(&folder, count, &calibration)));
            });
            match compared {
                Ok(comparison) => self.comparison = Some(comparison),
                Err(error) => tell(not_compared(&error)),
            }
        }
        Ok(())
    }
}

/// What the rig trials in `folder`, `count` of them, say of the calibration.
fn outcome(folder: &Path, count: usize, calibration: &RigCalibration) -> OperatorNotice {
    let compared = match written(folder, count) {
        Ok(trials) => compare(&trials, calibration).map_err(|error| error.to_string()),
        Err(error) => Err(error),
    };
    match compared {
        Ok(comparison) => notice(&comparison, calibration),
        Err(error) => not_compared(&error),
    }
}

/// The outcome of `compared`; of a comparison that panics, the alarm at once: somebody is about to sit down.
fn or_not_compared(compared: impl FnOnce() -> OperatorNotice) -> OperatorNotice {
    // What the comparison read and computed is lost with it.
    panic::catch_unwind(AssertUnwindSafe(compared))
        .unwrap_or_else(|_| not_compared(&"the comparison failed by a fault of the program"))
}

fn not_compared(reason: &dyn Display) -> OperatorNotice {
    OperatorNotice::Alarm(format!("the rig was not compared with its calibration: {reason}"))
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
fn notice(comparison: &RigComparison, calibration: &RigCalibration) -> OperatorNotice {
    let trials = comparison.trials;
    let of = format!("{trials} trials with the empty handle and the calibration of {}", calibration.session);
    let changed = match comparison.verdict() {
        RigVerdict::Agrees => {
            let p_value = comparison.p_value;
            return OperatorNotice::Message(format!("check of the day: {of} agree (p = {p_value:.3})"));
        }
        RigVerdict::DiffersUnexplained => {
            return OperatorNotice::Alarm(format!(
                "check of the day: {of} differ (p = {:.4}), and a change of no single quantity explains it; find out why, or \
                 calibrate again, before a person sits down",
                comparison.p_value
            ));
        }
        RigVerdict::NotComparable(reason) => return not_compared(&reason),
        RigVerdict::Differs(changed) => changed,
    };
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
    let names: Vec<String> = changed.iter().map(differs).collect();
    OperatorNotice::Alarm(format!(
        "check of the day: {of} differ: {}; find out why, or calibrate again, before a person sits down",
        names.join(", or ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::QuantityDifference;
    use crate::dataset::RigQuantity;

    fn told(changed: Vec<RigQuantity>, quantities: usize, p_value: f64) -> OperatorNotice {
        let calibration = RigCalibration::new("ramphold".into(), "rig-day".into(), Vec::new(), Vec::new());
        let own = QuantityDifference {
            name: RigQuantity::TorqueOffset,
            calibrated: 0.1,
            difference: 0.001,
            se: 0.002,
            p_value: 0.6,
        };
        let quantities = vec![own; quantities];
        let comparison = RigComparison { quantities, changed, untested: Vec::new(), trials: 6, p_value };
        notice(&comparison, &calibration)
    }

    #[test]
    fn only_a_rig_that_differs_is_an_alarm() {
        let agrees = told(Vec::new(), 1, 0.4);
        assert!(matches!(agrees, OperatorNotice::Message(text) if text.contains("agree (p = 0.400)")));
        let differs = told(vec![RigQuantity::LeverInertia], 1, 0.4);
        assert!(
            matches!(differs, OperatorNotice::Alarm(text) if text.contains("differ: lever_inertia_kg_m2"))
        );
    }

    #[test]
    fn a_comparison_that_panics_is_an_alarm() {
        let failed = or_not_compared(|| panic!("a fault of the comparison"));
        assert!(
            matches!(&failed, OperatorNotice::Alarm(text) if text.contains("was not compared with its calibration")),
            "{failed:?}"
        );
    }

    #[test]
    fn a_difference_that_no_quantity_explains_and_a_rig_that_was_not_compared_are_alarms() {
        for (notice, words) in [
            (told(Vec::new(), 1, 0.0), "differ (p = 0.0000), and a change of no single quantity explains it"),
            (told(Vec::new(), 0, 0.001), "differ (p = 0.0010)"),
            (told(Vec::new(), 1, f64::NAN), "not compared with its calibration: how far"),
            (told(Vec::new(), 0, 0.4), "not compared with its calibration: these trials tell"),
        ] {
            assert!(matches!(&notice, OperatorNotice::Alarm(text) if text.contains(words)), "{notice:?}");
        }
    }
}
