//! How late the periods of a loop began, as a histogram that never asks for memory.

use std::fmt;
use std::time::Duration;

/// Number of bins: the last begins at a second.
const BINS: usize = 21;

/// Counts of periods by how late they began: bin 0 up to 1 us, bin n from 2^(n-1) us to 2^n us, the last all above.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Lateness {
    bins: [u64; BINS],
    latest: Duration,
}

impl Lateness {
    /// Counts a period.
    pub fn add(&mut self, late: Duration) {
        let bin = (late.as_micros().min(u128::from(u64::MAX)) as u64)
            .checked_ilog2()
            .map_or(0, |log| log as usize + 1);
        self.bins[bin.min(BINS - 1)] += 1;
        self.latest = self.latest.max(late);
    }

    /// Number of periods.
    pub fn periods(&self) -> u64 {
        self.bins.iter().sum()
    }

    /// The latest beginning.
    pub fn latest(&self) -> Duration {
        self.latest
    }

    /// What a fraction of the periods did not exceed, us, to the upper end of its bin.
    pub fn quantile_us(&self, fraction: f64) -> u64 {
        let wanted = (fraction * self.periods() as f64).ceil() as u64;
        let mut seen = 0;
        let within = self.bins.iter().position(|count| {
            seen += count;
            seen >= wanted
        });
        let latest_us = self.latest.as_micros() as u64;
        within.filter(|bin| *bin < BINS - 1).map_or(latest_us, |bin| latest_us.min(1 << bin))
    }

    /// How many periods began later than `limit`, to the resolution of the bins: those of a bin that contains it count.
    pub fn later_than(&self, limit: Duration) -> u64 {
        let bins = self.bins.iter().enumerate();
        bins.filter(|(bin, _)| Duration::from_micros(1 << bin) > limit).map(|(_, count)| count).sum()
    }
}

impl fmt::Display for Lateness {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "lateness of {} periods, latest {} us", self.periods(), self.latest.as_micros())?;
        for (bin, count) in self.bins.iter().enumerate().filter(|(_, count)| **count > 0) {
            let bound =
                if bin == BINS - 1 { "      above".to_owned() } else { format!("< {:>7} us", 1u64 << bin) };
            writeln!(out, "  {bound} {count:>9}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_period_is_counted_in_the_bin_of_its_lateness() {
        let mut lateness = Lateness::default();
        for us in [0, 1, 2, 3, 1023, 1024, 5_000_000] {
            lateness.add(Duration::from_micros(us));
        }
        assert_eq!(lateness.periods(), 7);
        assert_eq!([lateness.bins[0], lateness.bins[1], lateness.bins[2]], [1, 1, 2]);
        assert_eq!([lateness.bins[10], lateness.bins[11], lateness.bins[20]], [1, 1, 1]);
        assert_eq!(lateness.later_than(Duration::from_micros(1024)), 2);
        assert_eq!(lateness.latest(), Duration::from_secs(5));
        assert_eq!([lateness.quantile_us(0.5), lateness.quantile_us(1.0)], [4, 5_000_000]);
        assert!(lateness.to_string().contains("<    1024 us         1"), "{lateness}");
    }
}
