//! The same two ramps as a folder of CSV files, as .mat files of both versions, as Parquet, and as one long record.

mod long_record;

use std::fs;
use std::path::Path;

use super::{
    ImportedSession, LongRecord, MappedSignal, Mapping, SignalUnit, SourceTable, TIME_COLUMN, import,
    read_source,
};
use crate::consistency::contradictions;
use crate::dataset;

const RATE_HZ: f64 = 1000.0;
const SAMPLES: usize = 800;

/// Time in ms, angle in degrees with the sign turned, torque in N cm.
fn columns(speed_rad_s: f64) -> [Vec<f64>; 3] {
    let time = |i: usize| i as f64 / RATE_HZ;
    let way = |t: f64| {
        let t = (t - 0.5).max(0.0);
        let risen = if t < 0.016 { t * t / 0.032 } else { t - 0.008 };
        (speed_rad_s * risen).min(0.14)
    };
    let angle = (0..SAMPLES).map(|i| -way(time(i)).to_degrees() + 5.0 + 1e-4 * libm::sin(i as f64)).collect();
    let torque = (0..SAMPLES)
        .map(|i| 100.0 * (1.5 + 0.01 * libm::sin(0.06 * i as f64) + 15.0 * way(time(i))))
        .collect();
    [(0..SAMPLES).map(|i| 1e3 * time(i)).collect(), angle, torque]
}

const NAMES: [&str; 3] = ["Time", "Pos", "Tq"];

fn mapping() -> Mapping {
    let text = r#"{
      "format": "ramphold-import/1", "subject": "S09",
      "columns": {
        "time": { "column": "Time", "unit": "ms" },
        "angle": { "column": "Pos", "unit": "deg", "sign": -1, "zero": 5 },
        "torque": { "column": "Tq", "unit": "N cm" }
      },
      "lever": { "inertia_kg_m2": 0.0016, "damping_nm_s_per_rad": 0.4, "stiffness_nm_per_rad": 900 },
      "recorded_filter": null
    }"#;
    Mapping::parse(text, Path::new("mapping.json")).unwrap()
}

fn table(name: &str, columns: [Vec<f64>; 3]) -> SourceTable {
    let columns = NAMES.iter().zip(columns).map(|(name, values)| ((*name).to_owned(), values)).collect();
    SourceTable::new(name.to_owned(), columns)
}

fn csv(table: &SourceTable) -> String {
    let mut text = NAMES.join(",") + "\n";
    for row in 0..table.columns[0].1.len() {
        let cells: Vec<String> = table.columns.iter().map(|(_, values)| values[row].to_string()).collect();
        text += &(cells.join(",") + "\n");
    }
    text
}

#[track_caller]
fn assert_two_trials(imported: &ImportedSession) {
    let session = &imported.session;
    assert_eq!(session.sample_rate_hz, RATE_HZ);
    let speeds: Vec<f64> = session.trials.iter().map(|trial| trial.velocity_rad_s).collect();
    assert_eq!(speeds, [1.3, 2.6]);
    for trial in &session.trials {
        assert_eq!(trial.torque_nm, 1.5);
        let onset_s = trial.onset_s.unwrap();
        assert!((onset_s - 0.5).abs() < 0.004, "{onset_s}");
        assert!(trial.record.theta_m_rad[0].abs() < 1e-3);
    }
    assert_eq!(contradictions(session), []);
}

#[test]
fn a_folder_of_csv_files_becomes_a_session_that_loads() {
    let folder = tempfile::tempdir().unwrap();
    for (number, speed) in [(1, 1.3), (2, 2.6)] {
        fs::write(folder.path().join(format!("t{number}.csv")), csv(&table("", columns(speed)))).unwrap();
    }
    let imported = import(read_source(folder.path()).unwrap(), &mapping()).unwrap();
    assert_two_trials(&imported);
    let written = folder.path().join("session");
    imported.write(&mapping(), &written).unwrap();
    let loaded = dataset::load(&written).unwrap();
    assert_eq!(loaded.trials.len(), 2);
    assert_eq!(loaded.trials[1].velocity_rad_s, 2.6);
    assert!(fs::read_to_string(written.join("import.svg")).unwrap().contains("trial 2: 2.6 rad/s"));
    let kept: serde_json::Value =
        serde_json::from_slice(&fs::read(written.join("import.json")).unwrap()).unwrap();
    let again: Mapping = serde_json::from_value(kept["mapping"].clone()).unwrap();
    assert_eq!(again, mapping(), "the mapping can be used again");
    assert!(imported.write(&mapping(), &written).unwrap_err().to_string().contains("not overwritten"));
}

