//! Statistics that several parts of the program share, as pure functions of numbers.
//!
//! The tests of a study's tables (analysis of variance, contrasts, reliability, comparison of two groups) rest on [`MeanCovariance`]
//! and [`MeanVariance`], which take in one subject at a time: a study of a million subjects needs no more memory than one of two.
//! Fit, diagnosis and report share [`group_indices`], [`upper_median`], [`probabilities`], [`log_determinant_of_factor`] and the linear regressions of `least_squares`.

mod bayes_factor;
mod correlation;
mod determinant;
mod distribution;
mod groups;
mod least_squares;
mod moments;
mod multiple_testing;
mod order;
mod probabilities;
mod reliability;
mod repeated_measures_anova;
mod welch;

pub use bayes_factor::largest_posterior;
pub use correlation::rank_correlation;
pub use determinant::log_determinant_of_factor;
pub use distribution::{
    HALF_INTERVAL_95, SD_BY_MEDIAN, chi_square_tail, f_tail, t_quantile, t_two_sided, wilson,
};
pub use groups::group_indices;
pub use least_squares::{WeightedRegression, slope_through_origin};
pub use moments::{Contrast, MeanCovariance, MeanVariance};
pub use multiple_testing::holm;
pub use order::upper_median;
pub use probabilities::probabilities;
pub use reliability::{Reliability, reliability};
pub use repeated_measures_anova::{AnovaEffect, FactorLevels, Mauchly, anova};
pub use welch::welch;

#[cfg(test)]
mod tests;
