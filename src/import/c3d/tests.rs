//! Files of every number format, written byte by byte, and files that are wrong.

use std::path::Path;

use proptest::prelude::*;

use super::{is_c3d, read};
use crate::import::recording::{Recording, TIME_COLUMN};

/// Number format of a file: its code, whether the highest byte is first, whether numbers are those of a VAX.
const INTEL: u8 = 84;
const DEC: u8 = 85;
const MIPS: u8 = 86;

/// A value of a parameter.
enum Value {
    Words(Vec<u16>),
    Floats(Vec<f32>),
    Texts(Vec<&'static str>),
}
use Value::{Floats, Texts, Words};

/// A file to be written: one marker, two channels at two samples a frame, three frames.
struct File {
    processor: u8,
    is_float: bool,
    frames_in_header: [u16; 2],
    samples_in_frame: u16,
    parameters: Vec<(&'static str, &'static str, Value)>,
    /// Samples in the order of the file; integers where the file has integers.
    samples: Vec<f64>,
}

impl File {
    fn new(processor: u8, is_float: bool) -> Self {
        let scale = if is_float { -0.1 } else { 0.1 };
        Self {
            processor,
            is_float,
            frames_in_header: [1, 3],
            samples_in_frame: 2,
            parameters: vec![
                ("POINT", "USED", Words(vec![1])),
                ("POINT", "SCALE", Floats(vec![scale])),
                ("POINT", "RATE", Floats(vec![50.0])),
                ("POINT", "FRAMES", Words(vec![3])),
                ("ANALOG", "USED", Words(vec![2])),
                ("ANALOG", "LABELS", Texts(vec!["EMG FCR", "Sync"])),
                ("ANALOG", "SCALE", Floats(vec![0.5, 0.25])),
                ("ANALOG", "GEN_SCALE", Floats(vec![2.0])),
                ("ANALOG", "OFFSET", Words(vec![0, 10])),
                ("ANALOG", "RATE", Floats(vec![100.0])),
            ],
            samples: vec![1.0, 10.0, -2.0, 12.0, 3.0, 14.0, -4.0, 16.0, 5.0, 18.0, -6.0, 20.0],
        }
    }

    fn with(mut self, group: &'static str, name: &'static str, value: Value) -> Self {
        self.parameters.retain(|own| (own.0, own.1) != (group, name));
        self.parameters.push((group, name, value));
        self
    }

    fn without(mut self, name: &str) -> Self {
        self.parameters.retain(|own| own.1 != name);
        self
    }

