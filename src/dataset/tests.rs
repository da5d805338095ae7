//! Every kind of bad input that the session format lists, and the message it gets.

use std::fs;
use std::path::Path;

use super::*;

const TABLE: &str = "trial,file,velocity_rad_s,torque_nm,repetition,onset_s,status\n";

/// A small sound session: two trials of 0.4 s at 1 kHz with the onset at 0.2 s.
fn sound() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "session.json", &description("ramphold-session/1", "1000"));
    let rows = "1,trials/trial-001.csv,1.3,0.9,1,0.2,ok\n2,trials/trial-002.csv,2.6,2.1,1,,ok\n";
    write(&folder, "trials.csv", &format!("{TABLE}{rows}"));
    write(&folder, "trials/trial-001.csv", &record(400, |sample| sample as f64 / 1000.0));
    write(&folder, "trials/trial-002.csv", &record(400, |sample| sample as f64 / 1000.0));
    folder
}

fn description(format: &str, rate: &str) -> String {
    format!(
        r#"{{ "format": "{format}", "subject": {{ "id": "S01" }}, "sample_rate_hz": {rate},
  "rig": {{ "lever": {{ "inertia_kg_m2": 0.0016, "damping_nm_s_per_rad": 0.4, "stiffness_nm_per_rad": 900 }} }},
  "recorded_filter": null, "note": "kept" }}"#
    )
}

fn record(samples: usize, time: impl Fn(usize) -> f64) -> String {
    let mut text = "t_s,theta_m_rad,torque_l_nm,emg_fcr_mvc,emg_ecr_mvc\n".to_owned();
    for sample in 0..samples {
        text += &format!("{:.4},0.0{sample},-1.25e-1,0.1,-0.02\n", time(sample));
    }
    text
}

