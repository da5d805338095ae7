//! `ramphold resume`, `replay` and `verify`: what the operator sees when a session did not go as planned.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};

use ramphold::dataset::{self, OperatorAction, Status, Wrist};
use ramphold::session::Event;
use serde_json::{Value, json};

use crate::workspace::{Workspace, files, wait_for};

impl Workspace {
    /// A folder with the protocol of a short session.
    pub fn with_short_protocol() -> Self {
        let workspace = Self::new();
        let mut protocol: Value = serde_json::from_str(include_str!("../../protocols/quick.json")).unwrap();
        protocol["velocities_rad_s"] = json!([3.25]);
        protocol["rest_s"] = json!(0.2);
        protocol["signal"]["sample_rate_hz"] = json!(1000);
        protocol["before"] = json!({ "offset_s": 0.2 });
        workspace.write("protocol.json", &protocol);
        workspace
    }

    /// A session that ran to its end.
    fn complete_session(&self) -> PathBuf {
        self.call(0, &["run", "protocol.json", "--seed", "7", "--out", "s"]);
        self.path("s")
    }

    /// A session at true speed that has come to its second trial.
    fn session_in_second_trial(&self) -> Child {
        let mut child = self
            .ramphold(&["run", "protocol.json", "--real-time", "--quiet", "--seed", "7", "--out", "s"])
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let second = self.path("s/trials/trial-002.csv.part");
        wait_for(&mut child, "the second trial", || second.exists());
        child
    }

    /// A session that was killed in its second trial.
    pub fn killed_session(&self) -> PathBuf {
        let mut child = self.session_in_second_trial();
        child.kill().unwrap();
        child.wait().unwrap();
        self.path("s")
    }
}

fn statuses(session: &Path) -> Vec<Status> {
    dataset::load(session).unwrap().trials.iter().map(|trial| trial.status).collect()
}

/// Condition and repetition of each completed trial, in order.
fn completed(session: &Path) -> Vec<(f64, f64, u32)> {
    let trials = dataset::load(session).unwrap().trials;
    let ok = trials.iter().filter(|trial| trial.status == Status::Ok);
    ok.map(|trial| (trial.velocity_rad_s, trial.torque_nm, trial.repetition)).collect()
}

#[test]
fn the_stretches_of_a_resumed_session_are_placed_by_the_clock_and_do_not_overlap() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.killed_session();
    workspace.call(0, &["resume", "s", "--yes", "--real-time", "--quiet"]);
    let stamped = dataset::SessionClock::read(&session).unwrap().stamped;
    let ramps = dataset::ramp_times(&session).unwrap().unwrap();
    let last = ramps.last().unwrap().stretch;
    assert!(last > 0 && ramps[0].stretch == 0);
    // The first sample of each stretch, and that of each trial.
    for stretch in [0, last] {
        let own: Vec<_> = stamped.iter().filter(|known| known.stretch == stretch).collect();
        assert!(own[0].time_s < 0.1 && own.len() > 1, "{own:?}");
        assert!(own.windows(2).all(|pair| pair[0].stamp.utc_ns < pair[1].stamp.utc_ns));
        assert!(own.windows(2).all(|pair| pair[0].stamp.monotonic_ns < pair[1].stamp.monotonic_ns));
    }
    workspace.call(0, &["verify", "s"]);
    workspace.call(0, &["replay", "s"]);
    workspace.call(0, &["export", "s", "--xdf", "s.xdf"]);
    let recording = ramphold::import::read_recording(&workspace.path("s.xdf")).unwrap();
    assert_eq!(recording.tables.len(), 2);
    let ends: Vec<[f64; 2]> = recording
        .tables
        .iter()
        .map(|table| table.column("time_s").unwrap())
        .map(|times_s| [times_s[0], times_s[times_s.len() - 1]])
        .collect();
    assert!(ends[0][0] >= 0.0 && ends[0][1] < ends[1][0], "{ends:?}");
    // The break is as long as UTC says.
    let at = |stretch: usize| stamped.iter().find(|known| known.stretch == stretch).unwrap().stamp.utc_ns;
    let break_s = 1e-9 * (at(last) - at(0)) as f64;
    assert!(ends[1][0] > break_s && ends[0][1] < break_s, "{ends:?}, resumed after {break_s} s");
}

#[test]
fn a_killed_session_goes_on_where_it_was_and_keeps_what_it_had() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.killed_session();
    let first = fs::read(session.join("trials/trial-001.csv")).unwrap();
    let (_, said) = workspace.call(0, &["fit", "s", "--independent", "--out", "so-far"]);
    assert!(said.contains("s is unfinished") && said.contains("Go on with: ramphold resume s"), "{said}");
    let (_, said) = workspace.call(0, &["resume", "s", "--yes"]);
    assert!(!said.contains("unfinished"), "{said}");
    assert!(said.contains("trial 2 was under way") && said.contains("kept with status aborted"), "{said}");
    assert_eq!(fs::read(session.join("trials/trial-001.csv")).unwrap(), first);
    let mut found = statuses(&session);
    assert_eq!(found[..2], [Status::Ok, Status::Aborted]);
    found.retain(|status| *status == Status::Ok);
    assert_eq!(found.len(), 4);
    assert!(session.join("results/fit.csv").exists());
    workspace.call(0, &["verify", "s"]);
    let (replayed, _) = workspace.call(0, &["replay", "s"]);
    assert!(replayed.contains("2 starts: no difference"), "{replayed}");

    // Which samples the trials have is compared in `crash_recovery`, on sessions that do not run in real time.
    workspace.call(0, &["run", "protocol.json", "--seed", "7", "--out", "undisturbed"]);
    assert_eq!(completed(&session), completed(&workspace.path("undisturbed")));
}

