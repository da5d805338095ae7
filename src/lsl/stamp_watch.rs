//! Whether the time stamps of a stream can be those of when its samples were taken.
//!
//! A device that stamps with the time of day, or with the time since it was switched on, gives EMG that nobody can place; one whose clock jumps
//! gives EMG of another moment. The newest sample that has come tells: it was taken a moment ago.

/// By how much a stamp may be in the future, s: a device may stamp a parcel by when its last sample will be due. Assumed.
pub const MOST_EARLY_S: f64 = 0.1;

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
    is_off: bool,
}

impl StampWatch {
    /// For a stream whose newest sample is at most this old, s: one that is older is no better than none.
    pub fn new(most_late_s: f64) -> Self {
        Self { most_late_s, is_off: false }
    }

    /// Takes how far the stamp of the newest sample is behind the clock, s. Says when the stamps begin or end to be off.
    pub fn take(&mut self, late_s: f64) -> Option<StampChange> {
        let is_right = (-MOST_EARLY_S..=self.most_late_s).contains(&late_s);
        match (self.is_off, is_right) {
            (false, false) => {
                self.is_off = true;
                Some(StampChange::Off { late_s })
            }
            (true, true) => {
                self.is_off = false;
                Some(StampChange::Right)
            }
            _ => None,
        }
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
    fn stamps_of_another_clock_and_of_the_future_are_off_and_those_of_a_late_parcel_are_not() {
        let mut watch = StampWatch::new(0.5);
        for late_s in [0.002, 0.3, -0.02, 0.5] {
            assert_eq!(watch.take(late_s), None);
        }
        for late_s in [-1.7e9, 4e4, 2.0, -3.0, f64::NAN] {
            let mut watch = StampWatch::new(0.5);
            assert!(matches!(watch.take(late_s), Some(StampChange::Off { .. })), "{late_s}");
        }
    }

    #[test]
    fn stamps_that_jump_and_come_back_are_told_once_each() {
        let mut watch = StampWatch::new(0.5);
        let told = [0.01, -3.0, -2.9, 0.02, 0.01].map(|late_s| watch.take(late_s));
        assert_eq!(
            told,
            [None, Some(StampChange::Off { late_s: -3.0 }), None, Some(StampChange::Right), None]
        );
    }
}
