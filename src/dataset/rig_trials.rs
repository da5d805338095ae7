//! Trials without a person, which measure the rig: reading `rig-trials.csv` and its records.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;

use super::csv_input::{CsvTable, SessionFolder};
use super::error::{DatasetError, FilePlace};
use super::hexadecimal::sha256;
use super::load::{check_total_size, read_description};
use super::rig_calibration::CalibrationSource;
use super::rig_trial_csv_reader::{RigTrialSignals, parse_rig_record};
use super::rig_trial_row::{COLUMNS_OF_SOME, RigTrialMotion, load_and_motion};
use super::session_about::SessionCard;
use super::utc::{A_UTC_TIME, utc_seconds};
use crate::files::{excerpt, limits};
use crate::protocol::RigLoad;
use crate::session::Status;
use crate::wrist::Lever;

/// Name of the table of rig trials in a session's folder.
pub const RIG_TRIALS_TABLE: &str = "rig-trials.csv";

/// One rig trial and its record.
#[derive(Debug, Clone, PartialEq)]
pub struct RigTrial {
    /// Number in the table.
    pub number: u32,
    /// Path of the record inside the session folder, with `/`.
    pub file: String,
    /// What is at the handle.
    pub load: RigLoad,
    /// What the motor does.
    pub motion: RigTrialMotion,
    /// Which repetition.
    pub repetition: u32,
    /// What became of it; only trials of status ok are analysed.
    pub status: Status,
    /// The signals.
    pub record: RigTrialSignals,
}

/// The rig trials of a session.
#[derive(Debug, Clone)]
pub struct RigTrials {
    /// Samples a second, all channels.
    pub sample_rate_hz: f64,
    /// The lever that the session states or assumes; `None` for a rigid one.
    pub lever: Option<Lever>,
    /// When the session began, UTC, where known.
    pub measured_utc: Option<String>,
    /// The trials in the order they were run, whatever their status.
    pub trials: Vec<RigTrial>,
    /// The files that were read, with their sums.
    pub sources: Vec<CalibrationSource>,
}

/// Reads and checks the rig trials of the session in `folder`.
///
/// # Errors
/// The first thing wrong, in the order session.json, rig-trials.csv, records; it names file, line, column and what was
/// expected. No file is changed, none outside the folder is opened.
pub fn load_rig_trials(folder: &Path) -> Result<RigTrials, DatasetError> {
    let card = SessionCard::read(folder)?;
    let folder = SessionFolder::open(folder)?;
    let about = read_description(&folder)?;
    check_started(
        card.about.started_utc.as_deref(),
        FilePlace::field(folder.name("session.json"), "started_utc"),
    )?;
    let text = folder.text(RIG_TRIALS_TABLE, limits::TABLE_BYTES, None)?;
    let rows = read_table(&folder, &text)?;
    check_total_size(&folder, rows.iter().map(|row| (row.trial.file.as_str(), &row.file_at)))?;
    let mut sources =
        vec![CalibrationSource { file: RIG_TRIALS_TABLE.into(), sha256: sha256(text.as_bytes()) }];
    // Every record is read before the first error is chosen, so that the message does not depend on threads.
    let read: Vec<Result<(RigTrial, Option<CalibrationSource>), DatasetError>> =
        rows.into_par_iter().map(|row| row.with_record(&folder, about.sample_rate_hz)).collect();
    let mut trials = Vec::with_capacity(read.len());
    for outcome in read {
        let (trial, source) = outcome?;
        trials.push(trial);
        sources.extend(source);
    }
    Ok(RigTrials {
        sample_rate_hz: about.sample_rate_hz,
        lever: about.rig.lever,
        measured_utc: card.about.started_utc,
        trials,
        sources,
    })
}

/// Refuses a time of the measurement that is none: the calibration would have it.
pub(super) fn check_started(started_utc: Option<&str>, at: FilePlace) -> Result<(), DatasetError> {
    match started_utc.filter(|text| utc_seconds(text).is_none()) {
        Some(text) => Err(DatasetError::Value {
            at,
            found: excerpt(text).into_owned(),
            expected: A_UTC_TIME.to_owned(),
        }),
        None => Ok(()),
    }
}

/// A row of the table, whose record is still to be read.
struct RigRow {
    trial: RigTrial,
    file_at: FilePlace,
}

impl RigRow {
    fn with_record(
        mut self,
        folder: &SessionFolder,
        sample_rate_hz: f64,
    ) -> Result<(RigTrial, Option<CalibrationSource>), DatasetError> {
        if self.trial.file.is_empty() {
            return Ok((self.trial, None));
        }
        let text = folder.text(&self.trial.file, limits::RECORD_BYTES, Some(&self.file_at))?;
        let name = folder.name(&self.trial.file);
        let analysed = self.trial.status == Status::Ok;
        self.trial.record = parse_rig_record(&name, &text, sample_rate_hz, analysed)?;
        let source = CalibrationSource { file: self.trial.file.clone(), sha256: sha256(text.as_bytes()) };
        Ok((self.trial, Some(source)))
    }
}

