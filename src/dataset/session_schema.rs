//! JSON schema of `session.json`, for laboratories that write their own.

use std::collections::BTreeMap;

use schemars::{JsonSchema, schema_for};

use crate::json_file;
use crate::rig::RecordedChannel;
use crate::signal::FilterSpec;

/// The least that a session's `session.json` must say; further fields are kept.
#[derive(JsonSchema)]
#[schemars(title = "session.json")]
#[allow(dead_code, reason = "only its schema is used")]
struct SessionFile {
    /// Format and version: `ramphold-session/1`.
    format: String,
    /// Who was measured.
    subject: SubjectField,
    /// Samples a second, the same for all channels.
    #[schemars(extend("exclusiveMinimum" = 0))]
    sample_rate_hz: f64,
    /// The rig.
    rig: RigField,
    /// The filter that both channels passed before they were recorded; null says none.
    #[schemars(required)]
    recorded_filter: Option<FilterSpec>,
    /// What is known of the channels, by the name of their column, such as `emg_fcr_mvc`.
    #[schemars(default)]
    channels: Option<BTreeMap<String, RecordedChannel>>,
    /// When the session began, in UTC: `2026-11-24T15:00:00Z`.
    #[schemars(default)]
    started_utc: Option<String>,
    /// Who ran the session.
    #[schemars(default)]
    operator: Option<String>,
    /// The hand that was measured: `left` or `right`.
    #[schemars(default)]
    hand: Option<String>,
}

/// Who was measured; further fields, such as age, are kept.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "only its schema is used")]
struct SubjectField {
    /// Identifier, such as `S01`.
    id: String,
}

/// The rig.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "only its schema is used")]
struct RigField {
    /// The lever between motor and handle; null says that the torque was measured at a rigid handle.
    #[schemars(required)]
    lever: Option<LeverFields>,
}

/// The lever.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "only its schema is used")]
struct LeverFields {
    /// Inertia, kg m2.
    inertia_kg_m2: f64,
    /// Damping, N m s/rad.
    damping_nm_s_per_rad: f64,
    /// Stiffness, N m/rad.
    stiffness_nm_per_rad: f64,
}

/// JSON schema of `session.json`.
pub fn session_schema_text() -> String {
    json_file::pretty(&schema_for!(SessionFile))
}
