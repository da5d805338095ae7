//! Why there is no console.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

use crate::dataset::DatasetError;
use crate::protocol::ProtocolError;

/// Why a console cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum ConsoleError {
    /// Others could read and press along.
    #[error(
        "--listen {0}: others on the network could look on and press buttons; give a certificate with --tls-cert FILE and \
         --tls-key FILE, or listen on 127.0.0.1"
    )]
    Plain(SocketAddr),
    /// Nobody could tell an honest request from a forged one.
    #[error(
        "--listen {0}: listens on every address; say with --host NAME under which name or address browsers will ask for it"
    )]
    Nameless(SocketAddr),
    /// The address cannot be had.
    #[error("{address}: cannot be listened on: {source}. Choose another with --console-port N")]
    Bind {
        /// Which.
        address: SocketAddr,
        /// The system's reason.
        source: io::Error,
    },
    /// A file of the certificate cannot be used.
    #[error("{}: {problem}; expected {expected} in PEM form", .file.display())]
    Certificate {
        /// Which.
        file: PathBuf,
        /// What is wrong.
        problem: String,
        /// What should be there.
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
    /// The system gives no random numbers to make tokens of.
    #[error("no tokens can be made: the system gives no random numbers ({0})")]
    Random(String),
    /// The threads of the console cannot be started.
    #[error("the console cannot be started: {0}")]
    Start(io::Error),
    /// The recorded session cannot be read.
    #[error(transparent)]
    Session(#[from] DatasetError),
    /// Nor can its protocol.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// There is nothing to play.
    #[error("{}: nothing happened in this session that could be played", .0.display())]
    Empty(PathBuf),
    /// The terminal cannot be drawn on.
    #[error("the terminal cannot be drawn on: {0}. Is this a terminal? Leave --tui out otherwise")]
    Terminal(io::Error),
}

impl ConsoleError {
    /// What was asked for makes no sense; otherwise the system refused.
    pub fn is_bad_input(&self) -> bool {
        matches!(
            self,
            Self::Plain(_)
                | Self::Nameless(_)
                | Self::Certificate { .. }
                | Self::NotBuilt { .. }
                | Self::Session(_)
                | Self::Protocol(_)
                | Self::Empty(_)
        )
    }
}
