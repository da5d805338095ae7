//! Recordings of other devices beside a session: found by a trigger, by a signal that both have, by markers.

use std::fmt::Write;
use std::fs;

use ramphold::dataset::{self, RampTime, Session};
use serde_json::{Value, json};

use crate::workspace::{PAPER, QUICK, Workspace, files};

/// The other device: its rate by its own clock, and how far that is ahead and fast.
const RATE_HZ: f64 = 2000.0;
const AHEAD_S: f64 = 17.3;
const FAST: f64 = 80e-6;

/// A session and what its other device saw.
struct Measured {
    workspace: Workspace,
    session: Session,
    ramps: Vec<RampTime>,
}

impl Measured {
    fn new() -> Self {
        Self::of(QUICK)
    }

    fn of(protocol: &str) -> Self {
        let workspace = Workspace::new();
        workspace.call(0, &["run", protocol, "--seed", "3", "--out", "s"]);
        let session = dataset::load(&workspace.path("s")).unwrap();
        let ramps = dataset::ramp_times(&workspace.path("s")).unwrap().unwrap();
        assert!(ramps.len() > session.trials.len() / 2 && ramps.iter().all(|ramp| ramp.stretch == 0));
        Self { workspace, session, ramps }
    }

    /// Time on the clock of the device.
    fn on_clock(&self, session_s: f64) -> f64 {
        AHEAD_S + session_s * (1.0 + FAST)
    }

