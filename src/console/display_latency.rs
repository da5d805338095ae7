//! Latency of the subject's display: from the sample to the message of the page that it has drawn the sample.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde::Serialize;

/// Number of snapshots in the statistics: about half a minute.
const LATENCIES_KEPT: usize = 2000;

/// Latencies of the latest snapshots. Clones share them.
#[derive(Debug, Clone, Default)]
pub struct DisplayLatencies(Arc<Mutex<VecDeque<Duration>>>);

/// Statistics of the latencies of the latest snapshots.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DisplayLatency {
    /// Number of snapshots.
    #[serde(rename = "pictures")]
    pub snapshots: usize,
    /// Median, ms.
    pub p50_ms: f64,
    /// 99th percentile, ms.
    pub p99_ms: f64,
    /// Maximum, ms.
    pub longest_ms: f64,
}

impl DisplayLatencies {
    /// Adds the latency of a snapshot.
    pub fn add(&self, latency: Duration) {
        let mut times = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if times.len() == LATENCIES_KEPT {
            times.pop_front();
        }
        times.push_back(latency);
    }

    /// Keeps every thread waiting that has a latency to add.
    #[cfg(test)]
    pub fn hold(&self) -> std::sync::MutexGuard<'_, VecDeque<Duration>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Statistics of the latest snapshots; `None` before the first.
    pub fn summary(&self) -> Option<DisplayLatency> {
        let mut times: Vec<Duration> =
            self.0.lock().unwrap_or_else(PoisonError::into_inner).iter().copied().collect();
        times.sort_unstable();
        let ms = |time: &Duration| (time.as_secs_f64() * 1e5).round() / 1e2;
        let quantile =
            |part: f64| times.get(((times.len() as f64 * part).ceil() as usize).max(1) - 1).map(ms);
        Some(DisplayLatency {
            snapshots: times.len(),
            p50_ms: quantile(0.5)?,
            p99_ms: quantile(0.99)?,
            longest_ms: quantile(1.0)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_covers_the_latest_snapshots_only() {
        let times = DisplayLatencies::default();
        assert_eq!(times.summary(), None);
        (1..=LATENCIES_KEPT as u64 + 100).rev().for_each(|ms| times.add(Duration::from_millis(ms)));
        let found = times.summary().unwrap();
        assert_eq!(
            found,
            DisplayLatency { snapshots: LATENCIES_KEPT, p50_ms: 1000.0, p99_ms: 1980.0, longest_ms: 2000.0 }
        );
    }
}
