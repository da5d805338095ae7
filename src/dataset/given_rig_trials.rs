//! Rig trials that a program gives rather than a folder: checked as those that are read, and written so that they are read back the same.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use rayon::prelude::*;
use serde_json::json;

use super::disk::Disk;
use super::error::{DatasetError, FilePlace};
use super::given_session::{DESCRIPTION, check_samples, new_folder, sample_at};
use super::hexadecimal::sha256;
use super::load::check_values;
use super::record_csv::{Digits, channels_csv};
use super::rig_calibration::CalibrationSource;
use super::rig_trial_csv_reader::{RigTrialSignals, check_rest, starts_at_zero};
use super::rig_trial_row::{RigTrialCells, load_and_motion};
use super::rig_trials::{RIG_TRIALS_TABLE, RigTrial, RigTrials, check_started};
use super::trial_csv_reader::check_times;
use super::{PROGRAM, SESSION_FORMAT, Status, tables};
use crate::files::{excerpt, limits};
use crate::wrist::Lever;

/// A rig trial, as a program gives it.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenRigTrial {
    /// Number, from 1.
    pub number: u32,
    /// Which repetition, from 1.
    pub repetition: u32,
    /// What became of it; only trials of status ok are analysed.
    pub status: Status,
    /// Load, motion and their values: cells of `rig-trials.csv` by column.
    pub cells: BTreeMap<String, String>,
    /// Times of the samples, s, from 0.
    pub times_s: Vec<f64>,
    /// The signals.
    pub record: RigTrialSignals,
}

/// The cells of a rig trial that was given, and its name in messages.
struct GivenCells<'a> {
    trial: &'a str,
    cells: &'a BTreeMap<String, String>,
}

impl GivenCells<'_> {
    fn place(trial: &str, column: &str) -> FilePlace {
        FilePlace { file: trial.into(), line: None, column: Some(column.into()) }
    }
}

impl RigTrialCells for GivenCells<'_> {
    fn cell(&self, column: &str) -> &str {
        self.cells.get(column).map_or("", |text| text.trim())
    }

    fn unexpected(&self, column: &str, expected: &str) -> DatasetError {
        DatasetError::Value {
            at: Self::place(self.trial, column),
            found: excerpt(self.cell(column)).into_owned(),
            expected: expected.to_owned(),
        }
    }
}

/// Rig trials from what a program gives, checked by the rules for those that are read, see [`super::load_rig_trials`].
///
/// Their sources have the sums of the files that [`write_rig_trials`] writes, so that a calibration is the same before and after.
///
/// # Errors
/// The first thing wrong; it names the trial, the sample and what was expected.
pub fn given_rig_trials(
    sample_rate_hz: f64,
    lever: Option<Lever>,
    measured_utc: Option<String>,
    given: Vec<GivenRigTrial>,
) -> Result<RigTrials, DatasetError> {
    check_values(DESCRIPTION, sample_rate_hz, lever.as_ref(), None)?;
    check_started(measured_utc.as_deref(), FilePlace::field(DESCRIPTION, "started_utc"))?;
    if given.len() > limits::MAX_SESSION_TRIALS {
        let at = FilePlace::file(DESCRIPTION);
        return Err(DatasetError::TooMany { at, what: "trials", limit: limits::MAX_SESSION_TRIALS });
    }
    let mut numbers = BTreeSet::new();
    let mut trials = Vec::with_capacity(given.len());
    for own in given {
        if !numbers.insert(own.number) {
            let at = GivenCells::place(&named(own.number), "trial");
            let expected = "a number that no other trial has".to_owned();
            return Err(DatasetError::Value { at, found: own.number.to_string(), expected });
        }
        trials.push(checked(own, sample_rate_hz)?);
    }
    let mut read = RigTrials { sample_rate_hz, lever, measured_utc, trials, sources: Vec::new() };
    read.sources = sources(&read);
    Ok(read)
}

/// Name of a trial in messages.
fn named(number: u32) -> String {
    format!("rig trial {number}")
}

