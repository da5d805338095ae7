//! How much anybody may send.

use std::time::{Duration, Instant};

/// The longest message of a page, bytes.
pub const LONGEST_MESSAGE: usize = 4096;
/// The longest head of a request, bytes.
pub const LONGEST_HEAD: usize = 8192;
/// Connections that have not shown a token yet, at a time.
pub const CONNECTIONS: usize = 64;
/// PageAddresses of one role, at a time.
pub const PAGES: usize = 8;
/// How long a request may take to come, and a connection to do nothing.
pub const PATIENCE: Duration = Duration::from_secs(5);
/// How long a page may leave pictures unanswered before it counts as gone.
pub const SILENCE: Duration = Duration::from_secs(10);
/// Pictures that may be on their way to a page.
pub const ON_THE_WAY: u64 = 3;

/// So many a second in the long run, and no more than `most` at once.
#[derive(Debug)]
pub struct Rate {
    most: f64,
    per_s: f64,
    left: f64,
    at: Instant,
}

impl Rate {
    /// Nothing is used up yet.
    pub fn new(most: f64, per_s: f64, now: Instant) -> Self {
        Self { most, per_s, left: most, at: now }
    }

    /// Whether one more may come.
    pub fn allows(&mut self, now: Instant) -> bool {
        let passed_s = now.saturating_duration_since(self.at).as_secs_f64();
        self.at = now;
        self.left = (self.left + passed_s * self.per_s).min(self.most);
        let allows = self.left >= 1.0;
        if allows {
            self.left -= 1.0;
        }
        allows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_is_allowed_and_then_only_the_rate() {
        let begun = Instant::now();
        let mut rate = Rate::new(3.0, 2.0, begun);
        let at = |ms: u64| begun + Duration::from_millis(ms);
        assert_eq!([0, 0, 0, 0].map(|ms| rate.allows(at(ms))), [true, true, true, false]);
        assert_eq!([400, 600, 700, 1100].map(|ms| rate.allows(at(ms))), [false, true, false, true]);
        assert_eq!([9000, 9000, 9000, 9000].map(|ms| rate.allows(at(ms))), [true, true, true, false]);
    }
}
