//! When, who and what of a measured session, as `session.json` keeps it.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::audit::Wrist;
use super::csv_input::SessionFolder;
use super::description_json::parse_json;
use super::error::DatasetError;
use crate::files::limits;
use crate::rig::RecordedChannel;

/// When, who and what of a session. A virtual session has none of it but what was given.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SessionAbout {
    /// When the session began, in UTC: `2026-11-24T15:00:00Z`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub started_utc: Option<String>,
    /// How far local time was ahead of UTC then, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub utc_offset_s: Option<i64>,
    /// Clock that the start was read from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<String>,
    /// Who ran the session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub operator: Option<String>,
    /// The hand that was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hand: Option<Wrist>,
}

/// The parts of `session.json` that say when, who and what.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
pub struct SessionCard {
    /// When and by whom.
    #[serde(flatten)]
    pub about: SessionAbout,
    /// The subject.
    pub subject: SubjectCard,
    /// Seed of the session, if this program ran it.
    #[serde(default)]
    pub seed: Option<u64>,
    /// What is known of the channels, by the name of their column.
    #[serde(default)]
    pub channels: BTreeMap<String, RecordedChannel>,
}

/// The subject with free fields, such as age, sex or dominant hand.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SubjectCard {
    /// Identifier.
    pub id: String,
    /// Further fields, as they were given.
    #[serde(flatten)]
    pub fields: Map<String, Value>,
}

impl SessionCard {
    /// Reads that of the session in `folder`.
    ///
    /// # Errors
    /// If `session.json` cannot be read, or one of these fields has another type.
    pub fn read(folder: &Path) -> Result<Self, DatasetError> {
        let opened = SessionFolder::open(folder)?;
        parse_json(&opened.name("session.json"), &opened.text("session.json", limits::SETTINGS_BYTES, None)?)
    }
}
