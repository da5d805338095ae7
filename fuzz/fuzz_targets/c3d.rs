//! Bytes of any kind are a C3D recording, whose columns are of equal length, or are refused.
#![no_main]

use std::cell::OnceCell;
use std::fs;

use libfuzzer_sys::fuzz_target;
use ramphold::import::read_recording;

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

fuzz_target!(|bytes: &[u8]| {
    FOLDER.with(|folder| {
        let file = folder.get_or_init(|| tempfile::tempdir().expect("a folder")).path().join("a.c3d");
        fs::write(&file, bytes).expect("a file");
        if let Ok(recording) = read_recording(&file) {
            for table in &recording.tables {
                let lengths = table.columns.iter().map(|(_, values)| values.len());
                assert!(lengths.clone().min() == lengths.max(), "columns of different lengths");
            }
        }
    });
});
