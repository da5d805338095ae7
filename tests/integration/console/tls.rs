//! Other machines are let in with a certificate only.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use super::program::{Page, Program, protocol};
use crate::workspace::{FOREVER, PROGRAM};

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

type TlsStream = StreamOwned<ClientConnection, TcpStream>;

/// A program whose pages are encrypted.
fn encrypted(arguments: &[&str]) -> Program {
    let (cert, key) = (file("cert.pem"), file("key.pem"));
    let own = ["--tls-cert", &cert, "--tls-key", &key, "--host", "console.test"];
    Program::run(&[&own, arguments].concat())
}

/// An encrypted connection to a page.
fn connect(page: &Page) -> std::io::Result<TlsStream> {
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
    let stream = TcpStream::connect(format!("127.0.0.1:{port}"))?;
    stream.set_read_timeout(Some(FOREVER))?;
    Ok(StreamOwned::new(client, stream))
}

/// The socket of a page; `None` if it is not opened, as in a flood.
fn live(page: &Page) -> Option<WebSocket<TlsStream>> {
    let mut request = format!("ws://{}{}live", page.host, page.path).into_client_request().unwrap();
    let origin = HeaderValue::from_str(&format!("https://{}", page.host)).unwrap();
    request.headers_mut().insert("Origin", origin);
    Some(tungstenite::client(request, connect(page).ok()?).ok()?.0)
}

/// Reads and answers as a page does, until the session is in a phase.
fn phase(page: &mut WebSocket<TlsStream>, wanted: &str) {
    loop {
        let message: Value = serde_json::from_str(page.read().unwrap().to_text().unwrap()).unwrap();
        if message["kind"] == "now" {
            page.send(Message::text(json!({ "seen": message["n"] }).to_string())).unwrap();
            if message["phase"] == wanted {
                return;
            }
        }
    }
}

#[test]
fn with_a_certificate_the_pages_are_encrypted() {
    let program = encrypted(&[]);
    let page = &program.operator;
    let mut stream = connect(page).unwrap();
    write!(stream, "GET {} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", page.path, page.host).unwrap();
    let mut answer = String::new();
    // Some ends of a connection are not said in so many words.
    let _ = stream.read_to_string(&mut answer);
    assert!(answer.starts_with("HTTP/1.1 200") && answer.contains("operator.js"), "{answer}");

    // Who speaks plainly gets nothing.
    let port = page.host.rsplit_once(':').unwrap().1;
    let mut plain = TcpStream::connect(format!("127.0.0.1:{port}")).unwrap();
    // The line may be cut before all of it is said.
    let _ = write!(plain, "GET {} HTTP/1.1\r\nHost: {}\r\n\r\n", page.path, page.host);
    let mut answer = Vec::new();
    let _ = plain.read_to_end(&mut answer);
    assert!(!String::from_utf8_lossy(&answer).contains("HTTP/1.1 200"));
}

/// Pages that look send messages that never end, and too many of them, and come again when they are sent away: all of it until
/// after the operator's pause has come through, on a page that was open before and on one that is opened meanwhile.
#[test]
fn looking_pages_that_flood_the_console_do_not_keep_the_operator_from_pausing() {
    let program = encrypted(&["--speed", "1"]);
    let mut operator = live(&program.operator).unwrap();
    let word = |word: &str| Message::text(json!({ "word": { "word": word, "sure": true } }).to_string());
    operator.send(word("start")).unwrap();
    phase(&mut operator, "rest");
    let (is_over, floods) = (AtomicBool::new(false), AtomicUsize::new(0));
    let flood = |frames: &[u8]| {
        while !is_over.load(Ordering::Relaxed) {
            let Some(mut page) = live(&program.subject) else { continue };
            while page.get_mut().write_all(frames).is_ok() && !is_over.load(Ordering::Relaxed) {}
            floods.fetch_add(1, Ordering::Relaxed);
        }
    };
    // Masked frames of text without any bytes: the first one begins a message, the others go on with it.
    let mut unfinished = vec![0x01, 0x80, 1, 2, 3, 4];
    unfinished.extend([0x00, 0x80, 1, 2, 3, 4].repeat(1000));
    // Whole messages, each the number 1.
    let messages = [0x81, 0x81, 0, 0, 0, 0, b'1'].repeat(1000);
    thread::scope(|scope| {
        for number in 0..6 {
            let frames = if number % 2 == 0 { &unfinished } else { &messages };
            scope.spawn(|| flood(frames));
        }
        let paused = thread::Builder::new().spawn_scoped(scope, || {
            while floods.load(Ordering::Relaxed) < 6 {
                thread::yield_now();
            }
            let mut late = live(&program.operator).expect("a page can be opened in the flood");
            operator.send(word("pause")).unwrap();
            phase(&mut operator, "paused");
            late.send(word("resume")).unwrap();
            phase(&mut late, "rest");
        });
        let paused = paused.unwrap().join();
        // Only now.
        is_over.store(true, Ordering::Relaxed);
        paused.expect("the operator came through");
    });
}