fn read_table(folder: &SessionFolder, text: &str) -> Result<Vec<RigRow>, DatasetError> {
    let header = "a header trial,file,load,motion,velocity_rad_s,repetition,sign,mass_kg,arm_m,inertia_kg_m2,\
                  stiffness_nm_per_rad,relative_error,status and a row a trial";
    let mut table = CsvTable::new(folder.name(RIG_TRIALS_TABLE), text, header)?;
    let [number, file, _, _, repetition, status] =
        columns(&table, ["trial", "file", "load", "motion", "repetition", "status"])?;
    columns(&table, COLUMNS_OF_SOME)?;
    let mut rows = Vec::new();
    let mut seen = BTreeMap::new();
    let mut records = BTreeMap::new();
    while table.next_row()? {
        if rows.len() == limits::MAX_SESSION_TRIALS {
            let at = FilePlace::line(folder.name(RIG_TRIALS_TABLE), table.line());
            return Err(DatasetError::TooMany { at, what: "trials", limit: limits::MAX_SESSION_TRIALS });
        }
        let trial_number = table.count(number)?;
        if let Some(first_line) = seen.insert(trial_number, table.line()) {
            let at = table.place(number);
            return Err(DatasetError::DuplicateTrial { at, number: trial_number, first_line });
        }
        let trial_status = match table.text(status) {
            "ok" => Status::Ok,
            "aborted" => Status::Aborted,
            "rejected" => Status::Rejected,
            _ => return Err(table.invalid(status, "ok, aborted or rejected")),
        };
        let trial_file = table.text(file).to_owned();
        if trial_file.is_empty() && trial_status == Status::Ok {
            let expected = "the path of the trial's record, such as rig-trials/rig-trial-001.csv";
            return Err(table.invalid(file, expected));
        }
        if !trial_file.is_empty()
            && let Some(first_line) = records.insert(trial_file.clone(), table.line())
        {
            let file_name = excerpt(&trial_file).into_owned();
            return Err(DatasetError::SharedRecord { at: table.place(file), file: file_name, first_line });
        }
        let (load, motion) = load_and_motion(&table)?;
        rows.push(RigRow {
            trial: RigTrial {
                number: trial_number,
                file: trial_file,
                load,
                motion,
                repetition: table.count(repetition)?,
                status: trial_status,
                record: RigTrialSignals::default(),
            },
            file_at: table.place(file),
        });
    }
    Ok(rows)
}

