//! The marginal likelihood of a session whose torque is linear in what is unknown.
//!
//! Own coordinates of the trials are random effects: a trial lies about its condition, a condition about a regression on log velocity
//! and log torque. Everything is Gaussian given the spreads, so that the integral over all unknowns is a determinant. The precision
//! matrix of the unknowns is an arrowhead: trials are blocks, then the means of conditions; regression and common coordinates are the
//! border.

mod added_column;
mod arrowhead;
mod block_columns;
mod design;
mod expected_squares;
mod products;
mod quadratic;
mod spreads;
#[cfg(test)]
mod tests;

pub use design::{Design, Point, REGRESSORS, cost};
pub use products::{Products, ResidualProducts};
pub use quadratic::Quadratic;
pub use spreads::{FreeLawPrior, Spreads};
