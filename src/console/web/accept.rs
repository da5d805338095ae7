//! The door: accepts connections, limited in number and time, encrypts them if there is a certificate, and hands each to the
//! thread that serves it. Operators have a thread of their own, which no page that only looks can keep busy.

use std::collections::VecDeque;
use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite};
use tokio::net::TcpStream;
use tokio::runtime::Handle;
use tokio::sync::watch;
use tokio::task::AbortHandle;
use tokio::time::timeout;

use super::access_control::AccessControl;
use super::limits::{CLOSING_TIME, CONNECTIONS, LONGEST_HEAD, REQUEST_TIMEOUT};
use super::metered::Metered;
use super::movable_stream::{Movable, MovableStream};
use super::tls::TlsAcceptor;

/// Pause after the system refused a connection, usually because too many files are open.
const REFUSED_PAUSE: Duration = Duration::from_millis(20);

/// A thread that serves connections.
#[derive(Debug, Clone)]
pub struct ServingThread {
    /// The thread's runtime.
    pub runtime: Handle,
    /// What it answers.
    pub router: Router,
}

/// What the door needs to decide where a connection goes.
#[derive(Clone)]
pub struct Door {
    /// Encryption, if there is a certificate.
    pub tls: Option<TlsAcceptor>,
    /// Knows the operator's token.
    pub access: Arc<AccessControl>,
    /// Serves connections that begin with the operator's token.
    pub operators: ServingThread,
    /// Serves all other connections.
    pub others: ServingThread,
}

impl Door {
    /// Accepts connections until `stopped`, then waits until the pages are closed.
    pub async fn serve(self, listener: TcpListener, mut stopped: watch::Receiver<bool>) {
        let listener = match tokio::net::TcpListener::from_std(listener) {
            Ok(listener) => listener,
            Err(error) => return tracing::error!("the console's address cannot be served: {error}"),
        };
        let mut open: VecDeque<AbortHandle> = VecDeque::new();
        loop {
            let accepted = tokio::select! {
                accepted = listener.accept() => accepted,
                _ = stopped.wait_for(|stopped| *stopped) => break,
            };
            let Ok((stream, _)) = accepted else {
                tokio::time::sleep(REFUSED_PAUSE).await;
                continue;
            };
            open.retain(|connection| !connection.is_finished());
            // At the limit the oldest connection is closed, so that a flood does not keep the operator out.
            if open.len() >= CONNECTIONS
                && let Some(oldest) = open.pop_front()
            {
                oldest.abort();
            }
            let door = self.clone();
            open.push_back(tokio::spawn(async move { door.let_in(stream).await }).abort_handle());
        }
        drop(listener);
        tokio::time::sleep(CLOSING_TIME).await;
    }

    async fn let_in(&self, stream: TcpStream) {
        // A snapshot is one small packet, which must not wait for the next one (Nagle's algorithm).
        if stream.set_nodelay(true).is_err() {
            return;
        }
        let stream = MovableStream::new(stream);
        match &self.tls {
            None => self.hand_over(stream).await,
            Some(tls) => {
                if let Ok(Ok(stream)) = timeout(REQUEST_TIMEOUT, tls.accept(stream)).await {
                    self.hand_over(stream).await;
                }
            }
        }
    }

    /// Hands a connection to the thread that serves it, and waits until it has been served.
    async fn hand_over<S>(&self, mut stream: S)
    where
        S: Movable + AsyncRead + AsyncWrite + Unpin + Send + 'static,
    {
        let Ok(Ok(begin)) = timeout(REQUEST_TIMEOUT, self.beginning(&mut stream)).await else { return };
        let thread = if self.access.is_operators_request(&begin) { &self.operators } else { &self.others };
        let router = thread.router.clone();
        let served = thread.runtime.spawn(async move {
            if stream.move_here().is_ok() {
                requests(Metered::new(stream, begin), router).await;
            }
        });
        // Ended together with this task.
        let _ended = AbortOnDrop(served.abort_handle());
        let _ = served.await;
    }

    /// The beginning of the first request, as far as it takes to see whose page it asks for.
    async fn beginning<S: AsyncRead + Unpin>(&self, stream: &mut S) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; self.access.operators_request().len()];
        let mut length = 0;
        while length < bytes.len() && !bytes[..length].contains(&b'\n') {
            match stream.read(&mut bytes[length..]).await? {
                0 => break,
                more => length += more,
            }
        }
        bytes.truncate(length);
        Ok(bytes)
    }
}

/// Ends a task when dropped.
struct AbortOnDrop(AbortHandle);

impl Drop for AbortOnDrop {
    fn drop(&mut self) {
        self.0.abort();
    }
}

async fn requests<S>(stream: Metered<S>, router: Router)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(REQUEST_TIMEOUT)
        .max_buf_size(LONGEST_HEAD)
        .max_headers(64)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router))
        .with_upgrades();
    // A connection that became a page's web socket has shown its token and continues in a task of its own.
    let _ = timeout(2 * REQUEST_TIMEOUT, served).await;
}
