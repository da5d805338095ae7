//! Connections: so many at a time, each for so long, encrypted where there is a certificate.

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

use super::FAREWELL;
use super::limits::{CONNECTIONS, LONGEST_HEAD, PATIENCE};
use super::tls::TlsAcceptor;

/// How long to wait after the system refused a connection: it has no room for another file just now.
const A_MOMENT: Duration = Duration::from_millis(20);

/// Serves until told to stop, and lets pages take leave.
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
            tokio::time::sleep(A_MOMENT).await;
            continue;
        };
        open.retain(|connection| !connection.is_finished());
        // More than anybody needs at once: the oldest makes room, so that a flood does not keep the operator out.
        if open.len() >= CONNECTIONS
            && let Some(oldest) = open.pop_front()
        {
            oldest.abort();
        }
        open.push_back(tokio::spawn(connection(stream, tls.clone(), router.clone())).abort_handle());
    }
    drop(listener);
    tokio::time::sleep(FAREWELL).await;
}

async fn connection(stream: TcpStream, tls: Option<TlsAcceptor>, router: Router) {
    // A picture is one small packet, and it must not wait for the next.
    if stream.set_nodelay(true).is_err() {
        return;
    }
    match tls {
        None => requests(stream, router).await,
        Some(tls) => {
            if let Ok(Ok(stream)) = tokio::time::timeout(PATIENCE, tls.accept(stream)).await {
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
        .header_read_timeout(PATIENCE)
        .max_buf_size(LONGEST_HEAD)
        .max_headers(64)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router))
        .with_upgrades();
    // A connection that did all it was asked to within its time ends by itself; one that became a page's socket lives on
    // elsewhere, and has shown its token.
    let _ = tokio::time::timeout(2 * PATIENCE, served).await;
}
