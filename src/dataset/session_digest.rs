//! A sum over all that an analysis reads of a session, so that results know what they were made from.

use std::collections::BTreeMap;

use sha2::{Digest, Sha256};

use super::hexadecimal::hexadecimal;
use super::{Session, Trial};

impl Session {
    /// SHA-256 over subject, rate, lever, filter, table and samples, in hexadecimal digits.
    ///
    /// Layout and further files of the folder do not matter; a value that changes the analysis does.
    pub fn digest(&self) -> String {
        let mut sum = Sha256::new();
        let mut put = |bytes: &[u8]| {
            sum.update((bytes.len() as u64).to_le_bytes());
            sum.update(bytes);
        };
        put(self.subject.id.as_bytes());
        put(&self.sample_rate_hz.to_le_bytes());
        put(format!("{:?}", self.lever).as_bytes());
        put(format!("{:?}", self.recorded_filter).as_bytes());
        let mut bytes = Vec::new();
        for trial in &self.trials {
            put(table_row(trial).as_bytes());
            let record = &trial.record;
            put(&record.start_s.to_le_bytes());
            let channels = [
                Some(&record.theta_m_rad),
                Some(&record.torque_l_nm),
                record.emg_fcr_mvc.as_ref(),
                record.emg_ecr_mvc.as_ref(),
            ];
            for channel in channels {
                put(little_endian(channel.map_or(&[], Vec::as_slice), &mut bytes));
            }
            for channel in record.further_channels() {
                put(channel.column().as_bytes());
                put(little_endian(record.further(channel).map_or(&[], Vec::as_slice), &mut bytes));
            }
        }
        hexadecimal(sum)
    }
}

/// The samples as bytes, written over what `bytes` held.
fn little_endian<'a>(samples: &[f64], bytes: &'a mut Vec<u8>) -> &'a [u8] {
    bytes.resize(8 * samples.len(), 0);
    let (eights, _) = bytes.as_chunks_mut::<8>();
    for (eight, sample) in eights.iter_mut().zip(samples) {
        *eight = sample.to_le_bytes();
    }
    bytes
}

/// What the table says of a trial.
fn table_row(trial: &Trial) -> String {
    let extra: &BTreeMap<String, String> = &trial.extra;
    format!(
        "{} {} {} {} {:?} {:?} {} {extra:?}",
        trial.number,
        trial.velocity_rad_s,
        trial.torque_nm,
        trial.repetition,
        trial.condition,
        trial.onset_s,
        trial.status.name()
    )
}
