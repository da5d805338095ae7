//! What the pages show and do, and how that changes while they are open.

use std::sync::Arc;

use serde_json::Value;
use tokio::sync::watch;

use super::super::controls::Controls;
use super::super::display_latency::DisplayLatencies;
use super::super::laboratory_view::LaboratoryViews;
use super::super::view_model::Views;

/// What pages show and do.
pub enum PageContent {
    /// A session that runs or is played.
    Session(SessionContent),
    /// A laboratory in which no session runs.
    Laboratory(LaboratoryContent),
}

/// What pages show and do of a session.
pub struct SessionContent {
    /// First messages for the operator's and the subject's page.
    pub welcome: [Value; 2],
    /// Snapshots, history and strip charts.
    pub views: Views,
    /// Receiver of the operators' requests.
    pub controls: Arc<dyn Controls>,
    /// Latencies of the subject's display.
    pub latencies: DisplayLatencies,
}

/// What pages show and do of a laboratory. The subject's page shows that nothing has begun.
pub struct LaboratoryContent {
    /// What the operator's page shows.
    pub views: LaboratoryViews,
    /// Receiver of the operators' requests.
    pub controls: Arc<dyn Controls>,
}

/// Changes what the open pages of a server show. Clones change the same pages.
#[derive(Clone)]
pub struct PageDisplay(pub(super) watch::Sender<Arc<PageContent>>);

impl std::fmt::Debug for PageDisplay {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("PageDisplay(..)")
    }
}

impl PageDisplay {
    /// Shows `content` in all pages, after the last of what they show now.
    pub fn show(&self, content: PageContent) {
        self.0.send_replace(Arc::new(content));
    }
}

impl PageContent {
    /// Receiver of the operators' requests.
    pub(super) fn controls(&self) -> &dyn Controls {
        match self {
            Self::Session(session) => session.controls.as_ref(),
            Self::Laboratory(laboratory) => laboratory.controls.as_ref(),
        }
    }
}
