//! A CiA 402 drive over CANopen, in cyclic synchronous position mode.

mod configure;
mod cyclic;
mod device;
mod homing;
mod object_setup;
mod power;
mod restart;

pub use device::Cia402;
