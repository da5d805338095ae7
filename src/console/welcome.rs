//! What pages are told first, and what does not change.

use serde_json::{Value, json};

use super::snapshot::PlaybackState;
use crate::dataset::Wrist;
use crate::session::transitions::TRANSITIONS;
use crate::session::{Phase, Settings};

/// What there is to know of a session.
#[derive(Debug, Clone)]
pub struct SessionInfo {
    /// Name of the protocol.
    pub protocol: String,
    /// Who is measured.
    pub subject: String,
    /// The session's folder, for reading.
    pub folder: String,
    /// What moves the wrist, for reading.
    pub rig: String,
}

/// The first message for the operator and for the person.
pub fn hello(
    about: &SessionInfo,
    settings: &Settings,
    wrist: Wrist,
    tape: Option<PlaybackState>,
) -> [Value; 2] {
    let person = json!({
        "kind": "hello",
        "wrist": wrist,
    });
    let mut operator = person.clone();
    let more = json!({
        "protocol": about.protocol,
        "subject": about.subject,
        "folder": about.folder,
        "rig": about.rig,
        "seed": settings.seed,
        "sample_rate_hz": settings.sample_rate_hz,
        "gate_s": settings.gate.duration_s,
        "antagonist_limit_mvc": settings.gate.antagonist_limit_mvc,
        "angle_rad": settings.limits.angle_rad,
        "tape": tape,
        "phases": Phase::ALL.map(Phase::name),
        "transitions": TRANSITIONS.iter().map(|line| json!({
            "from": line.from.name(),
            "event": line.event.name(),
            "by": line.event.source().name(),
            "if": line.guard.text(),
            "to": line.to.name(),
            "does": line.effect.text(),
        })).collect::<Vec<_>>(),
    });
    if let (Value::Object(operator), Value::Object(more)) = (&mut operator, more) {
        operator.extend(more);
    }
    [operator, person]
}
