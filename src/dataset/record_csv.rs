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
    let mut text = "t_s".to_owned();
    channels.iter().for_each(|(column, _)| text += &format!(",{column}"));
    text += "\n";
    for sample in 0..record.theta_m_rad.len().min(record.torque_l_nm.len()) {
        let time_s = record.start_s + sample as f64 / sample_rate_hz;
        // Writing into memory does not fail.
        let _ = match digits {
            Digits::All => write!(text, "{time_s}"),
            Digits::OfRecording => write!(text, "{time_s:.6}"),
        };
        for (column, samples) in &channels {
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
