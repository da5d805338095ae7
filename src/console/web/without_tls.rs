//! Takes the place of the encryption of the pages where the feature `tls` is not built.

use std::io;
use std::path::Path;

use super::super::error::ConsoleError;
use super::movable_stream::MovableStream;

/// What encrypts connections: without the feature there is none.
#[derive(Clone)]
pub enum TlsAcceptor {}

impl TlsAcceptor {
    /// An encrypted connection.
    pub async fn accept(&self, _stream: MovableStream) -> io::Result<MovableStream> {
        match *self {}
    }
}

/// Refuses.
///
/// # Errors
/// Always: the feature is not built.
pub fn acceptor(_chain: &Path, _key: &Path) -> Result<TlsAcceptor, ConsoleError> {
    Err(ConsoleError::NotBuilt { option: "--tls-cert", feature: "tls" })
}