fn columns<const N: usize>(table: &CsvTable<'_>, names: [&str; N]) -> Result<[usize; N], DatasetError> {
    let mut found = [0; N];
    for (place, name) in found.iter_mut().zip(names) {
        *place = table.column(name)?;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const HEADER: &str = "trial,file,load,motion,velocity_rad_s,repetition,sign,mass_kg,arm_m,inertia_kg_m2,\
                          stiffness_nm_per_rad,relative_error,status\n";

    const ROWS: [&str; 5] = [
        "1,rig-trials/rig-trial-001.csv,empty_handle,ramp,1.3,1,,,,,,,ok",
        "2,rig-trials/rig-trial-002.csv,known_weight,still,,1,-1,1.0,0.1,,,0.002,ok",
        "3,rig-trials/rig-trial-003.csv,known_inertia,multisine,,1,,,,0.004,,0.01,rejected",
        "4,,clamped_handle,multisine,,1,,,,,,,aborted",
        "5,rig-trials/rig-trial-005.csv,known_spring,multisine,,1,,,,,20,0.01,ok",
    ];

    fn record(samples: usize, rest: usize) -> String {
        let mut text = "t_s,target_rad,theta_m_rad,torque_l_nm,theta_l_rad\n".to_owned();
        for sample in 0..samples {
            let target = if sample < rest { 0.0 } else { 0.01 };
            text += &format!("{},{target},{target},0.1,0.2\n", sample as f64 / 1000.0);
        }
        text
    }

    fn session(rows: &[String]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let about = r#"{ "format": "ramphold-session/1", "subject": { "id": "rig" }, "sample_rate_hz": 1000,
            "rig": { "lever": null }, "recorded_filter": null, "started_utc": "2026-11-24T10:00:00Z" }"#;
        fs::write(folder.path().join("session.json"), about).unwrap();
        fs::write(folder.path().join(RIG_TRIALS_TABLE), format!("{HEADER}{}\n", rows.join("\n"))).unwrap();
        fs::create_dir(folder.path().join("rig-trials")).unwrap();
        for number in [1, 2, 3, 5] {
            let file = folder.path().join(format!("rig-trials/rig-trial-00{number}.csv"));
            // A rejected trial may have been broken off in the rest.
            fs::write(file, if number == 3 { record(50, 50) } else { record(400, 250) }).unwrap();
        }
        folder
    }

    fn rows() -> Vec<String> {
        ROWS.map(str::to_owned).to_vec()
    }

    fn refusal(change: impl FnOnce(&mut Vec<String>)) -> String {
        let mut rows = rows();
        change(&mut rows);
        let folder = session(&rows);
        load_rig_trials(folder.path()).expect_err("must be refused").to_string()
    }

    #[test]
    fn rig_trials_of_a_time_that_is_none_are_refused() {
        let folder = session(&rows());
        let file = folder.path().join("session.json");
        let about = fs::read_to_string(&file).unwrap().replace("2026-11-24T10:00:00Z", "yesterday");
        fs::write(file, about).unwrap();
        let message = load_rig_trials(folder.path()).expect_err("must be refused").to_string();
        assert!(message.contains("started_utc") && message.contains("a time in UTC"), "{message}");
    }

    #[test]
    fn rig_trials_are_read_with_their_loads_and_sums() {
        let folder = session(&rows());
        let read = load_rig_trials(folder.path()).unwrap();
        assert_eq!(read.trials.len(), 5);
        assert_eq!(read.measured_utc.as_deref(), Some("2026-11-24T10:00:00Z"));
        assert_eq!(read.trials[0].motion, RigTrialMotion::Ramp { velocity_rad_s: 1.3 });
        let weight = RigLoad::KnownWeight { mass_kg: 1.0, arm_m: 0.1, sign: -1, relative_error: 0.002 };
        assert_eq!(read.trials[1].load, weight);
        assert_eq!(read.trials[2].status, Status::Rejected);
        assert_eq!(read.trials[3].record, RigTrialSignals::default());
        assert_eq!(read.trials[4].record.theta_l_rad.as_ref().map(Vec::len), Some(400));
        // The table and four records.
        assert_eq!(read.sources.len(), 5);
        assert_eq!(read.sources[1].sha256, sha256(record(400, 250).as_bytes()));
    }

    #[test]
    fn a_wrong_cell_is_refused_with_line_and_column() {
        let replace = |row: usize, from: &'static str, to: &'static str| {
            refusal(|rows| {
                assert!(rows[row].contains(from));
                rows[row] = rows[row].replacen(from, to, 1);
            })
        };
        for (message, parts) in [
            (replace(0, "empty_handle", "nothing"), ["line 2, column load", "empty_handle, known_weight"]),
            (replace(0, "ramp,1.3", "ramp,0"), ["line 2, column velocity_rad_s", "other than 0"]),
            (replace(0, "ramp,1.3", "chirp,"), ["line 2, column motion", "still, ramp or multisine"]),
            (replace(1, ",-1,1.0", ",,1.0"), ["line 3, column sign", "1 or -1"]),
            (replace(1, "1.0,0.1", "1.0,-0.1"), ["line 3, column arm_m", "above 0"]),
            (replace(1, "0.002", "2"), ["line 3, column relative_error", "0.01 for 1 %"]),
            (replace(2, "0.004", ""), ["line 4, column inertia_kg_m2", "above 0"]),
            (replace(3, ",,,,,,,aborted", ",,1,,,,,aborted"), ["line 5, column mass_kg", "an empty cell"]),
            (
                replace(4, "spring,multisine,", "spring,multisine,1.3"),
                ["line 6, column velocity", "an empty cell"],
            ),
            (replace(4, "005.csv", "001.csv"), ["line 6, column file", "line 2 already"]),
            (replace(4, "rig-trials/rig-trial-005.csv", "../x.csv"), ["line 6, column file", "leads out of"]),
            (replace(3, "aborted", "ok"), ["line 5, column file", "the path of the trial's record"]),
            (replace(0, ",ok", ",fine"), ["line 2, column status", "ok, aborted or rejected"]),
        ] {
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
    }

    #[test]
    fn a_record_must_begin_at_time_zero_with_a_rest() {
        let complaint = |text: &str| {
            let folder = session(&rows());
            fs::write(folder.path().join("rig-trials/rig-trial-001.csv"), text).unwrap();
            load_rig_trials(folder.path()).expect_err("must be refused").to_string()
        };
        let early = complaint(&record(400, 150));
        assert!(early.contains("rig-trial-001.csv, line 152, column target_rad"), "{early}");
        let late = complaint(&record(400, 250).replacen("\n0,", "\n0.5,", 1));
        assert!(late.contains("line 2, column t_s") && late.contains("time 0"), "{late}");
        assert!(complaint(&record(150, 150)).contains("150 samples"));
        let gap = complaint(&record(400, 250).replacen("\n0.3,", "\n0.31,", 1));
        assert!(gap.contains("gap in time"), "{gap}");
        let missing = complaint(&record(400, 250).replacen("target_rad", "angle", 1));
        assert!(missing.contains("column target_rad is missing"), "{missing}");
    }
}
