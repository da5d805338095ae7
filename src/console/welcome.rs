//! First message of a page's socket: what does not change during the session.

use serde_json::{Value, json};

use super::snapshot::PlaybackState;
use crate::dataset::Wrist;
use crate::report::{MARK_MEANING, SHOWN};
use crate::session::transitions::TRANSITIONS;
use crate::session::{Phase, Settings};

/// Description of a session for the pages.
#[derive(Debug, Clone)]
pub struct SessionInfo {
    /// Name of the protocol.
    pub protocol: String,
    /// Identifier of the subject.
    pub subject: String,
    /// The session's folder.
    pub folder: String,
    /// Name of the rig.
    pub rig: String,
}

/// The first messages for the operator's and the subject's page.
pub fn welcome_messages(
    info: &SessionInfo,
    settings: &Settings,
    wrist: Wrist,
    playback: Option<PlaybackState>,
) -> [Value; 2] {
    let subject = json!({
        "kind": "hello",
        "wrist": wrist,
    });
    let mut operator = subject.clone();
    let more = json!({
        "protocol": info.protocol,
        "subject": info.subject,
        "folder": info.folder,
        "rig": info.rig,
        "seed": settings.seed,
        "sample_rate_hz": settings.sample_rate_hz,
        "gate_s": settings.gate.duration_s,
        "antagonist_limit_mvc": settings.gate.antagonist_limit_mvc,
        "angle_rad": settings.limits.angle_rad,
        "quantities": SHOWN.iter().map(|shown| json!({
            "name": shown.name,
            "sign": shown.sign,
            "unit": shown.unit,
            "meaning": shown.meaning,
        })).collect::<Vec<_>>(),
        "mark": MARK_MEANING,
        "tape": playback,
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
    [operator, subject]
}
