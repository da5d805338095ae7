//! The rows of a record: decimal numbers with a fixed number of places, which read back to the very same value.

use super::FurtherChannel;
use crate::rig::{Sample, resolution};

/// Writes the rows of one record.
#[derive(Debug, Clone)]
pub struct TrialCsvWriter {
    sample_rate_hz: f64,
    time_places: usize,
}

/// The columns that every record of a trial has.
pub const HEADER: &[u8] = b"t_s,theta_m_rad,torque_l_nm\n";

/// The columns of the muscles that are measured.
const EMG_COLUMNS: [&str; 2] = ["emg_fcr_mvc", "emg_ecr_mvc"];

/// The columns that every record of a rig trial has; no muscle is part of it.
pub const RIG_HEADER: &[u8] = b"t_s,target_rad,theta_m_rad,torque_l_nm\n";

/// The further channels that a rig trial has: without a person there is no joint.
const RIG_CHANNELS: [FurtherChannel; 3] =
    [FurtherChannel::HandleAngle, FurtherChannel::HandleAcceleration, FurtherChannel::HandTorque];

/// The header of the record of a rig trial of samples like this one.
pub fn rig_header(sample: &Sample) -> Vec<u8> {
    let mut header = RIG_HEADER[..RIG_HEADER.len() - 1].to_vec();
    for (channel, _) in rig_channels(sample) {
        header.push(b',');
        header.extend_from_slice(channel.column().as_bytes());
    }
    header.push(b'\n');
    header
}

/// The further channels of a rig trial that the rig measures, and their values.
fn rig_channels(sample: &Sample) -> impl Iterator<Item = (FurtherChannel, f64)> {
    let of_rig = FurtherChannel::ALL.into_iter().zip(sample.further);
    of_rig.filter_map(|(channel, value)| Some((channel, value?))).filter(|own| RIG_CHANNELS.contains(&own.0))
}

/// The header of a record of samples like this one.
pub fn header(sample: &Sample) -> Vec<u8> {
    let mut header = HEADER[..HEADER.len() - 1].to_vec();
    let muscles = EMG_COLUMNS.into_iter().zip([sample.emg_fcr_mvc, sample.emg_ecr_mvc]);
    let further = FurtherChannel::ALL.into_iter().map(FurtherChannel::column).zip(sample.further);
    for (column, _) in muscles.chain(further).filter(|(_, value)| value.is_some()) {
        header.push(b',');
        header.extend_from_slice(column.as_bytes());
    }
    header.push(b'\n');
    header
}

/// The header line of a record that may be cut anywhere; `None` if it is not complete, or no header that this program writes.
pub fn header_of(record: &[u8]) -> Option<&[u8]> {
    let end = record.iter().position(|byte| *byte == b'\n')?;
    let after = |least: &'static [u8]| record[..end].strip_prefix(&least[..least.len() - 1]);
    let (optional, emg, further): (_, &[&str], &[FurtherChannel]) = match after(RIG_HEADER) {
        Some(optional) => (optional, &[], &RIG_CHANNELS),
        None => (after(HEADER)?, &EMG_COLUMNS, &FurtherChannel::ALL),
    };
    let optional = std::str::from_utf8(optional).ok()?;
    let is_known = |name: &str| emg.contains(&name) || further.iter().any(|channel| channel.column() == name);
    let all_known = optional.is_empty() || optional.strip_prefix(',')?.split(',').all(is_known);
    all_known.then_some(&record[..=end])
}

impl TrialCsvWriter {
    /// TrialCsvWriter at a rate; times get as many places as it takes to be exact, at most 9.
    pub fn new(sample_rate_hz: f64) -> Self {
        let exact = |places: &usize| {
            let ticks = 10f64.powi(*places as i32) / sample_rate_hz;
            ticks >= 1.0 && ticks.fract() == 0.0
        };
        Self { sample_rate_hz, time_places: (3..9).find(exact).unwrap_or(9) }
    }

    /// Time of a sample, s.
    pub fn time_s(&self, sample: u64) -> f64 {
        sample as f64 / self.sample_rate_hz
    }

