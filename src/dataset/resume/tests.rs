//! A session is interrupted at every operation of the disk, and resumed.

use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::time::Duration;

use super::*;
use crate::dataset::journal::{JournalEntry, JournalText};
use crate::dataset::recorder::tests::{Starter, protocol, protocol_with_rig_trials, run, run_protocol};
use crate::dataset::trial_csv_writer::HEADER;
use crate::dataset::{BackgroundRecorder, Manifest, Status, load, replay};
use crate::protocol::Limits;
use crate::random::Stream;
use crate::rig::virtual_wrist::{LOAD_CHANGE_S, Person, Setup, VirtualWrist};
use crate::rig::{Armed, ArmingConsent, Command, Fault, Rig, Sample};
use crate::session::{
    Event, Machine, Operator, Phase, RealTime, TransitionDetail, Unpaced, run_control_loop,
};

/// Goes on with the session to its end; how many operations that took.
fn go_on(folder: &Path, disk: Disk) -> Result<(), ResumeError> {
    let session = Resumable::open(folder, disk)?;
    let wrist =
        VirtualWrist::new(Person::default(), Setup::default(), session.seed(), session.sample_rate_hz());
    let is_finished = session.is_finished();
    let Resumed { mut recorder, mut machine, .. } = session.resume()?;
    if !is_finished {
        run_control_loop(wrist, &mut machine, &mut Starter, &mut Unpaced, &mut recorder)?;
        assert_eq!(machine.phase(), Phase::Finished);
    }
    Ok(())
}

/// The trials that count, by their place in the schedule. The first sample of a record was measured before the subject
/// saw the trial and depends on the sample before; so do the angles while the load of a rig trial is taken off. The comparison leaves them
/// out.
fn counting(folder: &Path) -> BTreeMap<String, (Option<f64>, crate::dataset::Record)> {
    let trials = load(folder).unwrap().trials.into_iter().filter(|trial| trial.status == Status::Ok);
    let left_out = (LOAD_CHANGE_S * protocol().signal.sample_rate_hz).ceil() as usize + 1;
    trials
        .map(|mut trial| {
            let record = &mut trial.record;
            let optional = [&mut record.emg_fcr_mvc, &mut record.emg_ecr_mvc];
            let channels = [&mut record.theta_m_rad, &mut record.torque_l_nm];
            for channel in channels.into_iter().chain(optional.into_iter().flatten()) {
                channel.drain(..left_out);
            }
            (trial.extra["position"].clone(), (trial.onset_s, trial.record))
        })
        .collect()
}

fn assert_as_if_undisturbed(folder: &Path, whole: &Path, case: &str) {
    assert!(counting(folder) == counting(whole), "{case}: the trials are not the same");
    let replay = replay(folder).unwrap();
    assert_eq!(replay.difference, None, "{case}");
    assert!(replay.events >= 13, "{case}: {} events", replay.events);
    let left: Vec<String> = Manifest::take(folder, true)
        .unwrap()
        .files
        .into_keys()
        .filter(|file| file.ends_with(".part") || file.ends_with(".new"))
        .collect();
    assert_eq!(left, [""; 0], "{case}");
}

#[test]
fn a_session_broken_off_at_any_operation_ends_as_if_it_had_not_been() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let whole = folder_of_sessions.path().join("whole");
    let operations = run(&whole, Disk::default()).unwrap();
    let mut resumed = 0;
    for operation in 0..operations {
        let folder = folder_of_sessions.path().join(format!("broken-{operation}"));
        run(&folder, Disk::failing_from(operation, ErrorKind::StorageFull)).unwrap_err();
        if !folder.exists() {
            assert_eq!(resumed, 0, "the folder is there from then on");
            continue;
        }
        // The disk fails once more on the way, and then no more.
        let again = Stream::new(1, &format!("again/{operation}")).below(40);
        match go_on(&folder, Disk::failing_from(again, ErrorKind::Other)) {
            Ok(()) | Err(ResumeError::Record(_)) => {}
            Err(error) => panic!("operation {operation}, then {again}: {error}"),
        }
        go_on(&folder, Disk::default()).unwrap();
        assert_as_if_undisturbed(&folder, &whole, &format!("operation {operation}, then {again}"));
        resumed += 1;
    }
    assert!(resumed > 60, "{resumed} sessions were resumed");
}