#[test]
fn one_long_record_is_cut_at_the_trigger_or_at_the_ramps() {
    let long = columns(1.3).into_iter().zip(columns(2.6)).map(|(first, second)| [first, second].concat());
    let mut long = table("long", long.collect::<Vec<_>>().try_into().unwrap());
    long.columns[0].1 = (0..2 * SAMPLES).map(|i| i as f64).collect();
    // The second ramp begins where the first one ended.
    long.columns[1].1[SAMPLES..].iter_mut().for_each(|angle| *angle -= 0.14_f64.to_degrees());
    let trigger =
        (0..2 * SAMPLES).map(|i| if (500..560).contains(&(i % SAMPLES)) { 5.0 } else { 0.0 }).collect();
    long.columns.push(("Trigger".into(), trigger));
    for ramp_column in [Some("Trigger".to_owned()), None] {
        let long_record = Some(LongRecord { ramp_column, threshold: 2.5, before_s: 0.4, after_s: 0.25 });
        let imported = import(vec![long.clone()], &Mapping { long_record, ..mapping() }).unwrap();
        let speeds: Vec<f64> = imported.session.trials.iter().map(|trial| trial.velocity_rad_s).collect();
        assert_eq!(speeds, [1.3, 2.6]);
        assert_eq!(imported.session.trials[0].record.theta_m_rad.len(), 650);
    }
}

#[test]
fn trials_in_one_table_are_told_apart_by_a_column() {
    let long = columns(1.3).into_iter().zip(columns(2.6)).map(|(first, second)| [first, second].concat());
    let mut long = table("long", long.collect::<Vec<_>>().try_into().unwrap());
    long.columns.push(("Trial".into(), (0..2 * SAMPLES).map(|i| (i / SAMPLES) as f64).collect()));
    // The time begins anew with each trial.
    let mapping = Mapping { trial_column: Some("Trial".into()), ..mapping() };
    assert_two_trials(&import(vec![long], &mapping).unwrap());
}

#[test]
fn the_velocity_of_a_condition_is_that_of_the_ramp_and_not_of_its_overshoot() {
    let [time, angle, torque] = columns(1.3);
    // A motor that catches up: up to 1.8 rad/s while the ramp rises.
    let hump = |ms: f64| 0.003 * libm::exp(-((ms - 522.0) / 5.0) * ((ms - 522.0) / 5.0));
    let angle = angle.iter().zip(&time).map(|(degrees, ms)| degrees - hump(*ms).to_degrees()).collect();
    let imported = import(vec![table("t1.csv", [time, angle, torque])], &mapping()).unwrap();
    assert_eq!(imported.session.trials[0].velocity_rad_s, 1.3);
}

#[test]
fn trials_of_a_folder_are_in_the_order_of_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    for number in [1, 2, 10] {
        fs::write(folder.path().join(format!("t{number}.csv")), csv(&table("", columns(1.3)))).unwrap();
    }
    let names: Vec<String> =
        read_source(folder.path()).unwrap().into_iter().map(|table| table.name).collect();
    assert!(names[1].ends_with("t2.csv") && names[2].ends_with("t10.csv"), "{names:?}");
}

#[test]
fn a_table_of_another_rate_or_with_a_gap_is_refused() {
    let [time, angle, torque] = columns(2.6);
    let tables = |time: Vec<f64>| {
        vec![table("t1.csv", columns(1.3)), table("t2.csv", [time, angle.clone(), torque.clone()])]
    };
    let told = |time| import(tables(time), &mapping()).unwrap_err().to_string();
    let twice_as_fast = told(time.iter().map(|ms| 0.5 * ms).collect());
    assert!(
        twice_as_fast.contains("t2.csv") && twice_as_fast.contains("2000") && twice_as_fast.contains("1000"),
        "{twice_as_fast}"
    );
    let gap = told(time.iter().map(|ms| if *ms < 300.0 { *ms } else { ms + 20.0 }).collect());
    assert!(gap.contains("t2.csv") && gap.contains("gap"), "{gap}");
}