    fn word(&self, value: u16) -> [u8; 2] {
        if self.processor == MIPS { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    fn float(&self, value: f32) -> [u8; 4] {
        match self.processor {
            INTEL => value.to_le_bytes(),
            MIPS => value.to_be_bytes(),
            _ => {
                // The exponent of a VAX is greater by two, and its words are exchanged.
                let [a, b, c, d] = (4.0 * value).to_le_bytes();
                [c, d, a, b]
            }
        }
    }

    fn section(&self) -> Vec<u8> {
        let mut bytes = vec![1, 80, 0, self.processor];
        let mut groups: Vec<&str> = Vec::new();
        for (group, ..) in &self.parameters {
            if !groups.contains(group) {
                groups.push(group);
                bytes.extend([group.len() as u8, (-(groups.len() as i8)) as u8]);
                bytes.extend(group.as_bytes());
                bytes.extend(self.word(3));
                bytes.push(0);
            }
        }
        for (group, name, value) in &self.parameters {
            let number = groups.iter().position(|own| own == group).unwrap() as u8 + 1;
            // A locked parameter has a negative length.
            bytes.extend([(-(name.len() as i8)) as u8, number]);
            bytes.extend(name.as_bytes());
            let mut content = Vec::new();
            match value {
                Words(values) => {
                    content.extend([2, 1, values.len() as u8]);
                    values.iter().for_each(|value| content.extend(self.word(*value)));
                }
                Floats(values) => {
                    content.extend([4, 1, values.len() as u8]);
                    values.iter().for_each(|value| content.extend(self.float(*value)));
                }
                Texts(values) => {
                    let length = values.iter().map(|value| value.len()).max().unwrap_or(0);
                    content.extend([0xff, 2, length as u8, values.len() as u8]);
                    values.iter().for_each(|value| content.extend(format!("{value:length$}").bytes()));
                }
            }
            content.push(0);
            bytes.extend(self.word(content.len() as u16 + 2));
            bytes.extend(content);
        }
        bytes.push(0);
        bytes
    }

    fn bytes(&self) -> Vec<u8> {
        let mut section = self.section();
        section.resize(section.len().next_multiple_of(512), 0);
        let [first, last] = self.frames_in_header;
        let mut bytes = vec![2, 0x50];
        bytes.extend(self.word(1));
        bytes.extend(self.word(2 * self.samples_in_frame));
        bytes.extend([self.word(first), self.word(last), self.word(10)].concat());
        bytes.extend(self.float(if self.is_float { -0.1 } else { 0.1 }));
        bytes.extend(self.word(2 + (section.len() / 512) as u16));
        bytes.extend(self.word(self.samples_in_frame));
        bytes.extend(self.float(50.0));
        bytes.resize(512, 0);
        bytes.extend(section);
        for frame in self.samples.chunks(2 * usize::from(self.samples_in_frame.max(1))) {
            for value in [7.0, 8.0, 9.0, 0.0].iter().chain(frame) {
                if self.is_float {
                    bytes.extend(self.float(*value as f32));
                } else {
                    bytes.extend(self.word(*value as i32 as u16));
                }
            }
        }
        bytes
    }

    fn read(&self) -> Recording {
        read(&self.bytes(), Path::new("a.c3d")).unwrap()
    }

    fn refused(&self) -> String {
        refused(&self.bytes())
    }
}

fn refused(bytes: &[u8]) -> String {
    read(bytes, Path::new("a.c3d")).unwrap_err().to_string()
}

#[test]
fn channels_are_the_same_in_every_number_format() {
    for processor in [INTEL, DEC, MIPS] {
        for is_float in [true, false] {
            let file = File::new(processor, is_float);
            assert!(is_c3d(&file.bytes()));
            let read = file.read();
            let [table] = read.tables.as_slice() else { panic!("{:?}", read.tables) };
            assert_eq!(table.column(TIME_COLUMN).unwrap(), [0.0, 0.01, 0.02, 0.03, 0.04, 0.05]);
            assert_eq!(table.column("EMG FCR").unwrap(), [1.0, -2.0, 3.0, -4.0, 5.0, -6.0]);
            assert_eq!(table.column("Sync").unwrap(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
            assert_eq!(table.names(), "time_s, EMG FCR, Sync");
        }
    }
}

#[test]
fn integers_without_a_sign_are_read_so_with_their_offsets() {
    let unsigned = File::new(INTEL, false).with("ANALOG", "FORMAT", Texts(vec!["UNSIGNED"])).with(
        "ANALOG",
        "OFFSET",
        Words(vec![32768, 40000]),
    );
    let file = File { samples: [40000.0, 32768.0].repeat(6), ..unsigned };
    let read = file.read();
    assert_eq!(read.tables[0].column("EMG FCR").unwrap(), [7232.0; 6]);
    assert_eq!(read.tables[0].column("Sync").unwrap(), [-3616.0; 6]);
    // The same bytes of a file that does not say it.
    let signed =
        file.with("ANALOG", "FORMAT", Texts(vec!["SIGNED"])).with("ANALOG", "OFFSET", Words(vec![0, 0]));
    assert_eq!(signed.read().tables[0].column("EMG FCR").unwrap(), [-25536.0; 6]);
}

#[test]
fn channels_beyond_255_have_their_labels_and_scales_in_a_second_parameter() {
    let file = File::new(INTEL, true)
        .with("ANALOG", "LABELS", Texts(vec!["EMG FCR"]))
        .with("ANALOG", "LABELS2", Texts(vec!["Sync"]))
        .with("ANALOG", "SCALE", Floats(vec![0.5]))
        .with("ANALOG", "SCALE2", Floats(vec![0.25]))
        .with("ANALOG", "OFFSET", Words(vec![0]))
        .with("ANALOG", "OFFSET2", Words(vec![10]));
    assert_eq!(file.read(), File::new(INTEL, true).read());
}

#[test]
fn more_frames_than_16_bits_can_count_are_read_wherever_their_number_is() {
    const FRAMES: usize = 70_000;
    let file = || {
        let file = File::new(INTEL, false).with("POINT", "FRAMES", Words(vec![65535]));
        File { samples: [1.0, 11.0].repeat(2 * FRAMES), frames_in_header: [1, 65535], ..file }
    };
    let of_trial = file().with("TRIAL", "ACTUAL_START_FIELD", Words(vec![2, 0])).with(
        "TRIAL",
        "ACTUAL_END_FIELD",
        Words(vec![4465, 1]),
    );
    let of_long_frames = file().with("POINT", "LONG_FRAMES", Floats(vec![70_000.0]));
    let in_a_float = file().with("POINT", "FRAMES", Floats(vec![70_000.0]));
    for file in [of_trial, of_long_frames, in_a_float, file()] {
        assert_eq!(file.read().tables[0].columns[1].1.len(), 2 * FRAMES);
    }
    // Programs fill the last block, and some write one more.
    let mut filled = file().bytes();
    filled.resize(filled.len().next_multiple_of(512) + 512, 0);
    let read = read(&filled, Path::new("a.c3d")).unwrap();
    assert_eq!(read.tables[0].columns[1].1.len(), 2 * FRAMES);
    filled.truncate(512 * 2 + 16 * FRAMES - 3);
    assert!(refused(&filled).contains("a last frame that is not whole"));
}

#[test]
fn a_channel_without_a_label_of_its_own_is_named_by_its_number() {
    let labelled =
        |labels| File::new(INTEL, true).with("ANALOG", "LABELS", Texts(labels)).read().tables.remove(0);
    assert_eq!(labelled(vec!["", "Sync"]).names(), "time_s, channel_1, Sync");
    assert_eq!(labelled(vec!["Sync"]).names(), "time_s, Sync, channel_2");
    assert_eq!(labelled(vec!["time_s", "Sync"]).names(), "time_s, channel_1, Sync");
    assert_eq!(labelled(vec!["channel_2", ""]).names(), "time_s, channel_1, channel_2");
    let twice = labelled(vec!["EMG", "EMG"]);
    assert_eq!(
        twice.why_not("EMG"),
        "cannot use column \"EMG\": several channels have this label; they are called channel_1 and channel_2"
    );
}

#[test]
fn a_channel_without_a_sound_scale_cannot_be_used_and_the_others_can() {
    for scale in [0.0, f32::NAN, f32::INFINITY, 1e-30] {
        let read = File::new(INTEL, true).with("ANALOG", "SCALE", Floats(vec![scale, 0.25])).read();
        let table = &read.tables[0];
        assert!(table.why_not("EMG FCR").contains("its ANALOG:SCALE is"), "{}", table.why_not("EMG FCR"));
        assert!(table.column("Sync").is_some());
    }
}

#[test]
fn rates_that_contradict_each_other_are_no_clock() {
    for (file, reason) in [
        (
            File::new(INTEL, true).with("ANALOG", "RATE", Floats(vec![1000.0])),
            "ANALOG:RATE is 1000 Hz, and 2 samples",
        ),
        (File::new(INTEL, true).with("ANALOG", "RATE", Floats(vec![f32::NAN])), "ANALOG:RATE is NaN"),
    ] {
        let read = file.read();
        let why_not = read.tables[0].why_not(TIME_COLUMN);
        assert!(read.tables[0].column(TIME_COLUMN).is_none() && why_not.contains(reason), "{why_not}");
    }
}

#[test]
fn counts_that_contradict_each_other_are_refused() {
    let new = || File::new(INTEL, true);
    for (file, reason) in [
        (new().with("POINT", "FRAMES", Words(vec![4])), "3 frames, 4 are stated: the file is cut off"),
        (new().with("POINT", "FRAMES", Floats(vec![2.5])), "2.5 frames are stated"),
        (new().with("POINT", "FRAMES", Floats(vec![f32::NAN])), "NaN frames are stated"),
        (
            new().with("POINT", "USED", Words(vec![2])),
            "the number of markers is 1 in the header and 2 in POINT:USED",
        ),
        (
            new().with("ANALOG", "USED", Words(vec![3])),
            "the number of analog channels is 2 in the header and 3",
        ),
        (
            new().with("POINT", "DATA_START", Words(vec![9])),
            "the block of the samples is 3 in the header and 9",
        ),
        (new().with("POINT", "SCALE", Floats(vec![1.0])), "whose sign says how samples are stored"),
        (new().with("ANALOG", "SCALE", Floats(vec![1.0])), "1 values in ANALOG:SCALE for 2 analog channels"),
        (new().without("SCALE"), "no ANALOG:SCALE"),
        (File { samples_in_frame: 0, ..new().without("USED") }, "no analog channels, only markers"),
    ] {
        let message = file.refused();
        assert!(message.contains(reason), "{message}");
    }
    // More frames than are stated, beyond the last block.
    let longer = File { samples: vec![1.0; 4 * 40], ..new() };
    assert!(longer.refused().contains("40 frames, 3 are stated: the count is wrong"), "{}", longer.refused());
    // Without POINT:FRAMES, the header counts.
    assert_eq!(new().without("FRAMES").read(), new().read());
    let short = File { frames_in_header: [1, 4], ..new().without("FRAMES") };
    assert!(short.refused().contains("3 frames, 4 are stated"));
}

#[test]
fn a_file_that_is_cut_off_anywhere_is_refused() {
    let whole = File::new(MIPS, true).bytes();
    for length in 0..whole.len() {
        let message = refused(&whole[..length]);
        assert!(message.contains("cut off"), "cut at {length}: {message}");
    }
    assert!(!is_c3d(b"") && !is_c3d(b"\x02") && !is_c3d(b"t,TRIG\n0,1") && !is_c3d(b"\0\x50"));
}

fn small_file() -> impl Strategy<Value = Vec<u8>> {
    (prop::sample::select(vec![INTEL, DEC, MIPS]), any::<bool>())
        .prop_map(|(processor, is_float)| File::new(processor, is_float).bytes())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn bytes_of_any_kind_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..4096)) {
        let _ = read(&bytes, Path::new("a.c3d"));
    }

    #[test]
    fn a_file_with_some_bytes_changed_is_a_table_or_is_refused(
        whole in small_file(),
        changes in prop::collection::vec((0..900usize, any::<u8>()), 1..20),
        length in 0..3000usize,
    ) {
        let mut bytes = whole;
        for (at, value) in changes {
            // Most places are in the header and in the parameters.
            if let Some(byte) = bytes.get_mut(at) {
                *byte = value;
            }
        }
        bytes.truncate(length.max(512));
        if let Ok(read) = read(&bytes, Path::new("a.c3d")) {
            let table = &read.tables[0];
            prop_assert!(table.columns.windows(2).all(|pair| pair[0].1.len() == pair[1].1.len()));
        }
    }
}
