//! The channels of a record, as the files of other tools name and describe them.

use crate::dataset::{FurtherChannel, Record, Session};

/// A channel of the record of a trial.
#[derive(Debug, Clone, Copy)]
pub struct RecordChannel {
    /// Name of its column.
    pub column: &'static str,
    /// Kind of quantity, as XDF names it: `Angle`, `Torque`, `EMG`, `Acceleration`.
    pub kind: &'static str,
    /// Unit of the samples.
    pub unit: &'static str,
    /// What is measured, for readers.
    pub title: &'static str,
    /// The samples of a record; `None` where the channel was not measured.
    pub samples: fn(&Record) -> Option<&Vec<f64>>,
}

/// All channels, in the order of their columns.
fn all() -> [RecordChannel; 4 + FurtherChannel::COUNT] {
    let of = |column, kind, unit, title, samples| RecordChannel { column, kind, unit, title, samples };
    let further = |channel: FurtherChannel, kind, samples| RecordChannel {
        column: channel.column(),
        kind,
        unit: channel.unit(),
        title: channel.title(),
        samples,
    };
    [
        of("theta_m_rad", "Angle", "rad", "motor angle, positive extends the wrist", |record| {
            Some(&record.theta_m_rad)
        }),
        of("torque_l_nm", "Torque", "N m", "torque in the lever, positive resists extension", |record| {
            Some(&record.torque_l_nm)
        }),
        of(
            "emg_fcr_mvc",
            "EMG",
            "MVC",
            "flexor carpi radialis, fraction of maximal voluntary contraction",
            |record| record.emg_fcr_mvc.as_ref(),
        ),
        of(
            "emg_ecr_mvc",
            "EMG",
            "MVC",
            "extensor carpi radialis, fraction of maximal voluntary contraction",
            |record| record.emg_ecr_mvc.as_ref(),
        ),
        further(FurtherChannel::HandleAngle, "Angle", |record| record.theta_l_rad.as_ref()),
        further(FurtherChannel::HandleAcceleration, "Acceleration", |record| record.alpha_l_rad_s2.as_ref()),
        further(FurtherChannel::HandTorque, "Torque", |record| record.torque_h_nm.as_ref()),
        further(FurtherChannel::JointAngle, "Angle", |record| record.theta_j_rad.as_ref()),
    ]
}

/// The channels that every record of `session` with samples has.
pub fn common_channels(session: &Session) -> Vec<RecordChannel> {
    let recorded = || session.trials.iter().filter(|trial| !trial.record.theta_m_rad.is_empty());
    all().into_iter().filter(|own| recorded().all(|trial| (own.samples)(&trial.record).is_some())).collect()
}

/// The channels that any record of `session` has.
pub fn measured_channels(session: &Session) -> Vec<RecordChannel> {
    let records = || session.trials.iter().map(|trial| &trial.record);
    all().into_iter().filter(|own| records().any(|record| (own.samples)(record).is_some())).collect()
}

/// What the channel with this symbol measures, such as `theta_m` of the column `theta_m_rad`; nothing for an unknown one.
pub fn title(symbol: &str) -> &'static str {
    let is_own =
        |own: &RecordChannel| own.column.strip_prefix(symbol).is_some_and(|unit| unit.starts_with('_'));
    all().into_iter().find(is_own).map_or("", |own| own.title)
}