/// The rig trials that count, by all that their row says but number and file, without the first sample, as [`counting`].
fn counting_rig_trials(folder: &Path) -> BTreeMap<String, Vec<String>> {
    let table = fs::read_to_string(folder.join("rig-trials.csv")).unwrap();
    let rows = table.lines().skip(1).filter(|row| row.ends_with(",ok"));
    rows.map(|row| {
        let mut cells = row.splitn(3, ',');
        let file = cells.nth(1).unwrap();
        let record = fs::read_to_string(folder.join(file)).unwrap();
        (cells.next().unwrap().to_owned(), record.lines().skip(2).map(str::to_owned).collect())
    })
    .collect()
}

#[test]
fn a_session_with_rig_trials_broken_off_at_any_operation_ends_as_if_it_had_not_been() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let protocol = protocol_with_rig_trials();
    let whole = folder_of_sessions.path().join("whole");
    let operations = run_protocol(&protocol, &whole, Disk::default()).unwrap();
    assert_eq!(counting_rig_trials(&whole).len(), 4);
    let (mut resumed, mut aborted) = (0, 0);
    // Every third one: three in a row are the beginning, the rows and the end of the same entry.
    for operation in (0..operations).step_by(3) {
        let folder = folder_of_sessions.path().join(format!("broken-{operation}"));
        run_protocol(&protocol, &folder, Disk::failing_from(operation, ErrorKind::StorageFull)).unwrap_err();
        if !folder.exists() {
            continue;
        }
        go_on(&folder, Disk::default()).unwrap();
        let case = format!("operation {operation}");
        assert_as_if_undisturbed(&folder, &whole, &case);
        assert_eq!(counting_rig_trials(&folder), counting_rig_trials(&whole), "{case}");
        let table = fs::read_to_string(folder.join("rig-trials.csv")).unwrap();
        aborted += usize::from(table.contains(",aborted"));
        resumed += 1;
    }
    assert!(resumed > 30 && aborted > 5, "{resumed} sessions were resumed, {aborted} in a rig trial");
}

#[test]
fn a_rig_trial_whose_targets_were_changed_does_not_replay() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let folder = folder_of_sessions.path().join("s");
    run_protocol(&protocol_with_rig_trials(), &folder, Disk::default()).unwrap();
    assert!(replay(&folder).unwrap().is_sound());
    let file = folder.join("rig-trials/rig-trial-001.csv");
    let record = fs::read_to_string(&file).unwrap();
    let mut rows: Vec<String> = record.lines().map(str::to_owned).collect();
    let moving =
        rows.iter().position(|row| row.split(',').nth(1).is_some_and(|cell| cell.contains("0.001"))).unwrap();
    let mut cells: Vec<&str> = rows[moving].split(',').collect();
    cells[1] = "0.0000000";
    rows[moving] = cells.join(",");
    fs::write(&file, rows.join("\n") + "\n").unwrap();
    let found = replay(&folder).unwrap();
    assert_eq!(found.changed_files, ["rig-trials/rig-trial-001.csv changed"]);
    assert_eq!(found.difference.unwrap().recorded, "a target of 0 rad");
}

#[test]
fn a_session_without_rig_trials_has_nothing_of_them() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let folder = folder_of_sessions.path().join("s");
    run(&folder, Disk::default()).unwrap();
    let files = Manifest::take(&folder, true).unwrap().files;
    assert!(!files.keys().any(|file| file.contains("rig-trial")), "{files:?}");
    for text in ["protocol.json", JOURNAL] {
        assert!(!fs::read_to_string(folder.join(text)).unwrap().contains("rig_"), "{text}");
    }
}

#[test]
fn a_result_that_another_program_has_not_finished_is_no_part_of_the_manifest() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let folder = folder_of_sessions.path().join("s");
    run(&folder, Disk::default()).unwrap();
    Manifest::take(&folder, true).unwrap().write(&Disk::default(), &folder).unwrap();
    fs::create_dir_all(folder.join("results")).unwrap();
    fs::write(folder.join("results/.report.html.de71836e9a51960a.new"), "half").unwrap();
    fs::write(folder.join("results/fit.csv"), "whole").unwrap();
    Manifest::renew_results(&Disk::default(), &folder).unwrap();
    let files = Manifest::read(&folder).unwrap().files;
    let results: Vec<&String> = files.keys().filter(|file| file.starts_with("results/")).collect();
    assert_eq!(results, ["results/fit.csv"]);
}

#[test]
fn a_session_that_is_at_work_is_not_opened_a_second_time() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let folder = folder_of_sessions.path().join("s");
    run(&folder, Disk::default()).unwrap();
    let first = Resumable::open(&folder, Disk::default()).unwrap();
    let error = Resumable::open(&folder, Disk::default()).unwrap_err();
    assert!(error.to_string().contains("another program has this session open"), "{error}");
    drop(first);
    Resumable::open(&folder, Disk::default()).unwrap();
}

