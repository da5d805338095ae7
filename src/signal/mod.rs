//! From raw samples to what the fit compares: the filter, the onset, the noise of the hold.

mod filter;
mod hum;
mod noise_covariance;
mod onset;

pub use filter::{FilterError, FilterSpec, Section, SectionState, filter, filter_both_ways};
pub use hum::Sinusoid;
pub use noise_covariance::NoiseCovariance;
pub use onset::onset;
