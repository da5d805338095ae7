//! How fast a session on the virtual wrist runs.

use super::Failure;

/// Speed of a session on the virtual wrist.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pace {
    /// As fast as possible.
    Unlimited,
    /// This many times real time.
    TimesRealTime(f64),
}

impl Pace {
    /// The pace that `--real-time` and `--speed` ask for.
    ///
    /// # Errors
    /// If the speed is not from 0.01 to 1000.
    pub fn new(real_time: bool, speed: Option<f64>) -> Result<Self, Failure> {
        match speed {
            None if real_time => Ok(Self::TimesRealTime(1.0)),
            None => Ok(Self::Unlimited),
            Some(speed) if (0.01..=1000.0).contains(&speed) => Ok(Self::TimesRealTime(speed)),
            Some(speed) => {
                Err(Failure::Usage(format!("--speed {speed}: expected a number from 0.01 to 1000")))
            }
        }
    }

    /// Whether a second of the session is one of the clocks: other devices can be recorded with it.
    pub fn is_real_time(self) -> bool {
        self == Self::TimesRealTime(1.0)
    }
}