#[test]
fn the_ramp_waits_for_a_slow_disk_and_the_replay_knows_it() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let folder = folder_of_sessions.path().join("s");
    run(&folder, Disk::failing_from(40, ErrorKind::Other)).unwrap_err();
    let session = Resumable::open(&folder, Disk::slow(Duration::from_millis(15))).unwrap();
    let rate = session.sample_rate_hz();
    let wrist = VirtualWrist::new(Person::default(), Setup::default(), session.seed(), rate);
    let Resumed { recorder, mut machine, .. } = session.resume().unwrap();
    let mut recorder = BackgroundRecorder::start(recorder, machine.progress().clone());
    let mut clock = RealTime::new(rate);
    run_control_loop(wrist, &mut machine, &mut Starter, &mut clock, &mut recorder).unwrap();
    recorder.finish().unwrap();
    assert_eq!(machine.phase(), Phase::Finished);
    let lateness = clock.lateness();
    assert!(lateness.count() + 2 >= machine.sample(), "{lateness}");

    let journal = JournalText::parse(&fs::read(folder.join(JOURNAL)).unwrap());
    let waited = journal.records.iter().filter_map(|placed| match placed.record {
        JournalEntry::Transition(transition) => match transition.detail {
            Some(TransitionDetail::Onset { waited_samples, .. }) => Some(waited_samples),
            _ => None,
        },
        _ => None,
    });
    assert!(waited.clone().max() > Some(0), "no ramp waited for the disk: {:?}", waited.collect::<Vec<_>>());
    assert_eq!(replay(&folder).unwrap().difference, None);
}

#[test]
fn a_disk_that_fails_behind_the_ring_ends_the_session() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let folder = folder_of_sessions.path().join("s");
    run(&folder, Disk::failing_from(40, ErrorKind::Other)).unwrap_err();
    let session = Resumable::open(&folder, Disk::failing_from(25, ErrorKind::StorageFull)).unwrap();
    let rate = session.sample_rate_hz();
    let wrist = VirtualWrist::new(Person::default(), Setup::default(), session.seed(), rate);
    let Resumed { recorder, mut machine, .. } = session.resume().unwrap();
    let mut recorder = BackgroundRecorder::start(recorder, machine.progress().clone());
    let error = match run_control_loop(wrist, &mut machine, &mut Starter, &mut Unpaced, &mut recorder) {
        Err(error) => error,
        Ok(_) => recorder.finish().unwrap_err(),
    };
    assert!(error.to_string().contains("Make room on the disk"), "{error}");
    go_on(&folder, Disk::default()).unwrap();
}

#[test]
fn a_record_cut_anywhere_keeps_its_complete_rows() {
    let rows = ["0.0000,0.0000000,2.1\n", "0.0004,0.0000000,2.2\n"];
    let all = [HEADER, rows[0].as_bytes(), rows[1].as_bytes()].concat();
    for length in 0..=all.len() {
        let whole = (length >= HEADER.len() + rows[0].len()) as u64 + (length == all.len()) as u64;
        let (good, samples) = complete_rows(&all[..length], HEADER);
        assert_eq!(samples, whole, "cut at {length}");
        assert_eq!(good, all[..HEADER.len() + rows[0].len() * whole as usize]);
    }
    let zeros = [&all[..], &[0; 30][..]].concat();
    assert_eq!(complete_rows(&zeros, HEADER).1, 2, "a block of zeros is no row");
}

#[test]
fn a_record_is_settled_under_its_name_whatever_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("trial-001.csv");
    let part = folder.path().join("trial-001.csv.part");
    let opened = Folder::open(folder.path()).unwrap();
    let complete_record = || super::complete_record(&Disk::default(), &opened, "trial-001.csv");
    assert_eq!(complete_record().unwrap().0, 0);
    assert_eq!(fs::read(&path).unwrap(), HEADER);
    fs::write(&part, [HEADER, b"0.0,0.0,2.1\n0.1,0."].concat()).unwrap();
    assert_eq!(complete_record().unwrap().0, 1);
    assert_eq!(fs::read(&path).unwrap(), [HEADER, b"0.0,0.0,2.1\n"].concat());
    assert!(!part.exists());
    let (samples, sum) = complete_record().unwrap();
    assert_eq!(samples, 1, "settling twice changes nothing");
    assert_eq!(sum.sha256, sha256(&fs::read(&path).unwrap()));
}

