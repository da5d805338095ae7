//! From raw samples to what the fit compares: the filter, the onset, the noise of the hold.

mod filter;

pub use filter::{FilterError, FilterSpec, Section, SectionState, filter, filter_both_ways};
