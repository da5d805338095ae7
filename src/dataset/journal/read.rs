//! Reading a journal: what is sound is read, whatever is wrong before, between or behind it.

use super::{HEAD, JournalEntry, head};

/// A journal as it was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JournalText {
    /// Every record that is sound, in order.
    pub records: Vec<JournalLine>,
    /// What is damaged with sound records behind it.
    pub damage: Vec<Damage>,
    /// The end, if it is torn: the program or the machine stopped while it was written.
    pub torn: Option<Damage>,
}

/// A record and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct JournalLine {
    /// Its first byte.
    pub offset: u64,
    /// The record.
    pub record: JournalEntry,
}

/// A stretch of the journal that is no record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// Its first byte.
    pub offset: u64,
    /// How many bytes.
    pub length: u64,
    /// What is wrong with it.
    pub reason: String,
}

impl JournalText {
    /// Reads all of a journal.
    pub fn parse(bytes: &[u8]) -> Self {
        let mut journal = Self::default();
        let mut place = 0;
        while place < bytes.len() {
            match record_at(&bytes[place..]) {
                Ok((record, length)) => {
                    journal.records.push(JournalLine { offset: place as u64, record });
                    place += length;
                }
                Err(reason) => {
                    let next = next_record(bytes, place);
                    let end = next.unwrap_or(bytes.len());
                    // What is sound behind it has no part in what is wrong with it.
                    let reason = record_at(&bytes[place..end]).err().unwrap_or(reason);
                    let damage = Damage {
                        offset: place as u64,
                        length: (end - place) as u64,
                        reason: reason.to_owned(),
                    };
                    match next {
                        Some(_) => journal.damage.push(damage),
                        None => journal.torn = Some(damage),
                    }
                    place = end;
                }
            }
        }
        journal
    }
}

/// How many places of a line are tried as the beginning of a record. More than one is possible only where the line end
/// before the record is damaged.
const TRIES_IN_A_LINE: usize = 8;

/// Where the next sound record begins. Even the line end before it may be what is damaged, so every place is tried that can
/// be the beginning of a record: it ends with its line, and its length says so.
fn next_record(bytes: &[u8], after: usize) -> Option<usize> {
    let mut start = after + 1;
    while start < bytes.len() {
        let end = start + bytes[start..].iter().position(|byte| *byte == b'\n')?;
        let reaches_the_end = |at: &usize| {
            bytes[at + 8] == b' ' && length_in(&bytes[*at..]).is_some_and(|length| at + HEAD + length == end)
        };
        let last = (end + 1).saturating_sub(HEAD);
        let found = (start..last).filter(reaches_the_end).take(TRIES_IN_A_LINE);
        if let Some(at) = { found }.find(|at| record_at(&bytes[*at..]).is_ok()) {
            return Some(at);
        }
        start = end + 1;
    }
    None
}

/// The length that the first 8 bytes of a record tell.
fn length_in(head: &[u8]) -> Option<usize> {
    let digits = std::str::from_utf8(head.get(..8)?).ok()?;
    let is_number = digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_number.then(|| usize::from_str_radix(digits, 16).ok()).flatten()
}

