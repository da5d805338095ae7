//! Parsing of protocols: a parsed protocol is a valid protocol.

use std::ops::Deref;
use std::path::Path;

use super::schema::SCHEMA;
use super::shape::Shape;
use super::source::JsonNode;
use super::{Duration, Problem, Protocol, ProtocolError, RampAndHold, TooShort, rules};
use crate::files::{self, limits};

/// A [`Protocol`] that passed every check, and the text it was read from.
///
/// It can be read like a [`Protocol`] but not changed. It is only made by the checks.
#[derive(Debug, Clone, PartialEq)]
pub struct ValidProtocol {
    protocol: Protocol,
    text: String,
}

impl Protocol {
    /// Reads a protocol from its JSON `text`; `file` is the name for messages.
    pub fn parse(text: &str, file: &str) -> Result<ValidProtocol, ProtocolError> {
        ValidProtocol::parse(text, file)
    }

    /// Checks a protocol that a program made; its text becomes the protocol as indented JSON.
    pub fn validate(self) -> Result<ValidProtocol, ProtocolError> {
        // A number that JSON does not have (NaN, infinity) becomes null and is found as such.
        let value = serde_json::json!(self);
        ValidProtocol::parse(&format!("{value:#}\n"), "protocol")
    }
}

impl ValidProtocol {
    /// Reads a protocol file.
    pub fn read(path: &Path) -> Result<Self, ProtocolError> {
        let file = path.display().to_string();
        let bytes = files::read(path, limits::SETTINGS_BYTES)
            .map_err(|source| ProtocolError::Unreadable { file: file.clone(), source })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let text = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            let line = 1 + text.iter().filter(|byte| **byte == b'\n').count();
            ProtocolError::NotText { file: file.clone(), line }
        })?;
        Self::parse(&text, &file)
    }

    /// Reads a protocol from its JSON `text`; `file` is the name for messages.
    pub fn parse(text: &str, file: &str) -> Result<Self, ProtocolError> {
        let source = JsonNode::parse(text, file)?;
        if let Some((what, advice)) = other_kind(&source, file) {
            return Err(ProtocolError::OtherKind { file: file.to_owned(), what, advice });
        }
        let shape = Shape {
            schema: &SCHEMA,
            example: "protocols/quick.json",
            format_error: |_, _| None,
            format_example: |_| None,
        };
        let mut problems = shape.walk(&source).problems;
        rules::add_problems(&source, &mut problems);
        if problems.is_empty() {
            match typed(&source) {
                Ok(protocol) => {
                    rules::add_problems_of_rig_trials(&source, &protocol, &mut problems);
                    if problems.is_empty() {
                        return Ok(Self { protocol, text: text.to_owned() });
                    }
                }
                Err(problem) => problems.push(problem),
            }
        }
        problems.sort_by_key(|problem| problem.line);
        Err(ProtocolError::Invalid { file: file.to_owned(), problems })
    }

    /// The text it was read from, byte for byte; the session folder keeps it.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The movement of a trial at a velocity. It exists for every velocity of the protocol.
    pub fn ramp_and_hold(&self, velocity_rad_s: f64) -> Result<RampAndHold, TooShort> {
        RampAndHold::new(&self.protocol.ramp, velocity_rad_s)
    }

    /// Number of trials that are recorded and analysed if none is rejected.
    pub fn trial_count(&self) -> usize {
        self.velocities_rad_s.len() * self.torques_nm.len() * self.repetitions as usize
    }

    /// Expected duration of the session.
    pub fn duration(&self) -> Duration {
        Duration::of(self)
    }
}

impl Deref for ValidProtocol {
    type Target = Protocol;

    fn deref(&self) -> &Protocol {
        &self.protocol
    }
}

/// What a file is, and what to do with it, if it is a file of this program but no protocol.
fn other_kind(source: &JsonNode, file: &str) -> Option<(&'static str, String)> {
    let text = |member: &str| source.member(member).map(|node| node.value());
    let format = text("format").unwrap_or_default();
    let format = format.as_str().unwrap_or_default().split('/').next().unwrap_or_default().to_owned();
    match format.as_str() {
        "ramphold-study" => Some(("a study", format!("Run it with: ramphold cohort {file}"))),
        "ramphold-person" => {
            Some(("a virtual subject", format!("Give it with: ramphold run PROTOCOL --subject {file}")))
        }
        "ramphold-model" => Some(("a model", format!("Give it with --model {file}"))),
        "ramphold-session" => Some((
            "the description of a session",
            "Give the path of a protocol, such as protocols/quick.json".into(),
        )),
        "" if text("kind").is_some_and(|kind| kind == "virtual" || kind == "can") => {
            Some(("a rig", format!("Give it with: ramphold run PROTOCOL --rig {file}")))
        }
        _ => None,
    }
}

/// Converts to the typed protocol. A value that passes schema and rules but not the types is reported as a problem.
fn typed(source: &JsonNode) -> Result<Protocol, Problem> {
    let mut value = source.value();
    if let Some(members) = value.as_object_mut() {
        members.remove("$schema");
    }
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().to_string();
        let place = source.at(&path);
        Problem {
            line: place.map_or(1, |node| node.line),
            value: place.map(JsonNode::to_string),
            expected: error.inner().to_string(),
            advice: "compare with protocols/quick.json".to_owned(),
            path,
        }
    })
}
