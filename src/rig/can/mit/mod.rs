//! MIT mode: the frame of the mini-cheetah's motors, which CubeMars' AK series speaks, too. One frame to the motor, one
//! back. Such a motor has no limits that could be written or read; what can be known of it is proved by a small motion.
//!
//! ```text
//! adapter   what the cycle asks of a motor
//! proof     the small motion: are the ranges those of the rig file, does the motor's own watchdog let go
//! device    what it was told, what it reported
//! trusted_motion    which replies are believed, and how far off the shaft may be all the same
//! frame     fields and their ranges
//! ```

mod adapter;
mod device;
mod frame;
mod proof;
mod trusted_motion;

pub use device::Mit;
pub(super) use device::check_gains;
