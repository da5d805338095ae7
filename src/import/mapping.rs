//! The mapping from a foreign recording to a session: `ramphold-import/1`.

use std::path::{Path, PathBuf};

use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};

use super::error::ImportError;
use super::signal_kind::signal_problems;
use crate::dataset::Subject;
use crate::json_file;
use crate::protocol::Problem;
use crate::protocol::shape::check_shape;
use crate::signal::FilterSpec;
use crate::wrist::Lever;

/// Format and version of a mapping.
pub const IMPORT_FORMAT: &str = "ramphold-import/1";

/// Which column of a recording is what, and how the recording becomes trials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mapping {
    /// Location of this schema, for editors.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Format and version: `ramphold-import/1`.
    pub format: String,
    /// Identifier of the subject.
    pub subject: String,
    /// Samples a second; not needed if there is a column of time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample_rate_hz: Option<f64>,
    /// The columns.
    pub columns: SignalColumns,
    /// The lever between motor and handle; null says that the torque was measured at a rigid handle.
    #[schemars(with = "Option<LeverSchema>")]
    pub lever: Option<Lever>,
    /// The filter that both channels passed before they were recorded; null says none.
    pub recorded_filter: Option<FilterSpec>,
    /// How one long record is cut into trials; without it, each table is a trial.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub long_record: Option<LongRecord>,
    /// Column whose value tells the trials of one table apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trial_column: Option<String>,
}

/// The fields of a lever, for the schema.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "only its schema is used")]
struct LeverSchema {
    /// Inertia, kg m2.
    inertia_kg_m2: f64,
    /// Damping, N m s/rad.
    damping_nm_s_per_rad: f64,
    /// Stiffness, N m/rad.
    stiffness_nm_per_rad: f64,
}

/// The columns of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SignalColumns {
    /// Time; without it, the sample rate counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<MappedSignal>,
    /// Angle of the motor. After the sign, the ramp that stretches the muscle is positive.
    pub angle: MappedSignal,
    /// Torque. After the sign, torque that resists the ramp is positive.
    pub torque: MappedSignal,
    /// EMG of the flexor carpi radialis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emg_fcr: Option<MappedSignal>,
    /// EMG of the extensor carpi radialis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emg_ecr: Option<MappedSignal>,
    /// Angle of the handle, from an encoder there; signs as for the angle of the motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub handle_angle: Option<MappedSignal>,
    /// Angular acceleration of the handle; signs as for the angle of the motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub handle_acceleration: Option<MappedSignal>,
    /// Torque between handle and hand; signs as for the torque.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hand_torque: Option<MappedSignal>,
    /// Angle of the joint itself; signs as for the angle of the motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_angle: Option<MappedSignal>,
}

/// A column with its unit and sign: the value is `sign` (column - `zero`) in SI units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MappedSignal {
    /// Name of the column, or of the variable in a .mat file.
    pub column: String,
    /// Unit of its values.
    pub unit: SignalUnit,
    /// 1, or -1 to turn the sign.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    #[schemars(range(min = -1, max = 1))]
    pub sign: i8,
    /// Value of the column at zero, in its unit.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub zero: f64,
    /// Value of EMG at maximal effort, in its unit; needed if EMG is not a fraction already.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_mvc: Option<f64>,
}

fn one() -> i8 {
    1
}