#[test]
fn times_that_are_no_even_axis_are_refused_where_they_are() {
    let told = |time: &dyn Fn(usize, f64) -> f64| {
        let [own, angle, torque] = columns(2.6);
        let own = own.iter().enumerate().map(|(sample, ms)| time(sample, *ms)).collect();
        import(vec![table("t1.csv", [own, angle, torque])], &mapping()).map_err(|error| error.to_string())
    };
    let lost = told(&|sample, ms| if sample < 510 { ms } else { ms + 1.0 }).unwrap_err();
    assert!(lost.contains("t1.csv: the column Time does not rise evenly"), "{lost}");
    assert!(lost.contains("it goes from 0.509 s to 0.511 s at sample 511"), "{lost}");
    let repeated = told(&|sample, ms| if sample == 300 { ms - 1.0 } else { ms }).unwrap_err();
    assert!(repeated.contains("goes from 0.299 s to 0.299 s at sample 301"), "{repeated}");
    let back = told(&|sample, ms| if sample == 300 { ms - 2.5 } else { ms }).unwrap_err();
    assert!(back.contains("goes from 0.299 s to 0.2975 s at sample 301"), "{back}");
    let mut random = crate::random::Stream::new(6, "jitter");
    let jitter_ms: Vec<f64> = (0..SAMPLES).map(|_| 0.125 * (2.0 * random.uniform() - 1.0)).collect();
    let jittered = told(&|sample, ms| ms + jitter_ms[sample]).unwrap_err();
    assert!(jittered.contains("us off even steps") && jittered.contains("sample_rate_hz"), "{jittered}");
    let coarse = told(&|_, ms| 2.0 * libm::round(0.5 * ms)).unwrap();
    assert!((coarse.session.sample_rate_hz - RATE_HZ).abs() < 2.0, "rounded to two samples");
    told(&|sample, ms| ms * (1.0 + 1e-8 * sample as f64)).unwrap();
}

#[test]
fn a_record_without_a_ramp_makes_no_trial() {
    // The encoder stands on one count, and goes to its neighbour now and then.
    let [time, _, torque] = columns(1.3);
    let angle = (0..SAMPLES).map(|i| 5.0 - 2.7e-3 * f64::from(u8::from(i > 60 && i % 7 == 0))).collect();
    let wobble = table("t1.csv", [time, angle, torque]);
    let sound = [table("t2.csv", columns(1.3)), table("t3.csv", columns(2.6))];
    let imported = import([vec![wobble], sound.to_vec()].concat(), &mapping()).unwrap();
    assert_two_trials(&imported);
    assert_eq!(imported.session.trials[1].file, "trials/trial-002.csv");
    let told = &imported.left_out;
    assert!(told.len() == 1 && told[0].starts_with("t1.csv: has no ramp: the motor goes"), "{told:?}");
}

#[test]
fn a_table_that_is_there_twice_is_refused_with_both_names() {
    let twice =
        vec![table("t1.csv", columns(1.3)), table("t2.csv", columns(2.6)), table("t3.csv", columns(1.3))];
    let told = import(twice, &mapping()).unwrap_err().to_string();
    assert!(told.contains("t1.csv and t3.csv have the same angle and torque in every sample"), "{told}");
}

#[test]
fn every_mistake_of_a_mapping_is_told_at_once() {
    let text =
        r#"{ "format": "ramphold-import/1", "columns": { "angle": { "unit": "degrees" } }, "speed": 1 }"#;
    let told = Mapping::parse(text, Path::new("m.json")).unwrap_err().to_string();
    for part in [
        "subject",
        "lever",
        "recorded_filter",
        "columns.torque",
        "columns.angle.column",
        "columns.angle.unit",
        "speed",
        "\"deg\"",
    ] {
        assert!(told.contains(part), "{part} is not in: {told}");
    }
}

