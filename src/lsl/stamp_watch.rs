//! Whether the time stamps of a stream can be those of when its samples were taken.
//!
//! A device that stamps with the time of day, or with the time since it was switched on, gives EMG that nobody can place; one whose clock jumps
//! gives EMG of another moment. The newest sample that has come tells: it was taken a moment ago.

/// By how much a stamp may be in the future, s: a device may stamp a parcel by when its last sample will be due. Assumed.
pub const MOST_EARLY_S: f64 = 0.1;

/// Least time by which a stamp may be late, s: devices and networks that are held up send late, and a stamp of another clock is off by more.
/// Assumed.
const LEAST_LATE_S: f64 = 1.0;

/// A change of a stream's stamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StampChange {
    /// They are this far behind the clock, s; negative where they are in the future.
    Off {
        /// How far behind.
        late_s: f64,
    },
    /// They are right again.
    Right,
}

/// Watches the stamps of a stream.
#[derive(Debug)]
pub struct StampWatch {
    most_late_s: f64,
    /// Since when they have been late, s.
    late_since_s: Option<f64>,
    is_off: bool,
}

impl StampWatch {
    /// For a stream whose samples may come so late, s; a second at the least.
    pub fn new(most_late_s: f64) -> Self {
        Self { most_late_s: most_late_s.max(LEAST_LATE_S), late_since_s: None, is_off: false }
    }

    /// Whether a sample that comes so long after its stamp, s, can have been taken then.
    pub fn allows(&self, late_s: f64) -> bool {
        (-MOST_EARLY_S..=self.most_late_s).contains(&late_s)
    }

    /// Takes how far the stamp of the newest sample is behind the clock, and when that is, s. Says when the stamps begin or end to be off: in
    /// the future at once, late once they have been so for as long as they may be late, since a device that was held up sends what it has
    /// all at once.
    pub fn take(&mut self, late_s: f64, at_s: f64) -> Option<StampChange> {
        if self.allows(late_s) {
            self.late_since_s = None;
            return std::mem::take(&mut self.is_off).then_some(StampChange::Right);
        }
        let since_s = *self.late_since_s.get_or_insert(at_s);
        let is_held_up = late_s > 0.0 && at_s - since_s < self.most_late_s;
        if is_held_up || self.is_off {
            return None;
        }
        self.is_off = true;
        Some(StampChange::Off { late_s })
    }

    /// Whether they are off.
    pub fn is_off(&self) -> bool {
        self.is_off
    }
}

/// How far stamps are off, for a message.
pub fn stamps_off(late_s: f64) -> String {
    let (size, side) = (late_s.abs(), if late_s < 0.0 { "ahead of" } else { "behind" });
    format!("its time stamps are {size:.3} s {side} the clock of Lab Streaming Layer when its samples come")
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
        let told = [0.01, -3.0, -2.9, 0.02, 0.01].map(|late_s| watch.take(late_s, 10.0));
        assert_eq!(
            told,
            [None, Some(StampChange::Off { late_s: -3.0 }), None, Some(StampChange::Right), None]
        );
    }

    #[test]
    fn a_device_that_was_held_up_is_not_off_and_one_that_stays_late_is() {
        let mut watch = StampWatch::new(0.5);
        for at_s in [10.0, 10.02, 10.9] {
            assert_eq!(watch.take(1.5, at_s), None);
        }
        assert_eq!(watch.take(0.01, 10.95), None);
        assert_eq!([11.0, 11.9].map(|at_s| watch.take(2.0, at_s)), [None, None]);
        assert_eq!(watch.take(2.0, 12.01), Some(StampChange::Off { late_s: 2.0 }));
    }
}