    /// Trigger, torque and EMG of the device at each of its samples. Outside of the trials the torque is 0.
    fn samples(&self) -> Vec<(f64, f64, f64, f64)> {
        let end_s = self.ramps.last().unwrap().onset_s + 5.0;
        let mut samples = Vec::new();
        for sample in 0..(RATE_HZ * self.on_clock(end_s)) as usize {
            let device_s = sample as f64 / RATE_HZ;
            let session_s = (device_s - AHEAD_S) / (1.0 + FAST);
            let since = |ramp: &RampTime| session_s - ramp.onset_s;
            let pulse = self.ramps.iter().any(|ramp| (0.0..0.005).contains(&since(ramp)));
            let own = self.ramps.iter().find_map(|ramp| {
                let trial = self.session.trials.iter().find(|trial| Some(trial.number) == ramp.trial)?;
                let at = (since(ramp) + trial.onset_s? - trial.record.start_s) * self.session.sample_rate_hz;
                let (before, share) = (at.floor(), at - at.floor());
                let torque = &trial.record.torque_l_nm;
                (before >= 0.0 && (before as usize) + 1 < torque.len())
                    .then(|| torque[before as usize] * (1.0 - share) + torque[before as usize + 1] * share)
            });
            let noise = ((sample as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / 16_777_216.0;
            let torque = 3.2 * own.unwrap_or(0.0) + 0.01 * noise;
            samples.push((device_s, if pulse { 4.9 } else { 0.1 }, torque, noise - 0.5));
        }
        samples
    }

    fn write_csv(&self, name: &str) -> Vec<(f64, f64, f64, f64)> {
        let samples = self.samples();
        let mut text = "t,TRIG,torque,EMG 1\n".to_owned();
        for (time, pulse, torque, emg) in &samples {
            writeln!(text, "{time:.6},{pulse},{torque},{emg}").unwrap();
        }
        fs::write(self.workspace.path(name), text).unwrap();
        samples
    }

    fn attachment(&self, name: &str) -> Value {
        let file = self.workspace.path(&format!("s/attached/{name}/attachment.json"));
        serde_json::from_str(&fs::read_to_string(file).unwrap()).unwrap()
    }

    /// The largest error of the ramps' times, s.
    fn largest_error_s(&self, attachment: &Value) -> f64 {
        let trials = attachment["trials"].as_array().unwrap();
        let off = trials.iter().map(|own| {
            let number = own["trial"].as_u64().unwrap() as u32;
            let ramp = self.ramps.iter().find(|ramp| ramp.trial == Some(number)).unwrap();
            (own["onset_s"].as_f64().unwrap() - self.on_clock(ramp.onset_s)).abs()
        });
        off.fold(0.0, f64::max)
    }
}

#[test]
fn a_recording_with_a_trigger_is_cut_into_the_trials_and_no_sample_is_changed() {
    let measured = Measured::new();
    let samples = measured.write_csv("emg.csv");
    let before = files(&measured.workspace.path("s"));
    let arguments = [
        "attach",
        "s",
        "emg.csv",
        "--time",
        "t",
        "--trigger",
        "TRIG",
        "--emg-fcr",
        "EMG 1",
        "--fcr-at-mvc",
        "2",
    ];
    let (told, _) = measured.workspace.call(0, &arguments);
    assert!(told.contains("drift against the session's clock: "), "{told}");

    let own = measured.attachment("emg");
    let with_onset = measured.session.trials.iter().filter(|trial| trial.onset_s.is_some()).count();
    assert_eq!(own["trials"].as_array().unwrap().len(), with_onset);
    assert!(measured.largest_error_s(&own) < 1.0 / RATE_HZ);
    let clock = &own["clock"];
    assert!((clock["drift_ppm"].as_f64().unwrap() - 80.0).abs() < 40.0, "{clock}");
    assert!(clock["residual_largest_s"].as_f64().unwrap() < 1.0 / RATE_HZ, "{clock}");
    assert!((clock["rate_hz"].as_f64().unwrap() - RATE_HZ).abs() < 1e-3);

    // Every row of a trial is a row of the recording, in order and without a gap, at its time.
    for trial in own["trials"].as_array().unwrap() {
        let number = trial["trial"].as_u64().unwrap() as u32;
        let text = fs::read_to_string(
            measured.workspace.path(&format!("s/attached/emg/{}", trial["file"].as_str().unwrap())),
        )
        .unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("t_s,TRIG,torque,EMG 1"));
        let rows: Vec<Vec<f64>> =
            lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
        assert_eq!(rows.len() as u64, trial["samples"].as_u64().unwrap());
        let ramp = measured.ramps.iter().find(|ramp| ramp.trial == Some(number)).unwrap();
        let onset_s =
            measured.session.trials.iter().find(|own| own.number == number).unwrap().onset_s.unwrap();
        let first = samples.iter().position(|own| [own.1, own.2, own.3] == rows[0][1..]).unwrap();
        for (row, sample) in rows.iter().zip(&samples[first..]) {
            assert_eq!(row[1..], [sample.1, sample.2, sample.3]);
            let session_s = (sample.0 - AHEAD_S) / (1.0 + FAST);
            let expected_s = session_s - ramp.onset_s + onset_s;
            assert!(
                (row[0] - expected_s).abs() < 1.0 / RATE_HZ,
                "trial {number}: {} and {expected_s}",
                row[0]
            );
        }
    }

    // The raw data are as they were, and the manifest knows what was added.
    let after = files(&measured.workspace.path("s"));
    for (name, bytes) in before.iter().filter(|(name, _)| *name != "manifest.json") {
        assert!(&after[name] == bytes, "{name} changed");
    }
    assert_eq!(after["attached/emg/source.csv"], fs::read(measured.workspace.path("emg.csv")).unwrap());
    measured.workspace.call(0, &["verify", "s"]);
    measured.workspace.call(0, &["export", "s", "--bids", "bids"]);
    assert!(
        files(&measured.workspace.path("bids")).keys().any(|name| name.ends_with("attached/emg/source.csv"))
    );

    // The report shows this EMG, at its own rate and in its own unit.
    measured.workspace.call(0, &["report", "s"]);
    let report = fs::read_to_string(measured.workspace.path("s/results/report.html")).unwrap();
    assert!(report.contains("The EMG is that of the attachment emg, 2000 samples a second."));
    assert!(report.contains("EMG by trial") && report.contains("Maximal efforts"));
    // Noise between -0.5 and 0.5 has a mean size of 0.25: 12.5 % of 2.
    let (_, table) = report.split_once("EMG by trial").unwrap();
    let row = table.split("<tr").find(|row| row.contains(">1<")).unwrap();
    let cells: Vec<f64> = row.split('>').filter_map(|cell| cell.split('<').next()?.parse().ok()).collect();
    assert!((cells[1] - 12.5).abs() < 0.5, "{row}");

    let (_, message) = measured.workspace.call(2, &arguments);
    assert!(message.contains("is there already and is not overwritten"), "{message}");
}

#[test]
fn a_recording_with_a_shared_signal_is_aligned_to_a_fraction_of_a_millisecond() {
    let measured = Measured::new();
    measured.write_csv("torque.csv");
    measured.workspace.call(
        0,
        &["attach", "s", "torque.csv", "--time", "t", "--signal", "torque", "--shared", "torque_l_nm"],
    );
    let own = measured.attachment("torque");
    assert!(measured.largest_error_s(&own) < 3e-4, "{own:#}");
    assert!(own["clock"]["lowest_correlation"].as_f64().unwrap() > 0.99);
    assert!((own["clock"]["drift_ppm"].as_f64().unwrap() - 80.0).abs() < 20.0, "{}", own["clock"]);

    // A column that has nothing to do with the session is refused, and nothing is written.
    let arguments = [
        "attach",
        "s",
        "torque.csv",
        "--time",
        "t",
        "--signal",
        "EMG 1",
        "--shared",
        "torque_l_nm",
        "--name",
        "x",
    ];
    let (_, message) = measured.workspace.call(2, &arguments);
    assert!(message.contains("which may be chance"), "{message}");
    assert!(!measured.workspace.path("s/attached/x").exists());
}

/// An XDF file with a stream of EMG and one of markers.
fn xdf(samples: &[(f64, f64, f64, f64)], markers: &[(f64, String)]) -> Vec<u8> {
    let mut bytes = b"XDF:".to_vec();
    let mut chunk = |tag: u16, content: &[u8]| {
        bytes.push(8);
        bytes.extend_from_slice(&(content.len() as u64 + 2).to_le_bytes());
        bytes.extend_from_slice(&tag.to_le_bytes());
        bytes.extend_from_slice(content);
    };
    let header = |id: u32, name: &str, kind: &str, rate: f64| {
        let xml = format!(
            "<?xml version=\"1.0\"?><info><name>{name}</name><type>{name}</type><channel_count>1</channel_count>\
             <nominal_srate>{rate}</nominal_srate><channel_format>{kind}</channel_format></info>"
        );
        [id.to_le_bytes().as_slice(), xml.as_bytes()].concat()
    };
    chunk(1, b"<?xml version=\"1.0\"?><info><version>1.0</version></info>");
    chunk(2, &header(1, "EMG", "float32", RATE_HZ));
    chunk(2, &header(2, "markers", "string", 0.0));
    for part in samples.chunks(500) {
        let mut content = 1u32.to_le_bytes().to_vec();
        content.push(4);
        content.extend_from_slice(&(part.len() as u32).to_le_bytes());
        for (time, _, _, emg) in part {
            content.push(8);
            content.extend_from_slice(&time.to_le_bytes());
            content.extend_from_slice(&(*emg as f32).to_le_bytes());
        }
        chunk(3, &content);
    }
    for (time, text) in markers {
        let mut content = 2u32.to_le_bytes().to_vec();
        content.extend_from_slice(&[1, 1, 8]);
        content.extend_from_slice(&time.to_le_bytes());
        content.extend_from_slice(&[1, text.len() as u8]);
        content.extend_from_slice(text.as_bytes());
        chunk(3, &content);
    }
    bytes
}

#[test]
fn a_recording_of_streams_is_aligned_by_markers_with_or_without_the_number_of_the_trial() {
    let measured = Measured::new();
    let samples = measured.samples();
    for (name, numbered) in [("numbered", true), ("plain", false)] {
        let markers: Vec<(f64, String)> = measured
            .ramps
            .iter()
            .filter(|ramp| !numbered || ramp.trial.is_some())
            .map(|ramp| {
                let number = ramp.trial.filter(|_| numbered).map_or(String::new(), |own| format!(" {own}"));
                (measured.on_clock(ramp.onset_s), format!("onset{number}"))
            })
            .collect();
        let file = format!("{name}.xdf");
        fs::write(measured.workspace.path(&file), xdf(&samples, &markers)).unwrap();
        measured.workspace.call(0, &["attach", "s", &file, "--marker", "onset"]);
        let own = measured.attachment(name);
        assert!(measured.largest_error_s(&own) < 1e-6, "{name}");
        assert_eq!(own["columns"], json!(["channel_1"]));
        assert!((own["clock"]["drift_ppm"].as_f64().unwrap() - 80.0).abs() < 0.1, "{}", own["clock"]);
    }
    let (_, message) =
        measured.workspace.call(2, &["attach", "s", "plain.xdf", "--marker", "begin", "--name", "x"]);
    assert!(message.contains("no marker \"begin\"; its markers are [\"onset\"]"), "{message}");
}

#[test]
fn numbered_markers_that_are_not_at_the_times_of_the_session_are_refused() {
    let measured = Measured::new();
    let samples = measured.samples();
    let trials: Vec<(f64, u32)> = measured
        .ramps
        .iter()
        .filter_map(|ramp| Some((measured.on_clock(ramp.onset_s), ramp.trial?)))
        .collect();
    let mut exchanged = trials.clone();
    (exchanged[3].1, exchanged[4].1) = (trials[4].1, trials[3].1);
    let from_zero: Vec<(f64, u32)> = trials.iter().map(|(time_s, number)| (*time_s, number - 1)).collect();
    let at_other_times: Vec<(f64, u32)> =
        trials.iter().enumerate().map(|(at, (_, number))| (20.0 + 5.0 * at as f64, *number)).collect();
    for (name, markers) in [("exchanged", exchanged), ("zero", from_zero), ("other", at_other_times)] {
        let markers: Vec<(f64, String)> =
            markers.into_iter().map(|(time_s, number)| (time_s, format!("onset {number}"))).collect();
        let file = format!("{name}.xdf");
        fs::write(measured.workspace.path(&file), xdf(&samples, &markers)).unwrap();
        let (_, message) = measured.workspace.call(2, &["attach", "s", &file, "--marker", "onset"]);
        assert!(message.contains("off the times of the session"), "{name}: {message}");
        assert!(!measured.workspace.path("s/attached").exists());
    }
}

#[test]
fn recordings_that_are_not_sound_or_not_of_this_session_are_refused_with_a_reason() {
    let measured = Measured::new();
    let samples = measured.write_csv("emg.csv");
    let text = fs::read_to_string(measured.workspace.path("emg.csv")).unwrap();
    let refused = |text: &str, more: &[&str]| {
        fs::write(measured.workspace.path("bad.csv"), text).unwrap();
        let arguments = [&["attach", "s", "bad.csv"], more].concat();
        let (_, message) = measured.workspace.call(2, &arguments);
        assert!(!measured.workspace.path("s/attached").exists());
        message
    };
    let by_trigger = ["--time", "t", "--trigger", "TRIG"];
    // A clock that jumps back.
    let jumped = text.replacen("20.000000,", "3.000000,", 1);
    assert!(refused(&jumped, &by_trigger).contains("did the clock jump?"));
    assert!(
        refused(&text, &["--trigger", "TRIG"])
            .contains("a column of time in seconds (--time) or the rate (--rate)")
    );
    assert!(refused(&text, &["--time", "t", "--trigger", "TRIGGER"]).contains("no column \"TRIGGER\""));
    assert!(refused(&text, &["--time", "t", "--trigger", "EMG 1"]).contains("set --threshold"));
    // The first half of the pulses, shifted: another session.
    let mut other = "t,TRIG\n".to_owned();
    for (at, sample) in samples.iter().enumerate() {
        writeln!(other, "{},{}", sample.0, if at % 14_983 < 10 { 5 } else { 0 }).unwrap();
    }
    let message = refused(&other, &by_trigger);
    assert!(message.contains("which may be chance"), "{message}");
    // A trigger that rests at the upper level: its pulses begin where the column falls.
    let mut turned = "t,TRIG\n".to_owned();
    for sample in &samples {
        writeln!(turned, "{},{}", sample.0, 5.0 - sample.1).unwrap();
    }
    let message = refused(&turned, &by_trigger);
    assert!(message.contains("is at 4.9 most of the time") && message.contains("--falling"), "{message}");
    // A cell that is no number, in the trigger and in a column that is used.
    let spoilt = text.replacen("\n20.000000,0.1,", "\n20.000000,NaN,", 1);
    let message = refused(&spoilt, &by_trigger);
    assert!(message.contains("NaN in column \"TRIG\", sample 40001"), "{message}");
    let line = text.lines().find(|line| line.starts_with("20.000000,")).unwrap();
    let spoilt = text.replacen(line, &format!("{}inf", &line[..line.rfind(',').unwrap() + 1]), 1);
    let message = refused(&spoilt, &[&by_trigger[..], &["--emg-fcr", "EMG 1"]].concat());
    assert!(message.contains("inf in column \"EMG 1\", sample 40001"), "{message}");
    let cut = &text[..text.len() / 2 - 3];
    assert!(refused(cut, &by_trigger).contains("bad.csv"));
}

#[test]
fn a_gap_costs_the_trials_in_it_and_no_other() {
    let measured = Measured::new();
    let samples = measured.samples();
    let third = measured.session.trials.iter().filter(|trial| trial.onset_s.is_some()).nth(2).unwrap().number;
    let ramp = measured.ramps.iter().find(|ramp| ramp.trial == Some(third)).unwrap();
    let lost_s = measured.on_clock(ramp.onset_s) + 0.02;
    let mut text = "t,TRIG,EMG\n".to_owned();
    for (time, pulse, _, emg) in samples.iter().filter(|own| (own.0 - lost_s).abs() > 0.004) {
        writeln!(text, "{time:.6},{pulse},{emg}").unwrap();
    }
    fs::write(measured.workspace.path("gap.csv"), text).unwrap();
    let (_, told) =
        measured.workspace.call(0, &["attach", "s", "gap.csv", "--time", "t", "--trigger", "TRIG"]);
    let own = measured.attachment("gap");
    let gone: Vec<u64> = own["left_out"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|left| left["because"].as_str().unwrap().contains("gap"))
        .map(|left| left["trial"].as_u64().unwrap())
        .collect();
    assert_eq!(gone, [u64::from(third)]);
    assert!(told.contains(&format!("trial {third} left out: the recording has a gap in it")), "{told}");
}

/// A session exported by the program itself has only the trials: what is between them is a gap.
#[test]
fn our_own_export_is_attached_whole_though_it_has_gaps_between_the_trials() {
    let measured = Measured::new();
    measured.workspace.call(0, &["export", "s", "--xdf", "own.xdf"]);
    let trials = measured.session.trials.iter().filter(|trial| trial.onset_s.is_some()).count();
    for (name, reference) in [
        ("marker", &["--marker", "onset"][..]),
        ("signal", &["--signal", "torque_l_nm", "--shared", "torque_l_nm"][..]),
    ] {
        let arguments =
            [&["attach", "s", "own.xdf", "--table", "ramphold signals", "--name", name], reference].concat();
        measured.workspace.call(0, &arguments);
        let own = measured.attachment(name);
        assert_eq!(own["left_out"], json!([]), "{name}");
        assert_eq!(own["trials"].as_array().unwrap().len(), trials, "{name}");
        for trial in own["trials"].as_array().unwrap() {
            let number = trial["trial"].as_u64().unwrap() as u32;
            let record = &measured.session.trials.iter().find(|own| own.number == number).unwrap().record;
            assert!(
                trial["samples"].as_u64().unwrap().abs_diff(record.theta_m_rad.len() as u64) <= 1,
                "{name}"
            );
        }
        let rate_hz = own["clock"]["rate_hz"].as_f64().unwrap();
        assert!((rate_hz / measured.session.sample_rate_hz - 1.0).abs() < 1e-6, "{name}: {rate_hz}");
    }
}

#[test]
fn a_column_that_only_moves_with_the_ramps_is_not_taken_for_the_shared_signal() {
    let measured = Measured::of(PAPER);
    let mut text = "t,position\n".to_owned();
    for (time_s, ..) in measured.samples() {
        let session_s = (time_s - AHEAD_S) / (1.0 + FAST);
        let ramp = measured.ramps.iter().rev().find(|ramp| ramp.onset_s <= session_s);
        let since_s = ramp.map_or(1.0, |ramp| session_s - ramp.onset_s);
        // Out in 60 ms, back after 0.3 s, with the noise of an encoder.
        let out = (since_s / 0.06).min(1.0) * if since_s < 0.3 { 1.0 } else { 0.0 };
        let noise = ((time_s.to_bits().wrapping_mul(0x9E37_79B9_7F4A_7C15)) >> 40) as f64 / 16_777_216.0;
        writeln!(text, "{time_s:.6},{}", 0.14 * out + 1e-3 * noise).unwrap();
    }
    fs::write(measured.workspace.path("position.csv"), text).unwrap();
    let arguments =
        ["attach", "s", "position.csv", "--time", "t", "--signal", "position", "--shared", "torque_l_nm"];
    let (_, message) = measured.workspace.call(2, &arguments);
    assert!(
        message.contains("in the holds before them it has nothing in common with torque_l_nm"),
        "{message}"
    );
    assert!(!measured.workspace.path("s/attached").exists());
}

#[test]
fn samples_that_were_lost_between_two_ramps_are_told_and_cost_the_trials_beside_them() {
    let measured = Measured::of(PAPER);
    let samples = measured.samples();
    let trials: Vec<&RampTime> = measured.ramps.iter().filter(|ramp| ramp.trial.is_some()).collect();
    let [before, after] = [trials[trials.len() / 2 - 1], trials[trials.len() / 2]];
    let lost_s = measured.on_clock(0.5 * (before.onset_s + after.onset_s));
    let mut text = "TRIG,EMG\n".to_owned();
    for (_, pulse, _, emg) in samples.iter().filter(|own| !(lost_s..lost_s + 0.020).contains(&own.0)) {
        writeln!(text, "{pulse},{emg}").unwrap();
    }
    fs::write(measured.workspace.path("lost.csv"), text).unwrap();
    let (_, told) =
        measured.workspace.call(0, &["attach", "s", "lost.csv", "--rate", "2000", "--trigger", "TRIG"]);
    let own = measured.attachment("lost");
    let steps = own["clock_steps"].as_array().unwrap();
    assert_eq!(steps.len(), 1, "{own:#}");
    assert!((steps[0]["step_s"].as_f64().unwrap() + 0.020).abs() < 1e-3, "{}", steps[0]);
    let (first, second) =
        (steps[0]["after_trial"].as_u64().unwrap(), steps[0]["before_trial"].as_u64().unwrap());
    assert_eq!(first, u64::from(before.trial.unwrap()));
    assert!(second >= u64::from(after.trial.unwrap()));
    assert!(told.contains(&format!("between trials {first} and {second} the clocks step by -")), "{told}");
    let kept: Vec<u64> =
        own["trials"].as_array().unwrap().iter().map(|own| own["trial"].as_u64().unwrap()).collect();
    assert!(!kept.contains(&first) && !kept.contains(&second) && kept.len() > trials.len() / 2, "{kept:?}");
    // The drift is that of the clocks, not that of a line through the step.
    assert!((own["clock"]["drift_ppm"].as_f64().unwrap() - 80.0).abs() < 60.0, "{}", own["clock"]);
    assert!(own["clock"]["residual_largest_s"].as_f64().unwrap() < 1e-3, "{}", own["clock"]);
}

#[test]
fn a_folder_times_in_milliseconds_rounded_times_and_a_threshold_that_is_no_number_are_refused_with_what_to_do()
 {
    let measured = Measured::new();
    let refused = |file: &str, more: &[&str]| {
        let (_, message) = measured.workspace.call(2, &[&["attach", "s", file], more].concat());
        assert!(!measured.workspace.path("s/attached").exists());
        message
    };
    let (mut millis, mut rounded) = ("t,TRIG\n".to_owned(), "t,TRIG\n".to_owned());
    for (time_s, pulse, ..) in measured.samples() {
        writeln!(millis, "{:.3},{pulse}", 1e3 * time_s).unwrap();
        writeln!(rounded, "{time_s:.3},{pulse}").unwrap();
    }
    fs::write(measured.workspace.path("ms.csv"), millis).unwrap();
    fs::write(measured.workspace.path("rounded.csv"), rounded).unwrap();
    let by_trigger = ["--time", "t", "--trigger", "TRIG"];
    let message = refused("ms.csv", &by_trigger);
    assert!(message.contains("a sample every 0.5 s") && message.contains("divide them by 1000"), "{message}");
    let message = refused("rounded.csv", &by_trigger);
    assert!(message.contains("if they are rounded") && message.contains("--rate"), "{message}");
    let message = refused("ms.csv", &["--rate", "2000", "--trigger", "TRIG", "--threshold", "nan"]);
    assert!(message.contains("--threshold NaN: expected a number"), "{message}");
    fs::create_dir(measured.workspace.path("recordings")).unwrap();
    let message = refused("recordings", &by_trigger);
    assert!(message.contains("recordings: a folder; expected one recording"), "{message}");
    let (_, message) = measured.workspace.call(2, &["new", "ms.csv", "--yes"]);
    assert!(message.contains("ms.csv: is a file; give the name of a new folder"), "{message}");
}
