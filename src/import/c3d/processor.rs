//! Number formats of the computers on which C3D files are written.

/// Kind of computer whose number formats a file has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Processor {
    /// Lowest byte first, IEEE 754.
    Intel,
    /// Lowest byte first, VAX F_floating.
    Dec,
    /// Highest byte first, IEEE 754.
    Mips,
}

impl Processor {
    /// The processor with this number in the parameter section.
    pub fn numbered(number: u8) -> Option<Self> {
        match number {
            84 => Some(Self::Intel),
            85 => Some(Self::Dec),
            86 => Some(Self::Mips),
            _ => None,
        }
    }

    /// An integer without sign.
    pub fn word(self, bytes: [u8; 2]) -> u16 {
        match self {
            Self::Intel | Self::Dec => u16::from_le_bytes(bytes),
            Self::Mips => u16::from_be_bytes(bytes),
        }
    }

    /// A floating-point number; NaN for the reserved values of the VAX.
    pub fn float(self, bytes: [u8; 4]) -> f64 {
        match self {
            Self::Intel => f64::from(f32::from_le_bytes(bytes)),
            Self::Mips => f64::from(f32::from_be_bytes(bytes)),
            Self::Dec => {
                let [a, b, c, d] = bytes;
                vax_float(u32::from_le_bytes([c, d, a, b]))
            }
        }
    }
}

/// The number with this sign, exponent and fraction: 0.1fraction times two to the power of exponent - 128.
fn vax_float(bits: u32) -> f64 {
    let is_negative = bits >> 31 == 1;
    let exponent = (bits >> 23 & 0xff) as i32;
    let fraction = f64::from(bits & 0x7f_ffff | 0x80_0000) / f64::from(1 << 24);
    match (exponent, is_negative) {
        (0, false) => 0.0,
        (0, true) => f64::NAN,
        (_, false) => libm::ldexp(fraction, exponent - 128),
        (_, true) => -libm::ldexp(fraction, exponent - 128),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values from "VAX Architecture Reference Manual", F_floating.
    #[test]
    fn numbers_of_a_vax_have_their_words_exchanged_and_another_exponent() {
        for (bytes, value) in [
            ([0x80, 0x40, 0, 0], 1.0),
            ([0x80, 0xc0, 0, 0], -1.0),
            ([0x00, 0x40, 0, 0], 0.5),
            ([0x49, 0x41, 0xdb, 0x0f], f64::from(std::f32::consts::PI)),
            ([0, 0, 0, 0], 0.0),
        ] {
            assert_eq!(Processor::Dec.float(bytes), value);
        }
        assert!(Processor::Dec.float([0, 0x80, 0, 0]).is_nan());
        // The largest number has an exponent that says infinity in IEEE 754.
        let largest = Processor::Dec.float([0xff, 0x7f, 0xff, 0xff]);
        assert!((largest / 1.701_411_83e38 - 1.0).abs() < 1e-7, "{largest}");
    }

    #[test]
    fn bytes_are_in_the_order_of_the_processor() {
        assert_eq!(
            [Processor::Intel, Processor::Dec, Processor::Mips].map(|own| own.word([1, 2])),
            [513, 513, 258]
        );
        assert_eq!(Processor::Intel.float([0, 0, 0xc8, 0x42]), 100.0);
        assert_eq!(Processor::Mips.float([0x42, 0xc8, 0, 0]), 100.0);
    }
}
