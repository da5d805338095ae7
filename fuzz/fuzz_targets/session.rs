//! Three files, one after the other with a line of dashes between them, are a session or are refused.
#![no_main]

use std::cell::OnceCell;
use std::fs;

use libfuzzer_sys::fuzz_target;
use ramphold::dataset;

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

fuzz_target!(|text: &[u8]| {
    let mut parts = split(text).into_iter();
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| tempfile::tempdir().expect("a folder")).path();
        fs::create_dir_all(folder.join("trials")).expect("a folder");
        for file in ["session.json", "trials.csv", "trials/trial-001.csv"] {
            fs::write(folder.join(file), parts.next().unwrap_or_default()).expect("a file");
        }
        if let Ok(session) = dataset::load(folder) {
            for trial in &session.trials {
                let record = &trial.record;
                assert_eq!(record.theta_m_rad.len(), record.torque_l_nm.len());
                assert!(record.torque_l_nm.iter().chain(&record.theta_m_rad).all(|value| value.is_finite()));
            }
        }
    });
});

/// The parts between lines of dashes.
fn split(text: &[u8]) -> Vec<&[u8]> {
    const LINE: &[u8] = b"\n----\n";
    let mut parts = Vec::new();
    let mut rest = text;
    while let Some(place) = rest.windows(LINE.len()).position(|window| window == LINE) {
        parts.push(&rest[..place]);
        rest = &rest[place + LINE.len()..];
    }
    parts.push(rest);
    parts
}
