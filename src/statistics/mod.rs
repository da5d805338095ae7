//! What a study's tables say of its persons: analysis of variance, contrasts, trends, reliability, group comparisons.
//!
//! Pure functions of numbers. All tests of one group rest on [`Moments`], the means and covariances of the cells over the
//! persons, which are gathered person by person: a study of a million persons takes the memory of one of two.

mod distribution;
mod moments;
mod multiple_testing;
mod reliability;
mod repeated_measures_anova;
mod two_groups;

pub use distribution::{chi_square_tail, f_tail, t_quantile, t_two_sided, wilson};
pub use moments::{Contrast, Moments};
pub use multiple_testing::holm;
pub use reliability::{Reliability, reliability};
pub use repeated_measures_anova::{Design, Effect, Mauchly, anova};
pub use two_groups::{Sample, welch};

#[cfg(test)]
mod tests;
