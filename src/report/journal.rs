//! Reads the journal for the report: gate times, duration, incidents.

use serde_json::Value;

use crate::dataset::stamps_from_clock;

/// The times of a session, from its journal.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SessionTimes {
    /// Number of each measured trial and the time until its gate opened, s.
    pub gates: Vec<(u32, f64)>,
    /// Time from the first to the last record, s, without the time between two starts of the program.
    pub duration_s: f64,
    /// Number of times the session was resumed.
    pub resumed: usize,
    /// Notes of the operator, with their time, s.
    pub notes: Vec<(f64, String)>,
    /// Faults and other incidents, with their time, s.
    pub incidents: Vec<(f64, String)>,
    /// Peak torque, N m, and peak EMG of flexor and extensor in each maximal effort.
    pub efforts: Vec<[f64; 3]>,
    /// Lines that could not be read.
    pub unread_lines: usize,
}

/// Length and checksum that stand before each line's JSON.
const HEAD: usize = 8 + 1 + 16 + 1;

/// Reads the journal's lines; a line that a crash cut off is counted and skipped.
pub fn times(text: &str, sample_rate_hz: f64) -> SessionTimes {
    let mut times = SessionTimes::default();
    let (mut before_s, mut last_s) = (0.0, 0.0_f64);
    let mut trial: Option<(u32, f64)> = None;
    for line in text.lines() {
        let Some(record) = line.get(HEAD..).and_then(|json| serde_json::from_str::<Value>(json).ok()) else {
            times.unread_lines += 1;
            continue;
        };
        if record["record"] == "resumed" {
            times.resumed += 1;
            (before_s, trial) = (before_s + last_s, None);
            last_s = 0.0;
        }
        let Some(sample) = record["sample"].as_u64() else { continue };
        last_s = last_s.max(sample as f64 / sample_rate_hz);
        if let Some(note) = record["deed"]["noted"]["text"].as_str() {
            times.notes.push((before_s + sample as f64 / sample_rate_hz, note.to_owned()));
        }
        if let Some(what) = stream_incident(&record["deed"]) {
            times.incidents.push((before_s + last_s, what));
        }
        let detail = &record["detail"];
        let peaks = ["peak_torque_nm", "peak_fcr", "peak_ecr"].map(|name| detail["effort"][name].as_f64());
        if let [Some(torque_nm), Some(fcr), Some(ecr)] = peaks {
            times.efforts.push([torque_nm, fcr, ecr]);
        }
        if detail["began"]["practice"] == false {
            trial = detail["began"]["number"].as_u64().map(|number| (number as u32, last_s));
        }
        let event = record["event"].as_str().unwrap_or("");
        if event == "gate_opened"
            && let Some((number, began_s)) = trial.take()
        {
            times.gates.push((number, last_s - began_s));
        }
        if record["origin"] == "set_here" {
            let text = "the present place of the handle became the start position";
            times.incidents.push((before_s + last_s, format!("origin set: {text}")));
        }
        let velocity = &detail["ended"]["deviation"]["velocity"];
        if event == "motion_deviated" {
            let why = match (velocity["measured_rad_s"].as_f64(), velocity["asked_rad_s"].as_f64()) {
                (Some(measured), Some(asked)) => {
                    format!("{measured:.3} rad/s where {asked:.3} rad/s were asked for")
                }
                _ => format!(
                    "periods were lost: {}",
                    detail["ended"]["deviation"]["lost_periods"]["lost_periods"]
                ),
            };
            times
                .incidents
                .push((before_s + last_s, format!("trial {} rejected: {why}", detail["ended"]["number"])));
        }
        let unusual = ["pause", "resume", "abort", "fault", "acknowledge", "skip"];
        if unusual.iter().any(|word| event.contains(word)) || !detail["fault"].is_null() {
            let fault = &detail["fault"];
            let what = match fault["message"].as_str() {
                Some(message) => format!(": {message}"),
                None if fault.is_null() => String::new(),
                None => format!(": {fault}"),
            };
            times.incidents.push((before_s + last_s, format!("{event}{what}")));
        }
    }
    times.duration_s = before_s + last_s;
    times
}