    /// Adds the row of a sample. Values that a converter cannot give (NaN, infinity) are not in any record.
    pub fn push(&self, rows: &mut Vec<u8>, sample: u64, values: &Sample) {
        self.push_cells(
            rows,
            sample,
            [
                (values.theta_m_rad, resolution::ANGLE_PER_RAD, 7),
                (values.torque_l_nm, resolution::TORQUE_PER_NM, 5),
            ],
        );
        for value in [values.emg_fcr_mvc, values.emg_ecr_mvc].into_iter().flatten() {
            push_cell(rows, (value, resolution::EMG_PER_MVC, 5));
        }
        let further = FurtherChannel::ALL.into_iter().zip(values.further);
        push_further(rows, further.filter_map(|(channel, value)| Some((channel, value?))));
        rows.push(b'\n');
    }

    /// As [`TrialCsvWriter::push`], for the record of a rig trial; `target_rad` is the angle commanded for the sample.
    pub fn push_rig(&self, rows: &mut Vec<u8>, sample: u64, target_rad: f64, values: &Sample) {
        self.push_cells(
            rows,
            sample,
            [
                (target_rad, resolution::ANGLE_PER_RAD, 7),
                (values.theta_m_rad, resolution::ANGLE_PER_RAD, 7),
                (values.torque_l_nm, resolution::TORQUE_PER_NM, 5),
            ],
        );
        push_further(rows, rig_channels(values));
        rows.push(b'\n');
    }

    fn push_cells<const N: usize>(&self, rows: &mut Vec<u8>, sample: u64, cells: [(f64, f64, usize); N]) {
        let ticks = self.time_s(sample) * 10f64.powi(self.time_places as i32);
        push_decimal(rows, ticks.round() as i64, self.time_places);
        for cell in cells {
            push_cell(rows, cell);
        }
    }
}

fn push_further(rows: &mut Vec<u8>, channels: impl Iterator<Item = (FurtherChannel, f64)>) {
    for (channel, value) in channels {
        push_cell(rows, (value, resolution::further_steps(channel), resolution::further_places(channel)));
    }
}

/// Adds a value, rounded to the nearest of its steps, after a comma.
fn push_cell(rows: &mut Vec<u8>, (value, steps, places): (f64, f64, usize)) {
    rows.push(b',');
    // Half a step away from zero and the cut towards it round to the nearest step.
    push_decimal(rows, (value * steps + f64::copysign(0.5, value)) as i64, places);
}

