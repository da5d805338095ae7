//! Numbers that the model and the filters are generic over: scalars, vectors of several trials, and both with derivatives.
//!
//! The equations are written once, over [`Number`]. A [`Plain`] number is one value per trial, for one trial (`f64`) or for
//! several at once (vectors); a [`Jet`] carries derivatives besides. All types do the same operations in the same order, and fuse the
//! same multiplications and additions, so a trial's result has the same bits whichever type computed it.

mod elementary;
mod jet;
mod lanes;
mod traits;
#[cfg(target_arch = "x86_64")]
mod vector;

pub use jet::Jet;
pub use lanes::Lanes;
pub use traits::{Number, Plain};
#[cfg(target_arch = "x86_64")]
pub(crate) use vector::{Eight, Four};