/// Writes a journal of these entries in place of the one in `folder`.
pub fn rewrite_journal(folder: &Path, entries: &[JournalEntry]) {
    fs::remove_file(folder.join(JOURNAL)).unwrap();
    let (disk, opened) = (Disk::default(), Folder::open(folder).unwrap());
    let mut journal = Journal::create(&disk, &opened).unwrap();
    entries.iter().for_each(|entry| journal.append(&disk, entry).unwrap());
}

/// The entries of the journal in `folder`.
pub fn journal_of(folder: &Path) -> Vec<JournalEntry> {
    let text = JournalText::parse(&fs::read(folder.join(JOURNAL)).unwrap());
    text.records.into_iter().map(|placed| placed.record).collect()
}

/// Every checksum of such a journal is right; `trials.csv` was rewritten from it into one that did not load any more.
#[test]
fn a_journal_whose_records_cannot_have_followed_each_other_is_refused() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let folder = folder_of_sessions.path().join("s");
    run(&folder, Disk::failing_from(70, ErrorKind::Other)).unwrap_err();
    let entries = journal_of(&folder);
    let table = fs::read(folder.join("trials.csv")).unwrap();
    let with_number = |number: u32| {
        let mut forged = entries.clone();
        for entry in &mut forged {
            if let JournalEntry::Transition(transition) = entry
                && let Some(TransitionDetail::Began { number: own, .. }) = &mut transition.detail
            {
                *own = number;
            }
        }
        forged
    };
    let mut reversed = entries.clone();
    reversed[1..].reverse();
    let mut doubled = entries.clone();
    doubled.push(entries[0].clone());
    for forged in [reversed, doubled, with_number(0), with_number(u32::MAX)] {
        rewrite_journal(&folder, &forged);
        let error = Resumable::open(&folder, Disk::default()).unwrap_err().to_string();
        assert!(error.contains("journal.log: the record at byte"), "{error}");
        assert_eq!(fs::read(folder.join("trials.csv")).unwrap(), table);
    }
    rewrite_journal(&folder, &entries);
    go_on(&folder, Disk::default()).unwrap();
}

/// Every file in `folder` with its content.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let tree = Folder::open(folder).unwrap().tree().unwrap();
    tree.iter()
        .map(|file| (file.path.display().to_string(), fs::read(folder.join(&file.path)).unwrap()))
        .collect()
}

#[test]
fn a_record_that_the_journal_does_not_mention_is_never_written_over() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let folder = folder_of_sessions.path().join("s");
    run(&folder, Disk::default()).unwrap();
    // As an older copy of the journal has it: the second trial had not begun.
    let mut entries = journal_of(&folder);
    let begins = |entry: &JournalEntry| match entry {
        JournalEntry::Transition(transition) => {
            matches!(transition.detail, Some(TransitionDetail::Began { number: 2, .. }))
        }
        _ => false,
    };
    entries.truncate(entries.iter().position(begins).unwrap());
    rewrite_journal(&folder, &entries);
    let before = contents(&folder);
    let record = folder.join("trials/trial-002.csv");
    for name in ["trials/trial-002.csv", "trials/trial-002.csv.part"] {
        fs::rename(&record, folder.join(name)).unwrap();
        let error = Resumable::open(&folder, Disk::default()).unwrap_err().to_string();
        assert!(error.contains(&format!("{name} is there, but the journal does not mention it")), "{error}");
        fs::rename(folder.join(name), &record).unwrap();
    }
    assert!(contents(&folder) == before, "nothing is changed");
    fs::rename(&record, folder_of_sessions.path().join("kept.csv")).unwrap();
    fs::write(folder.join("trials/trial-002-notes.csv"), "no record of the session").unwrap();
    go_on(&folder, Disk::default()).unwrap();
    assert!(record.exists());
}

#[test]
fn a_table_that_was_edited_by_hand_is_refused_with_how_a_trial_is_judged() {
    let folder_of_sessions = tempfile::tempdir().unwrap();
    let operations = run(&folder_of_sessions.path().join("whole"), Disk::default()).unwrap();
    let folder = folder_of_sessions.path().join("s");
    run(&folder, Disk::failing_from(operations - 8, ErrorKind::Other)).unwrap_err();
    let table = fs::read_to_string(folder.join("trials.csv")).unwrap();
    assert!(table.contains(",ok,"), "{table}");
    let with_a_column: Vec<String> = table.lines().map(|row| format!("{row},note")).collect();
    for edited in [table.replacen(",ok,", ",rejected,", 1), with_a_column.join("\n")] {
        fs::write(folder.join("trials.csv"), &edited).unwrap();
        let before = contents(&folder);
        let error = Resumable::open(&folder, Disk::default()).unwrap_err().to_string();
        assert!(error.contains("a file is not as the session left it: trials.csv changed"), "{error}");
        assert!(error.contains("ramphold trials --reject"), "{error}");
        assert!(contents(&folder) == before, "nothing is changed");
    }
    // A spreadsheet that only stores it again changes no cell.
    fs::write(folder.join("trials.csv"), table.replace('\n', "\r\n")).unwrap();
    go_on(&folder, Disk::default()).unwrap();
}

