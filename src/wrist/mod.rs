//! The wrist model: Eq. 1-7 of de Vlugt et al. 2011, and the mechanisms that it may lack.
//!
//! Written once, over any [`Number`]: plain, with derivatives, several trials at once. The virtual wrist advances it sample
//! by sample, the fit and the diagnosis run whole trials through [`simulate`].

pub mod mechanisms;

mod coefficient;
mod elementary;
mod group;
mod integrate;
mod jet;
mod motion;
mod number;
mod plant;
mod simulate;
#[cfg(test)]
mod tests;
mod trace;
#[cfg(target_arch = "x86_64")]
mod vector;

pub use coefficient::{Coefficient, Coefficients, Mixed, Separate};
pub use integrate::{Drive, Given, Glide, LONGEST_STEP, Varied, Walk, substeps};
pub use jet::Jet;
pub use motion::{Smoothing, knots, servo_response};
pub use number::{Number, Plain};
pub use plant::{
    BASE_PARAMETERS, JOINT_DAMPING_NM_S_PER_RAD, Knot, Lever, LeverCoefficients, MEMORY, Mechanics, Moment,
    Plant, State, Torques, YIELD_SMOOTHNESS_PER_NM,
};
pub use simulate::{Request, Response, Trial, Width, simulate};
pub use trace::{Instant, srs_period_s, trace};
