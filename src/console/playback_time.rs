//! The time of a recording as it is played: of a pause only the beginning.

use crate::session::Phase;

/// Time that is played of a pause, s.
const PLAYED_PAUSE_S: f64 = 3.0;

/// Counts the samples that are played.
#[derive(Debug, Clone, Default)]
pub struct PlaybackTime {
    /// Samples played so far.
    played: u64,
    /// Sample at which the present pause began.
    pause_start: Option<u64>,
}

impl PlaybackTime {
    /// Takes the step that made `sample` samples since the session was started or resumed; returns whether it is played.
    pub fn takes(&mut self, phase: Phase, sample: u64, rate_hz: f64) -> bool {
        if phase != Phase::Paused {
            self.pause_start = None;
        } else {
            let start = *self.pause_start.get_or_insert(sample);
            if (sample - start) as f64 >= PLAYED_PAUSE_S * rate_hz {
                return false;
            }
        }
        self.played += 1;
        true
    }

    /// Time in the recording as it is played, s.
    pub fn position_s(&self, rate_hz: f64) -> f64 {
        self.played as f64 / rate_hz
    }

    /// How long the pause lasted that ends with sample `sample`, s, if it was not played in full.
    pub fn shortened_pause_s(&self, sample: u64, rate_hz: f64) -> Option<f64> {
        let lasted_s = (sample - self.pause_start?) as f64 / rate_hz;
        (lasted_s > PLAYED_PAUSE_S).then_some(lasted_s)
    }
}

/// A duration in the units that a person would use: `160 h`, `2 min 5 s`.
pub fn duration_text(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    let (hours, minutes, seconds) = (whole / 3600, whole / 60 % 60, whole % 60);
    let parts = match hours {
        0 => [(minutes, "min"), (seconds, "s")],
        _ => [(hours, "h"), (minutes, "min")],
    };
    let parts: Vec<String> =
        parts.iter().filter(|(value, _)| *value > 0).map(|(value, unit)| format!("{value} {unit}")).collect();
    if parts.is_empty() { "0 s".to_owned() } else { parts.join(" ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_pause_of_days_three_seconds_are_played() {
        const RATE_HZ: f64 = 100.0;
        let mut time = PlaybackTime::default();
        let rest = (1..=200).filter(|sample| time.takes(Phase::Rest, *sample, RATE_HZ)).count();
        let settling = (201..=2000).filter(|sample| time.takes(Phase::Paused, *sample, RATE_HZ)).count();
        assert_eq!((rest, settling), (200, 300));
        let days = 201 + 160 * 3600 * 100;
        assert_eq!(time.shortened_pause_s(days, RATE_HZ), Some(160.0 * 3600.0));
        assert!(time.takes(Phase::Rest, days, RATE_HZ));
        assert_eq!(time.position_s(RATE_HZ), 5.01);
        // A short pause is played as it was.
        assert!((days + 1..days + 201).all(|sample| time.takes(Phase::Paused, sample, RATE_HZ)));
        assert_eq!(time.shortened_pause_s(days + 201, RATE_HZ), None);
    }

    #[test]
    fn a_duration_is_told_in_the_units_of_a_person() {
        for (seconds, text) in
            [(0.2, "0 s"), (7.4, "7 s"), (125.0, "2 min 5 s"), (576_000.0, "160 h"), (5400.0, "1 h 30 min")]
        {
            assert_eq!(duration_text(seconds), text);
        }
    }
}
