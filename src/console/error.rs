//! Errors of the console.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

use crate::dataset::DatasetError;
use crate::protocol::ProtocolError;

/// Reason why a console cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum ConsoleError {
    /// Without encryption, others on the network could read the pages and give commands.
    #[error(
        "--listen {0}: without a certificate, others on the network could read the pages and give commands; give a certificate \
         with --tls-cert FILE and --tls-key FILE, or listen on 127.0.0.1"
    )]
    Plain(SocketAddr),
    /// Without a host name, forged requests cannot be recognised.
    #[error(
        "--listen {0}: this means every address; give with --host NAME the name or address that browsers will use"
    )]
    Nameless(SocketAddr),
    /// The address is not available.
    #[error("{address}: cannot be listened on: {source}. Choose another with --console-port N")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// The system's reason.
        source: io::Error,
    },
    /// A file of the certificate cannot be used.
    #[error("{}: {problem}; expected {expected} in PEM form", .file.display())]
    Certificate {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        problem: String,
        /// Expected content.
        expected: &'static str,
    },
    /// The program was built without this part.
    #[error(
        "{option}: this program was built without the feature {feature}; build it with: \
         cargo build --release --features {feature}"
    )]
    NotBuilt {
        /// The option that needs the feature.
        option: &'static str,
        /// The cargo feature.
        feature: &'static str,
    },
    /// The system gives no random numbers for the tokens.
    #[error("the addresses of the pages cannot be made secret: the system gives no random numbers ({0})")]
    Random(String),
    /// The threads of the console cannot be started.
    #[error("the console cannot be started: {0}")]
    Start(io::Error),
    /// The recorded session cannot be read.
    #[error(transparent)]
    Session(#[from] DatasetError),
    /// The protocol of the recorded session cannot be read.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The recorded session has no samples.
    #[error("{}: the session has no events; there is nothing to play", .0.display())]
    Empty(PathBuf),
    /// The session was measured elsewhere, and has no journal to play.
    #[error(
        "{}: was measured elsewhere, so there is no journal to play; ramphold report shows its trials",
        .0.display()
    )]
    Foreign(PathBuf),
    /// The terminal cannot be drawn on.
    #[error("--tui: the terminal cannot be drawn on: {0}; run it in a terminal, or give --console instead")]
    Terminal(io::Error),
}

impl ConsoleError {
    /// Whether the input is at fault rather than the system.
    pub fn is_bad_input(&self) -> bool {
        matches!(
            self,
            Self::Plain(_)
                | Self::Nameless(_)
                | Self::Certificate { .. }
                | Self::NotBuilt { .. }
                | Self::Terminal(_)
                | Self::Session(_)
                | Self::Protocol(_)
                | Self::Empty(_)
                | Self::Foreign(_)
        )
    }
}