fn checked(given: GivenRigTrial, sample_rate_hz: f64) -> Result<RigTrial, DatasetError> {
    let name = named(given.number);
    let GivenRigTrial { number, repetition, status, cells, times_s, record } = given;
    for (column, count) in [("trial", number), ("repetition", repetition)] {
        if count == 0 {
            let (at, found) = (GivenCells::place(&name, column), count.to_string());
            return Err(DatasetError::Value { at, found, expected: "a whole number from 1 up".to_owned() });
        }
    }
    let (load, motion) = load_and_motion(&GivenCells { trial: &name, cells: &cells })?;
    check_samples(&name, record.channels(), &times_s)?;
    if !starts_at_zero(&times_s, sample_rate_hz) {
        return Err(DatasetError::Value {
            at: sample_at(&name, 0, "t_s"),
            found: times_s[0].to_string(),
            expected: "time 0 at the first sample of a rig trial".to_owned(),
        });
    }
    check_times(&times_s, &record.theta_m_rad, sample_rate_hz, |sample| sample_at(&name, sample, "t_s"))?;
    if status == Status::Ok {
        let at = |sample: usize| sample_at(&name, sample, "target_rad");
        check_rest(&name, &record.target_rad, sample_rate_hz, at)?;
    }
    Ok(RigTrial { number, file: tables::rig_trial_file(number), load, motion, repetition, status, record })
}

/// The files that [`write_rig_trials`] writes, with their sums.
fn sources(trials: &RigTrials) -> Vec<CalibrationSource> {
    let table = CalibrationSource {
        file: RIG_TRIALS_TABLE.to_owned(),
        sha256: sha256(trials.table_text().as_bytes()),
    };
    let mut sources = vec![table];
    sources.par_extend(trials.trials.par_iter().map(|trial| CalibrationSource {
        file: trial.file.clone(),
        sha256: sha256(record_text(&trial.record, trials.sample_rate_hz).as_bytes()),
    }));
    sources
}

impl RigTrials {
    /// The text of `rig-trials.csv`.
    pub fn table_text(&self) -> String {
        let mut text = String::from_utf8_lossy(tables::empty_rig_table()).into_owned();
        for trial in &self.trials {
            let motion = (trial.motion.name(), trial.motion.velocity_rad_s());
            text += &tables::rig_row(trial.number, trial.load, motion, trial.repetition, trial.status);
        }
        text
    }
}

/// The text of a trial's record.
fn record_text(record: &RigTrialSignals, sample_rate_hz: f64) -> String {
    channels_csv(&record.channels().collect::<Vec<_>>(), 0.0, sample_rate_hz, Digits::All)
}

