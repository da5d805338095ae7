//! The address of the pages, and whether it is safe to serve pages there.

use std::net::SocketAddr;
use std::path::PathBuf;

use super::super::error::ConsoleError;
use super::tls::{self, TlsAcceptor};

/// Address of the pages and the names under which browsers may request them.
#[derive(Debug, Clone)]
pub struct Address {
    /// IP address and port; port 0 lets the system choose a free port.
    pub listen: SocketAddr,
    /// PEM files of the certificate chain and the private key; required unless the address is this machine's own.
    pub certificate: Option<(PathBuf, PathBuf)>,
    /// Host names that browsers may use, beside the address itself.
    pub hosts: Vec<String>,
}

impl Address {
    /// Checks that the pages can be served there safely.
    ///
    /// # Errors
    /// If the address is not this machine's own and there is no certificate, if a file of the certificate cannot be used, or
    /// if the address stands for all addresses and no host name is given.
    pub fn check(&self) -> Result<(), ConsoleError> {
        let ip = self.listen.ip();
        if !ip.is_loopback() && self.certificate.is_none() {
            return Err(ConsoleError::Plain(self.listen));
        }
        if ip.is_unspecified() && self.hosts.is_empty() {
            return Err(ConsoleError::Nameless(self.listen));
        }
        self.acceptor().map(|_| ())
    }

    /// The TLS acceptor, if there is a certificate.
    pub(super) fn acceptor(&self) -> Result<Option<TlsAcceptor>, ConsoleError> {
        self.certificate.as_ref().map(|(chain, key)| tls::acceptor(chain, key)).transpose()
    }
}
