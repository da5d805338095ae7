//! Reads `fit.json`, so that a report needs no second fit.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::error::ReportError;
use super::known_rig::KnownRig;
use crate::dataset::Session;
use crate::files::{excerpt, limits};
use crate::fit::{DESCRIBING_VAF, FIT_FORMAT, Model, QUANTITIES, RigConstants};
use crate::json_file::JsonFileError;
use crate::signal::FilterSpec;
use crate::wrist::BASE_PARAMETERS;

/// The content of `fit.json` that the report shows.
#[derive(Debug, Clone, Deserialize)]
pub struct Fitted {
    /// Format and version, [`FIT_FORMAT`].
    pub format: String,
    /// Id of the subject.
    pub subject: Option<String>,
    /// Version of the program that fitted.
    pub version: String,
    /// The settings of the preprocessing.
    pub settings: FitSettings,
    /// The model, as in a model file.
    pub model: Value,
    /// Values of the mechanisms' parameters that all trials share.
    pub mechanism_values: Option<BTreeMap<String, f64>>,
    /// The trials.
    pub trials: Vec<FittedTrial>,
    /// The conditions.
    pub conditions: Vec<ConditionFit>,
    /// The model of the session, or why there is none.
    pub session_model: Option<SessionModel>,
    /// What is known of the rig; older programs did not write it.
    pub rig: Option<KnownRig>,
    /// What the fit was made from; older programs did not write it.
    pub made_from: Option<MadeFrom>,
    /// Contradictions between the signals and the table that were accepted.
    #[serde(default)]
    pub accepted: Vec<AcceptedContradiction>,
}

/// What a fit was made from.
#[derive(Debug, Clone, Deserialize)]
pub struct MadeFrom {
    /// Sum of the session.
    pub session_sha256: String,
}

/// A contradiction between the signals and the table that the operator accepted.
#[derive(Debug, Clone, Deserialize)]
pub struct AcceptedContradiction {
    /// Name of the check.
    pub check: String,
    /// What was measured.
    pub measured: String,
    /// What was expected.
    pub stated: String,
}

/// Whether the trials were fitted together.
#[derive(Debug, Clone, Deserialize)]
pub struct SessionModel {
    /// Whether they were.
    pub used: bool,
    /// Why not.
    pub reason: Option<String>,
}

/// The fit of a trial on its own.
#[derive(Debug, Clone, Deserialize)]
pub struct IndependentFit {
    /// The fitted quantities.
    pub values: Values,
    /// Relative standard errors from the measured noise.
    pub se_relative: Values,
    /// Other optima within the noise.
    #[serde(default)]
    pub other_optima: Vec<Optimum>,
}

/// Another optimum of a trial.
#[derive(Debug, Clone, Deserialize)]
pub struct Optimum {
    /// The six parameters.
    pub values: Values,
    /// Its probability.
    pub probability: f64,
}

/// The settings of preprocessing and weighting.
#[derive(Debug, Clone, Deserialize)]
pub struct FitSettings {
    /// The analysed window after the onset, s.
    pub window_s: f64,
    /// The filter of measured and predicted torque: that of the rig, if it filtered before recording. `None`: none.
    pub filter: Option<FilterSpec>,
    /// The weighting of the residuals.
    pub weighting: String,
    /// Longest time by which stated onsets are after the motor has begun to move, s; older programs took every onset as stated.
    #[serde(default)]
    pub stated_onsets_late_s: f64,
    /// The same before it.
    #[serde(default)]
    pub stated_onsets_early_s: f64,
    /// The constants of the rig by which the records became angle and torque; older programs used those that the session states.
    pub rig_constants: Option<RigConstants>,
    /// Sum of the file that they were measured in.
    #[serde(default)]
    pub calibration_sha256: Option<String>,
}

/// Values by name; `None` where the fit has none.
pub type Values = BTreeMap<String, Option<f64>>;

