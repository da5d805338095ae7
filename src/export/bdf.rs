//! Writes 24-bit BDF of Biosemi, the variant of EDF that stores a record without loss.
//!
//! A channel's range is 8 times a power of ten over 8,000,000 steps either way, so that a step is a power of ten: decimals
//! as this program records them are kept to the last digit.

/// Number of steps on each side of zero; 2^23 = 8,388,608 is the most that fits.
const STEPS_PER_SIDE: f64 = 8_000_000.0;

/// The largest power of ten that a range may have; its text has at most 8 characters.
const LARGEST_POWER: i32 = 5;
const SMALLEST_POWER: i32 = -4;

/// One channel of a recording.
#[derive(Debug, Clone)]
pub struct BdfChannel<'a> {
    /// At most 16 ASCII characters.
    pub label: &'static str,
    /// At most 8 ASCII characters.
    pub unit: &'a str,
    /// Its values.
    pub values: &'a [f64],
}

impl BdfChannel<'_> {
    /// Its range: 8 times a power of ten; `Err` with the value that no range holds.
    fn range(&self) -> Result<f64, f64> {
        let most = self.values.iter().fold(0.0, |most, value| f64::max(most, value.abs()));
        let fits = |power: &i32| most <= 8.0 * 10f64.powi(*power);
        (SMALLEST_POWER..=LARGEST_POWER).find(fits).map(|power| 8.0 * 10f64.powi(power)).ok_or(most)
    }
}

/// The largest value that a channel can store.
pub const LARGEST_VALUE: f64 = 8e5;

/// The bytes of a recording.
///
/// # Errors
/// Index of the channel, and its value that is out of range.
pub fn recording(subject: &str, rate_hz: f64, channels: &[BdfChannel]) -> Result<Vec<u8>, (usize, f64)> {
    let samples = channels.first().map_or(0, |channel| channel.values.len());
    let (records, each) = records(samples, rate_hz, channels.len());
    let ranges: Vec<f64> = channels
        .iter()
        .enumerate()
        .map(|(place, channel)| channel.range().map_err(|value| (place, value)))
        .collect::<Result<_, _>>()?;
    let mut bytes = b"\xffBIOSEMI".to_vec();
    text(&mut bytes, subject, 80);
    text(&mut bytes, "", 80);
    // The standard's clipping date: when a person was measured is not this file's business.
    text(&mut bytes, "01.01.85", 8);
    text(&mut bytes, "00.00.00", 8);
    text(&mut bytes, &(256 * (channels.len() + 1)).to_string(), 8);
    text(&mut bytes, "24BIT", 44);
    text(&mut bytes, &records.to_string(), 8);
    text(&mut bytes, &number(each as f64 / rate_hz), 8);
    text(&mut bytes, &channels.len().to_string(), 4);
    let mut field = |width: usize, of: &dyn Fn(usize) -> String| {
        for place in 0..channels.len() {
            text(&mut bytes, &of(place), width);
        }
    };
    field(16, &|place| channels[place].label.into());
    field(80, &|_| String::new());
    field(8, &|place| channels[place].unit.into());
    field(8, &|place| number(-ranges[place]));
    field(8, &|place| number(ranges[place]));
    field(8, &|_| format!("-{STEPS_PER_SIDE}"));
    field(8, &|_| STEPS_PER_SIDE.to_string());
    field(80, &|_| String::new());
    field(8, &|_| each.to_string());
    field(32, &|_| String::new());
    for record in 0..records {
        for (channel, range) in channels.iter().zip(&ranges) {
            for value in &channel.values[record * each..(record + 1) * each] {
                let steps = libm::round(value / range * STEPS_PER_SIDE) as i32;
                bytes.extend_from_slice(&steps.to_le_bytes()[..3]);
            }
        }
    }
    Ok(bytes)
}

/// How many data records, and how many samples of a channel in each: the fewest records of at most 61,440 bytes (as the
/// standard asks) that divide the samples without rest and whose duration has an exact text; one record if there are none.
fn records(samples: usize, rate_hz: f64, channels: usize) -> (usize, usize) {
    let exact = |each: usize| {
        let duration = each as f64 / rate_hz;
        number(duration).parse::<f64>().is_ok_and(|read| read == duration)
    };
    let good = |records: &usize| {
        samples.is_multiple_of(*records)
            && samples / records * channels * 3 <= 61_440
            && exact(samples / records)
    };
    (1..=samples).find(good).map_or((1, samples), |records| (records, samples / records))
}

/// A number in at most 8 characters.
fn number(value: f64) -> String {
    let text = value.to_string();
    if text.len() <= 8 { text } else { text[..8].trim_end_matches('.').to_owned() }
}

/// ASCII, filled with blanks; what is not ASCII becomes an underscore.
fn text(bytes: &mut Vec<u8>, text: &str, width: usize) {
    let ascii = text.chars().map(|c| if c.is_ascii_graphic() || c == ' ' { c as u8 } else { b'_' });
    bytes.extend(ascii.chain(std::iter::repeat(b' ')).take(width));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_is_the_least_that_holds_all_values() {
        let range = |values: &[f64]| BdfChannel { label: "a", unit: "rad", values }.range();
        assert_eq!(
            [range(&[0.14]), range(&[0.8]), range(&[-0.81]), range(&[12.0])],
            [Ok(0.8), Ok(0.8), Ok(8.0), Ok(80.0)]
        );
        assert_eq!(range(&[0.0, 1e9]), Err(1e9));
    }

    #[test]
    fn records_divide_the_samples_without_rest_and_last_an_exact_time() {
        assert_eq!(records(6500, 2500.0, 4), (2, 3250));
        assert_eq!(records(6501, 2500.0, 4), (3, 2167));
        let (records, each) = records(99_991, 2500.0, 4);
        assert_eq!(records * each, 99_991, "a prime number of samples");
    }

    #[test]
    fn headers_and_samples_are_where_the_standard_says() {
        let values = [0.1, -0.2];
        let bytes =
            recording("S01", 1000.0, &[BdfChannel { label: "theta_m", unit: "rad", values: &values }])
                .unwrap();
        assert_eq!(bytes.len(), 512 + 2 * 3);
        assert_eq!(&bytes[..8], b"\xffBIOSEMI");
        assert_eq!(&bytes[512..515], &1_000_000i32.to_le_bytes()[..3]);
        assert_eq!(&bytes[515..518], &(-2_000_000i32).to_le_bytes()[..3]);
    }
}