/// A virtual wrist that fails once, at a given sample.
struct Failing<R> {
    rig: R,
    /// Samples until the fault.
    samples_left: u64,
    fault: Fault,
}

impl<R: Rig> Rig for Failing<R> {
    type Armed = Failing<R::Armed>;

    fn arm(self, consent: ArmingConsent, limits: &Limits) -> Result<Self::Armed, (Self, Fault)> {
        let Self { rig, samples_left, fault } = self;
        match rig.arm(consent, limits) {
            Ok(rig) => Ok(Failing { rig, samples_left, fault }),
            Err((rig, why)) => Err((Self { rig, samples_left, fault }, why)),
        }
    }
}

impl<A: Armed> Armed for Failing<A> {
    type Disarmed = Failing<A::Disarmed>;

    fn exchange(&mut self, command: &Command) -> Result<Sample, Fault> {
        self.samples_left = self.samples_left.saturating_sub(1);
        if self.samples_left == 0 { Err(self.fault) } else { self.rig.exchange(command) }
    }

    fn rescale_emg(&mut self, factors: [f64; 2]) {
        self.rig.rescale_emg(factors);
    }

    fn disarm(self) -> Self::Disarmed {
        Failing { rig: self.rig.disarm(), samples_left: self.samples_left, fault: self.fault }
    }
}

/// Starts the session, and ends it when a fault stopped it.
struct EndsAtAFault;

impl Operator for EndsAtAFault {
    fn poll_command(&mut self, _: &Machine) -> Option<Event> {
        None
    }
    fn wait_for_command(&mut self, machine: &Machine) -> Event {
        if machine.phase() == Phase::Ready { Event::Start } else { Event::Abort }
    }
    fn command_refused(&mut self, event: Event, phase: Phase) {
        panic!("{event:?} refused in {phase:?}");
    }
    fn arming_failed(&mut self, fault: Fault) {
        panic!("{fault}");
    }
    fn fault_occurred(&mut self, _: Fault) {}
    fn power_not_confirmed(&mut self) {}
}

/// The faults are read from lines of version 0.1.0, so that the journals get the bytes that version 0.1.0 wrote; the
/// last one is called by a name that no version knows.
#[test]
fn a_session_that_ended_by_a_can_fault_of_an_older_version_resumes_and_replays() {
    let faults = [
        (100, r#"{"fault":"can","kind":"heartbeat_lost","node":5,"after_ms":2003}"#),
        (700, r#"{"fault":"can","kind":"missed_cycle","in_a_row":401,"tolerated":400,"id":389}"#),
        (700, r#"{"fault":"can","kind":"following_error","error_rad":0.05321,"limit_rad":0.05}"#),
        (900, r#"{"fault":"can","kind":"renamed_since","in_a_row":1}"#),
    ];
    let folder_of_sessions = tempfile::tempdir().unwrap();
    for (at, (samples_left, text)) in faults.into_iter().enumerate() {
        let folder = folder_of_sessions.path().join(at.to_string());
        run(&folder, Disk::failing_from(40, ErrorKind::Other)).unwrap_err();
        let session = Resumable::open(&folder, Disk::default()).unwrap();
        let wrist =
            VirtualWrist::new(Person::default(), Setup::default(), session.seed(), session.sample_rate_hz());
        let rig = Failing { rig: wrist, samples_left, fault: serde_json::from_str(text).unwrap() };
        let Resumed { mut recorder, mut machine, .. } = session.resume().unwrap();
        run_control_loop(rig, &mut machine, &mut EndsAtAFault, &mut Unpaced, &mut recorder).unwrap();
        drop(recorder);
        let journal = fs::read_to_string(folder.join(JOURNAL)).unwrap();
        assert!(journal.contains(&format!("\"fault\":{text}")), "{journal}");
        go_on(&folder, Disk::default()).unwrap();
        assert_eq!(replay(&folder).unwrap().difference, None, "{text}");
    }
}
