//! Stale samples: a counter that does not count, or a torque or EMG that does not change.

use super::fault::CanFault;
use super::file::{CanRigFile, Carried, FrameLayout};
use super::pdo_decoder::{MAX_SAMPLES, Readings};
use crate::rig::Channel;

/// Whether samples go on: the counter by one each period, or at least a torque that changes; and whether EMG changes.
#[derive(Debug, Clone)]
pub struct StalenessCheck {
    /// Largest number of the counter, if there is one.
    counter_mask: Option<u32>,
    before: Option<u32>,
    torque_before: [f64; MAX_SAMPLES],
    unchanged: u32,
    tolerated: u32,
    emg_before: [Option<[f64; MAX_SAMPLES]>; 2],
    emg_unchanged: [u32; 2],
    /// Periods with the same EMG that are tolerated; `None` if it is not checked.
    emg_tolerated: Option<u32>,
    /// By how much the counter may go on besides the one of each period.
    slack: u32,
    /// Periods without an answer to SYNC since the last readings.
    unanswered: u32,
    /// By how many periods the counter is behind the SYNCs that were sent, and for how many periods in a row.
    behind: u32,
    behind_in_a_row: u32,
    /// Periods in a row that may be behind, and the frame with the counter.
    missed_tolerated: u32,
    frame: u16,
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
            tolerated: file.tolerate.unchanged_torque_periods,
            emg_before: [None; 2],
            emg_unchanged: [0; 2],
            emg_tolerated: file.tolerate.unchanged_emg_periods,
            slack: 0,
            unanswered: 0,
            behind: 0,
            behind_in_a_row: 0,
            missed_tolerated: file.tolerate.missed_cycles_in_a_row,
            frame: file.frames.iter().find(has_counter).and_then(|frame| frame.identifier()).unwrap_or(0),
        }
    }

    /// Periods went by, perhaps without SYNC: the counter may have gone on by as many.
    pub fn expect_gap(&mut self, periods: u64) {
        self.slack = self.slack.saturating_add(u32::try_from(periods).unwrap_or(u32::MAX));
    }

    /// A SYNC was not answered: the counter must have gone on by one, unless the answer is late.
    pub fn expect_unanswered(&mut self) {
        self.expect_gap(1);
        self.unanswered = self.unanswered.saturating_add(1);
    }

    /// The readings of one more period.
    ///
    /// # Errors
    /// [`CanFault::StaleSample`], [`CanFault::FrozenTorque`], [`CanFault::FrozenEmg`], or [`CanFault::MissedCycle`] where every
    /// answer is that to an earlier SYNC.
    pub fn check(&mut self, readings: &Readings) -> Result<(), CanFault> {
        self.check_counter(readings.counter)?;
        self.unchanged = if readings.torque_nm == self.torque_before { self.unchanged + 1 } else { 0 };
        self.torque_before = readings.torque_nm;
        if self.unchanged > self.tolerated {
            let (periods, tolerated) = (self.unchanged, self.tolerated);
            return Err(CanFault::FrozenTorque { torque_nm: readings.torque_nm[0], periods, tolerated });
        }
        self.check_emg(readings)
    }

    /// Each muscle by itself: one amplifier may stop while the other goes on.
    fn check_emg(&mut self, readings: &Readings) -> Result<(), CanFault> {
        let Some(tolerated) = self.emg_tolerated else { return Ok(()) };
        let before = std::mem::replace(&mut self.emg_before, readings.emg_mvc);
        for (muscle, channel) in [Channel::EmgFcr, Channel::EmgEcr].into_iter().enumerate() {
            let Some(now) = readings.emg_mvc[muscle] else { continue };
            let unchanged = &mut self.emg_unchanged[muscle];
            *unchanged = if before[muscle] == Some(now) { *unchanged + 1 } else { 0 };
            if *unchanged > tolerated {
                let periods = *unchanged;
                return Err(CanFault::FrozenEmg { channel, emg_mvc: now[0], periods, tolerated });
            }
        }
        Ok(())
    }

    fn check_counter(&mut self, now: u32) -> Result<(), CanFault> {
        let (slack, unanswered) = (std::mem::take(&mut self.slack), std::mem::take(&mut self.unanswered));
        let Some(mask) = self.counter_mask else { return Ok(()) };
        let Some(before) = self.before.replace(now) else { return Ok(()) };
        let went_on = now.wrapping_sub(before) & mask;
        let most = slack.saturating_add(self.behind).saturating_add(1);
        if !(1..=most).contains(&went_on) {
            return Err(CanFault::StaleSample { before, now });
        }
        self.behind = (self.behind + unanswered + 1).saturating_sub(went_on);
        self.behind_in_a_row = if self.behind > 0 { self.behind_in_a_row + 1 } else { 0 };
        let (in_a_row, tolerated) = (self.behind_in_a_row, self.missed_tolerated);
        if in_a_row > tolerated {
            return Err(CanFault::MissedCycle { in_a_row, tolerated, id: self.frame });
        }
        Ok(())
    }
}

fn has_counter(frame: &&FrameLayout) -> bool {
    frame.carries.contains(&Carried::Counter)
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
    fn answers_that_are_all_one_period_late_are_missed_and_a_single_one_is_not() {
        let mut fresh = StalenessCheck::new(&plain());
        fresh.missed_tolerated = 3;
        let check = |fresh: &mut StalenessCheck, counter: u32| {
            let mut readings = Readings { counter, ..Readings::default() };
            readings.torque_nm[0] = f64::from(counter);
            fresh.check(&readings)
        };
        assert_eq!([1, 2].map(|counter| check(&mut fresh, counter)), [Ok(()), Ok(())]);
        fresh.expect_unanswered();
        assert_eq!([3, 4].map(|counter| check(&mut fresh, counter)), [Ok(()), Ok(())], "late");
        assert_eq!(check(&mut fresh, 6), Ok(()), "two in a period: it has caught up");
        assert!(matches!(check(&mut fresh, 8), Err(CanFault::StaleSample { .. })));
        fresh.expect_unanswered();
        let found = (9..20).find(|counter| check(&mut fresh, *counter).is_err());
        assert_eq!(found, Some(12), "3 in a row are tolerated");
    }

    #[test]
    fn emg_of_one_muscle_that_stands_still_is_found_after_the_tolerated_periods_and_only_if_the_rig_file_says_so()
     {
        let frozen = |tolerated: Option<u32>| {
            let mut check = StalenessCheck::new(&plain());
            check.emg_tolerated = tolerated;
            (0..200).find_map(|counter| {
                let moving = f64::from(counter);
                let mut readings = Readings { counter, ..Readings::default() };
                readings.torque_nm[0] = moving;
                // The flexor goes on until the extensor has long stopped.
                readings.emg_mvc = [Some([moving; MAX_SAMPLES]), Some([0.02; MAX_SAMPLES])];
                check.check(&readings).err()
            })
        };
        let fault = frozen(Some(50)).unwrap();
        let expected =
            CanFault::FrozenEmg { channel: Channel::EmgEcr, emg_mvc: 0.02, periods: 51, tolerated: 50 };
        assert_eq!(fault, expected);
        assert!(fault.to_string().contains("the ECR EMG was 0.02 MVC"), "{fault}");
        assert_eq!(frozen(None), None);
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
