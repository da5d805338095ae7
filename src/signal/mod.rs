//! From raw samples to the values that the fit compares: low-pass filter, onset of the ramp, noise of the hold, sinusoid in the hold.

mod filter;
mod noise_covariance;
mod onset;
mod sinusoid;

pub use filter::{FilterError, FilterSpec, Section, SectionState, filter, filter_both_ways};
pub use noise_covariance::NoiseCovariance;
pub use onset::onset;
pub use sinusoid::Sinusoid;
