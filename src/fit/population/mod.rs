//! The model of a session: the parameters of each trial are a person's, and vary around a regression on velocity and torque.
//!
//! At low velocities, two places of the yield explain a window within the noise. A trial that decides alone takes the wrong one now
//! and then; the other trials of the session know better. For trial i of condition c and each of its own parameters (on a log scale)
//!
//! ```text
//! y_i       = f(theta_i) + e_i,        e_i ~ N(0, S_i)      the wrist model and the measured noise
//! theta_i   = mu_c + t_i,              t_i ~ Student t(4), scale tau     one trial and another
//! mu_c      = B z_c + u_c,             u_c ~ N(0, omega^2)               a condition and the regression
//! z_c       = 1, log velocity, log torque
//! ```
//!
//! tau, omega and B are estimated by marginal likelihood (EM) with weak priors. Each trial enters as a mixture of its optima, each
//! approximated by a quadratic (Laplace).

mod convergence;
pub mod hierarchy;
pub mod no_session_model;
pub mod other_optimum;
mod session_equations;
pub mod session_fit;
pub mod session_place;
pub mod session_priors;
mod skewness;
mod summary;
mod trial_blocks;
pub mod trial_groups;