fn write(folder: &tempfile::TempDir, file: &str, text: &str) {
    let path = folder.path().join(file);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

fn edit(folder: &tempfile::TempDir, file: &str, from: &str, to: &str) {
    let path = folder.path().join(file);
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{file} has no {from:?}");
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}

/// The message without the folder's own path.
fn complaint(folder: &tempfile::TempDir) -> String {
    let error = load(folder.path()).expect_err("the session must be refused");
    error.to_string().replace(&format!("{}/", folder.path().display()), "")
}

#[track_caller]
fn assert_refused(folder: &tempfile::TempDir, parts: &[&str]) {
    let message = complaint(folder);
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

/// A sound session whose records have a handle encoder and an accelerometer too.
fn with_further_channels() -> tempfile::TempDir {
    let folder = sound();
    for file in ["trials/trial-001.csv", "trials/trial-002.csv"] {
        let path = folder.path().join(file);
        let text = fs::read_to_string(&path).unwrap();
        let rows = text.lines().enumerate().map(|(line, row)| match line {
            0 => format!("{row},theta_l_rad,alpha_l_rad_s2\n"),
            line => format!("{row},{}e-3,-{line}.5\n", line),
        });
        let text: String = rows.collect();
        fs::write(&path, text).unwrap();
    }
    folder
}

#[test]
fn further_channels_are_read_and_are_part_of_the_digest() {
    let folder = with_further_channels();
    let session = load(folder.path()).unwrap();
    assert_eq!(session.further_channels(), [FurtherChannel::HandleAngle, FurtherChannel::HandleAcceleration]);
    let record = &session.trials[0].record;
    assert_eq!(record.theta_l_rad.as_ref().unwrap()[6], 7e-3);
    assert_eq!(record.alpha_l_rad_s2.as_ref().unwrap()[6], -7.5);
    assert_eq!((&record.torque_h_nm, &record.theta_j_rad), (&None, &None));
    let without = load(sound().path()).unwrap();
    assert_eq!(without.further_channels(), []);
    assert_ne!(session.digest(), without.digest());
    let mut renamed = session.clone();
    for trial in &mut renamed.trials {
        trial.record.theta_j_rad = trial.record.theta_l_rad.take();
    }
    assert_ne!(session.digest(), renamed.digest(), "the angle of the joint is not that of the handle");
    let mut stripped = session;
    for trial in &mut stripped.trials {
        (trial.record.theta_l_rad, trial.record.alpha_l_rad_s2) = (None, None);
    }
    assert_eq!(stripped.digest(), without.digest());
}

#[test]
fn a_further_channel_is_checked_like_the_others() {
    let folder = with_further_channels();
    edit(&folder, "trials/trial-002.csv", ",8e-3,", ",NaN,");
    assert_refused(
        &folder,
        &["trials/trial-002.csv", "line 9", "column theta_l_rad", "NaN", "a finite number"],
    );
}

#[test]
fn a_record_with_other_further_channels_than_the_first_is_named() {
    let folder = with_further_channels();
    edit(&folder, "trials/trial-002.csv", "theta_l_rad", "theta_k_rad");
    assert_refused(
        &folder,
        &[
            "trials/trial-002.csv, line 1",
            "alpha_l_rad_s2",
            "trials/trial-001.csv has theta_l_rad, alpha_l_rad_s2",
        ],
    );
}

#[test]
fn a_sound_session_is_read_in_full() {
    let session = load(sound().path()).unwrap();
    assert_eq!(session.subject.id, "S01");
    assert_eq!(session.sample_rate_hz, 1000.0);
    assert_eq!(session.lever.unwrap().stiffness_nm_per_rad, 900.0);
    assert_eq!(session.recorded_filter, None);
    let [first, second] = &session.trials[..] else { panic!("two trials") };
    assert_eq!((first.number, first.velocity_rad_s, first.torque_nm, first.repetition), (1, 1.3, 0.9, 1));
    assert_eq!((first.onset_s, second.onset_s), (Some(0.2), None));
    assert_eq!(first.record.theta_m_rad.len(), 400);
    assert_eq!(first.record.theta_m_rad[7], 0.07);
    assert_eq!(first.record.torque_l_nm[399], -0.125);
    assert_eq!(first.record.emg_ecr_mvc.as_ref().unwrap()[0], -0.02);
}

#[test]
fn further_columns_and_a_condition_label_are_kept() {
    let folder = sound();
    let rows = "1,trials/trial-001.csv,-1.3,0.9,1,0.2,ok,slow,5\n";
    write(&folder, "trials.csv", &format!("{},condition,rest_s\n{rows}", TABLE.trim()));
    let trial = load(folder.path()).unwrap().trials.remove(0);
    assert_eq!(trial.condition.as_deref(), Some("slow"));
    assert_eq!(trial.extra.get("rest_s").map(String::as_str), Some("5"));
    assert_eq!(trial.velocity_rad_s, -1.3);
}

#[test]
fn a_rest_that_is_no_time_is_named() {
    for rest in ["five", "-5", "nan"] {
        let folder = sound();
        let rows = format!("1,trials/trial-001.csv,-1.3,0.9,1,0.2,ok,{rest}\n");
        write(&folder, "trials.csv", &format!("{},rest_s\n{rows}", TABLE.trim()));
        assert_refused(&folder, &["trials.csv, line 2, column rest_s", rest]);
    }
}

#[test]
fn carriage_returns_byte_order_marks_and_column_order_do_not_matter() {
    let folder = sound();
    for file in ["session.json", "trials.csv", "trials/trial-001.csv"] {
        let text = fs::read_to_string(folder.path().join(file)).unwrap();
        write(&folder, file, &format!("\u{feff}{}", text.replace('\n', "\r\n")));
    }
    let other_order = "torque_l_nm,t_s,theta_m_rad\n".to_owned()
        + &(0..100).map(|sample| format!("2,{:.3},0.5\n", 0.001 * f64::from(sample))).collect::<String>();
    write(&folder, "trials/trial-002.csv", &other_order);
    let session = load(folder.path()).unwrap();
    assert_eq!(session.trials[0].record, load(sound().path()).unwrap().trials[0].record);
    assert_eq!(session.trials[1].record.torque_l_nm[3], 2.0);
    assert_eq!(session.trials[1].record.emg_fcr_mvc, None);
}

#[test]
fn a_folder_that_is_not_there_is_named() {
    let message = load(Path::new("no/such/session")).unwrap_err().to_string();
    assert!(message.contains("no/such/session: not found; expected a session folder"), "{message}");
}

#[test]
fn a_file_in_place_of_a_folder_is_named() {
    let folder = sound();
    let message = load(&folder.path().join("trials.csv")).unwrap_err().to_string();
    assert!(message.contains("trials.csv") && message.contains("a session folder"), "{message}");
}

#[test]
fn a_description_or_table_that_is_not_there_is_named() {
    for file in ["session.json", "trials.csv"] {
        let folder = sound();
        fs::remove_file(folder.path().join(file)).unwrap();
        assert_refused(&folder, &[file, "not found"]);
    }
}

#[test]
fn empty_files_are_named() {
    for file in ["session.json", "trials.csv", "trials/trial-001.csv"] {
        let folder = sound();
        write(&folder, file, "");
        assert_refused(&folder, &[file, "the file is empty; expected"]);
    }
}

#[test]
fn an_unknown_format_version_is_refused_before_anything_else() {
    let folder = sound();
    write(&folder, "session.json", r#"{ "format": "ramphold-session/2" }"#);
    assert_refused(
        &folder,
        &["session.json, field format", "\"ramphold-session/2\"", "\"ramphold-session/1\""],
    );
}

#[test]
fn json_that_is_not_json_is_refused_with_its_line() {
    let folder = sound();
    edit(&folder, "session.json", "\"rig\": {", "\"rig\": ");
    assert_refused(&folder, &["session.json, line 2", "expected"]);
}

#[test]
fn missing_and_mistyped_fields_are_refused_with_their_path() {
    for (from, to, path) in [
        ("\"recorded_filter\": null,", "", "recorded_filter"),
        ("\"format\": \"ramphold-session/1\",", "", "format"),
        ("\"sample_rate_hz\": 1000,", "\"sample_rate_hz\": \"1 kHz\",", "field sample_rate_hz"),
        ("\"stiffness_nm_per_rad\": 900", "\"stiffnes\": 900", "rig.lever"),
        ("{ \"id\": \"S01\" }", "{}", "id"),
        ("\"rig\": {", "\"rig\": {}, \"gir\": {", "lever"),
    ] {
        let folder = sound();
        edit(&folder, "session.json", from, to);
        assert_refused(&folder, &["session.json", path]);
    }
}

#[test]
fn impossible_values_of_the_description_are_refused() {
    for (from, to, field) in [
        ("1000,", "0,", "field sample_rate_hz"),
        ("1000,", "-2500,", "field sample_rate_hz"),
        ("0.0016", "0", "field rig.lever.inertia_kg_m2"),
        ("0.4", "-0.4", "field rig.lever.damping_nm_s_per_rad"),
        ("900", "0", "field rig.lever.stiffness_nm_per_rad"),
        (
            "null",
            r#"{"kind": "butterworth", "order": 3, "cutoff_hz": 500}"#,
            "field recorded_filter.cutoff_hz",
        ),
        (
            "null",
            r#"{"kind": "butterworth", "order": 3, "cutoff_hz": 0.25}"#,
            "field recorded_filter.cutoff_hz: \"0.25\" is not valid; expected a frequency in Hz from 3.98 up",
        ),
        ("null", r#"{"kind": "butterworth", "order": 0, "cutoff_hz": 50}"#, "field recorded_filter.order"),
    ] {
        let folder = sound();
        edit(&folder, "session.json", from, to);
        assert_refused(&folder, &["session.json", field, "expected"]);
    }
}

#[test]
fn a_missing_column_is_named_with_the_header_that_is_there() {
    for column in ["trial", "file", "velocity_rad_s", "torque_nm", "repetition", "onset_s", "status"] {
        let folder = sound();
        edit(&folder, "trials.csv", column, "other");
        assert_refused(&folder, &["trials.csv, line 1", &format!("column {column} is missing"), "other"]);
    }
    for column in ["t_s", "theta_m_rad", "torque_l_nm"] {
        let folder = sound();
        edit(&folder, "trials/trial-002.csv", column, "other");
        assert_refused(&folder, &["trials/trial-002.csv, line 1", &format!("column {column} is missing")]);
    }
}

#[test]
fn a_column_there_twice_is_refused() {
    let folder = sound();
    edit(&folder, "trials/trial-001.csv", "emg_fcr_mvc", "torque_l_nm");
    assert_refused(&folder, &["trials/trial-001.csv, line 1", "column torque_l_nm is there twice"]);
}

#[test]
fn text_where_a_number_belongs_is_named_with_line_and_column() {
    let folder = sound();
    edit(&folder, "trials/trial-001.csv", "0.0020,0.02,", "0.0020,O.02,");
    assert_refused(
        &folder,
        &["trials/trial-001.csv, line 4, column theta_m_rad", "\"O.02\"", "a finite number"],
    );
    for (from, to, column) in [
        (",1.3,", ",fast,", "column velocity_rad_s"),
        (",1.3,", ",0,", "column velocity_rad_s"),
        (",0.9,", ",,", "column torque_nm"),
        (",1,0.2", ",one,0.2", "column repetition"),
        (",0.2,", ",soon,", "column onset_s"),
        ("1,trials", "0,trials", "column trial"),
        (",ok", ",fine", "column status"),
    ] {
        let folder = sound();
        edit(&folder, "trials.csv", from, to);
        assert_refused(&folder, &["trials.csv, line 2", column, "expected"]);
    }
}

#[test]
fn nan_and_infinity_are_no_numbers() {
    for number in ["NaN", "nan", "inf", "-Infinity", "1e999"] {
        let folder = sound();
        edit(&folder, "trials/trial-001.csv", "-1.25e-1", number);
        assert_refused(&folder, &["trials/trial-001.csv, line 2, column torque_l_nm", number]);
    }
}

#[test]
fn a_row_cut_short_is_refused() {
    let folder = sound();
    let mut text = record(400, |sample| sample as f64 / 1000.0);
    text.truncate(text.len() - 7);
    write(&folder, "trials/trial-001.csv", &text);
    assert_refused(&folder, &["trials/trial-001.csv, line 401", "4 fields; expected 5"]);
}

#[test]
fn a_gap_in_time_is_named_where_it_is() {
    let folder = sound();
    let gap = |sample: usize| (sample + usize::from(sample >= 100)) as f64 / 1000.0;
    write(&folder, "trials/trial-001.csv", &record(400, gap));
    assert_refused(&folder, &["trials/trial-001.csv, line 102, column t_s", "gap", "0.099 s to 0.101 s"]);
}

#[test]
fn a_step_back_in_time_is_named_where_it_is() {
    let folder = sound();
    let back = |sample: usize| if sample == 50 { 0.048 } else { sample as f64 / 1000.0 };
    write(&folder, "trials/trial-001.csv", &record(400, back));
    assert_refused(&folder, &["trials/trial-001.csv, line 52, column t_s", "0.049 s to 0.048 s"]);
}

#[test]
fn a_rate_that_disagrees_is_refused_however_small_the_difference() {
    for rate_hz in [500.0, 900.0, 995.0, 1005.0, 1250.0, 2500.0] {
        let folder = sound();
        write(&folder, "trials/trial-001.csv", &record(400, |sample| sample as f64 / rate_hz));
        assert_refused(
            &folder,
            &["trials/trial-001.csv, line", "column t_s", "sample_rate_hz of session.json, 1000"],
        );
    }
}

#[test]
fn times_printed_with_few_digits_are_accepted() {
    let folder = sound();
    write(&folder, "session.json", &description(SESSION_FORMAT, "3000"));
    for trial in ["trials/trial-001.csv", "trials/trial-002.csv"] {
        write(&folder, trial, &record(1200, |sample| sample as f64 / 3000.0));
    }
    assert_eq!(load(folder.path()).unwrap().trials.len(), 2);
}

#[test]
fn times_of_samples_that_were_not_taken_evenly_are_refused() {
    let mut random = crate::random::Stream::new(5, "jitter");
    let mut text = "t_s,theta_m_rad,torque_l_nm\n".to_owned();
    for sample in 0..400_u16 {
        let time_s = f64::from(sample) / 1000.0;
        let angle_rad = (3.25 * (time_s - 0.2)).clamp(0.0, 0.14);
        let jitter_s = 1e-4 * (2.0 * random.uniform() - 1.0);
        text += &format!("{:.7},{angle_rad:.7},1.25\n", time_s + jitter_s);
    }
    let folder = sound();
    write(&folder, "trials/trial-001.csv", &text);
    assert_refused(
        &folder,
        &[
            "trials/trial-001.csv, line",
            "column t_s",
            "us off even steps",
            "bring every channel to even times",
        ],
    );
}

#[test]
fn a_record_that_is_not_there_is_named_with_the_row_that_names_it() {
    let folder = sound();
    fs::remove_file(folder.path().join("trials/trial-002.csv")).unwrap();
    assert_refused(&folder, &["trials/trial-002.csv: not found", "trials.csv, line 3, column file"]);
}

#[test]
fn a_folder_in_place_of_a_record_is_refused() {
    let folder = sound();
    edit(&folder, "trials.csv", "trials/trial-001.csv", "trials");
    assert_refused(&folder, &["trials: cannot be read", "it is a folder; expected a plain file"]);
}

#[test]
fn an_onset_outside_the_record_or_too_near_its_ends_is_refused() {
    for (onset, expected) in
        [("0.5", "inside the record"), ("-0.1", "inside the record"), ("0.02", "40 ms"), ("0.38", "40 ms")]
    {
        let folder = sound();
        edit(&folder, "trials.csv", ",0.2,", &format!(",{onset},"));
        assert_refused(&folder, &["trials.csv, line 2, column onset_s", onset, expected, "0.399 s"]);
    }
}

#[test]
fn an_ok_trial_too_short_to_analyse_is_refused() {
    let folder = sound();
    write(&folder, "trials/trial-002.csv", &record(79, |sample| sample as f64 / 1000.0));
    assert_refused(&folder, &["trials/trial-002.csv: 79 samples; expected at least 80"]);
}

#[test]
fn paths_that_leave_the_folder_are_refused() {
    for path in ["/etc/hostname", "../other/trial.csv", "trials/../../trial.csv", "..", "."] {
        let folder = sound();
        edit(&folder, "trials.csv", "trials/trial-001.csv", path);
        assert_refused(&folder, &["trials.csv, line 2, column file", path, "expected"]);
    }
}

#[cfg(unix)]
#[test]
fn links_that_leave_the_folder_are_refused() {
    let elsewhere = tempfile::tempdir().unwrap();
    write(&elsewhere, "trial.csv", &record(400, |sample| sample as f64 / 1000.0));
    let folder = sound();
    let link = folder.path().join("trials/trial-001.csv");
    fs::remove_file(&link).unwrap();
    std::os::unix::fs::symlink(elsewhere.path().join("trial.csv"), &link).unwrap();
    assert_refused(&folder, &["trials/trial-001.csv: cannot be read", "symbolic link"]);
}

#[cfg(unix)]
#[test]
fn a_link_inside_the_folder_is_refused_and_a_detour_is_not() {
    let folder = sound();
    std::os::unix::fs::symlink("trial-001.csv", folder.path().join("trials/again.csv")).unwrap();
    edit(&folder, "trials.csv", "trials/trial-002.csv", "./trials/../trials/again.csv");
    assert_refused(&folder, &["again.csv", "symbolic link"]);
    edit(&folder, "trials.csv", "again.csv", "trial-002.csv");
    load(folder.path()).unwrap();
}

#[test]
fn a_trial_number_there_twice_is_refused() {
    let folder = sound();
    edit(&folder, "trials.csv", "2,trials/trial-002", "1,trials/trial-002");
    assert_refused(&folder, &["trials.csv, line 3, column trial", "trial 1 is already in line 2"]);
}

#[test]
fn text_that_is_not_utf8_is_refused_with_its_line() {
    let folder = sound();
    let mut bytes = fs::read(folder.path().join("trials.csv")).unwrap();
    bytes.extend(b"3,trials/\xE9.csv");
    fs::write(folder.path().join("trials.csv"), bytes).unwrap();
    assert_refused(&folder, &["trials.csv, line 4", "UTF-8"]);
}

#[test]
fn aborted_and_rejected_trials_may_have_a_short_record_or_none() {
    let folder = sound();
    let rows = "1,trials/trial-001.csv,1.3,0.9,1,0.2,ok\n2,trials/trial-002.csv,2.6,2.1,1,,aborted\n\
                3,,2.6,2.1,1,,rejected\n4,trials/trial-004.csv,2.6,2.1,1,,aborted\n";
    write(&folder, "trials.csv", &format!("{TABLE}{rows}"));
    write(&folder, "trials/trial-002.csv", &record(3, |sample| sample as f64 / 1000.0));
    write(&folder, "trials/trial-004.csv", &record(0, |sample| sample as f64 / 1000.0));
    let lengths: Vec<usize> =
        load(folder.path()).unwrap().trials.iter().map(|trial| trial.record.theta_m_rad.len()).collect();
    assert_eq!(lengths, [400, 3, 0, 0]);
}

#[test]
fn an_ok_trial_must_name_its_record() {
    let folder = sound();
    edit(&folder, "trials.csv", "trials/trial-001.csv", "");
    assert_refused(&folder, &["trials.csv, line 2, column file", "the path of the trial's record"]);
}

#[test]
fn the_measured_ankle_sessions_load() {
    for (name, trials) in [("ankle-0", 234), ("ankle-1", 231)] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(name);
        if !folder.exists() {
            eprintln!("skipped: {} is not there", folder.display());
            continue;
        }
        let session = load(&folder).unwrap();
        assert_eq!(session.trials.len(), trials);
        assert!(session.lever.is_none());
        assert!(session.trials.iter().all(|trial| trial.record.theta_m_rad.len() == 240));
    }
}
