//! Which openings and closings of the operator's pages the journal keeps: all of an ordinary session, not those of a flood.

use std::time::{Duration, Instant};

/// Openings that are kept at once.
const BURST: u32 = 100;

/// Time after which one more is kept.
const PERIOD: Duration = Duration::from_secs(30);

/// Decides whether the journal keeps that a page was opened or closed.
#[derive(Debug)]
pub struct ComingAndGoing {
    left: u32,
    since: Instant,
    /// Pages whose opening was kept and whose closing is still to come.
    kept: u32,
    was_full: bool,
}

impl ComingAndGoing {
    /// No page was opened yet.
    pub fn new(now: Instant) -> Self {
        Self { left: BURST, since: now, kept: 0, was_full: false }
    }

    /// Whether an opening is kept.
    pub fn keeps_opening(&mut self, now: Instant) -> bool {
        let periods = now.saturating_duration_since(self.since).as_secs() / PERIOD.as_secs();
        if periods > 0 {
            self.left = self.left.saturating_add(u32::try_from(periods).unwrap_or(BURST)).min(BURST);
            self.since = now;
        }
        if self.left == 0 {
            return false;
        }
        self.left -= 1;
        self.kept += 1;
        true
    }

    /// Whether a closing is kept: as many as there were openings.
    pub fn keeps_closing(&mut self) -> bool {
        let keeps = self.kept > 0;
        self.kept -= u32::from(keeps);
        keeps
    }

    /// Whether this is the first opening that the journal does not keep; the operator gets a message about it.
    pub fn is_full_for_the_first_time(&mut self) -> bool {
        !std::mem::replace(&mut self.was_full, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 70,000 openings and closings made the journal 13 MB larger.
    #[test]
    fn a_flood_of_openings_leaves_a_bounded_trace() {
        let start = Instant::now();
        let mut pages = ComingAndGoing::new(start);
        let kept = (0..70_000u64).filter(|n| {
            let opened = pages.keeps_opening(start + Duration::from_millis(*n));
            assert_eq!(pages.keeps_closing(), opened);
            opened
        });
        assert_eq!(kept.count(), 102);
        assert!(pages.keeps_opening(start + Duration::from_secs(200)));
        assert!(pages.is_full_for_the_first_time() && !pages.is_full_for_the_first_time());
    }
}
