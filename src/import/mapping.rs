//! The mapping from a foreign recording to a session: `ramphold-import/1`.

use std::path::{Path, PathBuf};

use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};

use super::error::ImportError;
use super::mapped_signal::{MappedSignal, SignalKind, problems_of};
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
    /// The signals by name, each with what it measures.
    fn signals(&self) -> impl Iterator<Item = (&'static str, SignalKind, &MappedSignal)> {
        let columns = &self.columns;
        let signals = [
            ("time", SignalKind::Time, columns.time.as_ref()),
            ("angle", SignalKind::Angle, Some(&columns.angle)),
            ("torque", SignalKind::Torque, Some(&columns.torque)),
            ("emg_fcr", SignalKind::Emg, columns.emg_fcr.as_ref()),
            ("emg_ecr", SignalKind::Emg, columns.emg_ecr.as_ref()),
            ("handle_angle", SignalKind::Angle, columns.handle_angle.as_ref()),
            ("handle_acceleration", SignalKind::Acceleration, columns.handle_acceleration.as_ref()),
            ("hand_torque", SignalKind::Torque, columns.hand_torque.as_ref()),
            ("joint_angle", SignalKind::Angle, columns.joint_angle.as_ref()),
        ];
        signals.into_iter().filter_map(|(name, kind, signal)| Some((name, kind, signal?)))
    }

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
        let of_signals = own.signals().flat_map(|(name, kind, signal)| problems_of(name, kind, signal, text));
        let problems: Vec<Problem> = of_signals.chain(problems_of_lever(own.lever.as_ref(), text)).collect();
        if problems.is_empty() { Ok(own) } else { Err(ImportError::Mapping { file: name, problems }) }
    }
}

/// Constants that no lever has.
fn problems_of_lever(lever: Option<&Lever>, text: &str) -> Vec<Problem> {
    let wrong = lever.into_iter().flat_map(Lever::impossible_constants);
    wrong
        .map(|(field, value, expected)| Problem {
            path: format!("lever.{field}"),
            line: 1 + text.lines().position(|line| line.contains(field)).unwrap_or(0),
            value: Some(value.to_string()),
            expected: expected.to_owned(),
            advice: "write null instead of a lever if the torque was measured at a rigid handle".to_owned(),
        })
        .collect()
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
    json_file::pretty(&schema())
}