#[test]
fn a_trial_with_a_sample_that_is_no_number_is_left_out_and_told() {
    let mut spoilt = columns(1.3);
    spoilt[2][41] = f64::NAN;
    let imported = import(vec![table("t1.csv", spoilt), table("t2.csv", columns(1.3))], &mapping()).unwrap();
    assert_eq!(imported.sources, ["t2.csv"]);
    assert_eq!(imported.left_out, ["t1.csv: sample 42 of the torque is no number"]);
}

#[test]
fn units_that_no_limb_has_are_refused_with_those_that_explain_them() {
    let refused = |change: &dyn Fn(&mut Mapping)| {
        let mut wrong = mapping();
        change(&mut wrong);
        import(vec![table("t1.csv", columns(1.3))], &wrong).unwrap_err().to_string()
    };
    let told = refused(&|own| own.columns.angle.unit = SignalUnit::Radian);
    assert!(
        told.contains("\"Pos\" in rad")
            && told.contains("one of deg, mrad")
            && told.contains("in columns.angle"),
        "{told}"
    );
    let mut millis = columns(1.3);
    millis[2].iter_mut().for_each(|torque| *torque *= 10.0);
    let mut wrong = mapping();
    wrong.columns.torque.unit = SignalUnit::NewtonMetre;
    let told = import(vec![table("t1.csv", millis)], &wrong).unwrap_err().to_string();
    // Several units would make it possible, so none is advised alone.
    assert!(told.contains("one of N mm, N cm") && told.contains("in columns.torque"), "{told}");
    let told = refused(&|own| own.columns.torque.column = "Pos".into());
    assert!(told.contains("columns.angle and columns.torque are both column \"Pos\""), "{told}");
    let mut twice = columns(1.3);
    twice[2] = twice[1].clone();
    let told = import(vec![table("t1.csv", twice)], &mapping()).unwrap_err().to_string();
    assert!(told.contains("are equal in every sample"), "{told}");
}

/// Its row of the table became one of 74 rad/s, and the others were fitted together with it.
#[test]
fn one_file_in_another_unit_than_the_others_is_refused_by_its_name() {
    let others =
        || (1..=3).map(|number| table(&format!("t{number}.csv"), columns(1.3 + 0.002 * f64::from(number))));
    for (column, factor, what) in [(1, 57.3, "ramp is 57"), (2, 100.0, "torque is 100")] {
        let mut own = columns(1.3);
        let first = own[column][0];
        own[column].iter_mut().for_each(|value| {
            *value = if column == 1 { 5.0 + (*value - first) * factor } else { *value * factor }
        });
        let tables: Vec<SourceTable> = others().chain([table("other.csv", own)]).collect();
        let told = import(tables, &mapping()).unwrap_err().to_string();
        assert!(told.contains("other.csv") && told.contains(what) && told.contains("another unit"), "{told}");
    }
    // A spike is none.
    let mut spiky = columns(1.31);
    spiky[2][100..103].fill(1e5);
    assert!(import(others().chain([table("other.csv", spiky)]).collect(), &mapping()).is_ok());
}

#[test]
fn times_of_another_unit_or_rate_are_refused_with_what_to_write() {
    let refused = |change: &dyn Fn(&mut Mapping)| {
        let mut wrong = mapping();
        change(&mut wrong);
        import(vec![table("t1.csv", columns(1.3))], &wrong).unwrap_err().to_string()
    };
    let in_seconds = |own: &mut Mapping| own.columns.time.as_mut().unwrap().unit = SignalUnit::Second;
    assert!(refused(&in_seconds).contains("\"unit\": \"ms\" in columns.time"));
    let told = refused(&|own| {
        own.columns.time.as_mut().unwrap().unit = SignalUnit::Microsecond;
        own.sample_rate_hz = Some(RATE_HZ);
    });
    assert!(told.contains("is the time in ms? Then write \"unit\": \"ms\" in columns.time"), "{told}");
    let told = refused(&|own| own.sample_rate_hz = Some(1200.0));
    assert!(
        told.contains("expected 1200") && told.contains("correct sample_rate_hz, or leave it out"),
        "{told}"
    );
}