fn is_one(sign: &i8) -> bool {
    *sign == 1
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Unit of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum SignalUnit {
    /// Seconds.
    #[serde(rename = "s")]
    Second,
    /// Milliseconds.
    #[serde(rename = "ms")]
    Millisecond,
    /// Microseconds.
    #[serde(rename = "us")]
    Microsecond,
    /// Radians.
    #[serde(rename = "rad")]
    Radian,
    /// Milliradians.
    #[serde(rename = "mrad")]
    Milliradian,
    /// Degrees.
    #[serde(rename = "deg")]
    Degree,
    /// Revolutions.
    #[serde(rename = "rev")]
    Revolution,
    /// Radians a second, squared.
    #[serde(rename = "rad/s2")]
    RadianPerSecondSquared,
    /// Degrees a second, squared.
    #[serde(rename = "deg/s2")]
    DegreePerSecondSquared,
    /// Newton metres.
    #[serde(rename = "N m")]
    NewtonMetre,
    /// Newton centimetres.
    #[serde(rename = "N cm")]
    NewtonCentimetre,
    /// Newton millimetres.
    #[serde(rename = "N mm")]
    NewtonMillimetre,
    /// Kilopond centimetres.
    #[serde(rename = "kgf cm")]
    KilopondCentimetre,
    /// Pound-force inches.
    #[serde(rename = "lbf in")]
    PoundInch,
    /// A fraction of maximal voluntary contraction.
    #[serde(rename = "mvc")]
    Mvc,
    /// Percent of maximal voluntary contraction.
    #[serde(rename = "%")]
    Percent,
    /// Volts.
    #[serde(rename = "V")]
    Volt,
    /// Millivolts.
    #[serde(rename = "mV")]
    Millivolt,
    /// Microvolts.
    #[serde(rename = "uV")]
    Microvolt,
}

impl SignalUnit {
    /// Name in a mapping.
    pub fn name(self) -> String {
        serde_json::to_value(self).ok().and_then(|name| name.as_str().map(str::to_owned)).unwrap_or_default()
    }

    /// Factor to the SI unit of its kind; EMG in volts has none, and is divided by its value at maximal effort.
    pub fn factor(self) -> f64 {
        match self {
            Self::Second | Self::Radian | Self::RadianPerSecondSquared | Self::NewtonMetre | Self::Mvc => 1.0,
            Self::Volt | Self::Millivolt | Self::Microvolt => 1.0,
            Self::Millisecond | Self::Milliradian | Self::NewtonMillimetre => 1e-3,
            Self::Microsecond => 1e-6,
            Self::Degree | Self::DegreePerSecondSquared => std::f64::consts::PI / 180.0,
            Self::Revolution => std::f64::consts::TAU,
            Self::NewtonCentimetre | Self::Percent => 1e-2,
            Self::KilopondCentimetre => 0.098_066_5,
            Self::PoundInch => 0.112_984_829,
        }
    }
}

impl MappedSignal {
    /// A value of the column in SI units, or as a fraction of maximal effort.
    pub fn convert(&self, value: f64) -> f64 {
        f64::from(self.sign) * (value - self.zero) * self.unit.factor() / self.at_mvc.unwrap_or(1.0)
    }
}

/// How one long record is cut into trials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LongRecord {
    /// Column that rises through `threshold` at each ramp, such as a trigger or the commanded speed. Without it the ramps are found in
    /// the angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ramp_column: Option<String>,
    /// Threshold of that column, in its unit.
    #[serde(default = "half")]
    pub threshold: f64,
    /// Time that is kept before each ramp, s.
    #[serde(default = "before_s")]
    #[schemars(range(min = 0.06, max = 10.0))]
    pub before_s: f64,
    /// Time that is kept after the begin of each ramp, s.
    #[serde(default = "after_s")]
    #[schemars(range(min = 0.06, max = 10.0))]
    pub after_s: f64,
}

fn half() -> f64 {
    0.5
}

fn before_s() -> f64 {
    1.0
}

fn after_s() -> f64 {
    0.3
}

impl Mapping {
    /// Reads a mapping; the error lists all wrong and missing fields.
    ///
    /// # Errors
    /// If the file cannot be read, or is no mapping.
    pub fn read(file: &Path) -> Result<Self, ImportError> {
        let text = json_file::read_text(file, "a mapping for ramphold import")?;
        Self::parse(&text, file)
    }

    /// Reads a mapping from its text; `file` is its name for messages.
    ///
    /// # Errors
    /// If it is no mapping.
    pub fn parse(text: &str, file: &Path) -> Result<Self, ImportError> {
        let name = file.display().to_string();
        let schema = schema();
        let mut problems = check_shape(text, &name, &schema, "the example in docs/how-to/own-data.md")
            .map_err(ImportError::NotJson)?;
        // The walk knows no null beside a value with a kind; here it says that nothing was filtered.
        problems.retain(|own| own.path != "recorded_filter" || own.value.as_deref() != Some("null"));
        if !problems.is_empty() {
            return Err(ImportError::Mapping { file: name, problems });
        }
        let own: Self = json_file::parse(text, &PathBuf::from(&name), "a mapping for ramphold import")?;
        if !Subject::is_identifier(&own.subject) {
            let problem = Problem {
                path: "subject".to_owned(),
                line: 1 + text.lines().position(|line| line.contains("\"subject\"")).unwrap_or(0),
                value: Some(format!("{:?}", own.subject)),
                expected: "an identifier of letters, digits, -, _ and ., such as S03".to_owned(),
                advice: "folders and tables are named after it".to_owned(),
            };
            return Err(ImportError::Mapping { file: name, problems: vec![problem] });
        }
        let problems = signal_problems(&own, text);
        if problems.is_empty() { Ok(own) } else { Err(ImportError::Mapping { file: name, problems }) }
    }
}

fn schema() -> serde_json::Value {
    let mut schema = schema_for!(Mapping).to_value();
    // A rigid handle and the lack of a filter are said, not left out: every stiffness rests on them.
    if let Some(required) = schema["required"].as_array_mut() {
        required.extend(["lever".into(), "recorded_filter".into()]);
    }
    schema
}

/// JSON schema of mappings.
pub fn schema_text() -> String {
    serde_json::to_string_pretty(&schema()).unwrap_or_default() + "\n"
}
