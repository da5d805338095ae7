//! From tables and a mapping to a session.

use super::conditions::{grouped, repetitions};
use super::cut::{at_ramps, into_trials};
use super::error::ImportError;
use super::mapped_signal::{MappedSignal, SignalUnit};
use super::mapping::Mapping;
use super::plausible::{check_distinct, check_own_records, check_units};
use super::ramp_candidates::{MovingRecord, with_ramps};
use super::ramp_way::RampWay;
use super::recording::TIME_COLUMN;
use super::source_table::SourceTable;
use crate::consistency::MeasuredTrial;
use crate::dataset::{
    EVENLY, FurtherChannel, Record, Session, Status, Subject, Trial, UnevenTime, grain, uneven_step,
    uneven_time,
};
use crate::statistics::upper_median;

/// Most rates are whole numbers. One is taken for the nearest if that moves the last sample by no more than this part of the time between two
/// samples, beside what the times are rounded by.
const RATE_ROUNDING: f64 = 0.05;

/// What to do about several ramps in a trial.
const SHORTEN: &str = "shorten long_record.after_s";
const CUT: &str = "cut the recording with long_record or trial_column";

/// A session made of a foreign recording, before it is written.
#[derive(Debug, Clone)]
pub struct ImportedSession {
    /// The session; onsets are those that were found.
    pub session: Session,
    /// For each trial, the table it is from.
    pub sources: Vec<String>,
    /// Tables and ramps that gave no trial, and why.
    pub left_out: Vec<String>,
}

/// Makes a session of `tables` as `mapping` says.
///
/// # Errors
/// If a column is missing, the sample rate is not known, or no trial is found.
pub fn import(tables: Vec<SourceTable>, mapping: &Mapping) -> Result<ImportedSession, ImportError> {
    check_distinct(&tables, mapping)?;
    let mut records = Vec::new();
    for table in tables {
        records.extend(into_trials(table, mapping)?);
    }
    check_own_records(&records, mapping)?;
    let rate_hz = sample_rate(&records, mapping)?;
    let (mut parts, mut left_out) = (Vec::new(), Vec::new());
    for record in records {
        let cut = at_ramps(record, mapping, rate_hz)?;
        parts.extend(cut.parts);
        left_out.extend(cut.left_out);
    }
    let mut candidates = Vec::new();
    for part in parts {
        let record = record(&part, mapping)?;
        if let Some((channel, sample)) = not_finite(&record) {
            left_out.push(format!("{}: sample {} of the {channel} is no number", part.name, sample + 1));
            continue;
        }
        let trial = trial(record);
        match MeasuredTrial::new(&trial, rate_hz) {
            Some(own) => candidates.push(MovingRecord { trial, measured: own, source: part.name }),
            None => left_out.push(format!("{}: no ramp stands out of the noise of the angle", part.name)),
        }
    }
    let (with_ramps, without_ramps) = with_ramps(candidates);
    left_out.extend(without_ramps);
    let (mut trials, mut sources) = (Vec::new(), Vec::new());
    let mut measured = Vec::new();
    for MovingRecord { mut trial, measured: own, source } in with_ramps {
        left_out.extend(later_ramps(&trial.record.theta_m_rad, own.hold_rad).map(|sample| {
            let time_s = sample as f64 / rate_hz;
            let cut = if mapping.long_record.is_some() { SHORTEN } else { CUT };
            format!("{source}: another ramp begins after {time_s:.3} s; a trial has one: {cut}")
        }));
        trial.number = trials.len() as u32 + 1;
        trial.file = format!("trials/trial-{:03}.csv", trial.number);
        trial.onset_s = Some(own.motion_s);
        measured.push(own);
        trials.push(trial);
        sources.push(source);
    }
    if trials.is_empty() {
        let reason = left_out.first().cloned().unwrap_or_else(|| "the source has no table".to_owned());
        return Err(ImportError::NoTrial {
            reason: format!("{reason}; check the column and the unit of the angle"),
        });
    }
    check_units(&trials, &sources, mapping)?;
    let speeds = grouped(&measured.iter().map(|own| own.middle_speed_rad_s).collect::<Vec<_>>());
    let torques = grouped(&measured.iter().map(|own| own.hold_nm).collect::<Vec<_>>());
    let conditions: Vec<(f64, f64)> = speeds.into_iter().zip(torques).collect();
    for ((trial, condition), repetition) in trials.iter_mut().zip(&conditions).zip(repetitions(&conditions)) {
        (trial.velocity_rad_s, trial.torque_nm) = *condition;
        trial.repetition = repetition;
    }
    let session = Session {
        subject: Subject { id: mapping.subject.clone() },
        sample_rate_hz: rate_hz,
        lever: mapping.lever,
        recorded_filter: mapping.recorded_filter,
        channel_ranges: Default::default(),
        trials,
    };
    Ok(ImportedSession { session, sources, left_out })
}

