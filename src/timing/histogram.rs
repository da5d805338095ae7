//! A histogram of durations in buckets of growing width, such as the lateness of a loop. It allocates once, when it is made.

use std::fmt;
use std::time::Duration;

/// Buckets to each power of two: a duration is kept to 12 %.
const PARTS: usize = 8;
const POWERS: usize = 24;

/// A histogram of durations in microseconds, from 0 to some 16 s.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Histogram {
    buckets: Box<[u64; PARTS * POWERS]>,
    count: u64,
    longest_us: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { buckets: Box::new([0; PARTS * POWERS]), count: 0, longest_us: 0 }
    }
}

impl Histogram {
    /// Adds a duration.
    pub fn add(&mut self, duration: Duration) {
        let us = duration.as_micros() as u64;
        self.buckets[bucket(us)] += 1;
        self.count += 1;
        self.longest_us = self.longest_us.max(us);
    }

    /// Number of durations added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The longest duration, us.
    pub fn longest_us(&self) -> u64 {
        self.longest_us
    }

    /// The duration that a fraction (0 to 1) of them does not exceed, us, rounded up to the end of its bucket.
    pub fn quantile_us(&self, fraction: f64) -> u64 {
        let wanted = (fraction * self.count as f64).ceil() as u64;
        let mut seen = 0;
        for (at, count) in self.buckets.iter().enumerate() {
            seen += count;
            if seen >= wanted && seen > 0 {
                return upper_end(at).min(self.longest_us);
            }
        }
        self.longest_us
    }

    /// Number of durations longer than `limit`, to the resolution of the buckets: a bucket that contains the limit counts.
    pub fn longer_than(&self, limit: Duration) -> u64 {
        let limit_us = limit.as_micros() as u64;
        self.buckets().filter(|(end_us, _)| *end_us > limit_us).map(|(_, count)| count).sum()
    }

    /// The buckets that are not empty: upper end in us, and count.
    pub fn buckets(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        self.buckets
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0)
            .map(|(at, count)| (upper_end(at), *count))
    }
}

/// The number of durations and the longest, then a line for each bucket that is not empty.
impl fmt::Display for Histogram {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "lateness of {} periods, latest {} us", self.count, self.longest_us)?;
        self.buckets().try_for_each(|(end_us, count)| writeln!(out, "  <= {end_us:>8} us {count:>9}"))
    }
}

fn bucket(us: u64) -> usize {
    if us < PARTS as u64 {
        return us as usize;
    }
    let power = us.ilog2() as usize - PARTS.ilog2() as usize;
    ((power + 1) * PARTS + ((us >> power) as usize - PARTS)).min(PARTS * POWERS - 1)
}

fn upper_end(at: usize) -> u64 {
    if at < PARTS {
        return at as u64;
    }
    let (power, part) = (at / PARTS - 1, at % PARTS);
    ((PARTS + part + 1) as u64 * (1 << power)) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_duration_falls_into_the_bucket_whose_end_is_next_above_it() {
        for us in (0..5000).chain([65_535, 1_000_000, 15_000_000]) {
            let end = upper_end(bucket(us));
            assert!(end >= us && end as f64 <= us as f64 * 1.13 + 1.0, "{us} -> {end}");
            assert!(bucket(us) == 0 || upper_end(bucket(us) - 1) < us);
        }
    }

    #[test]
    fn quantiles_and_the_longest_come_from_what_was_added() {
        let mut histogram = Histogram::default();
        for us in 1..=1000 {
            histogram.add(Duration::from_micros(us));
        }
        assert_eq!((histogram.count(), histogram.longest_us()), (1000, 1000));
        assert!((500..=575).contains(&histogram.quantile_us(0.5)), "{}", histogram.quantile_us(0.5));
        assert!((990..=1000).contains(&histogram.quantile_us(0.99)));
        assert_eq!(Histogram::default().quantile_us(0.5), 0);
        assert_eq!(histogram.longer_than(Duration::from_micros(1023)), 0);
        assert_eq!(
            histogram.longer_than(Duration::from_micros(100)),
            1000 - 95,
            "the bucket 96..=103 contains the limit"
        );
        histogram.add(Duration::from_secs(3600));
        assert_eq!(histogram.longest_us(), 3_600_000_000);
    }
}
