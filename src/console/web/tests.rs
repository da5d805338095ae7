//! The operator's way past pages that only look.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use super::{Address, PageContent, Role, Server, SessionContent};
use crate::console::command_questions::CommandQuestions;
use crate::console::controls::{Controls, Request};
use crate::console::display_latency::DisplayLatencies;
use crate::console::fitter::{Fitter, TrialFitContext};
use crate::console::step_feed::TimedStep;
use crate::console::view_model::ViewModel;
use crate::dataset::ActionOrigin;
use crate::fit::PreprocessingSettings;
use crate::protocol::ValidProtocol;
use crate::rig::Cue;
use crate::schedule;
use crate::session::{Event, Phase, Progress, RecordTarget, Settings, Step};

/// Longer than any machine takes; nothing is measured by it.
const FOREVER: Duration = Duration::from_secs(120);

/// Passes the operators' requests on to the test.
struct Heard(mpsc::Sender<Request>);

impl Controls for Heard {
    fn request(&self, request: Request, _: ActionOrigin) {
        self.0.send(request).unwrap();
    }
}

fn certificate(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/console").join(name)
}

/// A view of a session of which one sample was measured.
fn view() -> (ViewModel, crate::console::Views) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let protocol = ValidProtocol::read(&root.join("protocols/quick.json")).unwrap();
    let order = schedule::draw(&protocol, 1, None).unwrap();
    let settings = Arc::new(Settings::new(&protocol, 1, &order).unwrap());
    let fitter = Fitter::start(TrialFitContext {
        subject: "V00".to_owned(),
        sample_rate_hz: settings.sample_rate_hz,
        lever: None,
        recorded_filter: None,
        preprocessing: PreprocessingSettings::of(&protocol),
    });
    let progress = Progress::new(&settings);
    let (mut view, views) = ViewModel::new(settings, progress, fitter, CommandQuestions::default(), None);
    let step = Step {
        sample: 1,
        clock: None,
        measured: None,
        record: RecordTarget::None,
        transition: None,
        refused: None,
        phase: Phase::Rest,
        cue: Cue::Rest,
        target_rad: 0.0,
        feedback_torque_nm: 0.0,
        feedback_emg_mvc: [None; 2],
        gate_fraction: 0.0,
    };
    view.take(&TimedStep::now(&step));
    view.publish();
    (view, views)
}

/// A connection, encrypted or not.
trait Stream: Read + Write {}
impl<S: Read + Write> Stream for S {}

/// Opens the socket of a page.
fn live(server: &Server, role: Role) -> WebSocket<Box<dyn Stream>> {
    let url = server.url(role);
    let (scheme, rest) = url.split_once("://").unwrap();
    let (host, path) = rest.split_at(rest.find('/').unwrap());
    let tcp = TcpStream::connect(server.address()).unwrap();
    tcp.set_read_timeout(Some(FOREVER)).unwrap();
    let stream: Box<dyn Stream> = if scheme == "https" {
        let mut roots = RootCertStore::empty();
        roots.add(CertificateDer::from_pem_file(certificate("cert.pem")).unwrap()).unwrap();
        let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_root_certificates(roots)
            .with_no_client_auth();
        let name = ServerName::try_from("console.test").unwrap();
        Box::new(StreamOwned::new(ClientConnection::new(Arc::new(config), name).unwrap(), tcp))
    } else {
        Box::new(tcp)
    };
    let mut request = format!("ws://{host}{path}live").into_client_request().unwrap();
    request.headers_mut().insert("Origin", HeaderValue::from_str(&format!("{scheme}://{host}")).unwrap());
    match tungstenite::client(request, stream) {
        Ok((socket, _)) => socket,
        Err(error) => panic!("the page of the {} is not opened: {error}", role.name()),
    }
}

/// The next snapshot's number.
fn snapshot(page: &mut WebSocket<Box<dyn Stream>>) -> Value {
    loop {
        let message: Value = serde_json::from_str(page.read().unwrap().to_text().unwrap()).unwrap();
        if message["kind"] == "now" {
            return message["n"].clone();
        }
    }
}

/// On an encrypted address operators shared a thread with pages that only look.
#[test]
fn an_operator_is_heard_while_the_thread_of_the_looking_pages_serves_nobody() {
    let tls = (certificate("cert.pem"), certificate("key.pem"));
    for certificate in [None, Some(tls)] {
        let (_view, views) = view();
        let (requests, heard) = mpsc::channel();
        let latencies = DisplayLatencies::default();
        let content = PageContent::Session(SessionContent {
            welcome: [json!({ "kind": "hello" }), json!({ "kind": "hello" })],
            views,
            controls: Arc::new(Heard(requests)),
            latencies: latencies.clone(),
        });
        let hosts = certificate.iter().map(|_| "console.test".to_owned()).collect();
        let address = Address { listen: "127.0.0.1:0".parse().unwrap(), certificate, hosts };
        let server = Server::start(&address, content).unwrap();
        let mut early = live(&server, Role::Operator);
        let mut looking = live(&server, Role::Subject);
        let n = snapshot(&mut looking);
        // The thread of the looking pages waits, with this message in its hands, until the test lets it go.
        let held = latencies.hold();
        looking.send(Message::text(json!({ "drawn": n }).to_string())).unwrap();
        let mut also_looking: Vec<TcpStream> =
            (0..4).map(|_| TcpStream::connect(server.address()).unwrap()).collect();
        also_looking.iter_mut().for_each(|stream| stream.write_all(b"GET /subject/").unwrap());
        // A page that was open, and one that is opened now.
        let mut late = live(&server, Role::Operator);
        for page in [&mut early, &mut late] {
            page.send(Message::text(json!({ "word": { "word": "pause" } }).to_string())).unwrap();
            let said = Request::Command { command: Event::Pause, confirmed: false };
            assert_eq!(heard.recv_timeout(FOREVER), Ok(said), "{:?}", address.certificate);
        }
        drop(held);
        let begun = Instant::now();
        while latencies.summary().is_none() {
            assert!(begun.elapsed() < FOREVER, "the thread of the looking pages did not wait");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
