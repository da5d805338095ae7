//! The paper's low-pass: a recursive Butterworth filter in second-order sections.
//!
//! Written here rather than taken from a library because the fit runs the same sections over numbers that carry
//! derivatives, several trials at once; the design is checked against scipy's in the tests.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::number::Number;

/// A low-pass filter, as protocols and session files write it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum FilterSpec {
    /// Butterworth low-pass.
    Butterworth {
        /// Order of the filter.
        order: u32,
        /// Cut-off frequency (-3 dB), Hz.
        cutoff_hz: f64,
        /// Applied forwards and backwards.
        #[serde(default)]
        zero_phase: bool,
    },
}

impl FilterSpec {
    /// Orders that a filter may have.
    pub const ORDERS: std::ops::RangeInclusive<u32> = 1..=8;

    /// The paper's: third order, 50 Hz, forwards (section 2.1).
    pub const PAPER: Self = Self::Butterworth { order: 3, cutoff_hz: 50.0, zero_phase: false };

    /// The filter's sections at a sampling rate.
    ///
    /// # Errors
    /// If the order is not 1 to 8, or the cut-off is not between zero and half the rate.
    pub fn sections(&self, sample_rate_hz: f64) -> Result<Vec<Section>, FilterError> {
        let Self::Butterworth { order, cutoff_hz, .. } = *self;
        if !Self::ORDERS.contains(&order) {
            return Err(FilterError::Order(order));
        }
        if !(cutoff_hz > 0.0 && cutoff_hz < 0.5 * sample_rate_hz) {
            return Err(FilterError::Cutoff { cutoff_hz, sample_rate_hz });
        }
        Ok(butterworth(order, cutoff_hz / sample_rate_hz))
    }

    /// Whether it runs forwards and backwards.
    pub fn zero_phase(&self) -> bool {
        let Self::Butterworth { zero_phase, .. } = *self;
        zero_phase
    }
}

/// A filter that cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// Outside 1 to 8.
    #[error("filter order {0}: expected 1 to 8")]
    Order(u32),
    /// Not below half the sampling rate.
    #[error(
        "filter cut-off {cutoff_hz} Hz: expected more than 0 and less than half the sampling rate of {sample_rate_hz} Hz"
    )]
    Cutoff {
        /// The cut-off asked for, Hz.
        cutoff_hz: f64,
        /// The sampling rate, Hz.
        sample_rate_hz: f64,
    },
}

/// One section: y = b0 x + b1 x' + b2 x'' - a1 y' - a2 y''.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Weights of the input and its two predecessors.
    pub b: [f64; 3],
    /// Weights of the two preceding outputs.
    pub a: [f64; 2],
}

/// What a section remembers (transposed direct form II).
#[derive(Debug, Clone, Copy)]
pub struct SectionState<T>([T; 2]);

impl<T: Number> SectionState<T> {
    /// The state after an endless input of zero.
    #[inline(always)]
    pub fn silent() -> Self {
        Self([T::constant(0.0); 2])
    }
}

impl Section {
    /// A first-order low-pass, dy/dt = 2 pi cutoff (x - y), at samples `period_s` apart: exact for an input that is straight between them.
    pub fn first_order_low_pass(cutoff_hz: f64, period_s: f64) -> Self {
        let steps = std::f64::consts::TAU * cutoff_hz * period_s;
        let keep = libm::exp(-steps);
        let mean = -libm::expm1(-steps) / steps;
        Self { b: [1.0 - mean, mean - keep, 0.0], a: [-keep, 0.0] }
    }

    /// The state after an endless input of `level`.
    #[inline(always)]
    pub fn settled<T: Number>(&self, level: T) -> SectionState<T> {
        // Unit gain at zero frequency: the output is the level too.
        let second = level.scale(self.b[2] - self.a[1]);
        SectionState([level.scale(self.b[1] - self.a[0]) + second, second])
    }

    /// The next output.
    #[inline(always)]
    pub fn step<T: Number>(&self, state: &mut SectionState<T>, input: T) -> T {
        let output = state.0[0].add_scaled(input, self.b[0]);
        state.0[0] = input.scale(self.b[1]).add_scaled(output, -self.a[0]) + state.0[1];
        state.0[1] = input.scale(self.b[2]).add_scaled(output, -self.a[1]);
        output
    }
}

