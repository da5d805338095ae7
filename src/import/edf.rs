//! Reads EDF and its 24-bit variant BDF: the formats of many amplifiers.
//!
//! Kemp et al. 1992, Kemp and Olivan 2003 (EDF+): a header of 256 bytes, 256 more for each signal, then records of equal
//! length with the samples of one signal after those of the other.

use std::path::Path;

use super::error::ImportError;
use super::recording::{Marker, Recording, TIME_COLUMN};
use super::source_table::SourceTable;

const EDF_HEADER: usize = 256;
/// The most signals that are read.
const MOST_SIGNALS: usize = 4096;

/// What the header says of a signal.
struct EdfSignal {
    label: String,
    unit: String,
    physical: [f64; 2],
    digital: [f64; 2],
    /// Samples in a record.
    each: usize,
}

impl EdfSignal {
    fn is_annotation(&self) -> bool {
        self.label.ends_with("Annotations")
    }

    fn value(&self, count: i32) -> f64 {
        let ([low, high], [least, most]) = (self.physical, self.digital);
        low + (f64::from(count) - least) * (high - low) / (most - least)
    }
}

/// Whether the bytes begin as a file of this kind does.
pub fn is_edf(bytes: &[u8]) -> bool {
    bytes.starts_with(b"0       ") || bytes.starts_with(b"\xffBIOSEMI")
}

/// Reads the signals in `bytes`, a table for each rate, and the annotations; `path` is for messages.
pub fn read(bytes: &[u8], path: &Path) -> Result<Recording, ImportError> {
    let broken = |found: String| ImportError::Source {
        path: path.into(),
        found,
        expected: "an EDF, EDF+C or BDF file that is whole; export the recording again",
    };
    let is_bdf = bytes.starts_with(b"\xff");
    let width = if is_bdf { 3 } else { 2 };
    let field = |from: usize, length: usize| {
        let text = bytes.get(from..from + length).map(|text| String::from_utf8_lossy(text).trim().to_owned());
        text.ok_or_else(|| broken("a header that is cut off".into()))
    };
    let number = |text: String, what: &str| {
        let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| broken(format!("{what} {text:?}, which is no number")))
    };
    let count = |text: String, what: &str| {
        let number = number(text, what)?;
        if (0.0..=1e9).contains(&number) {
            Ok(number as usize)
        } else {
            Err(broken(format!("{number} {what}")))
        }
    };
    if field(192, 44)?.ends_with("+D") {
        return Err(broken("a recording with interruptions (EDF+D)".into()));
    }
    let signal_count = count(field(252, 4)?, "signals")?;
    let start = EDF_HEADER * (signal_count + 1);
    if signal_count == 0 || signal_count > MOST_SIGNALS || bytes.len() < start {
        return Err(broken(format!("a header of {signal_count} signals in {} bytes", bytes.len())));
    }
    // The fields of the signals stand one kind after the other.
    let of_signal = |before: usize, length: usize, at: usize| {
        field(EDF_HEADER + before * signal_count + length * at, length)
    };
    let mut signals = Vec::with_capacity(signal_count);
    for at in 0..signal_count {
        let signal = EdfSignal {
            label: of_signal(0, 16, at)?,
            unit: of_signal(96, 8, at)?,
            physical: [
                number(of_signal(104, 8, at)?, "physical minimum")?,
                number(of_signal(112, 8, at)?, "physical maximum")?,
            ],
            digital: [
                number(of_signal(120, 8, at)?, "digital minimum")?,
                number(of_signal(128, 8, at)?, "digital maximum")?,
            ],
            each: count(of_signal(216, 8, at)?, "samples in a record")?,
        };
        if signal.digital[0] == signal.digital[1] && !signal.is_annotation() {
            return Err(broken(format!("signal {:?} with a digital range of 0", signal.label)));
        }
        signals.push(signal);
    }
    let record_s = number(field(244, 8)?, "duration of a record")?;
    let in_record = width * signals.iter().map(|signal| signal.each).sum::<usize>();
    if in_record == 0 || !(record_s > 0.0 || signals.iter().all(EdfSignal::is_annotation)) {
        return Err(broken(format!("records of {in_record} bytes and {record_s} s")));
    }
    let there = (bytes.len() - start) / in_record;
    // While it is recorded, the number of records is -1.
    let stated = number(field(236, 8)?, "number of records")?;
    if stated >= 0.0 && stated > there as f64 {
        return Err(broken(format!("{there} records, {stated} are stated: the file is cut off")));
    }
    let records = if stated >= 0.0 { stated as usize } else { there };
    let data = &bytes[start..];
    let mut tables: Vec<(usize, SourceTable)> = Vec::new();
    let mut markers = Vec::new();
    let mut before = 0;
    for signal in &signals {
        let own = before..before + width * signal.each;
        before = own.end;
        let pieces = (0..records).map(|record| &data[record * in_record..][own.clone()]);
        if signal.is_annotation() {
            pieces.for_each(|piece| annotations(piece, &mut markers));
            continue;
        }
        if signal.each == 0 {
            continue;
        }
        let values: Vec<f64> = pieces
            .flat_map(|piece| piece.chunks_exact(width))
            .map(|own| signal.value(integer(own)))
            .collect();
        let rate_hz = signal.each as f64 / record_s;
        let at = tables.iter().position(|(each, _)| *each == signal.each).unwrap_or_else(|| {
            let times = (0..values.len()).map(|sample| sample as f64 / rate_hz).collect();
            let name = format!("{}, signals of {rate_hz} Hz", path.display());
            let mut table = SourceTable::new(name, vec![(TIME_COLUMN.to_owned(), times)]);
            table.stated.is_even = true;
            tables.push((signal.each, table));
            tables.len() - 1
        });
        tables[at].1.stated.units.push((signal.label.clone(), signal.unit.clone()));
        tables[at].1.columns.push((signal.label.clone(), values));
    }
    Ok(Recording { tables: tables.into_iter().map(|(_, table)| table).collect(), markers })
}

