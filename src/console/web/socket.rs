//! The web socket of a page: sends it what is shown, of a session or of a laboratory, and takes its messages.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use serde::Deserialize;
use serde_json::{Value, json};
use tokio::sync::watch;
use tokio::time::{sleep_until, timeout};

use super::super::controls::Request as OperatorRequest;
use super::super::snapshot::Snapshot;
use super::access_control::Role;
use super::content::{LaboratoryContent, PageContent, SessionContent};
use super::limits::{
    CLOSING_TIME, MESSAGES, PAGE_TIMEOUT, REQUEST_TIMEOUT, RateLimiter, UNACKNOWLEDGED_SNAPSHOTS,
};
use crate::dataset::ActionOrigin;

/// Shortest time between two snapshots for the operator's page.
const OPERATOR_PERIOD: Duration = Duration::from_millis(33);
/// Shortest time between two snapshots for the subject's page, well below the period of a screen.
const SUBJECT_PERIOD: Duration = Duration::from_millis(4);
/// Longest time between two messages about a laboratory, which the page acknowledges.
const LABORATORY_PERIOD: Duration = Duration::from_secs(2);

/// Number of snapshots whose sample time is kept until the page has drawn them.
const SAMPLE_TIMES: usize = 64;

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

/// Why a page is no longer served what it was.
enum Served {
    /// Something else is shown now.
    Changed,
    /// The socket is to be closed.
    Closed(Option<CloseReason>),
}

/// Connection to one page.
pub struct PageConnection {
    role: Role,
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
    /// A connection to a page of `role`.
    pub fn new(role: Role) -> Self {
        let now = Instant::now();
        let [burst, per_s] = MESSAGES[role as usize];
        Self {
            role,
            sent: 0,
            seen: 0,
            acknowledged_at: now,
            next_bin: 0,
            measured: VecDeque::with_capacity(SAMPLE_TIMES),
            messages: RateLimiter::new(burst, per_s, now),
            requests: RateLimiter::new(20.0, 10.0, now),
        }
    }

