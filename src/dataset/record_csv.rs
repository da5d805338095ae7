//! The CSV text of a whole record, for sessions that were not measured by this program.

use std::fmt::Write as _;

use super::Record;

/// How many digits the samples have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Digits {
    /// As many as it takes to read back the same number.
    All,
    /// Those of the files that the program records: 1 µs, 10 nrad, 1 µN m.
    OfRecording,
}

/// The text of a record, with the columns of the channels that it has.
pub fn record_csv(record: &Record, sample_rate_hz: f64, digits: Digits) -> String {
    let channels: Vec<(&str, &[f64])> = record.channels().collect();
    channels_csv(&channels, record.start_s, sample_rate_hz, digits)
}

/// The text of `channels`, each with the name of its column, whose first sample is at `start_s`.
pub(super) fn channels_csv(
    channels: &[(&str, &[f64])],
    start_s: f64,
    sample_rate_hz: f64,
    digits: Digits,
) -> String {
    let mut text = "t_s".to_owned();
    channels.iter().for_each(|(column, _)| text += &format!(",{column}"));
    text += "\n";
    for sample in 0..channels.iter().map(|(_, samples)| samples.len()).min().unwrap_or(0) {
        let time_s = start_s + sample as f64 / sample_rate_hz;
        // Writing into memory does not fail.
        let _ = match digits {
            Digits::All => write!(text, "{time_s}"),
            Digits::OfRecording => write!(text, "{time_s:.6}"),
        };
        for (column, samples) in channels {
            let value = samples[sample];
            let _ = match digits {
                Digits::All => write!(text, ",{value}"),
                Digits::OfRecording if *column == "torque_l_nm" || column.ends_with("_mvc") => {
                    write!(text, ",{value:.6}")
                }
                Digits::OfRecording => write!(text, ",{value:.8}"),
            };
        }
        text += "\n";
    }
    text
}
