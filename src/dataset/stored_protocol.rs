//! The protocol in a session folder.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use super::csv_input::SessionFolder;
use super::error::{DatasetError, FilePlace};
use super::hexadecimal::sha256;
use super::journal::{JOURNAL, JournalEntry, JournalText};
use super::{Session, Status};
use crate::files::limits;
use crate::protocol::{ValidProtocol, significant};

/// Name of the protocol in a session folder.
pub const PROTOCOL: &str = "protocol.json";

/// Reads the protocol of the session in `folder`; `None` if it has none, as a session that another program measured.
///
/// # Errors
/// If it is there and cannot be read, is no protocol, or is not the one with which the session was begun, as its journal has it.
pub fn stored_protocol(folder: &Path) -> Result<Option<ValidProtocol>, DatasetError> {
    let folder = SessionFolder::open(folder)?;
    if !folder.folder().contains(PROTOCOL) {
        return Ok(None);
    }
    let (protocol, text) = read_protocol(&folder)?;
    if let Some(begun_with) = begun_with(&folder) {
        check_unchanged(&folder, &text, &begun_with)?;
    }
    Ok(Some(protocol))
}

/// SHA-256 of the protocol with which the session was begun; `None` for a session without a journal. A journal that is damaged at its first
/// record is refused where it is needed.
fn begun_with(folder: &SessionFolder) -> Option<String> {
    let journal = folder.folder().open_file(JOURNAL).ok()?;
    let mut first = Vec::new();
    BufReader::new(journal.take(limits::SETTINGS_BYTES)).read_until(b'\n', &mut first).ok()?;
    match JournalText::parse(&first).records.into_iter().next()?.record {
        JournalEntry::Session { protocol_sha256, .. } => Some(protocol_sha256),
        _ => None,
    }
}

/// Refuses the text of a protocol that is not the one with which the session was begun.
pub(super) fn check_unchanged(
    folder: &SessionFolder,
    text: &str,
    begun_with: &str,
) -> Result<(), DatasetError> {
    let found = sha256(text.as_bytes());
    if found == begun_with {
        return Ok(());
    }
    Err(DatasetError::ProtocolChanged {
        at: FilePlace::file(folder.name(PROTOCOL)),
        found,
        expected: begun_with.to_owned(),
    })
}

/// Numbers of a table and of its protocol are the same to this part of them: a table may be rounded.
const TABLE_ROUNDING: f64 = 1e-3;

/// The protocol in `folder`, from which the analysis of `session`, the session there, takes filter and window; `None` if it has none.
///
/// # Errors
/// If it cannot be read, the session was sampled at another rate, or a trial that counts has a velocity or a torque that the protocol
/// does not.
pub fn protocol_of_session(folder: &Path, session: &Session) -> Result<Option<ValidProtocol>, DatasetError> {
    let protocol = stored_protocol(folder)?;
    if let Some(protocol) = &protocol {
        check_protocol(folder, protocol, session)?;
    }
    Ok(protocol)
}

fn check_protocol(folder: &Path, protocol: &ValidProtocol, session: &Session) -> Result<(), DatasetError> {
    let are_same = |a: f64, b: f64| (a - b).abs() <= TABLE_ROUNDING * b.abs();
    let refused = |field: &str, has: &str, expected: String| {
        let name = folder.join(PROTOCOL).display().to_string();
        let expected = format!("{expected}; is it the protocol of another session?");
        Err(DatasetError::Value {
            at: FilePlace::field(name.as_str(), field),
            found: has.to_owned(),
            expected,
        })
    };
    let list = |values: &[f64]| values.iter().map(|own| significant(*own)).collect::<Vec<_>>().join(", ");
    let rate_hz = protocol.signal.sample_rate_hz;
    if !are_same(rate_hz, session.sample_rate_hz) {
        let expected = format!("{} as in session.json", session.sample_rate_hz);
        return refused("signal.sample_rate_hz", &rate_hz.to_string(), expected);
    }
    for trial in session.trials.iter().filter(|trial| trial.status == Status::Ok) {
        // A left hand's velocity is negative in the table.
        for (field, values, own, unit) in [
            ("velocities_rad_s", &protocol.velocities_rad_s, trial.velocity_rad_s, "rad/s"),
            ("torques_nm", &protocol.torques_nm, trial.torque_nm, "N m"),
        ] {
            if !values.iter().any(|value| are_same(own.abs(), value.abs())) {
                let expected = format!("{} {unit} too, as trial {} has it", significant(own), trial.number);
                return refused(field, &list(values), expected);
            }
        }
    }
    Ok(())
}

/// The protocol in an open session folder, which must be there, and its text.
pub(super) fn read_protocol(folder: &SessionFolder) -> Result<(ValidProtocol, String), DatasetError> {
    let text = folder.text(PROTOCOL, limits::SETTINGS_BYTES, None)?;
    Ok((ValidProtocol::parse(&text, &folder.name(PROTOCOL))?, text))
}
