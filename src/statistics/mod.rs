//! What a study's tables say of its persons: analysis of variance, contrasts, trends, reliability, group comparisons.
//!
//! Pure functions of numbers. All tests of one group rest on [`Moments`], the means and covariances of the cells over the
//! persons, which are gathered person by person: a study of a million persons takes the memory of one of two.

mod anova;
mod distribution;
mod groups;
mod holm;
mod moments;
mod reliability;

pub use anova::{Design, Effect, Mauchly, anova};
pub use distribution::{chi_square_tail, f_tail, t_quantile, t_two_sided, wilson};
pub use groups::{Sample, welch};
pub use holm::holm;
pub use moments::{Contrast, Moments};
pub use reliability::{Reliability, reliability};

#[cfg(test)]
mod tests;
