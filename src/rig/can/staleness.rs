//! Stale samples: a counter that does not count, or a torque that does not change.

use super::fault::CanFault;
use super::file::CanRigFile;
use super::pdo_decoder::{MAX_SAMPLES, Readings};

/// Whether samples go on: the counter by one each period, or at least a torque that changes.
#[derive(Debug, Clone)]
pub struct StalenessCheck {
    /// Largest number of the counter, if there is one.
    counter_mask: Option<u32>,
    before: Option<u32>,
    torque_before: [f64; MAX_SAMPLES],
    unchanged: u32,
    tolerated: u32,
    /// Periods without readings since the last.
    missed: u32,
}

impl StalenessCheck {
    /// For the signals of a rig file.
    pub fn new(file: &CanRigFile) -> Self {
        let counter_mask = file.signals.counter.map(|counter| match counter.kind.bytes() {
            1 => 0xFF,
            2 => 0xFFFF,
            _ => u32::MAX,
        });
        Self {
            counter_mask,
            before: None,
            torque_before: [f64::NAN; MAX_SAMPLES],
            unchanged: 0,
            missed: 0,
            tolerated: file.tolerate.unchanged_torque_periods,
        }
    }

    /// Periods went by without readings: the counter may have gone on by as many.
    pub fn expect_gap(&mut self, periods: u64) {
        self.missed = self.missed.saturating_add(u32::try_from(periods).unwrap_or(u32::MAX));
    }

    /// The readings of one more period.
    ///
    /// # Errors
    /// [`CanFault::StaleSample`], [`CanFault::FrozenTorque`]
    pub fn check(&mut self, readings: &Readings) -> Result<(), CanFault> {
        let now = readings.counter;
        let missed = std::mem::take(&mut self.missed);
        if let Some(mask) = self.counter_mask {
            let before = self.before.replace(now);
            let went_on = |before: u32| now.wrapping_sub(before) & mask;
            let may_go_on = 1..=missed.saturating_add(1);
            if let Some(before) = before.filter(|before| !may_go_on.contains(&went_on(*before))) {
                return Err(CanFault::StaleSample { before, now });
            }
        }
        self.unchanged = if readings.torque_nm == self.torque_before { self.unchanged + 1 } else { 0 };
        self.torque_before = readings.torque_nm;
        if self.unchanged > self.tolerated {
            let (periods, tolerated) = (self.unchanged, self.tolerated);
            return Err(CanFault::FrozenTorque { torque_nm: readings.torque_nm[0], periods, tolerated });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::can::file::ValidRigFile;

    fn plain() -> ValidRigFile {
        ValidRigFile::parse(include_str!("../../../fixtures/can/rigs/plain.json"), "plain.json").unwrap()
    }

    #[test]
    fn a_counter_that_does_not_go_on_by_one_is_stale_and_one_that_wraps_is_not() {
        let file = plain();
        let check = |counters: &[u32]| {
            let mut fresh = StalenessCheck::new(&file);
            counters.iter().enumerate().try_for_each(|(at, counter)| {
                let mut readings = Readings { counter: *counter, ..Readings::default() };
                readings.torque_nm[0] = at as f64;
                fresh.check(&readings)
            })
        };
        assert_eq!(check(&[65_534, 65_535, 0, 1]), Ok(()));
        for stale in [[5, 5], [5, 7], [5, 4]] {
            assert!(matches!(check(&stale), Err(CanFault::StaleSample { .. })), "{stale:?}");
        }
        assert!(check(&[5, 5]).unwrap_err().to_string().contains("it stands"));
        assert!(check(&[5, 7]).unwrap_err().to_string().contains("were lost or came out of order"));
    }

    #[test]
    fn a_torque_that_stands_still_to_the_last_digit_is_stale_after_a_while() {
        let mut fresh = StalenessCheck::new(&plain());
        let periods = (0..100)
            .find(|counter| fresh.check(&Readings { counter: *counter, ..Readings::default() }).is_err());
        assert_eq!(periods, Some(51), "50 are tolerated after the first");
        let frozen = fresh.check(&Readings { counter: 52, ..Readings::default() }).unwrap_err();
        assert!(matches!(frozen, CanFault::FrozenTorque { periods: 52, tolerated: 50, .. }), "{frozen:?}");
        assert!(frozen.to_string().contains("to the last digit in 52 periods"), "{frozen}");
    }
}
