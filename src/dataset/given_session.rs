//! Sessions that a program gives rather than a folder: checked as those that are read, and written so that they are read back the same.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde_json::json;

use super::disk::Disk;
use super::error::{DatasetError, FilePlace};
use super::load::{check_further_channels, check_record, check_values};
use super::record_csv::{Digits, record_csv};
use super::trial_csv_reader::check_times;
use super::{PROGRAM, SESSION_FORMAT, Session, Status, Trial};
use crate::files::{Folder, csv_cell, limits, make_folders};

/// How messages name what was given instead of `session.json`.
pub(super) const DESCRIPTION: &str = "the session given";

/// Columns of `trials.csv` that every session has.
const TRIAL_COLUMNS: [&str; 8] =
    ["trial", "file", "velocity_rad_s", "torque_nm", "repetition", "onset_s", "status", "condition"];

/// Checks a session that was made in memory by the rules for one that is read, see [`super::load`].
///
/// `times_s` holds the time axis of each trial's record, s, one value per sample.
///
/// # Errors
/// The first thing wrong; it names the trial, the sample and what was expected.
pub fn check_given(session: &Session, times_s: &[Vec<f64>]) -> Result<(), DatasetError> {
    let rate = session.sample_rate_hz;
    check_values(DESCRIPTION, rate, session.lever.as_ref(), session.recorded_filter.as_ref())?;
    if session.trials.is_empty() {
        let expected = "at least one trial".to_owned();
        return Err(DatasetError::Empty { at: FilePlace::file(DESCRIPTION), expected });
    }
    if session.trials.len() > limits::MAX_SESSION_TRIALS {
        let at = FilePlace::file(DESCRIPTION);
        return Err(DatasetError::TooMany { at, what: "trials", limit: limits::MAX_SESSION_TRIALS });
    }
    let mut numbers = BTreeSet::new();
    let mut files = BTreeSet::new();
    for (trial, times_s) in session.trials.iter().zip(times_s) {
        let name = format!("trial {}", trial.number);
        let wrong = |column: &str, found: String, expected: &str| DatasetError::Value {
            at: FilePlace { file: name.as_str().into(), line: None, column: Some(column.into()) },
            found,
            expected: expected.to_owned(),
        };
        if !numbers.insert(trial.number) {
            return Err(wrong("trial", trial.number.to_string(), "a number that no other trial has"));
        }
        if trial.file.is_empty() || !files.insert(&trial.file) {
            return Err(wrong("file", trial.file.clone(), "a path of its own in the session's folder"));
        }
        if !trial.velocity_rad_s.is_finite() || trial.velocity_rad_s == 0.0 {
            return Err(wrong("velocity_rad_s", trial.velocity_rad_s.to_string(), "a velocity other than 0"));
        }
        if !trial.torque_nm.is_finite() {
            return Err(wrong("torque_nm", trial.torque_nm.to_string(), "a finite torque"));
        }
        check_samples(&name, trial.record.channels(), times_s)?;
        check_times(times_s, &trial.record.theta_m_rad, rate, |sample| sample_at(&name, sample, "t_s"))?;
        let onset_at = FilePlace { file: name.as_str().into(), line: None, column: Some("onset_s".into()) };
        check_record(trial, &name, &onset_at, rate)?;
    }
    check_further_channels(&session.trials, |trial| FilePlace::file(format!("trial {}", trial.number)))
}

/// Whether all channels have a finite value for every time.
pub(super) fn check_samples<'a>(
    name: &str,
    channels: impl Iterator<Item = (&'static str, &'a [f64])>,
    times_s: &'a [f64],
) -> Result<(), DatasetError> {
    for (channel, values) in std::iter::once(("t_s", times_s)).chain(channels) {
        if values.len() != times_s.len() {
            return Err(DatasetError::Value {
                at: FilePlace { file: name.into(), line: None, column: Some(channel.into()) },
                found: format!("{} samples", values.len()),
                expected: format!("{}, one for each time", times_s.len()),
            });
        }
        if let Some(sample) = values.iter().position(|value| !value.is_finite()) {
            return Err(DatasetError::Value {
                at: sample_at(name, sample, channel),
                found: values[sample].to_string(),
                expected: "a finite number".to_owned(),
            });
        }
    }
    Ok(())
}

