//! `fit.json` read back, so that a report needs no second fit.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use crate::fit::{FIT_FORMAT, Model, QUANTITIES};
use crate::signal::FilterSpec;
use crate::wrist::BASE_PARAMETERS;

/// What `fit.json` holds, as far as the report shows it.
#[derive(Debug, Clone, Deserialize)]
pub struct Fitted {
    /// Format and version; [`FIT_FORMAT`].
    pub format: String,
    /// Version of the program that fitted.
    pub version: String,
    /// How the records were looked at.
    pub settings: Settings,
    /// The model file.
    pub model: Value,
    /// Values of the mechanisms' parameters that all trials share.
    pub mechanism_values: Option<BTreeMap<String, f64>>,
    /// By trial.
    pub trials: Vec<TrialFit>,
    /// By condition.
    pub conditions: Vec<ConditionFit>,
}

/// How the fit looked at the records.
#[derive(Debug, Clone, Deserialize)]
pub struct Settings {
    /// The window, s.
    pub window_s: f64,
    /// The filter; `None` where the rig had filtered.
    pub filter: Option<FilterSpec>,
    /// How residuals were weighed.
    pub weighting: String,
}

/// Values by name; absent where the fit has none.
pub type Values = BTreeMap<String, Option<f64>>;

/// One trial.
#[derive(Debug, Clone, Deserialize)]
pub struct TrialFit {
    /// Its number.
    pub trial: u32,
    /// Label of its condition.
    pub condition: Option<String>,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// The quantities.
    pub values: Values,
    /// Eq. 9, relative.
    pub sem_eq9_relative: Values,
    /// Standard error from the measured noise, relative.
    pub se_relative: Values,
    /// Whether the optimisation came to its end.
    pub converged: bool,
    /// Remarks for a person.
    #[serde(default)]
    pub remarks: Vec<String>,
}

/// One condition.
#[derive(Debug, Clone, Deserialize)]
pub struct ConditionFit {
    /// Its label.
    pub condition: Option<String>,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// How many repetitions.
    pub repetitions: usize,
    /// Means.
    pub mean: Values,
    /// Standard deviations.
    pub sd: Values,
}

impl Fitted {
    /// Line, field and what is wrong, if `text` is no `fit.json` of this version.
    pub fn parse(text: &str) -> Result<Self, (usize, String, String)> {
        let mut deserializer = serde_json::Deserializer::from_str(text);
        let fitted: Self = serde_path_to_error::deserialize(&mut deserializer)
            .map_err(|error| (error.inner().line(), error.path().to_string(), error.inner().to_string()))?;
        if fitted.format != FIT_FORMAT {
            return Err((1, "format".into(), format!("{:?} is not known", fitted.format)));
        }
        Ok(fitted)
    }

    /// All parameters of a trial in the order of its model; `None` if the file does not hold them all.
    pub fn parameters(&self, trial: &TrialFit) -> Option<(Model, Vec<f64>)> {
        let model = Model::parse(&self.model.to_string()).ok()?;
        let shared = self.mechanism_values.as_ref();
        let value = |name: &String| match trial.values.get(name) {
            Some(value) => *value,
            None => shared.and_then(|values| values.get(name).copied()),
        };
        let values = model.parameter_names().iter().map(value).collect::<Option<Vec<f64>>>()?;
        Some((model, values))
    }
}

/// How a quantity is shown.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    /// Its name in results.
    pub name: &'static str,
    /// Its sign.
    pub sign: &'static str,
    /// Its meaning.
    pub meaning: &'static str,
    /// Unit in which it is shown.
    pub unit: &'static str,
    /// From SI to that unit.
    pub factor: f64,
    /// What the paper states, in that unit: lower and upper end.
    pub paper: Option<(f64, f64)>,
    /// The same in words.
    pub paper_says: &'static str,
}

/// The quantities, in the order of [`QUANTITIES`]; the paper's values are those of its sections 3.1 to 3.3.
pub const SHOWN: [Shown; 9] = [
    shown(0, "I_j", "inertia of hand and handle part", "g m²", 1e3, None, "no figure"),
    shown(1, "b_h", "damping between hand and handle", "N m s/rad", 1.0, None, "no figure"),
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
    shown(6, "k_after", "stiffness beyond the elastic limit", "N m/rad", 1.0, None, "no figure"),
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
    /// Its sign with its unit, for an axis or a heading.
    pub fn with_unit(&self) -> String {
        if self.unit.is_empty() { self.sign.into() } else { format!("{} ({})", self.sign, self.unit) }
    }
}

/// The six of them that are estimated.
pub fn estimated() -> &'static [Shown] {
    &SHOWN[..BASE_PARAMETERS.len()]
}

/// A condition in words.
pub fn condition_name(label: Option<&String>, velocity_rad_s: f64, torque_nm: f64) -> String {
    match label {
        Some(label) => label.clone(),
        None => format!("{velocity_rad_s} rad/s, {torque_nm} N m"),
    }
}
