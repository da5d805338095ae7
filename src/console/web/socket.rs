//! Requests for the files of a page, and the web socket that sends it snapshots.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Body;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade, close_code};
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde::Deserialize;
use serde_json::json;
use tokio::sync::watch;
use tokio::time::{sleep_until, timeout};

use super::super::controls::Request as OperatorRequest;
use super::super::snapshot::Snapshot;
use super::access_control::{AccessControl, Role};
use super::assets;
use super::content::PageContent;
use super::limits::{
    CLOSING_TIME, LONGEST_MESSAGE, MESSAGES, PAGE_TIMEOUT, PAGES_PER_ROLE, REQUEST_TIMEOUT, RateLimiter,
    UNACKNOWLEDGED_SNAPSHOTS,
};
use crate::dataset::ActionOrigin;

/// Shortest time between two snapshots for the operator's page.
const OPERATOR_PERIOD: Duration = Duration::from_millis(33);
/// Shortest time between two snapshots for the subject's page, well below the period of a screen.
const SUBJECT_PERIOD: Duration = Duration::from_millis(4);

/// Number of snapshots whose sample time is kept until the page has drawn them.
const SAMPLE_TIMES: usize = 64;

/// Security headers of every response: no foreign content, no cache, no frames.
const SECURITY_HEADERS: [(header::HeaderName, &str); 7] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
    (header::HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (header::HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
];

/// What the pages are made of.
#[derive(Clone)]
pub struct Site {
    access: Arc<AccessControl>,
    content: Arc<PageContent>,
    stopped: watch::Receiver<bool>,
    /// Number of open pages of the operator and of the subject.
    pages: Arc<[AtomicUsize; 2]>,
    /// Role whose pages are kept open on this thread.
    thread_of: Role,
}

impl Site {
    /// Pages of `content` that are closed when `stopped`.
    pub fn new(
        access: Arc<AccessControl>,
        content: Arc<PageContent>,
        stopped: watch::Receiver<bool>,
    ) -> Self {
        Self { access, content, stopped, pages: Arc::default(), thread_of: Role::Subject }
    }

    /// The routes of the pages, on the thread that keeps those of `role` open.
    pub fn router(self, role: Role) -> Router {
        let site = Self { thread_of: role, ..self };
        Router::new()
            .route("/{role}/{token}/", get(page))
            .route("/{role}/{token}/live", get(live))
            .route("/{role}/{token}/{file}", get(asset))
            .fallback(async || StatusCode::FORBIDDEN)
            .layer(middleware::from_fn_with_state(site.clone(), check))
            .with_state(site)
    }
}

/// Refuses forged requests and adds the security headers to every response.
async fn check(State(site): State<Site>, request: Request, next: Next) -> Response {
    let mut response = match site.access.check_source(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(refusal) => (refusal.status(), refusal.to_string()).into_response(),
    };
    for (name, value) in SECURITY_HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn page(State(site): State<Site>, Path((role, token)): Path<(String, String)>) -> Response {
    match site.access.role(&role, &token) {
        Ok(role) => answer(&format!("{}.html", role.name())),
        Err(refusal) => (refusal.status(), refusal.to_string()).into_response(),
    }
}

async fn asset(
    State(site): State<Site>,
    Path((role, token, file)): Path<(String, String, String)>,
) -> Response {
    match site.access.role(&role, &token) {
        Ok(_) => answer(&file),
        Err(refusal) => (refusal.status(), refusal.to_string()).into_response(),
    }
}

fn answer(file: &str) -> Response {
    match assets::file(file) {
        Some((kind, bytes)) => ([(header::CONTENT_TYPE, kind)], Body::from(bytes)).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn live(
    State(site): State<Site>,
    Path((role, token)): Path<(String, String)>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let role = match site.access.role(&role, &token) {
        Ok(role) => role,
        Err(refusal) => return (refusal.status(), refusal.to_string()).into_response(),
    };
    if let Err(refusal) = site.access.check_socket(&headers) {
        return (refusal.status(), refusal.to_string()).into_response();
    }
    // A connection that began with another page's request. Browsers open a new one for each socket.
    if role != site.thread_of {
        return (StatusCode::MISDIRECTED_REQUEST, "open a new connection").into_response();
    }
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(rejection) => return rejection.into_response(),
    };
    let Some(slot) = PageSlot::take(&site.pages, role) else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages are open").into_response();
    };
    upgrade.max_message_size(LONGEST_MESSAGE).max_frame_size(LONGEST_MESSAGE).write_buffer_size(0).on_upgrade(
        move |socket| async move {
            let stopped = site.stopped.clone();
            PageConnection::new(role, site.content).run(socket, stopped).await;
            drop(slot);
        },
    )
}

/// One of the limited number of open pages of a role; free again when dropped.
struct PageSlot {
    pages: Arc<[AtomicUsize; 2]>,
    role: Role,
}

impl PageSlot {
    fn take(pages: &Arc<[AtomicUsize; 2]>, role: Role) -> Option<Self> {
        let slot = Self { pages: pages.clone(), role };
        let before = slot.pages[role as usize].fetch_add(1, Ordering::Relaxed);
        // A slot beyond the limit is freed when it is dropped.
        (before < PAGES_PER_ROLE).then_some(slot)
    }
}

impl Drop for PageSlot {
    fn drop(&mut self) {
        self.pages[self.role as usize].fetch_sub(1, Ordering::Relaxed);
    }
}

/// Message of a page.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum PageMessage {
    /// The page has received a snapshot.
    Seen(Seen),
    /// The page has drawn a snapshot.
    Drawn(Drawn),
    /// The operator asked for something.
    Request(OperatorRequest),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Seen {
    seen: u64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Drawn {
    drawn: u64,
}

/// Code and reason with which a page's socket is closed.
type CloseReason = (u16, &'static str);

/// Connection to one page.
struct PageConnection {
    role: Role,
    content: Arc<PageContent>,
    /// Number of the last snapshot sent, and of the last one acknowledged.
    sent: u64,
    seen: u64,
    acknowledged_at: Instant,
    next_bin: u64,
    /// Time of the sample of the latest snapshots, by number.
    measured: VecDeque<(u64, Option<Instant>)>,
    messages: RateLimiter,
    requests: RateLimiter,
}

impl PageConnection {
    fn new(role: Role, content: Arc<PageContent>) -> Self {
        let now = Instant::now();
        let [burst, per_s] = MESSAGES[role as usize];
        Self {
            role,
            content,
            sent: 0,
            seen: 0,
            acknowledged_at: now,
            next_bin: 0,
            measured: VecDeque::with_capacity(SAMPLE_TIMES),
            messages: RateLimiter::new(burst, per_s, now),
            requests: RateLimiter::new(20.0, 10.0, now),
        }
    }

    async fn run(mut self, mut socket: WebSocket, stopped: watch::Receiver<bool>) {
        if self.role == Role::Operator {
            self.content.controls.joined(ActionOrigin::Page);
        }
        let (code, reason) = self.serve(&mut socket, stopped).await.unwrap_or((close_code::AWAY, "gone"));
        if self.role == Role::Operator {
            self.content.controls.left(ActionOrigin::Page);
        }
        let close = Message::Close(Some(CloseFrame { code, reason: reason.into() }));
        // Messages of the page are read until it has closed: a socket that is closed with unread messages is reset, and the
        // page would lose the close reason. The page may also be gone already.
        let closing = async {
            let mut open = socket.send(close).await.is_ok();
            while open {
                open = matches!(socket.recv().await, Some(Ok(_)));
            }
        };
        let _ = timeout(CLOSING_TIME / 2, closing).await;
    }

    /// Serves the page until either side closes; returns the reason for the page, where one is known.
    async fn serve(
        &mut self,
        socket: &mut WebSocket,
        mut stopped: watch::Receiver<bool>,
    ) -> Option<CloseReason> {
        let content = self.content.clone();
        let welcome = &content.welcome[usize::from(self.role == Role::Subject)];
        send(socket, welcome.to_string()).await?;
        let (mut snapshot, mut history) = (content.views.snapshot(), content.views.history());
        let mut ramps = content.views.ramps();
        snapshot.mark_changed();
        history.mark_changed();
        ramps.mark_changed();
        let period = if self.role == Role::Operator { OPERATOR_PERIOD } else { SUBJECT_PERIOD };
        let mut due = tokio::time::Instant::now();
        loop {
            let may_send = self.sent - self.seen < UNACKNOWLEDGED_SNAPSHOTS;
            tokio::select! {
                biased;
                message = socket.recv() => {
                    if let Err(reason) = self.receive(message?.ok()) {
                        return reason;
                    }
                }
                () = until(&mut stopped) => {
                    self.send_shared(socket, &history).await?;
                    let last = snapshot.borrow().clone();
                    self.send_snapshot(socket, &last).await?;
                    return Some((close_code::NORMAL, "over"));
                }
                _ = sleep_until(tokio::time::Instant::from_std(self.acknowledged_at + PAGE_TIMEOUT)) => {
                    return Some((close_code::POLICY, "no answer"));
                }
                Ok(()) = history.changed(), if may_send && self.role == Role::Operator => {
                    history.mark_unchanged();
                    self.send_shared(socket, &history).await?;
                }
                Ok(()) = snapshot.changed(), if may_send && due <= tokio::time::Instant::now() => {
                    let latest = snapshot.borrow_and_update().clone();
                    self.send_snapshot(socket, &latest).await?;
                    due = tokio::time::Instant::now() + period;
                }
                Ok(()) = ramps.changed(), if may_send && self.role == Role::Operator => {
                    ramps.mark_unchanged();
                    self.send_shared(socket, &ramps).await?;
                }
                _ = sleep_until(due), if may_send && due > tokio::time::Instant::now() => {}
            }
        }
    }

    /// Sends what all operators' pages get alike.
    async fn send_shared(
        &mut self,
        socket: &mut WebSocket,
        message: &watch::Receiver<Arc<str>>,
    ) -> Option<()> {
        if self.role == Role::Subject {
            return Some(());
        }
        let text = message.borrow().to_string();
        send(socket, text).await
    }

    async fn send_snapshot(&mut self, socket: &mut WebSocket, snapshot: &Snapshot) -> Option<()> {
        self.sent += 1;
        let mut message = match self.role {
            Role::Subject => json!(snapshot.subject),
            Role::Operator => json!(snapshot),
        };
        message["kind"] = "now".into();
        message["n"] = self.sent.into();
        if self.role == Role::Operator {
            let (bins, next) = self.content.views.bins_since(self.next_bin);
            self.next_bin = next;
            message["bins"] = json!(bins);
        }
        if self.measured.len() == SAMPLE_TIMES {
            self.measured.pop_front();
        }
        self.measured.push_back((self.sent, snapshot.measured));
        send(socket, message.to_string()).await
    }

    /// Takes a message of the page; an error closes the socket.
    fn receive(&mut self, message: Option<Message>) -> Result<(), Option<CloseReason>> {
        let now = Instant::now();
        if !self.messages.allows(now) {
            return Err(Some((close_code::POLICY, "too many messages")));
        }
        let text = match message {
            Some(Message::Text(text)) => text,
            Some(Message::Ping(_) | Message::Pong(_)) => return Ok(()),
            Some(Message::Close(_)) => return Err(None),
            Some(Message::Binary(_)) => return Err(Some((close_code::UNSUPPORTED, "text only"))),
            // Not a frame, or a frame that is too long.
            None => return Err(Some((close_code::PROTOCOL, "malformed or too long"))),
        };
        match serde_json::from_str::<PageMessage>(&text) {
            Ok(PageMessage::Seen(Seen { seen })) if seen <= self.sent => {
                self.seen = self.seen.max(seen);
                self.acknowledged_at = now;
                Ok(())
            }
            Ok(PageMessage::Drawn(Drawn { drawn })) if drawn <= self.sent && self.role == Role::Subject => {
                let mut measured = self.measured.iter().filter(|(n, _)| *n == drawn);
                if let Some((_, Some(at))) = measured.next() {
                    self.content.latencies.add(now.saturating_duration_since(*at));
                }
                Ok(())
            }
            Ok(PageMessage::Request(_)) if self.role == Role::Subject => {
                Err(Some((close_code::POLICY, "the subject's page gives no commands")))
            }
            Ok(PageMessage::Request(_)) if !self.requests.allows(now) => {
                Err(Some((close_code::POLICY, "too many requests")))
            }
            Ok(PageMessage::Request(request)) => {
                self.content.controls.request(request, ActionOrigin::Page);
                Ok(())
            }
            Ok(PageMessage::Seen(_) | PageMessage::Drawn(_)) | Err(_) => {
                Err(Some((close_code::INVALID, "not understood")))
            }
        }
    }
}

/// Waits until the server stops.
async fn until(stopped: &mut watch::Receiver<bool>) {
    // An error means that the server was dropped, which also stops it.
    let _ = stopped.wait_for(|stopped| *stopped).await;
}

/// Sends text; `None` if the page does not receive it in time.
async fn send(socket: &mut WebSocket, text: String) -> Option<()> {
    timeout(REQUEST_TIMEOUT, socket.send(Message::Text(text.into()))).await.ok()?.ok()
}
