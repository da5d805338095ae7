//! The record of one rig trial: reading `rig-trials/*.csv`.

use super::csv_input::CsvTable;
use super::error::{DatasetError, FilePlace};
use super::trial_csv_reader::check_times;

/// Rest before the motion of a rig trial, s.
pub const RIG_TRIAL_REST_S: f64 = 0.2;

/// The raw signals of a rig trial: unfiltered, offsets not removed, one value a sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RigTrialSignals {
    /// Angle commanded to the motor, rad.
    pub target_rad: Vec<f64>,
    /// Motor angle, rad.
    pub theta_m_rad: Vec<f64>,
    /// Torque measured in the lever, N m.
    pub torque_l_nm: Vec<f64>,
    /// Handle angle, rad, where measured.
    pub theta_l_rad: Option<Vec<f64>>,
    /// Angular acceleration of the handle, rad/s2, where measured.
    pub alpha_l_rad_s2: Option<Vec<f64>>,
    /// Torque between handle and load, N m, where measured.
    pub torque_h_nm: Option<Vec<f64>>,
}

impl RigTrialSignals {
    /// The channels that there are, with the names of their columns, in the order of a record.
    pub fn channels(&self) -> impl Iterator<Item = (&'static str, &[f64])> {
        let needed = [
            ("target_rad", &self.target_rad),
            ("theta_m_rad", &self.theta_m_rad),
            ("torque_l_nm", &self.torque_l_nm),
        ];
        let optional = [
            ("theta_l_rad", &self.theta_l_rad),
            ("alpha_l_rad_s2", &self.alpha_l_rad_s2),
            ("torque_h_nm", &self.torque_h_nm),
        ];
        let optional = optional.into_iter().filter_map(|(name, values)| Some((name, values.as_ref()?)));
        needed.into_iter().chain(optional).map(|(name, values)| (name, values.as_slice()))
    }
}

/// Reads a record; `file` is its name for messages. Only the record of an `analysed` trial must begin with a rest.
pub(super) fn parse_rig_record(
    file: &str,
    text: &str,
    sample_rate_hz: f64,
    analysed: bool,
) -> Result<RigTrialSignals, DatasetError> {
    let expected = "a header t_s,target_rad,theta_m_rad,torque_l_nm and a row a sample";
    let mut table = CsvTable::new(file.to_owned(), text, expected)?;
    let time = table.column("t_s")?;
    let needed = [table.column("target_rad")?, table.column("theta_m_rad")?, table.column("torque_l_nm")?];
    let optional = ["theta_l_rad", "alpha_l_rad_s2", "torque_h_nm"].map(|name| table.find(name));

    let mut times_s = Vec::new();
    let mut lines = Vec::new();
    let mut channels: [Vec<f64>; 3] = Default::default();
    let mut further = optional.map(|column| column.map(|_| Vec::new()));
    while table.next_row()? {
        times_s.push(table.number(time)?);
        for (channel, column) in channels.iter_mut().zip(needed) {
            channel.push(table.number(column)?);
        }
        for (channel, column) in further.iter_mut().zip(optional) {
            if let (Some(channel), Some(column)) = (channel, column) {
                channel.push(table.number(column)?);
            }
        }
        lines.push(table.line());
        if times_s.len() == 1 && !starts_at_zero(&times_s, sample_rate_hz) {
            return Err(table.invalid(time, "time 0 in the first row of a rig trial"));
        }
    }
    check_times(&times_s, &channels[1], sample_rate_hz, |row| {
        FilePlace::cell(file, lines[row], "column t_s")
    })?;
    let [target_rad, theta_m_rad, torque_l_nm] = channels;
    let [theta_l_rad, alpha_l_rad_s2, torque_h_nm] = further;
    if analysed {
        let at = |row: usize| FilePlace::cell(file, lines[row], "column target_rad");
        check_rest(file, &target_rad, sample_rate_hz, at)?;
    }
    Ok(RigTrialSignals { target_rad, theta_m_rad, torque_l_nm, theta_l_rad, alpha_l_rad_s2, torque_h_nm })
}

/// Whether the first of the times, s, is 0 but for rounding.
pub(super) fn starts_at_zero(times_s: &[f64], sample_rate_hz: f64) -> bool {
    times_s.first().is_none_or(|first_s| first_s.abs() <= 0.5 / sample_rate_hz)
}

/// Whether the target stands still long enough before the motion, and the record, called `name` in messages, is longer than this rest;
/// `at` is the place of a target.
pub(super) fn check_rest(
    name: &str,
    target_rad: &[f64],
    sample_rate_hz: f64,
    at: impl Fn(usize) -> FilePlace,
) -> Result<(), DatasetError> {
    let rest = (RIG_TRIAL_REST_S * sample_rate_hz).floor() as usize;
    if target_rad.len() <= rest {
        let at = FilePlace::file(name);
        return Err(DatasetError::TooShort { at, found: target_rad.len(), expected: rest + 1 });
    }
    match (0..rest).find(|row| target_rad[*row] != target_rad[0]) {
        None => Ok(()),
        Some(row) => Err(DatasetError::Value {
            at: at(row),
            found: target_rad[row].to_string(),
            expected: format!(
                "the first target, {}, for at least {RIG_TRIAL_REST_S} s: the noise is measured at rest before the motion",
                target_rad[0]
            ),
        }),
    }
}
