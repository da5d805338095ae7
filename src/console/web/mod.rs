//! The pages, served to browsers on this machine or, with a certificate, on the laboratory's network.

mod accept;
mod access_control;
mod assets;
mod limits;
mod socket;
#[cfg(feature = "tls")]
mod tls;
#[cfg(not(feature = "tls"))]
#[path = "without_tls.rs"]
mod tls;

use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde_json::Value;
use tokio::sync::watch;

use super::{ConsoleError, Controls, DisplayLatencies, Views, nice};
use access_control::AccessControl;
pub use access_control::{Role, Tokens};

/// How long pages are given to take the last picture, when the program ends.
const FAREWELL: Duration = Duration::from_millis(800);

/// Where and to whom pages are served.
#[derive(Debug, Clone)]
pub struct Address {
    /// The address; port 0 lets the system choose one.
    pub listen: SocketAddr,
    /// Certificate chain and private key, PEM files; needed for any address but this machine's own.
    pub certificate: Option<(PathBuf, PathBuf)>,
    /// Names under which browsers may ask for it, beside the address itself.
    pub hosts: Vec<String>,
}

impl Address {
    /// Whether nobody else gets in there.
    ///
    /// # Errors
    /// If others could read along, a file of the certificate cannot be used, or a forged request could not be told from an honest one.
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

    fn acceptor(&self) -> Result<Option<tls::TlsAcceptor>, ConsoleError> {
        self.certificate.as_ref().map(|(chain, key)| tls::acceptor(chain, key)).transpose()
    }
}

/// What pages show and do.
pub struct Content {
    /// What does not change, for the two roles.
    pub hello: [Value; 2],
    /// What does.
    pub views: Views,
    /// What the operator's buttons do.
    pub controls: Arc<dyn Controls>,
    /// Where it is noted how long torque takes to the person's screen.
    pub screen: DisplayLatencies,
}

/// PageAddresses that are being served.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    scheme: &'static str,
    host: String,
    tokens: Tokens,
    stop: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Opens the address and starts to serve.
    ///
    /// # Errors
    /// If the address is not this machine's own and there is no certificate, if it is taken, or if a file cannot be read.
    pub fn start(address: &Address, content: Content) -> Result<Self, ConsoleError> {
        address.check()?;
        let listen = address.listen;
        let tls = address.acceptor()?;
        let bind = |source| ConsoleError::Bind { address: listen, source };
        let listener = TcpListener::bind(listen).map_err(bind)?;
        listener.set_nonblocking(true).map_err(bind)?;
        let bound = listener.local_addr().map_err(bind)?;
        let tokens = Tokens::draw()?;
        let scheme = if tls.is_some() { "https" } else { "http" };
        let guard = AccessControl::new(tokens.clone(), scheme, bound, &address.hosts);
        let host = guard.first_host().to_owned();
        let (stop, stopped) = watch::channel(false);
        let router = socket::router(Arc::new(guard), Arc::new(content), stopped.clone());
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(ConsoleError::Start)?;
        let serve = move || {
            nice();
            runtime.block_on(accept::serve(listener, tls, router, stopped));
            // What is still being sent is given a moment.
            runtime.shutdown_timeout(Duration::from_millis(100));
        };
        let thread =
            thread::Builder::new().name("console".to_owned()).spawn(serve).map_err(ConsoleError::Start)?;
        Ok(Self { address: bound, scheme, host, tokens, stop, thread: Some(thread) })
    }

    /// The address that is listened on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Where a role's page is; whoever knows this has that role.
    pub fn url(&self, role: Role) -> String {
        format!("{}://{}/{}/{}/", self.scheme, self.host, role.name(), self.tokens.of(role))
    }
}

impl Drop for Server {
    /// Says good-bye to all pages.
    fn drop(&mut self) {
        self.stop.send_replace(true);
        if let Some(thread) = self.thread.take() {
            // It has nothing to say that could still be of use.
            let _ = thread.join();
        }
    }
}
