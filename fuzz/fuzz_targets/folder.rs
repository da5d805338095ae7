//! A folder made of any files, links, pipes and sizes is read, replayed, verified, resumed and exported, or refused; nothing
//! outside it is read or changed, and nobody waits.
//!
//! The input is a list of lines `KIND PATH CONTENT`: `f` a file, `l` a link, `h` a hard link, `p` a FIFO, `d` a folder, `s` a
//! file of a size, `x` takes a file away. The folder begins as a small session.
#![no_main]

use std::fs;
use std::path::{Path, PathBuf};

use libfuzzer_sys::fuzz_target;
use ramphold::dataset::{self, Disk, Manifest, Resumable};
use ramphold::export::{Participant, write_bids};
use ramphold::files::Folder;
use ramphold::report;

const SESSION: [(&str, &[u8]); 7] = [
    ("session.json", include_bytes!("../session/session.json")),
    ("trials.csv", include_bytes!("../session/trials.csv")),
    ("protocol.json", include_bytes!("../session/protocol.json")),
    ("schedule.csv", include_bytes!("../session/schedule.csv")),
    ("rig.json", include_bytes!("../session/rig.json")),
    ("journal.log", include_bytes!("../session/journal.log")),
    ("trials/trial-001.csv", include_bytes!("../session/trial-001.csv")),
];

/// Where links lead.
const TARGETS: [&str; 8] = [
    "../outside/victim",
    "../../outside/fit.csv",
    "../outside",
    "../outside/manifest.json",
    "trials",
    "..",
    "session.json",
    "/dev/zero",
];

const VICTIM: &[u8] = b"precious";

fuzz_target!(|text: &[u8]| {
    let place = tempfile::tempdir().expect("a folder");
    let (session, outside) = (place.path().join("s"), place.path().join("outside"));
    fs::create_dir_all(session.join("trials")).expect("a folder");
    fs::create_dir(&outside).expect("a folder");
    for name in ["victim", "manifest.json", "fit.csv"] {
        fs::write(outside.join(name), VICTIM).expect("a file");
    }
    for (name, bytes) in SESSION {
        fs::write(session.join(name), bytes).expect("a file");
    }
    for line in String::from_utf8_lossy(text).lines().take(40) {
        apply(line, &session);
    }
    let _ = dataset::replay(&session);
    let _ = Manifest::read(&session).map(|manifest| manifest.changes(&session));
    let _ = write_bids(
        &[Participant { folder: session.clone(), label: Some("01".into()) }],
        &place.path().join("bids"),
    );
    let read = dataset::load(&session);
    let results = Folder::open(&session).and_then(|folder| folder.folder_made("results"));
    if let (Ok(read), Ok(results)) = (read, results) {
        let _ = report::write(&session, read, &results, None, &results, &Disk::default());
    }
    let _ = Manifest::renew_results(&Disk::default(), &session);
    let _ = Resumable::open(&session, Disk::default()).map(|session| session.resume());
    let _ = Manifest::take(&session, true).map(|manifest| manifest.write(&Disk::default(), &session));
    let left: Vec<_> =
        fs::read_dir(&outside).expect("the folder").map(|entry| entry.expect("an entry").path()).collect();
    assert_eq!(left.len(), 3, "{left:?}");
    assert!(left.iter().all(|path| fs::read(path).expect("the file") == VICTIM));
});

/// Does what a line says, as far as that is possible inside the session's folder.
fn apply(line: &str, session: &Path) {
    let mut words = line.splitn(3, ' ');
    let (Some(kind), Some(name)) = (words.next(), words.next()) else { return };
    let content = words.next().unwrap_or_default();
    let Some(path) = inside(session, name) else { return };
    if let Some(folder) = path.parent() {
        let _ = fs::create_dir_all(folder);
    }
    if kind != "d" && kind != "a" {
        let _ = fs::remove_file(&path);
        let _ = fs::remove_dir_all(&path);
    }
    match kind {
        "f" => drop(fs::write(&path, content.replace("\\n", "\n"))),
        "a" => {
            let is_small =
                path.symlink_metadata().is_ok_and(|about| about.is_file() && about.len() < 1 << 20);
            let before = if is_small { fs::read(&path).unwrap_or_default() } else { Vec::new() };
            let _ = fs::remove_file(&path);
            let _ = fs::write(&path, [&before[..], content.replace("\\n", "\n").as_bytes()].concat());
        }
        "l" => {
            // Nothing of the machine is named, so that a fault of the program could not harm it.
            let target = TARGETS.iter().find(|target| **target == content).unwrap_or(&"nowhere");
            let _ = std::os::unix::fs::symlink(target, &path);
        }
        "h" => drop(fs::hard_link(session.join("../outside/victim"), &path)),
        "d" => drop(fs::create_dir_all(&path)),
        "p" => drop(std::process::Command::new("mkfifo").arg(&path).status()),
        "s" => {
            let bytes = content.parse::<u64>().unwrap_or(0).min(1 << 40);
            let _ = fs::File::create(&path).and_then(|file| file.set_len(bytes));
        }
        _ => {}
    }
}

/// The path in the session; none for a name that leads out of it, also by a link that was made before.
fn inside(session: &Path, name: &str) -> Option<PathBuf> {
    let mut path = session.to_owned();
    let parts: Vec<&str> = name.split('/').collect();
    for part in &parts {
        if part.is_empty() || part.starts_with("..") || part.contains('\0') || path.is_symlink() {
            return None;
        }
        path.push(part);
    }
    Some(path)
}
