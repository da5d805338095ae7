//! Requests for the files of a page and for its web socket: who may have what.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use axum::Router;
use axum::body::Body;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::watch;

use super::access_control::{AccessControl, Role};
use super::assets;
use super::content::PageContent;
use super::limits::{LONGEST_MESSAGE, PAGES_PER_ROLE};
use super::socket::PageConnection;

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
    content: watch::Receiver<Arc<PageContent>>,
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
        content: watch::Receiver<Arc<PageContent>>,
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
            PageConnection::new(role).run(socket, site.content, stopped).await;
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