/// What happened to a stream, if an action says so.
fn stream_incident(deed: &Value) -> Option<String> {
    let of = |kind: &str| deed[kind]["stream"].as_str().map(|name| (name.to_owned(), &deed[kind]));
    if let Some((name, silent)) = of("stream_silent") {
        return Some(format!("stream {name} silent: no sample for {:.2} s", silent["for_s"].as_f64()?));
    }
    if let Some((name, back)) = of("stream_back") {
        return Some(format!("stream {name} back after {:.2} s", back["after_s"].as_f64()?));
    }
    if let Some((name, frozen)) = of("stream_frozen") {
        let (channel, for_s) = (frozen["channel"].as_str()?, frozen["for_s"].as_f64()?);
        return Some(format!("stream {name} frozen: {channel} the same for {for_s:.2} s"));
    }
    if let Some((name, live)) = of("stream_live") {
        let (channel, after_s) = (live["channel"].as_str()?, live["after_s"].as_f64()?);
        return Some(format!("stream {name} live: {channel} changes again after {after_s:.2} s"));
    }
    if let Some((name, off)) = of("stream_stamps_off") {
        let late_s = off["late_s"].as_f64()?;
        return Some(format!(
            "stream {name} with wrong time stamps: {} the clock",
            stamps_from_clock(late_s)
        ));
    }
    if let Some((name, _)) = of("stream_stamps_right") {
        return Some(format!("stream {name} with right time stamps again"));
    }
    let (name, lost) = of("stream_not_recorded")?;
    Some(format!("stream {name} not recorded any more: {}", lost["because"].as_str()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(json: &str) -> String {
        format!("{:026}{json}\n", 0)
    }

    #[test]
    fn an_origin_set_anew_and_a_ramp_that_was_not_as_asked_are_incidents() {
        let text = line(r#"{"record":"resumed"}"#)
            + &line(r#"{"record":"origin","sample":50,"origin":"set_here"}"#)
            + &line(r#"{"record":"origin","sample":60,"origin":"kept"}"#)
            + &line(
                r#"{"record":"happened","sample":90,"from":"ramp_hold","event":"motion_deviated","to":"return","detail":{"ended":{"number":7,"status":"rejected","samples":1,"deviation":{"velocity":{"measured_rad_s":2.62,"standard_error_rad_s":0.01,"asked_rad_s":3.25,"tolerance":0.05}}}}}"#,
            );
        let incidents = times(&text, 100.0).incidents;
        let [(set_s, set), (slow_s, slow)] = &incidents[..] else { panic!("{incidents:?}") };
        assert!(*set_s == 0.5 && set.contains("became the start position"), "{set}");
        assert!(*slow_s == 0.9 && slow.contains("trial 7 rejected: 2.620 rad/s where 3.250"), "{slow}");
    }

    #[test]
    fn a_stream_that_stopped_and_came_back_is_two_incidents() {
        let deed = |sample: u64, deed: &str| {
            line(&format!(r#"{{"record":"console","sample":{sample},"desk":"program","deed":{deed}}}"#))
        };
        let text = deed(100, r#"{"stream_silent":{"stream":"EMG","for_s":1.02}}"#)
            + &deed(300, r#"{"stream_back":{"stream":"EMG","after_s":2.5}}"#);
        let incidents = times(&text, 100.0).incidents;
        let expected =
            [(1.0, "stream EMG silent: no sample for 1.02 s"), (3.0, "stream EMG back after 2.50 s")];
        assert_eq!(incidents, expected.map(|(at_s, what)| (at_s, what.to_owned())));
    }

    #[test]
    fn emg_of_a_stream_that_stood_still_and_went_on_is_two_incidents() {
        let deed = |deed: &str| {
            line(&format!(r#"{{"record":"console","sample":100,"desk":"program","deed":{deed}}}"#))
        };
        let text = deed(r#"{"stream_frozen":{"stream":"EMG","channel":"emg_fcr","value":0.5,"for_s":1.02}}"#)
            + &deed(r#"{"stream_live":{"stream":"EMG","channel":"emg_fcr","after_s":2.5}}"#);
        let incidents: Vec<String> =
            times(&text, 100.0).incidents.into_iter().map(|(_, what)| what).collect();
        let expected = [
            "stream EMG frozen: emg_fcr the same for 1.02 s",
            "stream EMG live: emg_fcr changes again after 2.50 s",
        ];
        assert_eq!(incidents, expected);
    }

    #[test]
    fn a_stream_whose_clock_jumped_and_came_back_is_two_incidents() {
        let deed = |deed: &str| {
            line(&format!(r#"{{"record":"console","sample":100,"desk":"program","deed":{deed}}}"#))
        };
        let text = deed(r#"{"stream_stamps_off":{"stream":"EMG","late_s":-3.0}}"#)
            + &deed(r#"{"stream_stamps_right":{"stream":"EMG"}}"#);
        let incidents: Vec<String> =
            times(&text, 100.0).incidents.into_iter().map(|(_, what)| what).collect();
        let expected = [
            "stream EMG with wrong time stamps: 3.000 s ahead of the clock",
            "stream EMG with right time stamps again",
        ];
        assert_eq!(incidents, expected);
    }

    #[test]
    fn a_gate_is_timed_from_the_start_of_its_trial_and_practice_is_not_counted() {
        let began = |sample: u64, number: u32, practice: bool| {
            line(&format!(
                r#"{{"record":"happened","sample":{sample},"from":"rest","event":"rest_over","to":"hold","detail":{{"began":{{"number":{number},"practice":{practice},"position":1,"rest_samples":1}}}}}}"#
            ))
        };
        let opened = |sample: u64| {
            line(&format!(
                r#"{{"record":"happened","sample":{sample},"from":"hold","event":"gate_opened","to":"delay"}}"#
            ))
        };
        let text = began(100, 1, true) + &opened(150) + &began(200, 1, false) + &opened(260) + "cut o";
        let times = times(&text, 100.0);
        let [(number, gate_s)] = times.gates[..] else { panic!("one gate, not {:?}", times.gates) };
        assert!(number == 1 && (gate_s - 0.6).abs() < 1e-9, "trial {number}: {gate_s} s");
        assert!((times.duration_s - 2.6).abs() < 1e-9 && times.unread_lines == 1);
    }
}
