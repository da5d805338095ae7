//! Other machines are let in with a certificate only.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};

use super::program::{Program, protocol};
use crate::workspace::PROGRAM;

fn file(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/console").join(name).display().to_string()
}

#[test]
fn an_address_that_others_reach_needs_a_certificate_and_a_name() {
    let folder = tempfile::tempdir().unwrap();
    let (cert, key) = (file("cert.pem"), file("key.pem"));
    for (arguments, wanted) in [
        (vec!["--listen", "0.0.0.0"], "--tls-cert"),
        (vec!["--listen", "::"], "--tls-cert"),
        (vec!["--listen", "0.0.0.0", "--tls-cert", &cert, "--tls-key", &key], "--host"),
        (vec!["--tls-cert", &cert], "--tls-key"),
        (vec!["--tls-cert", &key, "--tls-key", &key], "certificate"),
        (vec!["--tls-cert", &cert, "--tls-key", &cert], "private key"),
        (vec!["--tls-cert", "nowhere.pem", "--tls-key", &key], "nowhere.pem"),
    ] {
        let session = folder.path().join("session");
        let output = Command::new(PROGRAM)
            .arg("run")
            .arg(protocol(folder.path()))
            .args(["--console", "--out"])
            .arg(&session)
            .args(&arguments)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(wanted), "{arguments:?}: {said}");
        assert!(!session.exists(), "{arguments:?}: a session was begun");
    }
}

#[test]
fn with_a_certificate_the_pages_are_encrypted() {
    let program = Program::run(&[
        "--tls-cert",
        &file("cert.pem"),
        "--tls-key",
        &file("key.pem"),
        "--host",
        "console.test",
    ]);
    let page = &program.operator;
    let (name, port) = page.host.rsplit_once(':').unwrap();
    assert_eq!(name, "console.test");
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_file(file("cert.pem")).unwrap()).unwrap();
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let client =
        ClientConnection::new(Arc::new(config), ServerName::try_from("console.test").unwrap()).unwrap();
    let mut stream = StreamOwned::new(client, TcpStream::connect(format!("127.0.0.1:{port}")).unwrap());
    write!(stream, "GET {} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", page.path, page.host).unwrap();
    let mut answer = String::new();
    // Some ends of a connection are not said in so many words.
    let _ = stream.read_to_string(&mut answer);
    assert!(answer.starts_with("HTTP/1.1 200") && answer.contains("operator.js"), "{answer}");

    // Who speaks plainly gets nothing.
    let mut plain = TcpStream::connect(format!("127.0.0.1:{port}")).unwrap();
    // The line may be cut before all of it is said.
    let _ = write!(plain, "GET {} HTTP/1.1\r\nHost: {}\r\n\r\n", page.path, page.host);
    let mut answer = Vec::new();
    let _ = plain.read_to_end(&mut answer);
    assert!(!String::from_utf8_lossy(&answer).contains("HTTP/1.1 200"));
}