#[test]
fn a_virtual_wrist_is_resumed_without_a_question() {
    let workspace = Workspace::with_short_protocol();
    workspace.killed_session();
    let (_, said) = workspace.call(0, &["resume", "s"]);
    assert!(!said.contains("motor"), "{said}");
}

#[test]
fn a_second_program_is_refused_and_a_lock_left_behind_holds_nobody_up() {
    let workspace = Workspace::with_short_protocol();
    let mut first = workspace.session_in_second_trial();
    let (_, said) = workspace.call(2, &["resume", "s", "--yes"]);
    assert!(said.contains("another program has this session open"), "{said}");
    first.kill().unwrap();
    first.wait().unwrap();
    workspace.call(0, &["resume", "s", "--yes"]);
}

#[test]
fn a_torn_end_of_the_journal_is_cut_off_and_told() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.killed_session();
    let journal = session.join("journal.log");
    let whole = fs::read(&journal).unwrap();
    let torn = [&whole[..], b"00000057 01f5"].concat();
    fs::write(&journal, &torn).unwrap();
    let (_, said) = workspace.call(0, &["resume", "s", "--yes"]);
    assert!(said.contains(&format!("from byte {}: 13 bytes were cut off", whole.len())), "{said}");
    assert!(fs::read(&journal).unwrap().starts_with(&whole));
}

#[test]
fn a_journal_damaged_in_the_middle_is_not_gone_on_with() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.killed_session();
    let journal = session.join("journal.log");
    let mut bytes = fs::read(&journal).unwrap();
    let second = bytes.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    bytes[second + 40] ^= 1;
    fs::write(&journal, bytes).unwrap();
    let before = files(&session);
    for verb in [&["resume", "s", "--yes"][..], &["replay", "s"]] {
        let (_, said) = workspace.call(2, verb);
        assert!(said.contains(&format!("damaged at byte {second}")), "{said}");
    }
    assert!(files(&session) == before);
    assert_eq!(statuses(&session), [Status::Ok], "what was measured can be read all the same");
}

#[test]
fn verify_names_every_file_that_was_changed_taken_away_or_added() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.complete_session();
    let (said, _) = workspace.call(0, &["verify", "s"]);
    assert!(said.contains("files unchanged; subject V00, seed 7"), "{said}");
    fs::write(session.join("trials/trial-003.csv"), "").unwrap();
    fs::remove_file(session.join("rig.json")).unwrap();
    fs::create_dir(session.join("notes")).unwrap();
    fs::write(session.join("notes/a.txt"), "hello").unwrap();
    let (said, why) = workspace.call(1, &["verify", "s"]);
    assert_eq!(said, "added    notes/a.txt\nmissing  rig.json\nchanged  trials/trial-003.csv\n");
    assert!(why.contains("3 files differ from what they were"), "{why}");
}

#[test]
fn a_session_that_is_complete_is_left_as_it_is() {
    let workspace = Workspace::with_short_protocol();
    let before = files(&workspace.complete_session());
    let (_, said) = workspace.call(0, &["resume", "s", "--yes"]);
    assert!(said.contains("every trial is done and the results are complete"), "{said}");
    assert!(files(&workspace.path("s")) == before);
}

#[test]
fn a_session_that_somebody_changed_is_not_gone_on_with() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.complete_session();
    fs::write(session.join("trials/trial-003.csv"), "").unwrap();
    fs::remove_file(session.join("rig.json")).unwrap();
    let before = files(&session);
    let (_, said) = workspace.call(2, &["resume", "s", "--yes"]);
    assert!(
        said.contains("files are not as the session left it: rig.json missing, trials/trial-003.csv changed"),
        "{said}"
    );
    assert!(files(&session) == before, "a new manifest would have hidden it");
}

#[test]
fn a_folder_that_is_no_session_or_one_of_a_later_version_is_named_as_such() {
    let workspace = Workspace::with_short_protocol();
    fs::create_dir(workspace.path("empty")).unwrap();
    for verb in ["resume", "replay", "verify"] {
        let (_, said) = workspace.call(2, &[verb, "empty"]);
        assert!(
            said.contains("session.json: not found; expected it in every session folder; is this one?"),
            "{said}"
        );
    }
    let session = workspace.complete_session();
    let about = fs::read_to_string(session.join("session.json")).unwrap();
    fs::write(session.join("session.json"), about.replace("ramphold-session/1", "ramphold-session/2"))
        .unwrap();
    for verb in [&["resume", "s", "--yes"][..], &["replay", "s"]] {
        let (_, said) = workspace.call(2, verb);
        assert!(said.contains("\"ramphold-session/2\" is not known"), "{said}");
    }
}

