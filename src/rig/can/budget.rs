//! What a cycle costs on the bus, and whether the bus can carry it.

use super::bus::BitRate;
use super::units::BusPeriod;

/// Load that a bus may be given. What is left is for heartbeats, emergencies and the frames of others.
pub const HIGHEST_LOAD: f64 = 0.95;

/// Bits of a data frame with an 11-bit identifier at the worst stuffing, and the space to the next frame.
///
/// 44 bits and 8 a byte; 34 of them and the data can be stuffed, one in four after the first; 3 of space.
pub fn frame_bits(bytes: usize) -> u32 {
    let data = 8 * bytes.min(8) as u32;
    44 + data + (34 + data - 1) / 4 + 3
}

/// The frames of one bus period, and those that come now and then.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Budget {
    lines: Vec<Line>,
}

/// One kind of frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// What it is.
    pub what: String,
    /// Its payload, bytes.
    pub bytes: usize,
    /// How often it comes.
    pub when: When,
}

/// How often a frame comes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum When {
    /// Once each bus period.
    EachPeriod,
    /// Once in so many milliseconds.
    EveryMs(u32),
}

impl Budget {
    /// Adds a kind of frame.
    pub fn add(&mut self, what: impl Into<String>, bytes: usize, when: When) {
        self.lines.push(Line { what: what.into(), bytes, when });
    }

    /// The kinds of frames.
    pub fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// Bits each bus period, without what comes now and then.
    pub fn bits_per_period(&self) -> u32 {
        let each = self.lines.iter().filter(|line| line.when == When::EachPeriod);
        each.map(|line| frame_bits(line.bytes)).sum()
    }

    /// The part of the bus's time that all of it takes, 0 to 1 and beyond.
    pub fn load(&self, period: BusPeriod, bit_rate: BitRate) -> f64 {
        let bits_per_s: f64 = self
            .lines
            .iter()
            .map(|line| {
                let times_per_s = match line.when {
                    When::EachPeriod => 1.0 / period.seconds(),
                    When::EveryMs(ms) => 1e3 / f64::from(ms.max(1)),
                };
                f64::from(frame_bits(line.bytes)) * times_per_s
            })
            .sum();
        bits_per_s / f64::from(bit_rate.bits_per_s())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table of the design: load in percent at 1, 2 and 2.5 kHz and 1 Mbit/s.
    #[test]
    fn the_table_of_loads_is_met() {
        let table: [(&[usize], u32, [u32; 3]); 5] = [
            (&[0, 6, 8], 305, [31, 61, 76]),
            (&[0, 8, 8], 325, [33, 65, 81]),
            (&[0, 8, 8, 8], 460, [46, 92, 115]),
            (&[0, 8, 8, 8, 8], 595, [60, 119, 149]),
            (&[0, 6, 8, 8, 8, 4], 670, [67, 134, 168]),
        ];
        for (frames, bits, percents) in table {
            let mut budget = Budget::default();
            for bytes in frames {
                budget.add("frame", *bytes, When::EachPeriod);
            }
            assert_eq!(budget.bits_per_period(), bits, "{frames:?}");
            for (us, percent) in [1000, 500, 400].into_iter().zip(percents) {
                let load = budget.load(BusPeriod::from_us(us).unwrap(), BitRate::MAX);
                assert_eq!((load * 100.0).round() as u32, percent, "{frames:?} every {us} us");
            }
        }
    }

    #[test]
    fn frames_of_0_1_and_8_bytes_take_55_65_and_135_bits() {
        assert_eq!([0, 1, 8].map(frame_bits), [55, 65, 135]);
    }

    #[test]
    fn what_comes_now_and_then_counts_by_its_own_time() {
        let mut budget = Budget::default();
        budget.add("heartbeat", 1, When::EveryMs(100));
        let load = budget.load(BusPeriod::from_us(1000).unwrap(), BitRate::MAX);
        assert!((load - 650e-6).abs() < 1e-12);
        assert_eq!(budget.bits_per_period(), 0);
    }
}
