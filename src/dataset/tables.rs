//! The tables of a session: `trials.csv`, and beside it what came before the trials.

use super::trial_csv_writer::{HEADER, RIG_HEADER, TrialCsvWriter};
use crate::protocol::{RigLoad, RigMotion};
use crate::rig::Punctuality;
use crate::session::{Attempt, PlannedTrial, Progress, Settings, Status};

/// The columns of `trials.csv`; the first seven are what every session has.
const TRIALS: &str = "trial,file,velocity_rad_s,torque_nm,repetition,onset_s,status,\
                      reason,position,amplitude_rad,rest_s,torque_offset_nm\n";

/// Further columns where the rig was tied to a clock.
const PUNCTUALITY: &str = ",lost_periods,longest_gap_us,latest_us";

/// The columns of `rig-trials.csv`.
const RIG_TRIALS: &str = "trial,file,load,motion,velocity_rad_s,repetition,sign,mass_kg,arm_m,inertia_kg_m2,\
                          stiffness_nm_per_rad,relative_error,status\n";

/// The table of rig trials.
pub const RIG_TABLE: &str = "rig-trials.csv";

/// The folder of the records of rig trials.
pub const RIG_FOLDER: &str = "rig-trials";

/// `rig-trials.csv` of a session without rig trials.
pub fn empty_rig_table() -> &'static [u8] {
    RIG_TRIALS.as_bytes()
}

/// File of the record of rig trial number `number`.
pub fn rig_trial_file(number: u32) -> String {
    format!("{RIG_FOLDER}/rig-trial-{number:03}.csv")
}

/// The columns that the record `file` has at least.
pub fn header_of_file(file: &str) -> &'static [u8] {
    if file.split('/').next() == Some(RIG_FOLDER) { RIG_HEADER } else { HEADER }
}

/// `trials.csv` of a session without trials.
pub fn empty() -> &'static [u8] {
    TRIALS.as_bytes()
}

/// File of a trial's record; practice trials have a folder of their own, so that they are not analysed by mistake.
pub fn trial_file(attempt: &Attempt) -> String {
    let folder = if attempt.planned.key.practice { "familiarisation" } else { "trials" };
    format!("{folder}/trial-{:03}.csv", attempt.number)
}

/// The tables as they are now: name and bytes.
pub fn of_session(
    progress: &Progress,
    settings: &Settings,
    rows: &TrialCsvWriter,
) -> Vec<(&'static str, Vec<u8>)> {
    let table = |practice: bool| {
        let attempts =
            || progress.attempts().iter().filter(|attempt| attempt.planned.key.practice == practice);
        let has_clock = attempts().any(|attempt| attempt.punctuality.is_some());
        let mut text = TRIALS.to_owned();
        if has_clock {
            text.insert_str(TRIALS.len() - 1, PUNCTUALITY);
        }
        for attempt in attempts() {
            push_row(&mut text, attempt, progress, settings, rows);
            if has_clock && attempt.ended.is_some() {
                text.pop();
                text += &punctuality_cells(attempt);
            }
        }
        text.into_bytes()
    };
    let mut tables = vec![("trials.csv", table(false))];
    if progress.attempts().iter().any(|attempt| attempt.planned.key.practice) {
        tables.push(("familiarisation.csv", table(true)));
    }
    if !progress.rig_attempts().is_empty() {
        tables.push((RIG_TABLE, rig_table(progress)));
    }
    tables
}

fn rig_table(progress: &Progress) -> Vec<u8> {
    let mut text = RIG_TRIALS.to_owned();
    for attempt in progress.rig_attempts() {
        // A rig trial under way has no row yet: its record is not complete.
        let Some((status, _)) = attempt.ended else { continue };
        let planned = &attempt.planned;
        let velocity_rad_s = match planned.motion {
            RigMotion::Ramp { velocity_rad_s, .. } => Some(velocity_rad_s),
            RigMotion::Still { .. } | RigMotion::Multisine(_) => None,
        };
        let motion = (planned.motion.name(), velocity_rad_s);
        text += &rig_row(attempt.number, planned.load, motion, planned.repetition, status);
    }
    text.into_bytes()
}

/// The row of a rig trial in `rig-trials.csv`; a motion is its name and the velocity of a ramp.
pub fn rig_row(
    number: u32,
    load: RigLoad,
    (motion, velocity_rad_s): (&str, Option<f64>),
    repetition: u32,
    status: Status,
) -> String {
    let cell = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    // Sign, mass, arm, inertia and stiffness.
    let values = match load {
        RigLoad::EmptyHandle | RigLoad::ClampedHandle => [None; 5],
        RigLoad::KnownWeight { mass_kg, arm_m, sign, .. } => {
            [Some(f64::from(sign)), Some(mass_kg), Some(arm_m), None, None]
        }
        RigLoad::KnownInertia { inertia_kg_m2, .. } => [None, None, None, Some(inertia_kg_m2), None],
        RigLoad::KnownSpring { stiffness_nm_per_rad, .. } => {
            [None, None, None, None, Some(stiffness_nm_per_rad)]
        }
    };
    format!(
        "{number},{},{},{motion},{},{repetition},{},{},{}\n",
        rig_trial_file(number),
        load.name(),
        cell(velocity_rad_s),
        values.map(cell).join(","),
        cell(load.relative_error()),
        status.name(),
    )
}

/// The cells under [`PUNCTUALITY`]; empty for a trial of which it is not known.
fn punctuality_cells(attempt: &Attempt) -> String {
    attempt.punctuality.map_or(
        ",,,\n".to_owned(),
        |Punctuality { lost_periods, longest_gap_us, latest_us }| {
            format!(",{lost_periods},{longest_gap_us},{latest_us}\n")
        },
    )
}

fn push_row(
    text: &mut String,
    attempt: &Attempt,
    progress: &Progress,
    settings: &Settings,
    rows: &TrialCsvWriter,
) {
    // A trial under way has no row yet: its record is not complete.
    let Some((status, reason)) = attempt.ended else { return };
    let planned = &attempt.planned;
    let onset_s = attempt.onset_sample.map_or(String::new(), |sample| rows.time_s(sample).to_string());
    *text += &format!(
        "{},{},{},{},{},{onset_s},{},{},{},{},{},{}\n",
        attempt.number,
        trial_file(attempt),
        planned.velocity_rad_s,
        planned.torque_nm,
        planned.repetition,
        status.name(),
        reason.name(),
        planned.key.position,
        amplitude_rad(planned),
        rest_s(attempt, settings),
        progress.offset_nm(),
    );
}

/// How far the motor turns in a trial.
pub fn amplitude_rad(planned: &PlannedTrial) -> f64 {
    planned.movement.at(planned.movement.ramp().duration_s()).angle_rad
}

/// Rest before a trial.
pub fn rest_s(attempt: &Attempt, settings: &Settings) -> f64 {
    attempt.rest_samples as f64 / settings.sample_rate_hz
}