/// Samples at which the motor leaves for another ramp after that of the trial.
fn later_ramps(theta_rad: &[f64], hold_rad: f64) -> impl Iterator<Item = usize> {
    RampWay::of(theta_rad, hold_rad).taken_in(theta_rad).into_iter().skip(1).map(|(left_at, _)| left_at)
}

/// The sample rate that the mapping states, or that of the column of time, which must be the same in every table.
fn sample_rate(tables: &[SourceTable], mapping: &Mapping) -> Result<f64, ImportError> {
    let not_known = |reason: String| ImportError::NoTrial { reason };
    // A format that has a rate of its own needs no column in the mapping.
    let own_clock = MappedSignal::plain(TIME_COLUMN, SignalUnit::Second);
    let time = match &mapping.columns.time {
        Some(time) => Some(time),
        None => tables.iter().all(|table| table.stated.is_even).then_some(&own_clock),
    };
    let measured = match time {
        Some(time) => {
            tables.iter().map(|table| measured_rate(table, time, mapping)).collect::<Result<Vec<_>, _>>()?
        }
        None => Vec::new(),
    };
    let rate_hz = mapping.sample_rate_hz.or(measured.first().copied()).ok_or_else(|| {
        not_known("the mapping has neither sample_rate_hz nor columns.time; add one of them".into())
    })?;
    for (own_hz, table) in measured.iter().zip(tables) {
        if (own_hz - rate_hz).abs() > RATE_ROUNDING * rate_hz {
            let advice = match time.and_then(|time| time_unit(time, *own_hz, rate_hz)) {
                Some(unit) => format!(
                    "is the time in {}? Then write \"unit\": \"{}\" in columns.time",
                    unit.name(),
                    unit.name()
                ),
                None if mapping.sample_rate_hz.is_some() => {
                    "correct sample_rate_hz, or leave it out: the column of time says it".to_owned()
                }
                None => "import recordings of one rate".to_owned(),
            };
            return Err(not_known(format!(
                "{}: its time has {own_hz:.6} samples a second; expected {rate_hz:.6}, as {}; {advice}",
                table.name,
                if mapping.sample_rate_hz.is_some() { "sample_rate_hz says" } else { "the first table has" },
            )));
        }
    }
    Ok(rate_hz)
}

/// Fewest samples a second of which a ramp of some ten milliseconds is more than a sample, Hz.
const SLOWEST_HZ: f64 = 50.0;

/// The unit of the time that would make a rate of `own_hz` one of `rate_hz`.
fn time_unit(time: &MappedSignal, own_hz: f64, rate_hz: f64) -> Option<SignalUnit> {
    let units = [SignalUnit::Second, SignalUnit::Millisecond, SignalUnit::Microsecond];
    units.into_iter().filter(|unit| *unit != time.unit).find(|unit| {
        let as_if_hz = own_hz * time.unit.factor() / unit.factor();
        (as_if_hz / rate_hz - 1.0).abs() < 0.01
    })
}

/// The rate of a column of time without gaps, by which samples are taken for even from then on.
fn measured_rate(table: &SourceTable, time: &MappedSignal, mapping: &Mapping) -> Result<f64, ImportError> {
    let not_known = |what: String| wrong_time(table, time, &what);
    let times_s: Vec<f64> =
        column(table, time, "the time")?.iter().map(|value| time.convert(*value)).collect();
    let (Some(first_s), Some(last_s)) = (times_s.first(), times_s.last()) else {
        return Err(not_known("is empty".into()));
    };
    let step_s = (last_s - first_s) / (times_s.len() - 1) as f64;
    if step_s.is_nan() || step_s <= 0.0 {
        return Err(not_known(
            "does not rise; are these several trials? Then name their column in trial_column".into(),
        ));
    }
    if step_s > 1.0 / SLOWEST_HZ {
        return Err(not_known(format!(
            "has a sample every {step_s} s, too few for a ramp; is it in ms? Then write \"unit\": \"ms\" in columns.time"
        )));
    }
    check_even(table, time, &times_s, step_s, mapping)?;
    let off_s = |(sample, own_s): (usize, &f64)| (*own_s - first_s - sample as f64 * step_s).abs();
    let rate_hz = 1.0 / step_s;
    let whole_hz = libm::round(rate_hz);
    let rounded_s = times_s.iter().enumerate().map(off_s).fold(0.0, f64::max);
    let moved_s = (times_s.len() - 1) as f64 * (step_s - 1.0 / whole_hz).abs();
    Ok(if moved_s < 2.0 * rounded_s + RATE_ROUNDING * step_s { whole_hz } else { rate_hz })
}

/// That a table's times cannot be used: `what` is wrong with their column.
fn wrong_time(table: &SourceTable, time: &MappedSignal, what: &str) -> ImportError {
    ImportError::NoTrial { reason: format!("{}: the column {} {what}", table.name, time.column) }
}