/// A number of two or three bytes, the lowest first.
fn integer(bytes: &[u8]) -> i32 {
    match *bytes {
        [low, high] => i32::from(i16::from_le_bytes([low, high])),
        [low, middle, high] => i32::from_le_bytes([0, low, middle, high]) >> 8,
        _ => 0,
    }
}

/// Adds the annotations of one record: `+12.5`, perhaps 21 and a duration, then 20 and a text ended by 20, ended by 0.
fn annotations(piece: &[u8], markers: &mut Vec<Marker>) {
    for list in piece.split(|byte| *byte == 0) {
        let mut parts = list.split(|byte| *byte == 20);
        let onset = parts.next().and_then(|onset| onset.split(|byte| *byte == 21).next());
        let time_s = onset.and_then(|onset| std::str::from_utf8(onset).ok()?.parse::<f64>().ok());
        let Some(time_s) = time_s.filter(|time_s| time_s.is_finite()) else { continue };
        // The first text of a record may be empty: it only says when the record began.
        for text in parts.filter(|text| !text.is_empty()) {
            markers.push(Marker { time_s, text: String::from_utf8_lossy(text).into_owned() });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of two signals at 4 and 2 samples a record of half a second, and annotations.
    fn file(records: &str, cut: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut text = |text: &str, width: usize| {
            bytes.extend(text.bytes().chain(std::iter::repeat(b' ')).take(width));
        };
        text("0", 8);
        text("X X X X", 80);
        text("Startdate X X X X", 80);
        text("01.01.8500.00.00", 16);
        text("1024", 8);
        text("EDF+C", 44);
        text(records, 8);
        text("0.5", 8);
        text("3", 4);
        for (own, width) in [
            (["EMG", "Trigger", "EDF Annotations"], 16),
            (["", "", ""], 80),
            (["mV", "V", ""], 8),
            (["-5", "0", "-1"], 8),
            (["5", "5", "1"], 8),
            (["-1000", "0", "-32768"], 8),
            (["1000", "1000", "32767"], 8),
            (["", "", ""], 80),
            (["4", "2", "8"], 8),
            (["", "", ""], 32),
        ] {
            own.iter().for_each(|own| text(own, width));
        }
        for record in 0..2i16 {
            for value in [100, -200, 300, 400].map(|value: i16| value + record) {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
            for value in [0i16, 1000] {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
            let mut list = format!("+{}\u{14}\u{14}\0", 0.5 * f64::from(record)).into_bytes();
            list.extend_from_slice(if record == 1 { b"+.7\x14go\x14" } else { b"" });
            list.resize(16, 0);
            bytes.extend(list);
        }
        bytes.truncate(bytes.len() - cut);
        bytes
    }

    #[test]
    fn signals_of_each_rate_and_annotations_are_read() {
        let read = read(&file("2", 0), Path::new("a.edf")).unwrap();
        let [fast, slow] = read.tables.as_slice() else { panic!("{:?}", read.tables) };
        let expected = [0.5, -1.0, 1.5, 2.0, 0.505, -0.995, 1.505, 2.005];
        let emg = fast.column("EMG").unwrap();
        assert!(emg.len() == 8 && emg.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{emg:?}");
        assert_eq!(fast.column(TIME_COLUMN).unwrap()[5], 0.625);
        assert_eq!(slow.column("Trigger").unwrap(), [0.0, 5.0, 0.0, 5.0]);
        assert_eq!(read.markers, [Marker { time_s: 0.7, text: "go".into() }]);
    }

    #[test]
    fn the_files_that_the_program_writes_are_read() {
        let values = [0.1, -0.25, 0.3, 0.0];
        let channel = bdf(&values);
        let read = read(&channel, Path::new("a.bdf")).unwrap();
        let found = read.tables[0].column("emg_fcr").unwrap();
        assert!(found.iter().zip(values).all(|(a, b)| (a - b).abs() < 1e-7), "{found:?}");
    }

    /// A BDF file of one signal with a step of 1e-7.
    fn bdf(values: &[f64]) -> Vec<u8> {
        let mut bytes = b"\xffBIOSEMI".to_vec();
        let mut text = |text: &str, width: usize| {
            bytes.extend(text.bytes().chain(std::iter::repeat(b' ')).take(width));
        };
        text("", 176);
        text("512", 8);
        text("24BIT", 44);
        text("1", 8);
        text("0.004", 8);
        text("1", 4);
        for (own, width) in [
            ("emg_fcr", 16),
            ("", 80),
            ("MVC", 8),
            ("-0.8", 8),
            ("0.8", 8),
            ("-8000000", 8),
            ("8000000", 8),
            ("", 80),
            (values.len().to_string().as_str(), 8),
            ("", 32),
        ] {
            text(own, width);
        }
        for value in values {
            bytes.extend_from_slice(&((value * 1e7) as i32).to_le_bytes()[..3]);
        }
        bytes
    }

    #[test]
    fn files_that_are_cut_off_or_lie_about_their_size_are_refused() {
        let message = |bytes: &[u8]| read(bytes, Path::new("a.edf")).unwrap_err().to_string();
        assert!(message(&file("2", 1)).contains("1 records, 2 are stated: the file is cut off"));
        assert!(message(&file("99999999", 0)).contains("are stated"));
        assert!(message(&file("2", 0)[..700]).contains("a header of 3 signals in 700 bytes"));
        let mut huge = file("2", 0);
        // The samples of a record of the first signal.
        let at = 256 + 216 * 3;
        huge[at..at + 8].copy_from_slice(b"99999999");
        assert!(message(&huge).contains("0 records, 2 are stated"));
        for length in 0..file("2", 0).len() {
            let _ = read(&file("2", 0)[..length], Path::new("a.edf"));
        }
        assert_eq!(read(&file("-1", 1), Path::new("a.edf")).unwrap().tables[0].columns[0].1.len(), 4);
    }
}
