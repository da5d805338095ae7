//! The console in a terminal: a session is run from the keyboard of a terminal that a program only believes to have.

#![cfg(unix)]

use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::thread;

use ramphold::dataset::{ActionOrigin, OperatorAction, operator_actions};
use ramphold::session::Event;

use super::program::protocol;
use crate::workspace::{FOREVER, PROGRAM};

#[test]
fn a_session_is_run_from_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let run = format!(
        "stty rows 40 cols 120; exec {} run {} --seed 1 --speed 20 --tui --out {}",
        PROGRAM,
        protocol(folder.path()).display(),
        session.display()
    );
    let mut child = Command::new("script")
        .args(["-qefc", &run, "/dev/null"])
        .env("TERM", "xterm-256color")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("script, of the package bsdutils");
    let (mut keys, mut screen) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    let (shown, seen) = mpsc::channel();
    thread::spawn(move || {
        let mut bytes = [0; 4096];
        while let Ok(length @ 1..) = screen.read(&mut bytes) {
            if shown.send(String::from_utf8_lossy(&bytes[..length]).into_owned()).is_err() {
                return;
            }
        }
    });
    // Only what changed is drawn, so a word is looked for rather than a line.
    let (mut all, mut from) = (String::new(), 0);
    let mut until = |what: &str| {
        while !all[from..].contains(what) {
            all += &seen.recv_timeout(FOREVER).unwrap_or_else(|_| panic!("never {what}: {all}"));
        }
        from += all[from..].find(what).unwrap() + what.len();
    };
    until("torque");
    // A virtual wrist is armed without a question.
    keys.write_all(b"s").unwrap();
    until("under");
    keys.write_all(b"nre-glued\r").unwrap();
    until("re-glued");
    // The table of the results comes when the terminal was given back.
    until("\u{1b}[?1049l");
    until("x_t");
    assert!(child.wait().unwrap().success());

    let said: Vec<OperatorAction> = operator_actions(&session)
        .unwrap()
        .into_iter()
        .filter(|(_, entry)| entry.origin == ActionOrigin::Terminal)
        .map(|(_, entry)| entry.action)
        .filter(|action| matches!(action, OperatorAction::Commanded { .. } | OperatorAction::Noted { .. }))
        .collect();
    let note = OperatorAction::Noted { text: "re-glued".to_owned(), clock: None };
    assert_eq!(said, [OperatorAction::Commanded { command: Event::Start }, note]);
}

/// The session's folder was there when the program noticed that it had no terminal to draw on.
#[test]
fn without_a_terminal_no_session_is_begun() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let output = Command::new(PROGRAM)
        .arg("run")
        .arg(protocol(folder.path()))
        .args(["--tui", "--out"])
        .arg(&session)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("--tui") && said.contains("terminal"), "{said}");
    assert!(!session.exists(), "a session was begun");
}
