//! How long torque takes to the person's screen: from the sample to the moment when the page has drawn it, as the page
//! tells; its message back is in it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde::Serialize;

/// Pictures that are kept: a good half minute.
const KEPT: usize = 2000;

/// Collects the times of the latest pictures.
#[derive(Debug, Clone, Default)]
pub struct DisplayLatencies(Arc<Mutex<VecDeque<Duration>>>);

/// How long the latest pictures took, ms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DisplayLatency {
    /// How many pictures.
    pub pictures: usize,
    /// Half of them at most, ms.
    pub p50_ms: f64,
    /// 99 % of them at most, ms.
    pub p99_ms: f64,
    /// The longest, ms.
    pub longest_ms: f64,
}

impl DisplayLatencies {
    /// A picture was drawn so long after its sample.
    pub fn add(&self, time: Duration) {
        let mut times = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if times.len() == KEPT {
            times.pop_front();
        }
        times.push_back(time);
    }

    /// The latest pictures in short; `None` before the first.
    pub fn in_short(&self) -> Option<DisplayLatency> {
        let mut times: Vec<Duration> =
            self.0.lock().unwrap_or_else(PoisonError::into_inner).iter().copied().collect();
        times.sort_unstable();
        let ms = |time: &Duration| (time.as_secs_f64() * 1e5).round() / 1e2;
        let quantile =
            |part: f64| times.get(((times.len() as f64 * part).ceil() as usize).max(1) - 1).map(ms);
        Some(DisplayLatency {
            pictures: times.len(),
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
    fn the_latest_pictures_tell_how_long_torque_takes() {
        let times = DisplayLatencies::default();
        assert_eq!(times.in_short(), None);
        (1..=KEPT as u64 + 100).rev().for_each(|ms| times.add(Duration::from_millis(ms)));
        let found = times.in_short().unwrap();
        assert_eq!(
            found,
            DisplayLatency { pictures: KEPT, p50_ms: 1000.0, p99_ms: 1980.0, longest_ms: 2000.0 }
        );
    }
}
