//! The console of a laboratory: sessions are chosen, checked, begun and ended from the page, and nothing else is.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::program::{Program, Socket};

const SUBJECTS: &str = "subject,hand,notes\nS01,left,tired\nS02,,\n";

/// The next view of the laboratory of which something is true.
fn view(page: &mut Socket, what: &str, is: impl Fn(&Value) -> bool) -> Value {
    let message = page.until(what, |message| message["kind"] == "laboratory" && is(&message["laboratory"]));
    message["laboratory"].clone()
}

fn choose(page: &mut Socket, part: &str, name: impl Into<Value>) {
    page.send(&json!({ "choose": { "part": part, "name": name.into() } }));
}

fn begin(page: &mut Socket, view: &Value) {
    page.send(&json!({ "begin": { "number": view["number"] } }));
}

/// Chooses a subject; the view in which everything is checked.
fn all_green(page: &mut Socket, subject: &str) -> Value {
    choose(page, "subject", subject);
    view(page, "green checks", |view| view["may_begin"] == true && chosen(view, "subject") == subject)
}

fn chosen<'a>(view: &'a Value, part: &str) -> &'a Value {
    let choices = view["choices"].as_array().unwrap();
    &choices.iter().find(|choice| choice["part"] == part).unwrap()["chosen"]
}

fn outcome<'a>(view: &'a Value, name: &str) -> (&'a str, &'a str) {
    let checks = view["checks"].as_array().unwrap();
    let own = checks.iter().find(|check| check["name"] == name).unwrap();
    (own["outcome"].as_str().unwrap(), own["text"].as_str().unwrap())
}

fn notice(view: &Value) -> &str {
    view["notice"]["text"].as_str().unwrap_or_default()
}

fn sessions(program: &Program) -> Vec<String> {
    let names = fs::read_dir(&program.session).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<String> = names.map(|name| name.into_string().unwrap()).collect();
    names.sort();
    names
}

