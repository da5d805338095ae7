//! Connections: limited in number and time, encrypted if there is a certificate.

use std::collections::VecDeque;
use std::net::TcpListener;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::runtime::Handle;
use tokio::sync::watch;
use tokio::task::AbortHandle;

use super::limits::{CLOSING_TIME, CONNECTIONS, LONGEST_HEAD, REQUEST_TIMEOUT};
use super::metered::Metered;
use super::tls::TlsAcceptor;

/// Pause after the system refused a connection, usually because too many files are open.
const REFUSED_PAUSE: Duration = Duration::from_millis(20);

/// Serves until `stopped`, then waits until the pages are closed.
pub async fn serve(
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
    router: Router,
    operators: Handle,
    mut stopped: watch::Receiver<bool>,
) {
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
        let connection = connection(stream, tls.clone(), router.clone(), operators.clone());
        open.push_back(tokio::spawn(connection).abort_handle());
    }
    drop(listener);
    tokio::time::sleep(CLOSING_TIME).await;
}

async fn connection(stream: TcpStream, tls: Option<TlsAcceptor>, router: Router, operators: Handle) {
    // A snapshot is one small packet, which must not wait for the next one (Nagle's algorithm).
    if stream.set_nodelay(true).is_err() {
        return;
    }
    match tls {
        None if begins_as_operator(&stream).await => {
            let Ok(stream) = stream.into_std() else { return };
            let served = operators.spawn(async move {
                if let Ok(stream) = TcpStream::from_std(stream) {
                    requests(stream, router).await;
                }
            });
            // Ended together with this task.
            let _ended = AbortOnDrop(served.abort_handle());
            let _ = served.await;
        }
        None => requests(stream, router).await,
        Some(tls) => {
            if let Ok(Ok(stream)) = tokio::time::timeout(REQUEST_TIMEOUT, tls.accept(stream)).await {
                requests(stream, router).await;
            }
        }
    }
}

/// Whether a connection begins by asking for the operator's page. It is served on a thread of its own then, which no page
/// that only looks can keep busy; the token is checked there. An encrypted connection does not show what it asks for.
async fn begins_as_operator(stream: &TcpStream) -> bool {
    const BEGINNING: &[u8] = b"GET /operator/";
    let mut begin = [0; BEGINNING.len()];
    let peeked = tokio::time::timeout(REQUEST_TIMEOUT, stream.peek(&mut begin)).await;
    matches!(peeked, Ok(Ok(_))) && begin == BEGINNING
}

/// Ends a task when dropped.
struct AbortOnDrop(AbortHandle);

impl Drop for AbortOnDrop {
    fn drop(&mut self) {
        self.0.abort();
    }
}

async fn requests<S>(stream: S, router: Router)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(REQUEST_TIMEOUT)
        .max_buf_size(LONGEST_HEAD)
        .max_headers(64)
        .serve_connection(TokioIo::new(Metered::new(stream)), TowerToHyperService::new(router))
        .with_upgrades();
    // A connection that became a page's web socket has shown its token and continues in a task of its own.
    let _ = tokio::time::timeout(2 * REQUEST_TIMEOUT, served).await;
}
