//! Files of results are input like any other: `fit.json`, `diagnosis.json` and `bus.json`, one after the other with a line of
//! dashes between them, give a report or are refused.
#![no_main]

use std::cell::OnceCell;
use std::fs;

use libfuzzer_sys::fuzz_target;
use ramphold::dataset::{self, Disk};
use ramphold::files::Folder;
use ramphold::report;

thread_local! {
    static SESSION: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

fuzz_target!(|text: &[u8]| {
    SESSION.with(|session| {
        let session = session.get_or_init(new_session).path();
        let text = String::from_utf8_lossy(text);
        let mut parts = text.split("\n----\n");
        for file in ["results/fit.json", "results/diagnosis.json", "bus.json"] {
            let path = session.join(file);
            match parts.next() {
                Some(part) => fs::write(path, part).expect("a file"),
                None => drop(fs::remove_file(path)),
            }
        }
        let results = Folder::open(session).and_then(|folder| folder.folder("results")).expect("a folder");
        let read = dataset::load(session).expect("the session");
        if let Ok(written) = report::write(session, read, &results, None, &results, &Disk::default()) {
            let page = fs::read_to_string(written.page).expect("the page");
            assert_eq!(page.matches("<script>").count(), 1, "a text became a script");
        }
    });
});

/// A session with one trial.
fn new_session() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir_all(folder.path().join("trials")).expect("a folder");
    fs::create_dir_all(folder.path().join("results")).expect("a folder");
    for (name, bytes) in [
        ("session.json", &include_bytes!("../session/session.json")[..]),
        ("trials.csv", include_bytes!("../session/trials.csv")),
        ("protocol.json", include_bytes!("../session/protocol.json")),
        ("trials/trial-001.csv", include_bytes!("../session/trial-001.csv")),
    ] {
        fs::write(folder.path().join(name), bytes).expect("a file");
    }
    folder
}
