//! The CSV text of a whole record, for sessions that were not measured by this program.

use std::fmt::Write as _;

use super::{FurtherChannel, Record};

/// How many digits the samples have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Digits {
    /// As many as it takes to read back the same number.
    All,
    /// Those of the files that the program records: 1 µs, 10 nrad, 1 µN m.
    OfRecording,
}

/// The channels that a record may have besides angle and torque, with their columns.
pub(super) fn optional_channels(record: &Record) -> impl Iterator<Item = (&'static str, &[f64])> {
    let emg = [("emg_fcr_mvc", &record.emg_fcr_mvc), ("emg_ecr_mvc", &record.emg_ecr_mvc)];
    let emg = emg.into_iter().filter_map(|(column, values)| Some((column, values.as_deref()?)));
    let further = FurtherChannel::ALL.into_iter();
    emg.chain(further.filter_map(|channel| Some((channel.column(), record.further(channel)?.as_slice()))))
}

/// The text of a record, with the columns of the channels that it has.
pub fn record_csv(record: &Record, sample_rate_hz: f64, digits: Digits) -> String {
    let optional: Vec<(&str, &[f64])> = optional_channels(record).collect();
    let mut text = "t_s,theta_m_rad,torque_l_nm".to_owned();
    optional.iter().for_each(|(column, _)| text += &format!(",{column}"));
    text += "\n";
    for (sample, (angle, torque)) in record.theta_m_rad.iter().zip(&record.torque_l_nm).enumerate() {
        let time_s = record.start_s + sample as f64 / sample_rate_hz;
        // Writing into memory does not fail.
        let _ = match digits {
            Digits::All => write!(text, "{time_s},{angle},{torque}"),
            Digits::OfRecording => write!(text, "{time_s:.6},{angle:.8},{torque:.6}"),
        };
        for (column, values) in &optional {
            let value = values[sample];
            let _ = match digits {
                Digits::All => write!(text, ",{value}"),
                Digits::OfRecording if column.ends_with("_mvc") => write!(text, ",{value:.6}"),
                Digits::OfRecording => write!(text, ",{value:.8}"),
            };
        }
        text += "\n";
    }
    text
}
