//! Whether the time stamps of a stream can be those of when its samples were taken.
//!
//! A device that stamps with the time of day, or with the time since it was switched on, gives EMG that nobody can place; one whose clock jumps
//! gives EMG of another moment. The newest sample that has come tells: it was taken a moment ago.

use crate::dataset::stamps_from_clock;

/// By how much a stamp may be in the future, s: a device may stamp a parcel by when its last sample will be due. Assumed.
pub const MOST_EARLY_S: f64 = 0.1;

/// Least time by which a stamp may be late, s: devices and networks that are held up send late, and a stamp of another clock is off by more.
/// Assumed.
const LEAST_LATE_S: f64 = 1.0;

/// Time for which samples of a device, a network or a computer that is held up may all come late, s; those of a clock that was set back, or
/// that stood still, stay so. Assumed.
const HELD_UP_S: f64 = 10.0;

/// A change of a stream's stamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StampChange {
    /// They are this far behind the clock, s; negative where they are in the future.
    Off {
        /// How far behind.
        late_s: f64,
        /// How many samples had come when they were last right.
        after_samples: u64,
    },
    /// They are right again.
    Right {
        /// How many samples had come by then.
        after_samples: u64,
    },
}

/// Watches the stamps of a stream.
#[derive(Debug)]
pub struct StampWatch {
    /// How late they may be, s.
    most_late_s: f64,
    /// The newest stamp, s.
    newest_s: Option<f64>,
    /// Whether they have been set back since they were right.
    is_set_back: bool,
    /// Samples that have come.
    samples: u64,
    /// Those that had come when stamps were last right.
    right_samples: u64,
    /// Since when they have been late, s.
    late_since_s: Option<f64>,
    is_off: bool,
}

impl StampWatch {
    /// For a stream whose samples may come so late, s; a second at the least.
    pub fn new(most_late_s: f64) -> Self {
        Self {
            most_late_s: most_late_s.max(LEAST_LATE_S),
            newest_s: None,
            is_set_back: false,
            samples: 0,
            right_samples: 0,
            late_since_s: None,
            is_off: false,
        }
    }

    /// Whether a sample that comes so long after its stamp, s, can have been taken then.
    pub fn allows(&self, late_s: f64) -> bool {
        (-MOST_EARLY_S..=self.most_late_s).contains(&late_s)
    }

    /// Takes the stamps of samples that have come, s, in their order.
    pub fn samples(&mut self, stamps_s: &[f64]) {
        for stamp_s in stamps_s {
            self.is_set_back |= self.newest_s.is_some_and(|newest_s| stamp_s - newest_s < -self.most_late_s);
            self.newest_s = Some(*stamp_s);
            self.samples += 1;
        }
    }

    /// The next stamp follows on none: the device may have begun anew.
    pub fn interrupt(&mut self) {
        (self.newest_s, self.is_set_back, self.late_since_s) = (None, false, None);
    }

    /// Takes how far the newest stamp is behind the clock, and when that is, s. Says when the stamps begin or end to be off: in the future or
    /// set back at once, late once they have been so for as long as a device may be held up, since it then sends what it has all at once.
    pub fn take(&mut self, late_s: f64, at_s: f64) -> Option<StampChange> {
        if self.allows(late_s) {
            (self.is_set_back, self.late_since_s, self.right_samples) = (false, None, self.samples);
            let right = StampChange::Right { after_samples: self.samples };
            return std::mem::take(&mut self.is_off).then_some(right);
        }
        let since_s = *self.late_since_s.get_or_insert(at_s);
        let may_be_held_up = late_s > 0.0 && !self.is_set_back && at_s - since_s < HELD_UP_S;
        if may_be_held_up || self.is_off {
            return None;
        }
        self.is_off = true;
        Some(StampChange::Off { late_s, after_samples: self.right_samples })
    }

    /// Whether they are off.
    pub fn is_off(&self) -> bool {
        self.is_off
    }
}

/// How far stamps are off, for a message.
pub fn stamps_off(late_s: f64) -> String {
    let off = stamps_from_clock(late_s);
    format!("its time stamps are {off} the clock of Lab Streaming Layer when its samples come")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_of_another_clock_and_of_the_future_are_not_allowed_and_those_of_a_late_parcel_are() {
        let watch = StampWatch::new(0.5);
        assert!([0.002, 0.3, -0.02, 0.9].iter().all(|late_s| watch.allows(*late_s)));
        assert!([-1.7e9, 4e4, 2.0, -3.0, f64::NAN].iter().all(|late_s| !watch.allows(*late_s)));
    }

    #[test]
    fn stamps_that_jump_and_come_back_are_told_once_each() {
        let mut watch = StampWatch::new(0.5);
        let told =
            [(0.01, 10.0), (-3.0, 10.1), (-2.9, 10.2), (0.02, 10.3), (0.01, 10.4)].map(|(late_s, at_s)| {
                watch.samples(&[at_s - late_s]);
                watch.take(late_s, at_s)
            });
        let off = StampChange::Off { late_s: -3.0, after_samples: 1 };
        assert_eq!(told, [None, Some(off), None, Some(StampChange::Right { after_samples: 4 }), None]);
    }

    #[test]
    fn samples_that_all_come_late_for_some_seconds_are_not_off_and_those_that_stay_late_are() {
        let mut watch = StampWatch::new(0.5);
        for at_s in [10.0, 10.02, 12.9, 19.9] {
            assert_eq!(watch.take(1.5, at_s), None);
        }
        assert_eq!(watch.take(0.01, 19.95), None);
        assert_eq!([20.0, 29.9].map(|at_s| watch.take(2.0, at_s)), [None, None]);
        assert_eq!(watch.take(2.0, 30.01), Some(StampChange::Off { late_s: 2.0, after_samples: 0 }));
    }

    #[test]
    fn what_a_device_sends_at_once_after_a_long_silence_is_not_off() {
        let mut watch = StampWatch::new(0.5);
        assert_eq!(watch.take(0.01, 10.0), None);
        watch.interrupt();
        assert_eq!(
            [(20.0, 40.0), (8.0, 40.02), (0.01, 40.04)].map(|(late_s, at_s)| watch.take(late_s, at_s)),
            [None; 3]
        );
    }

    #[test]
    fn stamps_that_are_set_back_are_off_at_once_until_they_are_put_right() {
        let mut watch = StampWatch::new(0.5);
        watch.samples(&[5.0, 5.001, 5.002]);
        assert_eq!(watch.take(0.01, 10.0), None);
        watch.samples(&[2.003, 2.004]);
        let off = StampChange::Off { late_s: 3.0, after_samples: 3 };
        assert_eq!([watch.take(3.0, 10.02), watch.take(3.0, 10.04)], [Some(off), None]);
        watch.samples(&[2.005, 5.006]);
        assert_eq!(watch.take(0.01, 10.06), Some(StampChange::Right { after_samples: 7 }));
    }

    #[test]
    fn parcels_that_were_held_up_and_stamped_when_they_were_sent_are_not_set_back() {
        let mut watch = StampWatch::new(0.5);
        watch.samples(&[5.0, 5.1, 5.2, 5.05, 5.15, 5.25, 5.0]);
        assert_eq!(watch.take(1.5, 10.0), None);
    }

    #[test]
    fn a_device_that_begins_anew_with_a_clock_of_its_own_has_not_been_set_back() {
        let mut watch = StampWatch::new(0.5);
        watch.samples(&[500.0]);
        watch.interrupt();
        watch.samples(&[5.0]);
        assert_eq!(watch.take(1.5, 10.0), None);
    }
}