/// A sample of a channel, counted from 0.
pub(super) fn sample_at(trial: &str, sample: usize, channel: &str) -> FilePlace {
    FilePlace { file: trial.into(), line: None, column: Some(format!("{channel}[{sample}]").into()) }
}

/// Writes `session` into the new folder `folder`; the numbers of the table have as many digits as it takes to read back the same, those
/// of the records what `digits` says.
///
/// `beside` are the names and bytes of further files. With `protocol.json`, whose window and filter hold for the session, and
/// `rig-calibration.json`, an analysis of the folder gives what one of the session gives.
///
/// # Errors
/// If the folder is there already, or cannot be written.
pub fn write_session(
    session: &Session,
    digits: Digits,
    beside: &[(&str, &[u8])],
    folder: &Path,
) -> std::io::Result<()> {
    let opened = new_folder(folder)?;
    let disk = Disk::default();
    let mut made = BTreeSet::new();
    // An aborted trial may have no record.
    for trial in session.trials.iter().filter(|trial| !trial.file.is_empty()) {
        let parent = Path::new(&trial.file).parent().filter(|parent| !parent.as_os_str().is_empty());
        if let Some(parent) = parent
            && made.insert(parent)
        {
            opened.make_folder(parent)?;
        }
        disk.write(
            &opened,
            &trial.file,
            record_csv(&trial.record, session.sample_rate_hz, digits).as_bytes(),
        )?;
    }
    disk.write(&opened, "trials.csv", table_text(session).as_bytes())?;
    for (name, bytes) in beside {
        disk.write(&opened, name, bytes)?;
    }
    let description = json!({
        "format": SESSION_FORMAT,
        "subject": { "id": session.subject.id },
        "sample_rate_hz": session.sample_rate_hz,
        "rig": { "lever": session.lever },
        "recorded_filter": session.recorded_filter,
        "program": PROGRAM,
    });
    // The description comes last: a folder without it is no session.
    disk.write(&opened, "session.json", format!("{description:#}\n").as_bytes())
}

/// Makes a folder for a session, which must not be there yet.
pub(super) fn new_folder(folder: &Path) -> std::io::Result<Folder> {
    if crate::files::exists(folder) {
        return Err(std::io::Error::new(
            std::io::ErrorKind::AlreadyExists,
            "exists already and is not overwritten; give another folder",
        ));
    }
    make_folders(folder)?;
    Folder::open(folder)
}

fn table_text(session: &Session) -> String {
    let labelled = session.trials.iter().any(|trial| trial.condition.is_some());
    let extra: Vec<&String> = session
        .trials
        .iter()
        .flat_map(|trial| trial.extra.keys())
        .collect::<BTreeSet<_>>()
        .into_iter()
        .collect();
    let columns = &TRIAL_COLUMNS[..if labelled { 8 } else { 7 }];
    let header = columns.iter().map(|name| (*name).to_owned()).chain(extra.iter().map(|name| csv_cell(name)));
    let mut text = header.collect::<Vec<_>>().join(",") + "\n";
    for trial in &session.trials {
        text += &row(trial, labelled, &extra).join(",");
        text += "\n";
    }
    text
}

