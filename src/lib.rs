//! Ramp-and-hold experiments on the human wrist, from the protocol to the cause of a misfit.
//!
//! A stiff servo motor holds a wrist, the person pushes with a set torque, the motor extends the wrist with a fast
//! ramp, and the first 40 ms of torque tell how stiff the muscle was and where it yielded
//! (de Vlugt et al. 2011, *Short range stiffness elastic limit depends on joint velocity*).
//!
//! Data walks one way through the modules, and each knows only those above it:
//!
//! | noun | module | what it is |
//! |---|---|---|
//! | protocol | [`protocol`] | what the experimenter writes, checked at the door |
//! | schedule | [`schedule`] | the order of the trials, drawn from a seed |
//! | wrist | [`wrist`] | Eq. 1-7 of the paper and the mechanisms that may be missing from them |
//! | session | [`session`] | the experiment as a state machine, stepped once a sample |
//! | rig | [`rig`] | what moves the wrist and measures it: virtual, or a motor on a CAN bus |
//! | dataset | [`dataset`] | session folders: reading what was measured, writing what was run |
//! | signal | [`signal`] | the filter, the onset, the noise of the hold |
//! | fit | [`fit`] | the wrist's parameters out of the recorded torque, and how well they are known |
//! | diagnosis | [`diagnose`] | what the model gets wrong, why, and what mending it gains |
//! | report | [`report`] | figures and tables of a session for a person |
//! | console | [`console`] | what operator and person see while a session runs, and how the operator is heard |
//! | statistics | [`statistics`] | what a table of many persons says |
//! | study | [`study`] | many persons through one protocol |
//! | export | [`export`] | sessions in the formats of other tools |
//!
//! SI units throughout; a field's name carries its unit. The ramp is positive and so is the resistance to it.

pub mod console;
pub mod dataset;
pub mod diagnose;
pub mod export;
pub mod fit;
pub mod number;
pub mod protocol;
pub mod random;
pub mod report;
pub mod rig;
pub mod schedule;
pub mod session;
pub mod signal;
pub mod statistics;
pub mod study;
pub mod wrist;