/// The record at the start of `bytes`, and its length.
fn record_at(bytes: &[u8]) -> Result<(JournalEntry, usize), &'static str> {
    let given = bytes.get(..HEAD).ok_or("it ends before the record does")?;
    let length = length_in(given).ok_or("the length of the record is no number")?;
    let rest = &bytes[HEAD..];
    if length >= rest.len() {
        return Err("it ends before the record does");
    }
    if given[8] != b' ' || given[HEAD - 1] != b' ' {
        return Err("the length and the checksum do not stand apart");
    }
    // Before the checksum, which would be computed for nothing, over the length that a forger wrote.
    if rest.iter().position(|byte| *byte == b'\n') != Some(length) {
        return Err("the record does not end with its line");
    }
    let json = &rest[..length];
    if head(json).as_bytes() != given {
        return Err("the checksum does not fit the record");
    }
    let record = serde_json::from_slice(json).map_err(|_| "the record is of a kind that is not known")?;
    Ok((record, HEAD + length + 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::journal::Interrupted;
    use crate::session::TransitionDetail;
    use proptest::prelude::*;

    fn line(record: &JournalEntry) -> Vec<u8> {
        let json = serde_json::to_vec(record).unwrap();
        [head(&json).as_bytes(), &json, b"\n"].concat()
    }

    /// Five records, and where each begins.
    fn journal() -> (Vec<JournalEntry>, Vec<usize>, Vec<u8>) {
        let records: Vec<JournalEntry> = (1..=5)
            .map(|number| JournalEntry::Resumed {
                interrupted: Some(Interrupted { number, samples: 10, is_rig_trial: false }),
                files_sha256: Default::default(),
            })
            .collect();
        let mut bytes = Vec::new();
        let starts = records.iter().map(|record| {
            bytes.extend(line(record));
            bytes.len() - line(record).len()
        });
        let starts = starts.collect();
        (records, starts, bytes)
    }

    fn read(bytes: &[u8]) -> (Vec<JournalEntry>, JournalText) {
        let journal = JournalText::parse(bytes);
        (journal.records.iter().map(|placed| placed.record.clone()).collect(), journal)
    }

    /// Found by the fuzzer: a length that led into the records behind it was told in other words when those were there.
    #[test]
    fn what_is_wrong_with_a_record_does_not_depend_on_those_behind_it() {
        let (_, starts, mut bytes) = journal();
        let overlong = starts[1];
        bytes[overlong + 5] = b'1';
        let reason = |bytes: &[u8]| JournalText::parse(bytes).damage[0].reason.clone();
        let short = reason(&bytes[..starts[3]]);
        assert_eq!(short, "it ends before the record does");
        let behind = bytes.repeat(10);
        assert_eq!(reason(&[&bytes[..], &behind[..]].concat()), short);
        for journal in [&bytes[..], include_bytes!("../../../fuzz/seeds/journal/overlong.log")] {
            let whole = JournalText::parse(journal);
            let end = whole.torn.as_ref().map_or(journal.len(), |torn| torn.offset as usize);
            let cut = JournalText::parse(&journal[..end]);
            assert_eq!((cut.records, cut.damage), (whole.records, whole.damage));
        }
    }

    /// 2 MB of such heads took 52 s: each told of a record that reached to the end, and its checksum was computed.
    #[test]
    fn forged_lengths_take_time_only_in_proportion_to_the_journal() {
        let (records, _, sound) = journal();
        let heads = |line_end: &str| -> Vec<u8> {
            (0..80_000u32)
                .flat_map(|n| format!("{:08x} {n:016x} {line_end}", 2_000_000 - 26 * n).into_bytes())
                .collect()
        };
        let one_line = heads("");
        let mut reaching: Vec<u8> = (0..40_000u32)
            .flat_map(|n| format!("{:08x} {n:016x} ", 26 * (39_999 - n)).into_bytes())
            .collect();
        reaching.push(b'\n');
        for forged in [one_line, heads("\n"), reaching] {
            let begun = std::time::Instant::now();
            let (found, journal) = read(&[&sound[..], &forged[..], b"\n", &sound[..]].concat());
            assert_eq!(found, [&records[..], &records[..]].concat());
            assert_eq!(journal.damage.len(), 1);
            assert!(begun.elapsed() < std::time::Duration::from_secs(5), "{:?}", begun.elapsed());
        }
    }

    #[test]
    fn a_tail_torn_at_any_byte_is_cut_off_and_the_rest_is_read() {
        let (records, starts, bytes) = journal();
        for length in 0..=bytes.len() {
            let whole = starts.iter().skip(1).filter(|start| **start <= length).count()
                + usize::from(length == bytes.len());
            let (found, journal) = read(&bytes[..length]);
            assert_eq!(found, records[..whole], "cut at {length}");
            assert!(journal.damage.is_empty());
            let good = starts.get(whole).copied().unwrap_or(bytes.len());
            let torn = journal.torn.map(|torn| (torn.offset as usize, torn.length as usize));
            assert_eq!(torn, (good < length).then_some((good, length - good)));
        }
    }

    #[test]
    fn a_damaged_record_in_the_middle_is_named_and_all_others_are_read() {
        let (records, starts, bytes) = journal();
        for place in 0..starts[4] {
            let mut bytes = bytes.clone();
            bytes[place] ^= 0x15;
            let broken = starts.iter().rposition(|start| *start <= place).unwrap();
            let (found, journal) = read(&bytes);
            let mut sound = records.clone();
            sound.remove(broken);
            assert_eq!(found, sound, "byte {place}");
            assert_eq!(journal.damage.len(), 1);
            assert_eq!(journal.damage[0].offset as usize, starts[broken]);
            assert_eq!(journal.damage[0].length as usize, starts[broken + 1] - starts[broken]);
            assert!(journal.torn.is_none());
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_accounted_for(bytes in prop::collection::vec(any::<u8>(), 0..300), at in 0usize..400) {
            let (_, _, mut all) = journal();
            let at = at.min(all.len());
            all.splice(at..at, bytes);
            let journal = JournalText::parse(&all);
            let records: u64 = journal.records.iter().map(|placed| line(&placed.record).len() as u64).sum();
            let damaged: u64 = journal.damage.iter().chain(&journal.torn).map(|damage| damage.length).sum();
            prop_assert_eq!(records + damaged, all.len() as u64);
        }
    }

    /// Lines as version 0.1.0 wrote them, one for each kind of fault of its CAN motor: neither class nor message.
    const FAULTS_OF_0_1_0: &[u8] = include_bytes!("can-faults-0.1.0.log");

    #[test]
    fn faults_of_a_can_motor_in_an_old_journal_are_read_and_keep_their_bytes() {
        let journal = JournalText::parse(FAULTS_OF_0_1_0);
        assert_eq!((journal.damage, journal.torn, journal.records.len()), (Vec::new(), None, 35));
        let written: Vec<u8> = journal.records.iter().flat_map(|placed| line(&placed.record)).collect();
        assert_eq!(String::from_utf8(written).unwrap(), String::from_utf8_lossy(FAULTS_OF_0_1_0));
    }

    #[test]
    fn a_fault_that_was_renamed_since_is_read_under_the_name_it_has_in_the_journal() {
        let text = String::from_utf8_lossy(FAULTS_OF_0_1_0).replace("missed_cycle", "no_answer_to_sync");
        let line = text.lines().find(|line| line.contains("no_answer_to_sync")).unwrap();
        let json = &line[HEAD..];
        let journal = JournalText::parse(format!("{}{json}\n", head(json.as_bytes())).as_bytes());
        let [JournalLine { record: JournalEntry::Transition(transition), .. }] = &journal.records[..] else {
            panic!("not one event: {journal:?}")
        };
        let Some(TransitionDetail::Fault(fault) | TransitionDetail::FaultInTrial { fault, .. }) =
            transition.detail
        else {
            panic!("no fault: {transition:?}")
        };
        assert_eq!(fault.code(), "no_answer_to_sync");
        assert!(fault.to_string().contains("in_a_row 401, tolerated 400, id 389"), "{fault}");
    }
}