/// A recording that the format says to be of 1000 Hz was taken for one of 2000, and N mm for N cm.
#[test]
fn what_a_format_says_of_its_rate_and_units_holds_against_the_mapping() {
    let tables = || {
        [1.3, 2.6].map(|speed| {
            let [time_ms, angle, torque] = columns(speed);
            let time_s = time_ms.iter().map(|own| own / 1e3).collect();
            let mut own = table("t.bdf", [time_s, angle, torque]);
            own.columns[0].0 = TIME_COLUMN.to_owned();
            own.stated.is_even = true;
            own.stated.units = vec![("Tq".into(), "N.cm".into()), ("Pos".into(), "uV".into())];
            own
        })
    };
    let without_time = || {
        let mut own = mapping();
        own.columns.time = None;
        own
    };
    assert_two_trials(&import(tables().to_vec(), &without_time()).unwrap());
    let other_rate = Mapping { sample_rate_hz: Some(2000.0), ..without_time() };
    let told = import(tables().to_vec(), &other_rate).unwrap_err().to_string();
    assert!(told.contains("its time has 1000.000000 samples a second; expected 2000"), "{told}");
    let mut other_unit = tables();
    other_unit.iter_mut().for_each(|own| own.stated.units[0].1 = "mNm".into());
    let told = import(other_unit.to_vec(), &without_time()).unwrap_err().to_string();
    assert!(told.contains("says that \"Tq\" is in \"mNm\"") && told.contains("\"N cm\""), "{told}");
}

#[test]
fn a_unit_of_another_kind_of_signal_is_refused_with_those_that_it_can_have() {
    let told = |change: &dyn Fn(&mut Mapping)| {
        let mut wrong = mapping();
        change(&mut wrong);
        let text = serde_json::to_string_pretty(&wrong).unwrap();
        Mapping::parse(&text, Path::new("m.json")).unwrap_err().to_string()
    };
    let volts = told(&|own| own.columns.torque.unit = SignalUnit::Volt);
    assert!(volts.contains("columns.torque.unit is \"V\"") && volts.contains("\"N m\""), "{volts}");
    assert!(told(&|own| own.columns.angle.unit = SignalUnit::Millisecond).contains("\"deg\""));
    assert!(told(&|own| own.columns.angle.sign = 0).contains("columns.angle.sign is 0"));
    assert!(told(&|own| own.columns.torque.at_mvc = Some(2.0)).contains("columns.torque.at_mvc"));
    let emg = |unit: SignalUnit| {
        told(&|own| own.columns.emg_fcr = Some(MappedSignal { unit, ..own.columns.torque.clone() }))
    };
    assert!(emg(SignalUnit::Millivolt).contains("columns.emg_fcr.at_mvc"));
    assert!(emg(SignalUnit::NewtonMetre).contains("columns.emg_fcr.unit is \"N m\""));
}

#[test]
fn a_name_that_two_columns_have_says_of_neither_what_it_is() {
    let mut twice = table("t1.csv", columns(1.3));
    twice.columns.push(("Pos".into(), columns(2.6)[1].clone()));
    let told = import(vec![twice], &mapping()).unwrap_err().to_string();
    assert!(told.contains("t1.csv: has several columns \"Pos\" (rename all but one)"), "{told}");
}

#[test]
fn a_number_with_a_divider_of_thousands_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("t1.csv");
    fs::write(&file, "Time,Pos\n0,\"2,218\"\n").unwrap();
    let told = read_source(&file).unwrap_err().to_string();
    assert!(told.contains("line 2, column Pos: \"2,218\" is no number"), "{told}");
    fs::write(&file, "Time;Pos\n0;2,218\n").unwrap();
    assert_eq!(read_source(&file).unwrap()[0].columns[1].1, [2.218]);
}

#[test]
fn a_subject_that_is_no_identifier_is_refused() {
    let text = serde_json::to_string_pretty(&mapping()).unwrap();
    for subject in ["", "../../x", "..", "S 1"] {
        let text = text.replace("\"S09\"", &format!("{subject:?}"));
        let told = Mapping::parse(&text, Path::new("m.json")).unwrap_err().to_string();
        assert!(told.contains("line 3: subject is") && told.contains("such as S03"), "{told}");
    }
}