    /// Serves the page what is shown, until either side closes.
    pub async fn run(
        mut self,
        mut socket: WebSocket,
        mut shown: watch::Receiver<Arc<PageContent>>,
        stopped: watch::Receiver<bool>,
    ) {
        let closed = loop {
            let content = shown.borrow_and_update().clone();
            if self.role == Role::Operator {
                content.controls().joined(ActionOrigin::Page);
            }
            let ends = (&mut shown, stopped.clone());
            let served = match content.as_ref() {
                PageContent::Session(session) => {
                    self.serve_session(&mut socket, session, &content, ends).await
                }
                PageContent::Laboratory(laboratory) => {
                    self.serve_laboratory(&mut socket, laboratory, &content, ends).await
                }
            };
            if self.role == Role::Operator {
                content.controls().left(ActionOrigin::Page);
            }
            match served {
                Some(Served::Changed) => {}
                Some(Served::Closed(reason)) => break reason,
                None => break None,
            }
        };
        let (code, reason) = closed.unwrap_or((close_code::AWAY, "gone"));
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

    /// Serves the page a session until something else is shown or either side closes; `None` if the page is gone.
    async fn serve_session(
        &mut self,
        socket: &mut WebSocket,
        session: &SessionContent,
        content: &PageContent,
        (shown, mut stopped): (&mut watch::Receiver<Arc<PageContent>>, watch::Receiver<bool>),
    ) -> Option<Served> {
        let welcome = &session.welcome[usize::from(self.role == Role::Subject)];
        send(socket, welcome.to_string()).await?;
        (self.next_bin, self.measured) = (0, VecDeque::with_capacity(SAMPLE_TIMES));
        let (mut snapshot, mut history) = (session.views.snapshot(), session.views.history());
        let mut ramps = session.views.ramps();
        snapshot.mark_changed();
        history.mark_changed();
        ramps.mark_changed();
        let period = if self.role == Role::Operator { OPERATOR_PERIOD } else { SUBJECT_PERIOD };
        let mut due = tokio::time::Instant::now();
        loop {
            let may_send = self.may_send();
            let end = tokio::select! {
                biased;
                message = socket.recv() => {
                    if let Err(reason) = self.receive(message?.ok(), content) {
                        return Some(Served::Closed(reason));
                    }
                    continue;
                }
                () = until(&mut stopped) => Served::Closed(Some((close_code::NORMAL, "over"))),
                Ok(()) = shown.changed() => Served::Changed,
                _ = sleep_until(self.times_out_at()) => {
                    return Some(Served::Closed(Some((close_code::POLICY, "no answer"))));
                }
                Ok(()) = history.changed(), if may_send && self.role == Role::Operator => {
                    history.mark_unchanged();
                    self.send_shared(socket, &history).await?;
                    continue;
                }
                Ok(()) = snapshot.changed(), if may_send && due <= tokio::time::Instant::now() => {
                    let latest = snapshot.borrow_and_update().clone();
                    self.send_snapshot(socket, session, &latest).await?;
                    due = tokio::time::Instant::now() + period;
                    continue;
                }
                Ok(()) = ramps.changed(), if may_send && self.role == Role::Operator => {
                    ramps.mark_unchanged();
                    self.send_shared(socket, &ramps).await?;
                    continue;
                }
                _ = sleep_until(due), if may_send && due > tokio::time::Instant::now() => continue,
            };
            self.send_shared(socket, &history).await?;
            let last = snapshot.borrow().clone();
            self.send_snapshot(socket, session, &last).await?;
            return Some(end);
        }
    }

    /// Serves the page a laboratory until something else is shown or either side closes; `None` if the page is gone.
    async fn serve_laboratory(
        &mut self,
        socket: &mut WebSocket,
        laboratory: &LaboratoryContent,
        content: &PageContent,
        (shown, mut stopped): (&mut watch::Receiver<Arc<PageContent>>, watch::Receiver<bool>),
    ) -> Option<Served> {
        let mut views = laboratory.views.receiver();
        views.mark_changed();
        let mut due = tokio::time::Instant::now();
        loop {
            let may_send = self.may_send();
            tokio::select! {
                biased;
                message = socket.recv() => {
                    if let Err(reason) = self.receive(message?.ok(), content) {
                        return Some(Served::Closed(reason));
                    }
                    continue;
                }
                () = until(&mut stopped) => {
                    return Some(Served::Closed(Some((close_code::NORMAL, "over"))));
                }
                Ok(()) = shown.changed() => return Some(Served::Changed),
                _ = sleep_until(self.times_out_at()) => {
                    return Some(Served::Closed(Some((close_code::POLICY, "no answer"))));
                }
                Ok(()) = views.changed(), if may_send => {}
                _ = sleep_until(due), if may_send => {}
            }
            let view = match self.role {
                Role::Operator => views.borrow_and_update().as_ref().clone(),
                Role::Subject => Value::Null,
            };
            self.sent += 1;
            let message = json!({ "kind": "laboratory", "n": self.sent, "laboratory": view });
            send(socket, message.to_string()).await?;
            due = tokio::time::Instant::now() + LABORATORY_PERIOD;
        }
    }

    /// Whether the page has acknowledged enough of what it was sent.
    fn may_send(&self) -> bool {
        self.sent - self.seen < UNACKNOWLEDGED_SNAPSHOTS
    }

    /// When the page counts as gone, unless it acknowledges something before.
    fn times_out_at(&self) -> tokio::time::Instant {
        tokio::time::Instant::from_std(self.acknowledged_at + PAGE_TIMEOUT)
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

    async fn send_snapshot(
        &mut self,
        socket: &mut WebSocket,
        session: &SessionContent,
        snapshot: &Snapshot,
    ) -> Option<()> {
        self.sent += 1;
        let mut message = match self.role {
            Role::Subject => json!(snapshot.subject),
            Role::Operator => json!(snapshot),
        };
        message["kind"] = "now".into();
        message["n"] = self.sent.into();
        if self.role == Role::Operator {
            let (bins, next) = session.views.bins_since(self.next_bin);
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
    fn receive(
        &mut self,
        message: Option<Message>,
        content: &PageContent,
    ) -> Result<(), Option<CloseReason>> {
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
                if let (PageContent::Session(session), Some((_, Some(at)))) = (content, measured.next()) {
                    session.latencies.add(now.saturating_duration_since(*at));
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
                content.controls().request(request, ActionOrigin::Page);
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