/// Writes rig trials that [`given_rig_trials`] made into the new folder `folder`: a session without a person, whose calibration by
/// `ramphold calibrate` is that of `trials`.
///
/// # Errors
/// If the folder is there already, or cannot be written.
pub fn write_rig_trials(trials: &RigTrials, folder: &Path) -> std::io::Result<()> {
    let opened = new_folder(folder)?;
    let disk = Disk::default();
    opened.make_folder(Path::new(tables::RIG_FOLDER))?;
    for trial in &trials.trials {
        disk.write(&opened, &trial.file, record_text(&trial.record, trials.sample_rate_hz).as_bytes())?;
    }
    disk.write(&opened, RIG_TRIALS_TABLE, trials.table_text().as_bytes())?;
    disk.write(&opened, "trials.csv", tables::empty())?;
    let mut description = json!({
        "format": SESSION_FORMAT,
        "subject": { "id": "rig" },
        "sample_rate_hz": trials.sample_rate_hz,
        "rig": { "lever": trials.lever },
        "recorded_filter": null,
        "program": PROGRAM,
    });
    if let Some(measured_utc) = &trials.measured_utc {
        description["started_utc"] = json!(measured_utc);
    }
    // The description comes last: a folder without it is no session.
    disk.write(&opened, "session.json", format!("{description:#}\n").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{load, load_rig_trials};

    fn given() -> Vec<GivenRigTrial> {
        let times_s: Vec<f64> = (0..400).map(|sample| f64::from(sample) / 1000.0).collect();
        let target_rad = times_s.iter().map(|t| if *t < 0.25 { 0.0 } else { t / 3.0 }).collect();
        let record = RigTrialSignals {
            target_rad,
            theta_m_rad: times_s.iter().map(|t| t / 7.0).collect(),
            torque_l_nm: times_s.iter().map(|t| 1.0 / 3.0 + t).collect(),
            alpha_l_rad_s2: Some(times_s.iter().map(|t| t / 9.0).collect()),
            ..RigTrialSignals::default()
        };
        let trial = |number: u32, cells: &[(&str, &str)]| GivenRigTrial {
            number,
            repetition: 1,
            status: Status::Ok,
            cells: cells.iter().map(|(column, text)| ((*column).to_owned(), (*text).to_owned())).collect(),
            times_s: times_s.clone(),
            record: record.clone(),
        };
        let weight = [("mass_kg", "3.3"), ("arm_m", "0.1"), ("sign", "-1"), ("relative_error", "0.002")];
        vec![
            trial(1, &[("load", "empty_handle"), ("motion", "ramp"), ("velocity_rad_s", "1.3")]),
            trial(2, &[&[("load", "known_weight"), ("motion", "still")], &weight[..]].concat()),
            trial(4, &[("load", "clamped_handle"), ("motion", "multisine"), ("arm_m", " ")]),
        ]
    }

    fn checked(given: Vec<GivenRigTrial>) -> Result<RigTrials, DatasetError> {
        given_rig_trials(1000.0, None, Some("2026-11-24T10:00:00Z".into()), given)
    }

    #[test]
    fn rig_trials_that_were_given_read_back_the_same_with_their_sums() {
        let mut given = given();
        // A trial that was broken off may have no rest.
        given[2].status = Status::Aborted;
        given[2].record.target_rad[3] = 0.5;
        let made = checked(given).unwrap();
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("rig");
        write_rig_trials(&made, &folder).unwrap();
        let read = load_rig_trials(&folder).unwrap();
        assert_eq!(read.trials, made.trials);
        assert_eq!((read.sample_rate_hz, &read.measured_utc), (1000.0, &made.measured_utc));
        assert_eq!(read.sources, made.sources);
        assert!(load(&folder).unwrap().trials.is_empty());
        let error = write_rig_trials(&made, &folder).unwrap_err();
        assert!(error.to_string().contains("exists already"), "{error}");
    }

    #[test]
    fn what_a_folder_may_not_hold_may_not_be_given() {
        let set = |trial: &mut GivenRigTrial, column: &str, text: &str| {
            trial.cells.insert(column.to_owned(), text.to_owned());
        };
        type Change<'a> = &'a dyn Fn(&mut [GivenRigTrial]);
        let cases: [(Change, &str); 15] = [
            (&|own| own[1].number = 1, "rig trial 1, trial: \"1\""),
            (&|own| own[1].number = 0, "rig trial 0, trial: \"0\""),
            (&|own| own[0].repetition = 0, "rig trial 1, repetition: \"0\""),
            (&|own| set(&mut own[0], "load", "nothing"), "rig trial 1, load: \"nothing\""),
            (&|own| set(&mut own[0], "motion", "chirp"), "still, ramp or multisine"),
            (&|own| set(&mut own[0], "velocity_rad_s", "0"), "rig trial 1, velocity_rad_s: \"0\""),
            (&|own| set(&mut own[1], "mass_kg", "nan"), "a mass in kg above 0"),
            (&|own| set(&mut own[1], "sign", "2"), "1 or -1"),
            (&|own| set(&mut own[1], "relative_error", "2"), "0.01 for 1 %"),
            (&|own| set(&mut own[2], "mass_kg", "1"), "an empty cell"),
            (&|own| own[2].record.theta_m_rad[7] = f64::NAN, "rig trial 4, theta_m_rad[7]"),
            (&|own| own[2].record.target_rad.truncate(399), "399 samples"),
            (&|own| own[1].times_s.iter_mut().for_each(|t| *t += 0.5), "rig trial 2, t_s[0]: \"0.5\""),
            (&|own| own[1].times_s[9] = own[1].times_s[8], "rig trial 2, t_s[9]"),
            (&|own| own[1].record.target_rad[150] = 0.1, "rig trial 2, target_rad[150]: \"0.1\""),
        ];
        for (change, named) in cases {
            let mut given = given();
            change(&mut given);
            let error = checked(given).expect_err(named).to_string();
            assert!(error.contains(named), "{named}: {error}");
        }
        let late = given_rig_trials(1000.0, None, Some("yesterday".into()), given()).unwrap_err();
        assert!(late.to_string().contains("2026-11-24T15:00:00Z"), "{late}");
        assert!(given_rig_trials(0.0, None, None, given()).is_err());
    }
}
