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
//! | random numbers | [`random`] | streams of random numbers, one for each purpose, all derived from one seed |
//! | wrist | [`wrist`] | the wrist model, Eq. 1-7 of the paper, and the mechanisms that may be missing from it |
//! | signal | [`signal`] | the low-pass filter, the onset of the ramp, the noise of the hold |
//! | protocol | [`protocol`] | the protocol file: its fields, its schema, its validation |
//! | schedule | [`schedule`] | the order of the trials, drawn from a seed |
//! | time | [`timing`] | the clock, a periodic timer, and a histogram of how late it was |
//! | rig | [`rig`] | what moves the wrist and measures it: the virtual wrist, or a motor on a CAN bus |
//! | session | [`session`] | the experiment as a state machine; the control loop around it |
//! | dataset | [`dataset`] | session folders: writing what is run, reading what was measured |
//! | statistics | [`statistics`] | tests and intervals for tables of many subjects |
//! | fit | [`fit`] | the wrist's parameters from the recorded torque, and their uncertainty |
//! | diagnosis | [`diagnose`] | what the model gets wrong, why, and what adding a mechanism gains |
//! | report | [`report`] | figures and tables of a session |
//! | console | [`console`] | what operator and subject see while a session runs, and the operator's commands |
//! | study | [`study`] | many subjects through one protocol |
//! | export | [`export`] | sessions in the formats of other tools |
//! | application | [`app`] | what the verbs share: messages, errors, folders, seeds |
//! | command line | [`cli`] | the command line, one file per verb |
//!
//! SI units throughout; a field's name carries its unit. The ramp is positive and so is the resistance to it.

// The program is part of the library, so that its command line can be documented and tested from outside.
extern crate self as ramphold;

pub mod app;
pub mod cli;
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
pub mod timing;
pub mod wrist;
