//! Recordings that are made chunk by chunk, and recordings that are wrong.

use super::*;

fn chunk(bytes: &mut Vec<u8>, tag: u16, content: &[u8]) {
    bytes.push(4);
    bytes.extend_from_slice(&(content.len() as u32 + 2).to_le_bytes());
    bytes.extend_from_slice(&tag.to_le_bytes());
    bytes.extend_from_slice(content);
}

fn stream_header(bytes: &mut Vec<u8>, id: u32, name: &str, kind: &str, count: &str) {
    let xml = format!(
        "<?xml version=\"1.0\"?><info><name>{name}</name><channel_count>{count}</channel_count>\
         <nominal_srate>100</nominal_srate><channel_format>{kind}</channel_format></info>"
    );
    chunk(bytes, 2, &[&id.to_le_bytes(), xml.as_bytes()].concat());
}

/// Offsets of a clock that is slow by 40 ppm, every 5 s, with noise of 0.2 ms.
fn offsets(seed: u64) -> Vec<(f64, f64)> {
    let mut stream = crate::random::Stream::new(seed, "offsets");
    (0..60).map(|at| 5.0 * f64::from(at)).map(|t| (t, 3.0 + 4e-5 * t + 2e-4 * stream.normal())).collect()
}

#[test]
fn a_clock_that_began_anew_is_noticed_and_one_that_drifts_or_was_measured_late_is_not() {
    for seed in 0..20 {
        let mut own = offsets(seed);
        own[7].1 += 0.08;
        own[59].1 -= 0.05;
        assert_eq!(clock_step(&own), None, "seed {seed}");
        own[30..].iter_mut().for_each(|pair| pair.1 -= 0.1);
        let (at_s, step_s) = clock_step(&own).unwrap();
        assert!(at_s == 145.0 && (step_s + 0.1).abs() < 2e-3, "{at_s} {step_s}");
    }
    assert_eq!(clock_step(&[]), None);
    assert_eq!(clock_step(&[(0.0, 1.0), (5.0, 1.1)]), None);
}

/// A stream of two channels whose clock is 5 s behind, and markers.
fn file() -> Vec<u8> {
    let mut bytes = b"XDF:".to_vec();
    chunk(&mut bytes, 1, b"<?xml version=\"1.0\"?><info><version>1.0</version></info>");
    stream_header(&mut bytes, 1, "EMG", "int16", "2");
    stream_header(&mut bytes, 2, "markers", "string", "1");
    let mut content = 1u32.to_le_bytes().to_vec();
    content.extend_from_slice(&[1, 3, 8]);
    content.extend_from_slice(&10.0f64.to_le_bytes());
    content.extend([7i16, -8].into_iter().flat_map(i16::to_le_bytes));
    for value in [9i16, 11] {
        content.push(0);
        content.extend([value, -value].into_iter().flat_map(i16::to_le_bytes));
    }
    chunk(&mut bytes, 3, &content);
    for time in [9.0f64, 11.0] {
        let content = [1u32.to_le_bytes().as_slice(), &time.to_le_bytes(), &5.0f64.to_le_bytes()].concat();
        chunk(&mut bytes, 4, &content);
    }
    let mut content = 2u32.to_le_bytes().to_vec();
    content.extend_from_slice(&[1, 1, 8]);
    content.extend_from_slice(&15.01f64.to_le_bytes());
    content.extend_from_slice(&[1, 5]);
    content.extend_from_slice(b"onset");
    chunk(&mut bytes, 3, &content);
    bytes
}

#[test]
fn streams_are_on_the_clock_of_the_recorder_and_texts_are_markers() {
    let read = read(&file(), Path::new("a.xdf")).unwrap();
    let [table] = read.tables.as_slice() else { panic!("{:?}", read.tables) };
    let times = table.column(TIME_COLUMN).unwrap();
    assert!(times.iter().zip([15.0, 15.01, 15.02]).all(|(a, b)| (a - b).abs() < 1e-9), "{times:?}");
    assert_eq!(table.column("channel_2").unwrap(), [-8.0, -9.0, -11.0]);
    assert_eq!(read.markers, [Marker { time_s: 15.01, text: "onset".into() }]);
}

#[test]
fn files_that_are_cut_off_anywhere_or_lie_about_their_counts_are_refused_or_end_at_a_chunk() {
    let whole = file();
    let ends: Vec<usize> = {
        let mut cursor = Cursor(&whole[4..]);
        let mut ends = vec![4];
        while let Some(length) = cursor.length() {
            cursor.take(length);
            ends.push(whole.len() - cursor.0.len());
        }
        ends
    };
    for length in 4..whole.len() {
        assert_eq!(
            read(&whole[..length], Path::new("a.xdf")).is_ok(),
            ends.contains(&length),
            "cut at {length}"
        );
    }
    for (kind, count, words) in [
        ("int16", "99999999", "it has 99999999 channels"),
        ("int16", "-1", "its channel_count is"),
        ("complex", "1", "its channel_format is \"complex\""),
    ] {
        let mut bytes = b"XDF:".to_vec();
        stream_header(&mut bytes, 1, "EMG", kind, count);
        let message = read(&bytes, Path::new("a.xdf")).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
    // A chunk that says that it has 2^60 samples.
    let mut bytes = b"XDF:".to_vec();
    stream_header(&mut bytes, 1, "EMG", "int8", "1");
    let content = [1u32.to_le_bytes().as_slice(), &[8], &(1u64 << 60).to_le_bytes()].concat();
    chunk(&mut bytes, 3, &content);
    let message = read(&bytes, Path::new("a.xdf")).unwrap_err().to_string();
    assert!(message.contains("not as its header says"), "{message}");
}

#[test]
fn a_clock_that_jumps_back_is_refused() {
    let mut bytes = b"XDF:".to_vec();
    stream_header(&mut bytes, 1, "EMG", "int8", "1");
    let mut content = 1u32.to_le_bytes().to_vec();
    content.extend_from_slice(&[1, 2]);
    for time in [10.0f64, 9.0] {
        content.push(8);
        content.extend_from_slice(&time.to_le_bytes());
        content.push(1);
    }
    chunk(&mut bytes, 3, &content);
    let message = read(&bytes, Path::new("a.xdf")).unwrap_err().to_string();
    assert!(message.contains("stream \"EMG\", sample 2: time goes from 10 to 9 s"), "{message}");
}