fn row(trial: &Trial, labelled: bool, extra: &[&String]) -> Vec<String> {
    let mut cells = vec![
        trial.number.to_string(),
        csv_cell(&trial.file),
        trial.velocity_rad_s.to_string(),
        trial.torque_nm.to_string(),
        trial.repetition.to_string(),
        trial.onset_s.map_or(String::new(), |onset_s| onset_s.to_string()),
        Status::name(trial.status).to_owned(),
    ];
    if labelled {
        cells.push(csv_cell(trial.condition.as_deref().unwrap_or("")));
    }
    let own: &BTreeMap<String, String> = &trial.extra;
    cells.extend(extra.iter().map(|name| csv_cell(own.get(*name).map_or("", String::as_str))));
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Record, Subject, load};

    fn given() -> (Session, Vec<Vec<f64>>) {
        let times_s: Vec<f64> = (0..400).map(|sample| -0.1 + f64::from(sample) / 2000.0).collect();
        let record = Record {
            start_s: times_s[0],
            theta_m_rad: times_s.iter().map(|t| (t / 3.0).max(0.0)).collect(),
            torque_l_nm: times_s.iter().map(|t| 1.0 / 3.0 + t).collect(),
            emg_ecr_mvc: Some(times_s.iter().map(|t| t / 7.0).collect()),
            alpha_l_rad_s2: Some(times_s.iter().map(|t| t / 3.0).collect()),
            ..Default::default()
        };
        let trial = |number: u32| Trial {
            number,
            file: format!("trials/trial-{number:03}.csv"),
            velocity_rad_s: 1.0 / 3.0,
            torque_nm: 0.9,
            repetition: number,
            condition: Some("a, \"b\"".into()),
            onset_s: Some(0.0),
            status: Status::Ok,
            extra: BTreeMap::from([("rest_s".into(), "1.5".into())]),
            record: record.clone(),
        };
        let session = Session {
            subject: Subject { id: "S01".into() },
            sample_rate_hz: 2000.0,
            lever: None,
            recorded_filter: None,
            channel_ranges: Default::default(),
            trials: vec![trial(1), trial(2)],
        };
        (session, vec![times_s.clone(), times_s])
    }

    #[test]
    fn a_session_that_was_given_reads_back_the_same() {
        let (mut session, times_s) = given();
        check_given(&session, &times_s).unwrap();
        let aborted = Trial {
            number: 3,
            file: String::new(),
            onset_s: None,
            status: Status::Aborted,
            record: Record::default(),
            ..session.trials[0].clone()
        };
        session.trials.push(aborted);
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("s");
        write_session(&session, Digits::All, &[], &folder).unwrap();
        let again = load(&folder).unwrap();
        assert_eq!(again.digest(), session.digest());
        assert_eq!(again.trials[1].record, session.trials[1].record);
        assert!(again.trials[2].record.theta_m_rad.is_empty());
        let error = write_session(&session, Digits::All, &[], &folder).unwrap_err();
        assert!(error.to_string().contains("exists already"), "{error}");
    }

    #[test]
    fn what_a_folder_may_not_hold_may_not_be_given() {
        type Change = fn(&mut Session, &mut Vec<Vec<f64>>);
        let cases: [(Change, &str); 11] = [
            (|session, _| session.trials[1].number = 1, "trial 1, trial"),
            (|session, _| session.trials[1].velocity_rad_s = 0.0, "trial 2, velocity_rad_s"),
            (|session, _| session.trials[1].torque_nm = f64::NAN, "trial 2, torque_nm"),
            (|session, _| session.trials[0].record.theta_m_rad[7] = f64::NAN, "theta_m_rad[7]"),
            (|session, _| session.trials[0].record.torque_l_nm.truncate(399), "399 samples"),
            (|_, times_s| times_s[1][9] = times_s[1][8], "trial 2, t_s[9]"),
            (|session, _| session.sample_rate_hz = 1000.0, "trial 1, t_s"),
            (|session, _| session.trials[0].onset_s = Some(9.0), "trial 1, onset_s"),
            (|session, _| session.trials[1].record.alpha_l_rad_s2 = None, "trial 2: has no further channel"),
            (|session, _| session.trials[0].record.theta_j_rad = Some(vec![0.0; 3]), "trial 1, theta_j_rad"),
            (|session, _| session.sample_rate_hz = 0.0, "sample_rate_hz"),
        ];
        for (change, named) in cases {
            let (mut session, mut times_s) = given();
            change(&mut session, &mut times_s);
            let error = check_given(&session, &times_s).unwrap_err().to_string();
            assert!(error.contains(named), "{named}: {error}");
        }
    }
}