#[test]
fn a_lever_that_cannot_be_is_refused_with_its_field() {
    let sound = serde_json::to_value(mapping()).unwrap();
    for (field, value) in
        [("inertia_kg_m2", -1.0), ("damping_nm_s_per_rad", -0.1), ("stiffness_nm_per_rad", 0.0)]
    {
        let mut wrong = sound.clone();
        wrong["lever"][field] = value.into();
        let told = Mapping::parse(&format!("{wrong:#}"), Path::new("m.json")).unwrap_err().to_string();
        assert!(told.contains(&format!("lever.{field} is {value}")) && told.contains("line "), "{told}");
    }
}

#[test]
fn a_column_that_is_not_there_is_named_with_those_that_are() {
    let mut wrong = mapping();
    wrong.columns.torque.column = "Torque".into();
    let told = import(vec![table("t1.csv", columns(1.3))], &wrong).unwrap_err().to_string();
    assert!(
        told.contains("t1.csv") && told.contains("\"Torque\"") && told.contains("Time, Pos, Tq"),
        "{told}"
    );
}

/// Columns of a Parquet table that cannot be used.
#[cfg(feature = "parquet")]
mod parquet_columns {
    use std::sync::Arc;

    use parquet::data_type::{DoubleType, Int64Type};
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    use super::*;

    #[test]
    fn a_parquet_column_with_an_empty_row_or_of_timestamps_is_named_with_its_reason_and_refused_if_it_is_used()
     {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("t.parquet");
        let schema = "message t { required double Time; required double Pos; optional double Tq; \
                      required int64 Stamp (TIMESTAMP_MICROS); }";
        let schema = Arc::new(parse_message_type(schema).unwrap());
        let mut writer =
            SerializedFileWriter::new(fs::File::create(&file).unwrap(), schema, Default::default()).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let [time, angle, torque] = columns(1.3);
        for values in [time, angle] {
            let mut column = group.next_column().unwrap().unwrap();
            column.typed::<DoubleType>().write_batch(&values, None, None).unwrap();
            column.close().unwrap();
        }
        let is_there: Vec<i16> = (0..SAMPLES).map(|row| i16::from(row != 41)).collect();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&torque[1..], Some(&is_there), None).unwrap();
        column.close().unwrap();
        let stamps: Vec<i64> = (0..SAMPLES as i64).map(|row| 1_700_000_000_000_000 + 1000 * row).collect();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int64Type>().write_batch(&stamps, None, None).unwrap();
        column.close().unwrap();
        group.close().unwrap();
        writer.close().unwrap();

        let tables = read_source(&file).unwrap();
        let names = tables[0].names();
        assert!(names.starts_with("Time, Pos, Tq (not usable: row 42 is empty"), "{names}");
        assert!(
            names.contains("Stamp (not usable: row 1 is a date or a time of day; write times as"),
            "{names}"
        );
        let told = import(tables, &mapping()).unwrap_err().to_string();
        assert!(
            told.contains("cannot use column \"Tq\": row 42 is empty") && told.contains("the torque"),
            "{told}"
        );
    }
}

/// Elements of a .mat file of version 5.
#[cfg(feature = "matlab")]
mod mat {
    use std::io::Write;

    use super::*;

    fn element(kind: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
        bytes.extend(data);
        bytes.resize(8 + data.len().next_multiple_of(8), 0);
        bytes
    }

    fn matrix(name: &str, rows: usize, values: &[f64]) -> Vec<u8> {
        let columns = values.len() / rows;
        let dimensions = [(rows as i32).to_le_bytes(), (columns as i32).to_le_bytes()].concat();
        let values: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let parts = [
            element(6, &[6, 0, 0, 0, 0, 0, 0, 0]),
            element(5, &dimensions),
            element(1, name.as_bytes()),
            element(9, &values),
        ];
        element(14, &parts.concat())
    }

