//! Limits on what browsers may send, and the time limits of connections.

use std::time::{Duration, Instant};

/// Longest message of a page, bytes.
pub const LONGEST_MESSAGE: usize = 4096;
/// Longest head of a request, bytes.
pub const LONGEST_HEAD: usize = 8192;
/// Bytes that a connection may send at once, and each second in the long run. They count as they arrive, so that frames count
/// too that never become a message: a frame has at least 6 bytes.
pub const RECEIVED_BYTES: [f64; 2] = [49_152.0, 32_768.0];
/// Messages that a page of the operator and one of the subject may send at once, and each second in the long run. A page
/// acknowledges 30 or 250 snapshots a second; the subject's also tells when it has drawn them.
pub const MESSAGES: [[f64; 2]; 2] = [[240.0, 120.0], [1200.0, 600.0]];
/// Largest number of connections that have not shown a token.
pub const CONNECTIONS: usize = 64;
/// Largest number of open pages of one role.
pub const PAGES_PER_ROLE: usize = 8;
/// Time limit of a request, a handshake and a message that is being sent.
pub const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);
/// Time without an acknowledged snapshot after which a page counts as gone.
pub const PAGE_TIMEOUT: Duration = Duration::from_secs(10);
/// Largest number of snapshots sent to a page and not acknowledged.
pub const UNACKNOWLEDGED_SNAPSHOTS: u64 = 3;
/// Time that pages get to receive the last snapshot before the program ends.
pub const CLOSING_TIME: Duration = Duration::from_millis(800);

/// Rate limiter (token bucket): `burst` messages at once, `per_s` messages a second in the long run.
#[derive(Debug)]
pub struct RateLimiter {
    burst: f64,
    per_s: f64,
    tokens: f64,
    at: Instant,
}

impl RateLimiter {
    /// A limiter with a full bucket.
    pub fn new(burst: f64, per_s: f64, now: Instant) -> Self {
        Self { burst, per_s, tokens: burst, at: now }
    }

    /// Whether one more message is allowed at time `now`; if so, it is counted.
    pub fn allows(&mut self, now: Instant) -> bool {
        self.allows_many(1.0, now)
    }

    /// Whether `count` more are allowed at time `now`; if so, they are counted.
    pub fn allows_many(&mut self, count: f64, now: Instant) -> bool {
        let passed_s = now.saturating_duration_since(self.at).as_secs_f64();
        self.at = now;
        self.tokens = (self.tokens + passed_s * self.per_s).min(self.burst);
        let allows = self.tokens >= count;
        if allows {
            self.tokens -= count;
        }
        allows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_is_allowed_and_then_only_the_rate() {
        let start = Instant::now();
        let mut limiter = RateLimiter::new(3.0, 2.0, start);
        let at = |ms: u64| start + Duration::from_millis(ms);
        assert_eq!([0, 0, 0, 0].map(|ms| limiter.allows(at(ms))), [true, true, true, false]);
        assert_eq!([400, 600, 700, 1100].map(|ms| limiter.allows(at(ms))), [false, true, false, true]);
        assert_eq!([9000, 9000, 9000, 9000].map(|ms| limiter.allows(at(ms))), [true, true, true, false]);
    }
}
