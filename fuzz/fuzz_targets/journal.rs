//! Every byte of a journal is part of a record or accounted for as damage.
#![no_main]

use libfuzzer_sys::fuzz_target;
use ramphold::dataset::JournalText;

fuzz_target!(|bytes: &[u8]| {
    let journal = JournalText::parse(bytes);
    let mut last = None;
    for placed in &journal.records {
        assert!(last < Some(placed.offset) && placed.offset < bytes.len() as u64);
        last = Some(placed.offset);
    }
    for damage in journal.damage.iter().chain(&journal.torn) {
        assert!(damage.length > 0 && damage.offset + damage.length <= bytes.len() as u64);
    }
    if let Some(torn) = &journal.torn {
        assert_eq!(torn.offset + torn.length, bytes.len() as u64);
        let whole = JournalText::parse(&bytes[..torn.offset as usize]);
        assert_eq!((whole.records, whole.damage), (journal.records, journal.damage));
    }
});