/// The fit of one trial.
#[derive(Debug, Clone, Deserialize)]
pub struct FittedTrial {
    /// Its number.
    pub trial: u32,
    /// Label of its condition.
    pub condition: Option<String>,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// The fitted quantities.
    pub values: Values,
    /// Relative standard errors of Eq. 9.
    pub sem_eq9_relative: Values,
    /// Relative standard errors from the measured noise, and from the errors of the rig's constants.
    pub se_relative: Values,
    /// The part of them that comes from the constants.
    #[serde(default)]
    pub se_of_rig_relative: Values,
    /// Relative change of the parameters by one standard error of each measured constant.
    #[serde(default)]
    pub change_by_se_of_constant: BTreeMap<String, Values>,
    /// Whether the optimisation converged.
    pub converged: bool,
    /// Remarks about the fit.
    #[serde(default)]
    pub remarks: Vec<String>,
    /// The fit of the trial on its own.
    pub independent: Option<IndependentFit>,
}

/// The mean fit of one condition.
#[derive(Debug, Clone, Deserialize)]
pub struct ConditionFit {
    /// Its label.
    pub condition: Option<String>,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// Number of repetitions.
    pub repetitions: usize,
    /// Means.
    pub mean: Values,
    /// Standard deviations.
    pub sd: Values,
    /// Relative standard errors of the means of parameters.
    #[serde(default)]
    pub se_relative: Values,
}

impl ConditionFit {
    /// What is shown beside the mean of a quantity: of trials that were fitted together its standard error, since their values are
    /// drawn towards each other; of independent ones the standard deviation over repetitions.
    pub fn spread(&self, name: &str, together: bool) -> Option<f64> {
        let value = |values: &Values| values.get(name).copied().flatten();
        if together { Some(value(&self.se_relative)? * value(&self.mean)?.abs()) } else { value(&self.sd) }
    }
}

impl FittedTrial {
    /// A quantity of the trial; `None` if the fit has none, or if it ended at its bound, which the data do not determine.
    pub fn determined(&self, name: &str) -> Option<f64> {
        let at_bound = format!("{name} ended at its bound");
        let is_at_bound = self.remarks.iter().any(|remark| remark.starts_with(&at_bound));
        self.values.get(name).copied().flatten().filter(|_| !is_at_bound)
    }
}

impl Fitted {
    /// Largest variance accounted for of any trial; `None` without trials.
    pub fn best_vaf(&self) -> Option<f64> {
        self.vafs().map(|(_, vaf)| vaf).max_by(f64::total_cmp)
    }

    /// Numbers of the trials that the model does not describe.
    pub fn undescribed(&self) -> Vec<u32> {
        self.vafs().filter(|(_, vaf)| *vaf < DESCRIBING_VAF).map(|(trial, _)| trial).collect()
    }

    /// The number of each trial with the variance accounted for.
    fn vafs(&self) -> impl Iterator<Item = (u32, f64)> {
        self.trials.iter().filter_map(|own| Some((own.trial, own.values.get("vaf").copied().flatten()?)))
    }

    /// Whether the trials were fitted together.
    pub fn is_together(&self) -> bool {
        self.session_model.as_ref().is_some_and(|model| model.used)
    }

    /// Checks that the file has the format that this program writes, and a window that can be drawn.
    pub fn check(&self, path: &Path) -> Result<(), ReportError> {
        let refuse = |field: &str, message: String| {
            let (file, field) = (path.to_owned(), field.to_owned());
            let source = JsonFileError::Value { file, line: 1, field, message, expected: FIT_FORMAT };
            Err(ReportError::Content { source, verb: "fit" })
        };
        if self.format != FIT_FORMAT {
            return refuse("format", format!("{:?} is not known", excerpt(&self.format)));
        }
        let window_s = self.settings.window_s;
        if !(window_s > 0.0 && window_s <= limits::MAX_WINDOW_S) {
            let range = format!("more than 0 and at most {}", limits::MAX_WINDOW_S);
            return refuse("settings.window_s", format!("{window_s} is no window; expected {range}"));
        }
        Ok(())
    }

