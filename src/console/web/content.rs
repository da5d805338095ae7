//! What the pages show and do.

use std::sync::Arc;

use serde_json::Value;

use super::super::controls::Controls;
use super::super::display_latency::DisplayLatencies;
use super::super::view_model::Views;

/// What pages show and do.
pub struct PageContent {
    /// First messages for the operator's and the subject's page.
    pub welcome: [Value; 2],
    /// Snapshots, history and strip charts.
    pub views: Views,
    /// Receiver of the operators' requests.
    pub controls: Arc<dyn Controls>,
    /// Latencies of the subject's display.
    pub latencies: DisplayLatencies,
}
