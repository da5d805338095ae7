//! Encryption with a certificate, for addresses that others can reach.

use std::io;
use std::path::Path;
use std::sync::Arc;

pub use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::server::TlsStream;

use super::super::error::ConsoleError;
use super::movable_stream::{Movable, MovableStream};

impl Movable for TlsStream<MovableStream> {
    fn move_here(&mut self) -> io::Result<()> {
        self.get_mut().0.move_here()
    }
}

/// Reads certificate chain and private key from PEM files.
pub fn acceptor(chain: &Path, key: &Path) -> Result<TlsAcceptor, ConsoleError> {
    let wrong = |file: &Path, expected| {
        let file = file.to_owned();
        move |problem: String| ConsoleError::Certificate { file, problem, expected }
    };
    let bad_chain = wrong(chain, "a certificate chain");
    let certificates: Result<Vec<_>, _> =
        CertificateDer::pem_file_iter(chain).and_then(|certificates| certificates.collect());
    let certificates = match certificates {
        Ok(certificates) if !certificates.is_empty() => certificates,
        Ok(_) => return Err(bad_chain("contains no certificate".to_owned())),
        Err(error) => return Err(bad_chain(error.to_string())),
    };
    let bad_key = wrong(key, "the private key of the certificate");
    let private = match PrivateKeyDer::from_pem_file(key) {
        Ok(private) => private,
        Err(error) => return Err(bad_key(error.to_string())),
    };
    ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(certificates, private))
        .map(|config| TlsAcceptor::from(Arc::new(config)))
        .map_err(|error| bad_key(error.to_string()))
}