    /// Whether it is of the subject and the trials of a session.
    pub fn is_of(&self, session: &Session) -> bool {
        let conditions: BTreeMap<u32, [f64; 2]> = session
            .trials
            .iter()
            .map(|trial| (trial.number, [trial.velocity_rad_s, trial.torque_nm]))
            .collect();
        self.subject.as_ref().is_none_or(|subject| *subject == session.subject.id)
            && self
                .trials
                .iter()
                .all(|own| conditions.get(&own.trial) == Some(&[own.velocity_rad_s, own.torque_nm]))
    }

    /// The model of the fit; `None` if the file holds none.
    pub fn model(&self) -> Option<Model> {
        Model::parse(&self.model.to_string()).ok()
    }

    /// All parameters of a trial in the order of its `model`; `None` if the file lacks one.
    pub fn parameters(&self, model: &Model, trial: &FittedTrial) -> Option<Vec<f64>> {
        let shared = self.mechanism_values.as_ref();
        let value = |name: &String| match trial.values.get(name) {
            Some(value) => *value,
            None => shared.and_then(|values| values.get(name).copied()),
        };
        model.parameter_names().iter().map(value).collect()
    }
}

/// The presentation of a quantity.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    /// Its name in results.
    pub name: &'static str,
    /// Its symbol.
    pub sign: &'static str,
    /// Its meaning.
    pub meaning: &'static str,
    /// Unit in which it is shown.
    pub unit: &'static str,
    /// Factor from the SI unit to the shown unit.
    pub factor: f64,
    /// Range that the paper states, in the shown unit.
    pub paper: Option<(f64, f64)>,
    /// The paper's value as text.
    pub paper_says: &'static str,
}

/// Places in [`SHOWN`] of what a verdict speaks of: k_srs, x_e and x_t.
pub const SPOKEN_OF: [usize; 3] = [3, 5, 7];

/// The quantities, in the order of [`QUANTITIES`]; the paper's values are those of its sections 3.1 to 3.3.
pub const SHOWN: [Shown; 9] = [
    shown(0, "I_j", "inertia of hand and handle part", "g m²", 1e3, None, "not stated"),
    shown(1, "b_h", "damping between hand and handle", "N m s/rad", 1.0, None, "not stated"),
    shown(
        2,
        "k_h",
        "stiffness between hand and handle",
        "N m/rad",
        1.0,
        None,
        "falls slightly with velocity",
    ),
    shown(3, "k_srs", "short range stiffness", "N m/rad", 1.0, Some((15.0, 23.0)), "15 to 23, with torque"),
    shown(
        4,
        "k_dec",
        "stiffness lost beyond the elastic limit",
        "N m/rad",
        1.0,
        None,
        "rises with velocity and torque",
    ),
    shown(5, "x_e", "elastic limit", "mrad", 1e3, Some((25.0, 65.0)), "25 to 65, with velocity"),
    shown(6, "k_after", "stiffness beyond the elastic limit", "N m/rad", 1.0, None, "not stated"),
    shown(7, "x_t", "time to the elastic limit", "ms", 1e3, Some((28.7, 30.3)), "29.5 ± 0.8"),
    shown(8, "VAF", "variance of the torque accounted for", "", 1.0, Some((0.993, 0.995)), "0.994 ± 0.001"),
];

const fn shown(
    index: usize,
    sign: &'static str,
    meaning: &'static str,
    unit: &'static str,
    factor: f64,
    paper: Option<(f64, f64)>,
    paper_says: &'static str,
) -> Shown {
    Shown { name: QUANTITIES[index], sign, meaning, unit, factor, paper, paper_says }
}

impl Shown {
    /// Its symbol with its unit, for an axis or a heading.
    pub fn with_unit(&self) -> String {
        if self.unit.is_empty() { self.sign.into() } else { format!("{} ({})", self.sign, self.unit) }
    }
}

/// The six estimated quantities.
pub fn estimated() -> &'static [Shown] {
    &SHOWN[..BASE_PARAMETERS.len()]
}

/// The label of a condition.
pub fn condition_name(label: Option<&String>, velocity_rad_s: f64, torque_nm: f64) -> String {
    match label {
        Some(label) => label.clone(),
        None => format!("{velocity_rad_s} rad/s, {torque_nm} N m"),
    }
}