    /// The variables of both trials as matrices with a column for each.
    fn variables() -> [(&'static str, usize, Vec<f64>); 3] {
        let [time, one_angle, one_torque] = columns(1.3);
        let [_, other_angle, other_torque] = columns(2.6);
        [
            ("Time", SAMPLES, time),
            ("Pos", SAMPLES, [one_angle, other_angle].concat()),
            ("Tq", SAMPLES, [one_torque, other_torque].concat()),
        ]
    }

    fn header() -> Vec<u8> {
        let mut bytes = b"MATLAB 5.0 MAT-file".to_vec();
        bytes.resize(124, b' ');
        bytes.extend([0x00, 0x01, b'I', b'M']);
        bytes
    }

    #[test]
    fn fields_of_a_struct_in_a_mat_file_of_version_5() {
        let names: Vec<u8> =
            variables().iter().flat_map(|(name, ..)| format!("{name:\0<8}").into_bytes()).collect();
        let fields = variables().into_iter().map(|(_, rows, values)| matrix("", rows, &values));
        let parts = [
            element(6, &[2, 0, 0, 0, 0, 0, 0, 0]),
            element(5, &[1, 0, 0, 0, 1, 0, 0, 0]),
            element(1, b"rec"),
            [5u32 | 4 << 16, 8].map(u32::to_le_bytes).concat(),
            element(1, &names),
            fields.collect::<Vec<_>>().concat(),
        ];
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("trials.mat");
        fs::write(&file, [header(), element(14, &parts.concat())].concat()).unwrap();
        let mut mapping = mapping();
        let columns = &mut mapping.columns;
        for signal in [columns.time.as_mut().unwrap(), &mut columns.angle, &mut columns.torque] {
            signal.column = format!("rec.{}", signal.column);
        }
        assert_two_trials(&import(read_source(&file).unwrap(), &mapping).unwrap());
    }

    #[test]
    fn a_mat_file_of_version_5_with_a_column_for_each_trial() {
        let folder = tempfile::tempdir().unwrap();
        for is_compressed in [false, true] {
            let mut bytes = header();
            for (name, rows, values) in variables() {
                let own = matrix(name, rows, &values);
                if is_compressed {
                    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
                    packer.write_all(&own).unwrap();
                    let packed = packer.finish().unwrap();
                    bytes.extend(15u32.to_le_bytes());
                    bytes.extend((packed.len() as u32).to_le_bytes());
                    bytes.extend(packed);
                } else {
                    bytes.extend(own);
                }
            }
            let file = folder.path().join("trials.mat");
            fs::write(&file, bytes).unwrap();
            assert_two_trials(&import(read_source(&file).unwrap(), &mapping()).unwrap());
        }
        let whole: Vec<u8> = header()
            .into_iter()
            .chain(variables().into_iter().flat_map(|(n, rows, v)| matrix(n, rows, &v)))
            .collect();
        let [first, second, _] = variables().map(|(name, rows, values)| matrix(name, rows, &values).len());
        for length in [130, 128 + first + 4, 128 + first + 100, whole.len() - first / 3, whole.len() - 1] {
            fs::write(folder.path().join("cut.mat"), &whole[..length]).unwrap();
            let told = read_source(&folder.path().join("cut.mat")).unwrap_err().to_string();
            assert!(told.contains(&format!("the file ends early, at byte {length}")), "{length}: {told}");
        }
        // An element that says that it is whole, with fewer values than rows and columns.
        let mut damaged = whole[..128 + first + second].to_vec();
        damaged[128 + 8 + 16 + 8] += 1;
        fs::write(folder.path().join("cut.mat"), &damaged).unwrap();
        let told = read_source(&folder.path().join("cut.mat")).unwrap_err().to_string();
        assert!(told.contains("an element at byte 128 that is damaged"), "{told}");
        fs::write(folder.path().join("cut.mat"), b"MATLAB 5.0").unwrap();
        let told = read_source(&folder.path().join("cut.mat")).unwrap_err().to_string();
        assert!(told.contains("cut.mat") && told.contains("-v7"), "{told}");
    }

    #[test]
    fn a_mat_file_of_version_7_3_with_a_column_for_each_trial() {
        let mut builder = hdf5_pure::FileBuilder::new();
        for (name, rows, values) in variables() {
            let columns = (values.len() / rows) as u64;
            builder.create_dataset(name).with_f64_data(&values).with_shape(&[columns, rows as u64]);
        }
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("trials.mat");
        builder.write(&file).unwrap();
        assert_two_trials(&import(read_source(&file).unwrap(), &mapping()).unwrap());
    }
}
