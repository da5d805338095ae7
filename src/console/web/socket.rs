//! Requests and sockets: the files of a page, and the pictures that it draws.

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

use super::access_control::{AccessControl, Role};
use super::assets;
use super::limits::{LONGEST_MESSAGE, ON_THE_WAY, PAGES, PATIENCE, Rate, SILENCE};
use super::{Content, FAREWELL};
use crate::console::{Request as OperatorRequest, Snapshot};
use crate::dataset::ActionOrigin;

/// Time between two pictures for the operator, whose charts need no more.
const OPERATORS_PERIOD: Duration = Duration::from_millis(33);
/// The same for the person, who follows a bar: well below a screen's own period.
const PERSONS_PERIOD: Duration = Duration::from_millis(4);

/// Pictures that the time of their sample is remembered of, until the page says that they were drawn.
const REMEMBERED: usize = 64;

/// What every answer says to the browser: nothing from elsewhere, nothing kept, nowhere framed.
const HEADERS: [(header::HeaderName, &str); 7] = [
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

#[derive(Clone)]
struct Site {
    guard: Arc<AccessControl>,
    content: Arc<Content>,
    stopped: watch::Receiver<bool>,
    /// PageAddresses open: operators', persons'.
    pages: Arc<[AtomicUsize; 2]>,
}

/// All there is to ask for.
pub fn router(guard: Arc<AccessControl>, content: Arc<Content>, stopped: watch::Receiver<bool>) -> Router {
    let site = Site { guard, content, stopped, pages: Arc::default() };
    Router::new()
        .route("/{role}/{token}/", get(page))
        .route("/{role}/{token}/live", get(live))
        .route("/{role}/{token}/{file}", get(asset))
        .fallback(async || StatusCode::FORBIDDEN)
        .layer(middleware::from_fn_with_state(site.clone(), check))
        .with_state(site)
}

/// Before anything else: was it meant for us? And what the browser must keep to with every answer, refusals included.
async fn check(State(site): State<Site>, request: Request, next: Next) -> Response {
    let mut response = match site.guard.check_source(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(refusal) => (refusal.status(), refusal.to_string()).into_response(),
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn page(State(site): State<Site>, Path((role, token)): Path<(String, String)>) -> Response {
    match site.guard.role(&role, &token) {
        Ok(role) => answer(&format!("{}.html", role.name())),
        Err(refusal) => (refusal.status(), refusal.to_string()).into_response(),
    }
}

async fn asset(
    State(site): State<Site>,
    Path((role, token, file)): Path<(String, String, String)>,
) -> Response {
    match site.guard.role(&role, &token) {
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
    let role = match site.guard.role(&role, &token) {
        Ok(role) => role,
        Err(refusal) => return (refusal.status(), refusal.to_string()).into_response(),
    };
    if let Err(refusal) = site.guard.check_socket(&headers) {
        return (refusal.status(), refusal.to_string()).into_response();
    }
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(rejection) => return rejection.into_response(),
    };
    let Some(place) = PageSlot::take(&site.pages, role) else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages are open").into_response();
    };
    upgrade.max_message_size(LONGEST_MESSAGE).max_frame_size(LONGEST_MESSAGE).write_buffer_size(0).on_upgrade(
        move |socket| async move {
            let stopped = site.stopped.clone();
            PageConnection::new(role, site.content).run(socket, stopped).await;
            drop(place);
        },
    )
}

/// A place among the pages of a role.
struct PageSlot {
    pages: Arc<[AtomicUsize; 2]>,
    role: Role,
}

impl PageSlot {
    fn take(pages: &Arc<[AtomicUsize; 2]>, role: Role) -> Option<Self> {
        let seat = Self { pages: pages.clone(), role };
        let before = seat.pages[role as usize].fetch_add(1, Ordering::Relaxed);
        // One too many gives its place back as it is dropped.
        (before < PAGES).then_some(seat)
    }
}

impl Drop for PageSlot {
    fn drop(&mut self) {
        self.pages[self.role as usize].fetch_sub(1, Ordering::Relaxed);
    }
}

/// What a page sends.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum PageMessage {
    /// It has taken the picture of that number.
    Seen(Seen),
    /// It has drawn it.
    Drawn(Drawn),
    /// The operator pressed something.
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

/// Why a page's socket is closed.
type Why = (u16, &'static str);

/// A page that looks on.
struct PageConnection {
    role: Role,
    content: Arc<Content>,
    /// Number of the last picture sent, and of the last that the page has taken.
    sent: u64,
    seen: u64,
    heard: Instant,
    next_bin: u64,
    /// When the latest pictures' samples were measured, by their number.
    measured: VecDeque<(u64, Option<Instant>)>,
    messages: Rate,
    requests: Rate,
}

impl PageConnection {
    fn new(role: Role, content: Arc<Content>) -> Self {
        let now = Instant::now();
        Self {
            role,
            content,
            sent: 0,
            seen: 0,
            heard: now,
            next_bin: 0,
            measured: VecDeque::with_capacity(REMEMBERED),
            messages: Rate::new(1200.0, 600.0, now),
            requests: Rate::new(20.0, 10.0, now),
        }
    }

    async fn run(mut self, mut socket: WebSocket, stopped: watch::Receiver<bool>) {
        if self.role == Role::Operator {
            self.content.controls.joined(ActionOrigin::Page);
        }
        let (code, reason) = self.look_on(&mut socket, stopped).await.unwrap_or((close_code::AWAY, "gone"));
        if self.role == Role::Operator {
            self.content.controls.left(ActionOrigin::Page);
        }
        let farewell = Message::Close(Some(CloseFrame { code, reason: reason.into() }));
        // What the page still says is read until it, too, has closed: a socket shut on unread words is reset, and the page
        // would lose the farewell on its way. It may also be gone already.
        let part = async {
            let mut open = socket.send(farewell).await.is_ok();
            while open {
                open = matches!(socket.recv().await, Some(Ok(_)));
            }
        };
        let _ = timeout(FAREWELL / 2, part).await;
    }

    /// Until either side has enough; why, if it is to be told.
    async fn look_on(&mut self, socket: &mut WebSocket, mut stopped: watch::Receiver<bool>) -> Option<Why> {
        let content = self.content.clone();
        let hello = &content.hello[usize::from(self.role == Role::Person)];
        send(socket, hello.to_string()).await?;
        let (mut now, mut story) = (content.views.now(), content.views.story());
        now.mark_changed();
        story.mark_changed();
        let period = if self.role == Role::Operator { OPERATORS_PERIOD } else { PERSONS_PERIOD };
        let mut due = tokio::time::Instant::now();
        loop {
            let may_send = self.sent - self.seen < ON_THE_WAY;
            tokio::select! {
                biased;
                message = socket.recv() => {
                    if let Err(why) = self.hear(message?.ok()) {
                        return why;
                    }
                }
                () = until(&mut stopped) => {
                    self.send_story(socket, &story).await?;
                    let last = now.borrow().clone();
                    self.send_picture(socket, &last).await?;
                    return Some((close_code::NORMAL, "over"));
                }
                _ = sleep_until(tokio::time::Instant::from_std(self.heard + SILENCE)) => {
                    return Some((close_code::POLICY, "no answer"));
                }
                Ok(()) = story.changed(), if may_send && self.role == Role::Operator => {
                    story.mark_unchanged();
                    self.send_story(socket, &story).await?;
                }
                Ok(()) = now.changed(), if may_send && due <= tokio::time::Instant::now() => {
                    let latest = now.borrow_and_update().clone();
                    self.send_picture(socket, &latest).await?;
                    due = tokio::time::Instant::now() + period;
                }
                _ = sleep_until(due), if may_send && due > tokio::time::Instant::now() => {}
            }
        }
    }

    async fn send_story(&mut self, socket: &mut WebSocket, story: &watch::Receiver<Arc<str>>) -> Option<()> {
        if self.role == Role::Person {
            return Some(());
        }
        let text = story.borrow().to_string();
        send(socket, text).await
    }

    async fn send_picture(&mut self, socket: &mut WebSocket, now: &Snapshot) -> Option<()> {
        self.sent += 1;
        let mut picture = match self.role {
            Role::Person => json!(now.shown),
            Role::Operator => json!(now),
        };
        picture["kind"] = "now".into();
        picture["n"] = self.sent.into();
        if self.role == Role::Operator {
            let (bins, next) = self.content.views.bins_since(self.next_bin);
            self.next_bin = next;
            picture["bins"] = json!(bins);
        }
        if self.measured.len() == REMEMBERED {
            self.measured.pop_front();
        }
        self.measured.push_back((self.sent, now.measured));
        send(socket, picture.to_string()).await
    }

    /// Takes a message in; an error ends the socket.
    fn hear(&mut self, message: Option<Message>) -> Result<(), Option<Why>> {
        let now = Instant::now();
        if !self.messages.allows(now) {
            return Err(Some((close_code::POLICY, "too many messages")));
        }
        let text = match message {
            Some(Message::Text(text)) => text,
            Some(Message::Ping(_) | Message::Pong(_)) => return Ok(()),
            Some(Message::Close(_)) => return Err(None),
            Some(Message::Binary(_)) => return Err(Some((close_code::UNSUPPORTED, "text only"))),
            // Not a frame, or one that is too long.
            None => return Err(Some((close_code::PROTOCOL, "malformed or too long"))),
        };
        match serde_json::from_str::<PageMessage>(&text) {
            Ok(PageMessage::Seen(Seen { seen })) if seen <= self.sent => {
                self.seen = self.seen.max(seen);
                self.heard = now;
                Ok(())
            }
            Ok(PageMessage::Drawn(Drawn { drawn })) if drawn <= self.sent && self.role == Role::Person => {
                let mut measured = self.measured.iter().filter(|(n, _)| *n == drawn);
                if let Some((_, Some(at))) = measured.next() {
                    self.content.screen.add(now.saturating_duration_since(*at));
                }
                Ok(())
            }
            Ok(PageMessage::Request(_)) if self.role == Role::Person => {
                Err(Some((close_code::POLICY, "this page can only look")))
            }
            Ok(PageMessage::Request(_)) if !self.requests.allows(now) => {
                Err(Some((close_code::POLICY, "too many requests")))
            }
            Ok(PageMessage::Request(asked)) => {
                self.content.controls.hear(asked, ActionOrigin::Page);
                Ok(())
            }
            Ok(PageMessage::Seen(_) | PageMessage::Drawn(_)) | Err(_) => {
                Err(Some((close_code::INVALID, "not understood")))
            }
        }
    }
}

/// Waits for the end of the program.
async fn until(stopped: &mut watch::Receiver<bool>) {
    // A server that is gone has stopped, too.
    let _ = stopped.wait_for(|stopped| *stopped).await;
}

/// Sends text; `None` if the page does not take it.
async fn send(socket: &mut WebSocket, text: String) -> Option<()> {
    timeout(PATIENCE, socket.send(Message::Text(text.into()))).await.ok()?.ok()
}