/// Butterworth low-pass by the bilinear transform with the cut-off kept; `cutoff` as a fraction of the sampling rate.
fn butterworth(order: u32, cutoff: f64) -> Vec<Section> {
    let warped = libm::tan(std::f64::consts::PI * cutoff);
    let mut sections = Vec::new();
    if order % 2 == 1 {
        let norm = 1.0 / (1.0 + warped);
        sections.push(Section { b: [warped * norm, warped * norm, 0.0], a: [(warped - 1.0) * norm, 0.0] });
    }
    for pair in 0..order / 2 {
        // Poles at the angles (2 pair + 1) pi / (2 order) from the imaginary axis.
        let angle = std::f64::consts::PI * f64::from(2 * pair + 1) / f64::from(2 * order);
        let damping = 2.0 * libm::sin(angle);
        let square = warped * warped;
        let norm = 1.0 / (1.0 + damping * warped + square);
        sections.push(Section {
            b: [square * norm, 2.0 * square * norm, square * norm],
            a: [2.0 * (square - 1.0) * norm, (1.0 - damping * warped + square) * norm],
        });
    }
    sections
}

/// Runs `sections` over `signal`, as if its first value had been there for ever.
pub fn filter(sections: &[Section], signal: &[f64]) -> Vec<f64> {
    let mut output = signal.to_vec();
    for section in sections {
        let mut state = section.settled(output.first().copied().unwrap_or(0.0));
        for value in &mut output {
            *value = section.step(&mut state, *value);
        }
    }
    output
}

/// Runs `forwards` over `signal`, and then `backwards` from its end to its beginning.
pub fn filter_both_ways(forwards: &[Section], backwards: &[Section], signal: &[f64]) -> Vec<f64> {
    let mut output = filter(forwards, signal);
    output.reverse();
    output = filter(backwards, &output);
    output.reverse();
    output
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_filter_has_scipys_coefficients() {
        // scipy.signal.butter(3, 50, fs=2500), impulse response of the first six samples.
        let sections = FilterSpec::PAPER.sections(2500.0).unwrap();
        let mut impulse = vec![0.0; 1000];
        impulse[1] = 1.0;
        let response = filter(&sections, &impulse);
        let expected = SCIPY_IMPULSE;
        for (got, want) in response[1..].iter().zip(expected) {
            assert!((got - want).abs() < 1e-14, "{got} instead of {want}");
        }
        assert!((response.iter().sum::<f64>() - 1.0).abs() < 1e-12, "unit gain at zero frequency");
    }

    const SCIPY_IMPULSE: [f64; 6] = [
        0.00021960621122536214,
        0.0012624800510183237,
        0.0035739537271968496,
        0.007022750976407734,
        0.011250361143480107,
        0.015949501545752438,
    ];

    #[test]
    fn every_order_is_three_decibels_down_at_the_cut_off() {
        for order in 1..=8 {
            let spec = FilterSpec::Butterworth { order, cutoff_hz: 40.0, zero_phase: false };
            let sections = spec.sections(1000.0).unwrap();
            let wave: Vec<f64> =
                (0..5000).map(|i| libm::sin(std::f64::consts::TAU * 40.0 * f64::from(i) / 1000.0)).collect();
            let power: f64 = filter(&sections, &wave)[4000..].iter().map(|y| y * y).sum::<f64>() / 1000.0;
            assert!((power / 0.5 - 0.5).abs() < 1e-3, "order {order}: {power}");
        }
    }

    #[test]
    fn a_constant_passes_unchanged_from_the_first_sample() {
        let sections = FilterSpec::PAPER.sections(2500.0).unwrap();
        for value in filter(&sections, &[2.1; 50]) {
            assert!((value - 2.1).abs() < 1e-12);
        }
    }

    #[test]
    fn a_first_order_low_pass_follows_a_straight_input_exactly() {
        let (cutoff_hz, period_s) = (80.0, 4e-4);
        let section = Section::first_order_low_pass(cutoff_hz, period_s);
        let rate = std::f64::consts::TAU * cutoff_hz;
        let time = |sample: usize| sample as f64 * period_s;
        let input: Vec<f64> = (0..200).map(time).collect();
        for (sample, value) in filter(&[section], &input).into_iter().enumerate() {
            let expected = time(sample) + libm::expm1(-rate * time(sample)) / rate;
            assert!((value - expected).abs() < 1e-12, "{value} instead of {expected}");
        }
    }

    #[test]
    fn impossible_filters_are_refused() {
        let spec = |order, cutoff_hz| FilterSpec::Butterworth { order, cutoff_hz, zero_phase: false };
        assert_eq!(spec(0, 50.0).sections(1000.0), Err(FilterError::Order(0)));
        assert!(matches!(spec(3, 500.0).sections(1000.0), Err(FilterError::Cutoff { .. })));
        assert!(matches!(spec(3, f64::NAN).sections(1000.0), Err(FilterError::Cutoff { .. })));
    }
}