#[test]
fn results_made_anew_are_no_change_but_anything_else_still_is() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.complete_session();
    workspace.call(0, &["fit", "s", "--window", "0.035"]);
    workspace.call(0, &["verify", "s"]);
    fs::write(session.join("schedule.csv"), "").unwrap();
    workspace.call(0, &["fit", "s"]);
    assert_eq!(workspace.call(1, &["verify", "s"]).0, "changed  schedule.csv\n");
}

#[test]
fn a_session_that_has_not_ended_has_no_manifest_yet() {
    let workspace = Workspace::with_short_protocol();
    workspace.killed_session();
    let (_, said) = workspace.call(2, &["verify", "s"]);
    assert!(said.contains("manifest.json: not found") && said.contains("ramphold resume"), "{said}");
}

/// Makes the person miss the target for a moment in the hold of a trial.
fn tamper(session: &Path, row: usize) {
    let path = session.join("trials/trial-001.csv");
    let text = fs::read_to_string(&path).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for line in &mut lines[row..row + 60] {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[2] = "0.10000";
        *line = cells.join(",");
    }
    fs::write(path, lines.join("\n") + "\n").unwrap();
}

#[test]
fn a_replay_names_the_first_sample_and_state_that_differ() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.complete_session();
    let (said, _) = workspace.call(0, &["replay", "s"]);
    assert!(said.contains("1 starts: no difference"), "{said}");
    let onset_s = dataset::load(&session).unwrap().trials[0].onset_s.unwrap();
    tamper(&session, (onset_s * 1000.0) as usize - 200);
    let (said, _) = workspace.call(1, &["replay", "s"]);
    assert!(
        said.contains("first difference at sample ") && said.contains("in state hold (trial 1)"),
        "{said}"
    );
    assert!(said.contains("recorded gate_opened to delay, replayed nothing"), "{said}");
    assert!(!said.contains("since rules"), "{said}");
}

/// A copy of the recorded session in `fixtures/`, which the test may change.
fn copy_of_fixture(workspace: &Workspace, fixture: &str) -> PathBuf {
    let copy = workspace.path(fixture);
    for (path, bytes) in files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(fixture)) {
        let to = copy.join(path);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::write(to, bytes).unwrap();
    }
    copy
}

/// Both sessions were recorded before the journal's entries had their present names in the program.
#[test]
fn an_older_journal_with_notes_pauses_and_refused_commands_is_read_and_replayed() {
    let workspace = Workspace::with_short_protocol();
    let copy = copy_of_fixture(&workspace, "session-with-notes");
    let (said, _) = workspace.call(0, &["replay", "session-with-notes"]);
    assert!(said.contains("15 events") && said.contains("no difference"), "{said}");
    let actions: Vec<_> =
        dataset::operator_actions(&copy).unwrap().into_iter().map(|(_, entry)| entry.action).collect();
    let note = |text: &str, clock: Option<&str>| OperatorAction::Noted {
        text: text.to_owned(),
        clock: clock.map(str::to_owned),
    };
    let command = |command| OperatorAction::Commanded { command };
    assert_eq!(
        actions,
        [
            OperatorAction::Opened { wrist: Wrist::Right },
            OperatorAction::Joined,
            note("electrodes checked", Some("2026-01-05T09:00:00+01:00")),
            command(Event::Resume),
            command(Event::Start),
            command(Event::Pause),
            note("handle adjusted", None),
            command(Event::Resume),
        ]
    );
}

#[test]
fn an_older_session_that_was_killed_in_a_trial_is_resumed_to_its_end_and_replayed() {
    let workspace = Workspace::with_short_protocol();
    let copy = copy_of_fixture(&workspace, "session-interrupted");
    let (said, _) = workspace.call(0, &["replay", "session-interrupted"]);
    assert!(said.contains("no difference"), "{said}");
    workspace.call(0, &["resume", "session-interrupted", "--yes"]);
    let statuses: Vec<Status> =
        dataset::load(&copy).unwrap().trials.iter().map(|trial| trial.status).collect();
    assert_eq!(statuses, [Status::Ok, Status::Aborted, Status::Ok]);
    let (said, _) = workspace.call(0, &["replay", "session-interrupted"]);
    assert!(said.contains("2 starts: no difference"), "{said}");
}

#[test]
fn a_session_of_an_older_version_replays_or_is_told_which_rule_changed() {
    let workspace = Workspace::with_short_protocol();
    let copy = copy_of_fixture(&workspace, "session-rules-1");
    let (said, _) = workspace.call(0, &["replay", "session-rules-1"]);
    assert!(said.contains("no difference"), "{said}");
    let onset_s = dataset::load(&copy).unwrap().trials[0].onset_s.unwrap();
    tamper(&copy, (onset_s * 1000.0) as usize - 200);
    let (said, _) = workspace.call(1, &["replay", "session-rules-1"]);
    assert!(
        said.contains("recorded by ramphold 0.1.0 under rules 1; since rules 2: the smoothing"),
        "{said}"
    );
}