/// Adds `number / 10^places` as a decimal.
fn push_decimal(text: &mut Vec<u8>, number: i64, places: usize) {
    let mut digits = [b'0'; 24];
    let mut first = digits.len();
    let mut rest = number.unsigned_abs();
    while rest > 0 || digits.len() - first < places + 2 {
        first -= 1;
        if digits.len() - first == places + 1 {
            digits[first] = b'.';
            continue;
        }
        digits[first] = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
    if number < 0 {
        text.push(b'-');
    }
    text.extend_from_slice(&digits[first..]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_row_has_time_and_channels_with_fixed_places() {
        let sample = Sample {
            theta_m_rad: -0.0014123,
            torque_l_nm: 2.1,
            emg_fcr_mvc: Some(0.0),
            emg_ecr_mvc: Some(-1.5),
            ..Sample::default()
        };
        let mut text = Vec::new();
        TrialCsvWriter::new(2500.0).push(&mut text, 3, &sample);
        assert_eq!(String::from_utf8(text).unwrap(), "0.0012,-0.0014123,2.10000,0.00000,-1.50000\n");
        assert_eq!(header(&sample), b"t_s,theta_m_rad,torque_l_nm,emg_fcr_mvc,emg_ecr_mvc\n");
    }

    #[test]
    fn a_muscle_that_is_not_measured_has_no_column() {
        for (emg, columns, cells) in
            [([None, None], "", ""), ([None, Some(0.25)], ",emg_ecr_mvc", ",0.25000")]
        {
            let sample = Sample { emg_fcr_mvc: emg[0], emg_ecr_mvc: emg[1], ..Sample::default() };
            let mut text = Vec::new();
            TrialCsvWriter::new(2500.0).push(&mut text, 0, &sample);
            assert_eq!(
                String::from_utf8(text.clone()).unwrap(),
                format!("0.0000,0.0000000,0.00000{cells}\n")
            );
            let header = header(&sample);
            assert_eq!(
                String::from_utf8(header.clone()).unwrap(),
                format!("t_s,theta_m_rad,torque_l_nm{columns}\n")
            );
            assert_eq!(header_of(&[header.clone(), text].concat()), Some(&header[..]));
        }
    }

    #[test]
    fn a_rig_with_more_sensors_has_a_column_for_each() {
        let sample =
            Sample { further: [Some(-0.00123), Some(-412.5), Some(1.25), None], ..Sample::default() };
        let mut text = Vec::new();
        TrialCsvWriter::new(2500.0).push(&mut text, 0, &sample);
        let row = "0.0000,0.0000000,0.00000,-0.0012300,-412.500,1.25000\n";
        assert_eq!(String::from_utf8(text.clone()).unwrap(), row);
        let columns = "t_s,theta_m_rad,torque_l_nm,theta_l_rad,alpha_l_rad_s2,torque_h_nm\n";
        let header = header(&sample);
        assert_eq!(String::from_utf8(header.clone()).unwrap(), columns);
        let record = [header.clone(), text].concat();
        assert_eq!(header_of(&record), Some(&header[..]));
        assert_eq!(header_of(&record[..header.len() - 1]), None, "the header is cut");
        assert_eq!(header_of(b"t_s,theta_m_rad,torque_l_nm,emg_fcr_mvc,emg_ecr_mvc,theta_x_rad\n"), None);
    }

    #[test]
    fn a_rig_trial_has_the_sensors_of_the_handle_and_none_of_muscle_or_joint() {
        let sample = Sample {
            theta_m_rad: 0.5,
            emg_fcr_mvc: Some(0.1),
            emg_ecr_mvc: Some(0.1),
            further: [Some(-0.00123), None, Some(1.25), Some(0.3)],
            ..Sample::default()
        };
        let writer = TrialCsvWriter::new(2500.0);
        let mut text = rig_header(&sample);
        writer.push_rig(&mut text, 0, 0.25, &sample);
        let expected = "t_s,target_rad,theta_m_rad,torque_l_nm,theta_l_rad,torque_h_nm\n\
                        0.0000,0.2500000,0.5000000,0.00000,-0.0012300,1.25000\n";
        assert_eq!(String::from_utf8(text.clone()).unwrap(), expected);
        assert_eq!(header_of(&text), Some(&rig_header(&sample)[..]));
        assert_eq!(rig_header(&Sample::default()), RIG_HEADER);
        for column in ["theta_j_rad", "emg_fcr_mvc"] {
            let foreign = format!("t_s,target_rad,theta_m_rad,torque_l_nm,{column}\n");
            assert_eq!(header_of(foreign.as_bytes()), None);
        }
    }

    #[test]
    fn times_have_as_many_places_as_the_rate_needs() {
        let places = |rate| TrialCsvWriter::new(rate).time_places;
        assert_eq!([places(1000.0), places(2500.0), places(4096.0), places(3000.0)], [3, 4, 9, 9]);
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back_to_the_same_bits(
            angle in -3.0..3.0f64, torque in -50.0..50.0f64, fcr in -5.0..5.0f64, ecr in -5.0..5.0f64,
            handle in -3.0..3.0f64, acceleration in -5000.0..5000.0f64, hand in -50.0..50.0f64
        ) {
            let sample = Sample {
                theta_m_rad: angle,
                torque_l_nm: torque,
                emg_fcr_mvc: Some(fcr),
                emg_ecr_mvc: Some(ecr),
                further: [Some(handle), Some(acceleration), Some(hand), None],
            }
            .rounded();
            let mut text = Vec::new();
            TrialCsvWriter::new(2500.0).push(&mut text, 0, &sample);
            let text = String::from_utf8(text).unwrap();
            let read: Vec<f64> = text.trim().split(',').map(|cell| cell.parse().unwrap()).collect();
            let further: Vec<f64> = sample.further.into_iter().flatten().collect();
            prop_assert_eq!(&read[1..5], &[
                sample.theta_m_rad, sample.torque_l_nm, sample.emg_fcr_mvc.unwrap(), sample.emg_ecr_mvc.unwrap()
            ]);
            prop_assert_eq!(&read[5..], &further[..]);
        }
    }
}
