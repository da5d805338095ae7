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
use tokio::sync::watch;
use tokio::task::AbortHandle;

use super::limits::{CLOSING_TIME, CONNECTIONS, LONGEST_HEAD, REQUEST_TIMEOUT};
use super::tls::TlsAcceptor;

/// Pause after the system refused a connection, usually because too many files are open.
const REFUSED_PAUSE: Duration = Duration::from_millis(20);

/// Serves until `stopped`, then waits until the pages are closed.
pub async fn serve(
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
    router: Router,
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
        open.push_back(tokio::spawn(connection(stream, tls.clone(), router.clone())).abort_handle());
    }
    drop(listener);
    tokio::time::sleep(CLOSING_TIME).await;
}

async fn connection(stream: TcpStream, tls: Option<TlsAcceptor>, router: Router) {
    // A snapshot is one small packet, which must not wait for the next one (Nagle's algorithm).
    if stream.set_nodelay(true).is_err() {
        return;
    }
    match tls {
        None => requests(stream, router).await,
        Some(tls) => {
            if let Ok(Ok(stream)) = tokio::time::timeout(REQUEST_TIMEOUT, tls.accept(stream)).await {
                requests(stream, router).await;
            }
        }
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
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router))
        .with_upgrades();
    // A connection that became a page's web socket has shown its token and continues in a task of its own.
    let _ = tokio::time::timeout(2 * REQUEST_TIMEOUT, served).await;
}
