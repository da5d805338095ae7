//! The axis reports its position by its own clock; this gives the position at SYNC, where the torque is measured.
//!
//! What is left: the time from the estimate to the arrival of its frame (0.1 to 0.3 ms: at 3 rad/s up to 1 mrad, the same in
//! every ramp), and the curve between two estimates (acceleration x time squared / 8).

use std::time::Instant;

/// The latest two estimates, in turns.
#[derive(Debug, Clone, Copy, Default)]
pub struct Estimates {
    latest: Option<(f64, Instant)>,
    before: Option<(f64, Instant)>,
}

impl Estimates {
    /// Forgets them: positions are on another scale.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// One more, which arrived at `at`.
    pub fn add(&mut self, turns: f64, at: Instant) {
        self.before = self.latest;
        self.latest = Some((turns, at));
    }

    /// Position at a time between the two, turns; beyond them, the nearer one. NaN before the first.
    pub fn turns_at(&self, at: Instant) -> f64 {
        let Some((latest, arrived)) = self.latest else { return f64::NAN };
        let Some((before, since)) = self.before.filter(|_| at < arrived) else { return latest };
        let whole_s = arrived.saturating_duration_since(since).as_secs_f64();
        let part_s = at.saturating_duration_since(since).as_secs_f64();
        if whole_s > 0.0 { before + (latest - before) * (part_s / whole_s).min(1.0) } else { latest }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn position_at_sync_lies_between_the_estimates_before_and_after_it() {
        let start = Instant::now();
        let at = |us: u64| start + Duration::from_micros(us);
        let mut estimates = Estimates::default();
        assert!(estimates.turns_at(at(0)).is_nan());
        estimates.add(0.10, at(1000));
        assert_eq!(estimates.turns_at(at(500)), 0.10, "the only one");
        estimates.add(0.14, at(3000));
        for (us, turns) in [(1000, 0.10), (1500, 0.11), (2500, 0.13), (3000, 0.14), (9000, 0.14), (0, 0.10)] {
            assert!((estimates.turns_at(at(us)) - turns).abs() < 1e-12, "{us} us");
        }
    }
}