/// Refuses times that are not those of samples taken evenly, `step_s` apart in the mean. They may be rounded to more than a sample, such as
/// whole milliseconds at 2500 a second.
fn check_even(
    table: &SourceTable,
    time: &MappedSignal,
    times_s: &[f64],
    step_s: f64,
    mapping: &Mapping,
) -> Result<(), ImportError> {
    let refused = |what: String| Err(wrong_time(table, time, &what));
    let grain_s = grain(column(table, time, "the time")?) * time.unit.factor();
    let usual_s = upper_median(times_s.windows(2).map(|pair| pair[1] - pair[0])).unwrap_or(step_s);
    // Of times that are rounded to more than a sample, no step is the usual one.
    let period_s = if grain_s > step_s || usual_s <= 0.0 { step_s } else { usual_s };
    if let Some(sample) = uneven_step(times_s, period_s, grain_s) {
        return refused(format!(
            "does not rise evenly: it goes from {} s to {} s at sample {}, where a step of {period_s:.7} s is due; export the recording \
             without gaps and without repeated samples",
            times_s[sample - 1],
            times_s[sample],
            sample + 1
        ));
    }
    let angle = &mapping.columns.angle;
    let theta_rad: Vec<f64> =
        column(table, angle, "the angle")?.iter().map(|value| angle.convert(*value)).collect();
    match uneven_time(times_s, &theta_rad, step_s, || grain_s) {
        Some(UnevenTime { sample, off_s, moved_rad }) => refused(format!(
            "does not rise evenly: {} s at sample {} is {:.1} us off even steps, more than its digits explain, and the motor turns by \
             {moved_rad:.2e} rad in that. {EVENLY}. Without columns.time, sample_rate_hz says how far even samples are apart",
            times_s[sample],
            sample + 1,
            off_s * 1e6
        )),
        None => Ok(()),
    }
}

fn record(table: &SourceTable, mapping: &Mapping) -> Result<Record, ImportError> {
    let columns = &mapping.columns;
    let converted = |signal: &MappedSignal, role: &'static str| -> Result<Vec<f64>, ImportError> {
        Ok(column(table, signal, role)?.iter().map(|value| signal.convert(*value)).collect())
    };
    let optional =
        |signal: &Option<MappedSignal>, role| signal.as_ref().map(|own| converted(own, role)).transpose();
    Ok(Record {
        start_s: 0.0,
        theta_m_rad: converted(&columns.angle, "the angle")?,
        torque_l_nm: converted(&columns.torque, "the torque")?,
        emg_fcr_mvc: optional(&columns.emg_fcr, "the EMG of the FCR")?,
        emg_ecr_mvc: optional(&columns.emg_ecr, "the EMG of the ECR")?,
        theta_l_rad: optional(&columns.handle_angle, "the angle of the handle")?,
        alpha_l_rad_s2: optional(&columns.handle_acceleration, "the acceleration of the handle")?,
        torque_h_nm: optional(&columns.hand_torque, "the torque at the hand")?,
        theta_j_rad: optional(&columns.joint_angle, "the angle of the joint")?,
    })
}

/// The first sample of a record that is no number, with its channel.
fn not_finite(record: &Record) -> Option<(&'static str, usize)> {
    let always = [("angle", Some(&record.theta_m_rad)), ("torque", Some(&record.torque_l_nm))];
    let emg =
        [("EMG of the FCR", record.emg_fcr_mvc.as_ref()), ("EMG of the ECR", record.emg_ecr_mvc.as_ref())];
    let further = FurtherChannel::ALL.into_iter().map(|channel| (channel.column(), record.further(channel)));
    let mut channels = always.into_iter().chain(emg).chain(further);
    channels.find_map(|(name, values)| {
        values?.iter().position(|value| !value.is_finite()).map(|sample| (name, sample))
    })
}

fn column<'a>(
    table: &'a SourceTable,
    signal: &MappedSignal,
    role: &'static str,
) -> Result<&'a [f64], ImportError> {
    let values = table.column(&signal.column).ok_or_else(|| ImportError::NoColumn {
        table: table.name.clone(),
        why: table.why_not(&signal.column),
        role,
        columns: table.names(),
    })?;
    let stated = table.stated_unit(&signal.column);
    match stated.and_then(SignalUnit::spelt) {
        Some(unit) if unit.is_of_kind(signal.unit) && unit.factor() != signal.unit.factor() => {
            Err(ImportError::NoTrial {
                reason: format!(
                    "{}: says that {:?} is in {:?}; expected that unit in the mapping, which has {:?}. Correct the mapping",
                    table.name,
                    signal.column,
                    stated.unwrap_or_default(),
                    signal.unit.name()
                ),
            })
        }
        _ => Ok(values),
    }
}

fn trial(record: Record) -> Trial {
    Trial {
        // Trials are numbered once it is known which have a ramp.
        number: 1,
        file: String::new(),
        // Both are measured once all trials are there; a speed of zero stands in no table.
        velocity_rad_s: 1.0,
        torque_nm: 0.0,
        repetition: 1,
        condition: None,
        onset_s: None,
        status: Status::Ok,
        extra: Default::default(),
        record,
    }
}