fn read(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn two_sessions_are_chosen_checked_and_run_one_after_the_other_in_the_same_pages() {
    let mut program = Program::laboratory(SUBJECTS, &["--speed", "20", "--operator", "A. Berg"]);
    let (mut operator, mut subject) = (program.operator.live(), program.subject.live());
    let first = view(&mut operator, "the lists", |_| true);
    // What there is one of is chosen; a subject never is, if there are several.
    assert_eq!(
        (chosen(&first, "protocol"), chosen(&first, "rig")),
        (&json!("protocol.json"), &json!("rig.json"))
    );
    assert_eq!((chosen(&first, "subject"), &first["may_begin"]), (&Value::Null, &json!(false)));
    assert_eq!(first["choices"][0]["entries"][0], json!({ "name": "S01", "about": "left hand, tired" }));
    // The subject's page stays open through both, and sees no list.
    let looking = std::thread::spawn(move || {
        let mut seen = Vec::new();
        while seen.len() < 5 {
            let message = subject.next().unwrap();
            assert!(message["kind"] != "laboratory" || message["laboratory"].is_null(), "{message}");
            let kind = message["kind"].as_str().unwrap().to_owned();
            if kind != "now" && seen.last() != Some(&kind) {
                seen.push(kind);
            }
        }
        seen
    });
    for (id, wrist) in [("S01", "left"), ("S02", "right")] {
        let green = all_green(&mut operator, id);
        begin(&mut operator, &green);
        let hello = operator.until("the session", |message| message["kind"] == "hello");
        assert_eq!((&hello["subject"], &hello["wrist"]), (&json!(id), &json!(wrist)));
        // It waits, and begins as any session of a console.
        let ready = operator.phase("ready");
        assert_eq!(ready["possible"], json!(["start", "abort"]));
        operator.word("start");
        operator.phase("finished");
        let over = view(&mut operator, "the laboratory again", |_| true);
        assert!(notice(&over).contains(&format!("session of {id} is over")), "{over}");
        assert!(notice(&over).ends_with("results"), "{over}");
        assert_eq!(chosen(&over, "subject"), &Value::Null, "the next subject is the last one unasked");
    }
    assert_eq!(looking.join().unwrap(), ["laboratory", "hello", "laboratory", "hello", "laboratory"]);
    let listed = view(&mut operator, "the list of sessions", |view| {
        view["sessions"].as_array().is_some_and(|sessions| sessions.len() == 2)
    });
    assert!(listed["sessions"].as_array().unwrap().iter().all(|own| own["state"] == "fitted"), "{listed}");
    let names = sessions(&program);
    assert!(names[0].starts_with("protocol-S01-") && names[1].starts_with("protocol-S02-"), "{names:?}");
    let card = read(&program.session.join(&names[0]).join("session.json"));
    assert_eq!(
        (&card["subject"]["id"], &card["operator"], &card["hand"]),
        (&json!("S01"), &json!("A. Berg"), &json!("left"))
    );
    assert!(program.session.join(&names[1]).join("results/report.html").exists());
    #[cfg(unix)]
    {
        program.interrupt();
        operator.read_to_the_end();
        assert_eq!(program.ends(), Some(0));
    }
}

#[test]
fn a_page_chooses_nothing_but_lines_of_the_lists() {
    let program = Program::laboratory(SUBJECTS, &[]);
    // A file of that name would be a virtual subject to `ramphold run`.
    fs::write(program.session.parent().unwrap().join("model.json"), "{}").unwrap();
    let mut operator = program.operator.live();
    let before = all_green(&mut operator, "S01");
    for (part, name) in [
        ("subject", "S99"),
        ("subject", "../S01"),
        ("subject", ""),
        ("protocol", "../lab/protocol.json"),
        ("protocol", "./protocol.json"),
        ("protocol", "rig.json"),
        ("protocol", "model.json"),
        ("protocol", "subjects.csv"),
        ("rig", "/dev/null"),
        ("rig", "protocol.json"),
        ("calibration", "../rig.json"),
    ] {
        choose(&mut operator, part, name);
        let refused = view(&mut operator, name, |view| notice(view).contains("not in the list"));
        assert_eq!(refused["choices"], before["choices"], "{part} {name:?}");
        assert_eq!(refused["number"], before["number"], "{part} {name:?}");
        choose(&mut operator, "subject", "S01");
        view(&mut operator, "the choice", |view| view["notice"].is_null());
    }
    assert_eq!(sessions(&program), Vec::<String>::new());
    // The subject's page chooses nothing, and what no page sends is not understood.
    let mut subject = program.subject.live();
    choose(&mut subject, "subject", "S02");
    assert_eq!(subject.closed(), "the subject's page gives no commands");
    operator.send(&json!({ "begin": { "number": before["number"], "protocol": "/tmp/own.json" } }));
    assert_eq!(operator.closed(), "not understood");
    assert_eq!(sessions(&program), Vec::<String>::new());
}

#[test]
fn of_two_pages_that_begin_at_once_one_begins_and_both_show_its_session() {
    let program = Program::laboratory(SUBJECTS, &["--speed", "20"]);
    let (mut one, mut other) = (program.operator.live(), program.operator.live());
    let green = all_green(&mut one, "S01");
    let also = view(&mut other, "the same choice", |view| view["may_begin"] == true);
    assert_eq!(also["number"], green["number"]);
    begin(&mut one, &green);
    begin(&mut other, &also);
    for page in [&mut one, &mut other] {
        let hello = page.until("the session", |message| message["kind"] == "hello");
        assert_eq!(hello["subject"], "S01");
        page.phase("ready");
    }
    // While it runs, no other begins, and the operators are told.
    begin(&mut other, &also);
    one.until("an alarm", |message| message.to_string().contains("asked to begin another session"));
    choose(&mut other, "subject", "S02");
    one.word("start");
    one.phase("finished");
    let over = view(&mut one, "the laboratory", |_| true);
    assert!(notice(&over).contains("S01"), "{over}");
    // The number of then begins nothing any more.
    let mut other = program.operator.live();
    begin(&mut other, &also);
    view(&mut other, "a refusal", |view| notice(view).contains("has changed since"));
    assert_eq!(sessions(&program).len(), 1);
}

#[test]
fn what_fails_its_check_begins_nothing_until_it_is_mended() {
    let program = Program::laboratory(SUBJECTS, &[]);
    let laboratory = program.session.parent().unwrap().to_owned();
    let mut operator = program.operator.live();
    let green = all_green(&mut operator, "S01");
    let good = fs::read_to_string(laboratory.join("rig.json")).unwrap();
    // The rig loses its EMG between choosing and beginning: the page has not seen that yet.
    fs::write(laboratory.join("rig.json"), r#"{ "kind": "virtual", "emg": false }"#).unwrap();
    begin(&mut operator, &green);
    let refused = view(&mut operator, "a refusal", |view| notice(view).contains("has changed since"));
    let (state, text) = outcome(&refused, "rig");
    assert_eq!((state, &refused["may_begin"]), ("failed", &json!(false)));
    assert!(text.contains("measures no EMG"), "{text}");
    // Nor does it with the number of the failed checks.
    begin(&mut operator, &refused);
    view(&mut operator, "another refusal", |view| notice(view).contains("not all checks"));
    for (file, text, check, words) in [
        ("rig.json", "{ \"kind\": \"virtual\", ", "rig", "rig.json"),
        ("protocol.json", "{ \"format\": \"ramphold-protocol/1\" }", "protocol", "velocities_rad_s"),
        ("subjects.csv", "subject,hand\nS01,lefty\n", "subject", "line 2, column hand"),
    ] {
        let before = fs::read_to_string(laboratory.join(file)).unwrap();
        fs::write(laboratory.join(file), text).unwrap();
        let failed = view(&mut operator, file, |view| {
            outcome(view, check).0 == "failed" && outcome(view, check).1.contains(words)
        });
        assert_eq!(failed["may_begin"], false, "{file}");
        fs::write(laboratory.join(file), before).unwrap();
    }
    fs::write(laboratory.join("rig.json"), good).unwrap();
    view(&mut operator, "green checks", |view| view["may_begin"] == true);
    assert_eq!(sessions(&program), Vec::<String>::new());
}

#[test]
fn a_page_that_lost_its_connection_finds_what_was_chosen_and_begins() {
    let program = Program::laboratory(SUBJECTS, &[]);
    let mut operator = program.operator.live();
    all_green(&mut operator, "S02");
    drop(operator);
    let mut back = program.operator.live();
    let found = view(&mut back, "the choice", |_| true);
    assert_eq!((chosen(&found, "subject"), &found["may_begin"]), (&json!("S02"), &json!(true)));
    begin(&mut back, &found);
    // Nobody is there when the session is made: it waits, and nothing moves.
    drop(back);
    let mut back = program.operator.live();
    back.phase("ready");
    back.word("abort");
    let over = view(&mut back, "the laboratory", |_| true);
    assert_eq!(over["notice"]["is_alarm"], true, "{over}");
    assert!(notice(&over).contains("ramphold resume"), "{over}");
    let journal =
        fs::read_to_string(program.session.join(&sessions(&program)[0]).join("journal.log")).unwrap();
    assert!(!journal.contains("\"start\""), "{journal}");
}

/// The motor is asked only when the session begins, and a bus that is not there makes no session.
#[test]
fn a_motor_that_cannot_be_reached_begins_nothing_and_the_page_says_why() {
    let program = Program::laboratory(SUBJECTS, &[]);
    let laboratory = program.session.parent().unwrap();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/can");
    let mut rig = read(&fixtures.join("rigs/plain.json"));
    rig["bus"] = json!("slcan:/dev/no-such-adapter");
    fs::write(laboratory.join("rig.json"), rig.to_string()).unwrap();
    fs::copy(fixtures.join("rigs/one-trial.json"), laboratory.join("protocol.json")).unwrap();
    let mut operator = program.operator.live();
    choose(&mut operator, "subject", "S01");
    let green = view(&mut operator, "green checks", |view| {
        view["may_begin"] == true && outcome(view, "rig").1.contains("no power before you arm it")
    });
    begin(&mut operator, &green);
    let over = view(&mut operator, "why not", |view| notice(view).contains("No session of S01 has begun"));
    assert!(notice(&over).contains("/dev/no-such-adapter"), "{over}");
    assert_eq!((over["is_beginning"].clone(), sessions(&program)), (json!(false), Vec::new()));
}

fn resume(page: &mut Socket, session: &str) {
    page.send(&json!({ "resume": { "session": session } }));
}

/// The view in which a session has a state.
fn listed(page: &mut Socket, session: &str, state: &str) -> Value {
    view(page, state, |view| {
        let sessions = view["sessions"].as_array();
        sessions.is_some_and(|own| own.iter().any(|own| own["session"] == session && own["state"] == state))
    })
}

/// Begins a session of S01 and ends it after its first trial; its name.
fn unfinished(program: &Program, page: &mut Socket) -> String {
    let green = all_green(page, "S01");
    begin(page, &green);
    page.phase("ready");
    page.word("start");
    page.until("a trial", |message| message["kind"] == "now" && message["done"] == 1);
    page.send(&json!({ "word": { "word": "abort", "sure": true } }));
    view(page, "the laboratory", |view| notice(view).contains("S01"));
    sessions(program).remove(0)
}

#[test]
fn an_unfinished_session_of_the_list_goes_on_by_a_click_and_waits_for_the_operator() {
    let program = Program::laboratory(SUBJECTS, &["--speed", "20"]);
    let mut operator = program.operator.live();
    let name = unfinished(&program, &mut operator);
    listed(&mut operator, &name, "unfinished");
    resume(&mut operator, &name);
    let hello = operator.until("the session", |message| message["kind"] == "hello");
    assert_eq!((&hello["subject"], &hello["wrist"]), (&json!("S01"), &json!("left")));
    // It has what was done, and nothing moves before the operator arms it.
    let waits = operator.until("the session", |message| message["kind"] == "now");
    assert_eq!((&waits["phase"], &waits["done"]), (&json!("ready"), &json!(1)));
    operator.word("start");
    operator.phase("finished");
    let over = view(&mut operator, "the laboratory again", |_| true);
    assert!(notice(&over).contains("session of S01 is over"), "{over}");
    listed(&mut operator, &name, "fitted");
    assert_eq!(sessions(&program), std::slice::from_ref(&name));
    // A session that is over has nothing to go on with.
    resume(&mut operator, &name);
    view(&mut operator, "a refusal", |view| notice(view).contains("no unfinished session of that name"));
}

#[test]
fn no_session_goes_on_that_is_not_an_unfinished_one_of_the_list_or_whose_files_were_changed() {
    let program = Program::laboratory(SUBJECTS, &["--speed", "20"]);
    let mut operator = program.operator.live();
    let name = unfinished(&program, &mut operator);
    listed(&mut operator, &name, "unfinished");
    for other in ["", ".", "..", "../sessions", "/", &format!("./{name}"), &format!("{name}/trials")] {
        resume(&mut operator, other);
        view(&mut operator, other, |view| notice(view).contains("no unfinished session of that name"));
        choose(&mut operator, "subject", "S02");
        view(&mut operator, "the choice", |view| view["notice"].is_null());
        choose(&mut operator, "subject", "S01");
    }
    // The checks of `ramphold resume`: the rig must be that of the beginning.
    let rig = program.session.join(&name).join("rig.json");
    let journal = fs::read(program.session.join(&name).join("journal.log")).unwrap();
    let changed = fs::read_to_string(&rig).unwrap().replacen("virtual", "virtual ", 1);
    fs::write(&rig, changed).unwrap();
    resume(&mut operator, &name);
    let over = view(&mut operator, "why not", |view| notice(view).contains("rig.json"));
    assert_eq!((&over["notice"]["is_alarm"], &over["is_beginning"]), (&json!(true), &json!(false)), "{over}");
    assert_eq!(fs::read(program.session.join(&name).join("journal.log")).unwrap(), journal);
    // The subject's page asks for nothing.
    let mut subject = program.subject.live();
    resume(&mut subject, &name);
    assert_eq!(subject.closed(), "the subject's page gives no commands");
}
