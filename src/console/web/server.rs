//! The server of the pages.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use tokio::runtime::Runtime;
use tokio::sync::watch;

use super::super::error::ConsoleError;
use super::super::thread_priority::lower_thread_priority;
use super::accept::{Door, ServingThread};
use super::access_control::{AccessControl, Role, Tokens};
use super::address::Address;
use super::content::{PageContent, PageDisplay};
use super::limits::CLOSING_TIME;
use super::site::Site;

/// Addresses of the two pages. Whoever knows an address has its role.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PageAddresses {
    /// The operator's page.
    pub operator: String,
    /// The subject's page.
    pub subject: String,
}

/// Serves the pages until it is dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    scheme: &'static str,
    host: String,
    tokens: Tokens,
    display: PageDisplay,
    stop: watch::Sender<bool>,
    threads: Vec<JoinHandle<()>>,
}

impl Server {
    /// Listens on the address and starts the server's threads.
    ///
    /// # Errors
    /// If the address is not this machine's own and there is no certificate, if it is taken, or if a file cannot be read.
    pub fn start(address: &Address, content: PageContent) -> Result<Self, ConsoleError> {
        address.check()?;
        let listen = address.listen;
        let tls = address.acceptor()?;
        let bind = |source| ConsoleError::Bind { address: listen, source };
        let listener = TcpListener::bind(listen).map_err(bind)?;
        listener.set_nonblocking(true).map_err(bind)?;
        let bound = listener.local_addr().map_err(bind)?;
        let tokens = Tokens::draw()?;
        let scheme = if tls.is_some() { "https" } else { "http" };
        let access = AccessControl::new(tokens.clone(), scheme, bound, &address.hosts);
        let host = access.first_host().to_owned();
        let (stop, stopped) = watch::channel(false);
        let access = Arc::new(access);
        let (shown, content) = watch::channel(Arc::new(content));
        let site = Site::new(access.clone(), content, stopped.clone());
        let runtime = || {
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ConsoleError::Start)
        };
        let (door, operators, others) = (runtime()?, runtime()?, runtime()?);
        let serving = |runtime: &Runtime, role| ServingThread {
            runtime: runtime.handle().clone(),
            router: site.clone().router(role),
        };
        let connections = Door {
            tls,
            access,
            operators: serving(&operators, Role::Operator),
            others: serving(&others, Role::Subject),
        };
        let threads = vec![
            start_thread("console door", door, connections.serve(listener, stopped.clone()))?,
            start_thread("console operator", operators, closing_time(stopped.clone()))?,
            start_thread("console pages", others, closing_time(stopped))?,
        ];
        Ok(Self { address: bound, scheme, host, tokens, display: PageDisplay(shown), stop, threads })
    }

    /// Address on which the server listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Changes what the pages show.
    pub fn display(&self) -> PageDisplay {
        self.display.clone()
    }

    /// Addresses of the pages.
    pub fn pages(&self) -> PageAddresses {
        PageAddresses { operator: self.url(Role::Operator), subject: self.url(Role::Subject) }
    }

    /// Address of a role's page; whoever knows it has that role.
    pub fn url(&self, role: Role) -> String {
        format!("{}://{}/{}/{}/", self.scheme, self.host, role.name(), self.tokens.of(role))
    }
}

/// Waits until the server was stopped and the pages have had their time to close.
async fn closing_time(mut stopped: watch::Receiver<bool>) {
    // An error means that the server was dropped, which also stops it.
    let _ = stopped.wait_for(|stopped| *stopped).await;
    tokio::time::sleep(CLOSING_TIME).await;
}

/// Runs a task on a thread of its own, until it ends.
fn start_thread(
    name: &str,
    runtime: Runtime,
    task: impl Future<Output = ()> + Send + 'static,
) -> Result<JoinHandle<()>, ConsoleError> {
    let run = move || {
        lower_thread_priority();
        runtime.block_on(task);
        // Time for messages that are still being sent.
        runtime.shutdown_timeout(Duration::from_millis(100));
    };
    thread::Builder::new().name(name.to_owned()).spawn(run).map_err(ConsoleError::Start)
}

impl Drop for Server {
    /// Closes all pages.
    fn drop(&mut self) {
        self.stop.send_replace(true);
        for thread in self.threads.drain(..) {
            // If the thread panicked, there is nothing left to close.
            let _ = thread.join();
        }
    }
}
