//! From raw samples to the values that the fit compares: low-pass filter, onset of the ramp, noise of the hold, sinusoid in the hold.

mod encoder_step;
mod filter;
mod noise_covariance;
mod onset;
mod restoration;
mod sinusoid;

pub use encoder_step::smallest_step;
pub use filter::{FilterError, FilterSpec, Section, SectionState, filter, filter_both_ways};
pub use noise_covariance::NoiseCovariance;
pub use onset::{farthest, onset};
pub use restoration::Restoration;
pub use sinusoid::Sinusoid;

/// A low-pass below this cut-off, Hz, has a time constant above the 40 ms that are analysed after an onset: of a ramp nothing is left in it.
pub const SLOWEST_CUTOFF_HZ: f64 = 1.0 / (std::f64::consts::TAU * 0.040);
