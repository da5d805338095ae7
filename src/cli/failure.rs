//! How errors of the layers end the program: message and exit code.

use std::io;

use ramphold::protocol::ProtocolError;
use ramphold::schedule::DrawError;

/// Why a verb did not do its work. One variant for each layer that can fail.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The protocol cannot be run.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The trials cannot be ordered as asked.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// Results could not be printed.
    #[error("standard output cannot be written: {0}. Is the disk it is redirected to full?")]
    Output(#[from] io::Error),
}

impl Failure {
    /// 1: the work failed; 2: what was given to it was bad.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Protocol(_) | Self::Draw(_) => 2,
            Self::Output(_) if self.is_broken_pipe() => 0,
            Self::Output(_) => 1,
        }
    }

    /// The reader of the results has read enough (`ramphold schedule ... | head -1`), which is no failure.
    pub fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }
}
