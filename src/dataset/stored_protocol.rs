//! The protocol in a session folder.

use std::path::Path;

use super::csv_input::SessionFolder;
use super::error::DatasetError;
use crate::files::limits;
use crate::protocol::ValidProtocol;

/// Name of the protocol in a session folder.
pub(super) const PROTOCOL: &str = "protocol.json";

/// Reads the protocol of the session in `folder`; `None` if it has none, as a session that another program measured.
///
/// # Errors
/// If it is there and cannot be read, or is no protocol.
pub fn stored_protocol(folder: &Path) -> Result<Option<ValidProtocol>, DatasetError> {
    let folder = SessionFolder::open(folder)?;
    if !folder.folder().contains(PROTOCOL) {
        return Ok(None);
    }
    read_protocol(&folder).map(|(protocol, _)| Some(protocol))
}

/// The protocol in an open session folder, which must be there, and its text.
pub(super) fn read_protocol(folder: &SessionFolder) -> Result<(ValidProtocol, String), DatasetError> {
    let text = folder.text(PROTOCOL, limits::SETTINGS_BYTES, None)?;
    Ok((ValidProtocol::parse(&text, &folder.name(PROTOCOL))?, text))
}
