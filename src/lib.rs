//! Ramp-and-hold experiments on the human wrist: run the protocol, fit the wrist model, find what the model gets wrong.
//!
//! A stiff servo motor holds the wrist of a subject. The subject pushes against it with a target torque. The motor then
//! extends the wrist with a fast ramp, and the first 40 ms of torque show how stiff the muscle is and where it yields
//! (de Vlugt et al. 2011, *Short range stiffness elastic limit depends on joint velocity*).
//!
//! # The nouns
//!
//! - A **protocol** says which ramps at which torques a session has, and under which conditions a ramp may start.
//! - A **schedule** is the order of the trials, drawn from a seed.
//! - A **rig** moves the wrist and measures it: a virtual wrist, or a motor on a CAN bus.
//! - A **session** is the experiment as it runs: a state machine that is stepped once per sample.
//! - A **dataset** is the folder of a session: journal, trials and signals.
//! - A **fit** estimates the parameters of the wrist model from the recorded torque.
//! - A **diagnosis** tests the residuals of a fit and names the **mechanisms** that the model lacks.
//! - A **study** is many subjects through one protocol.
//!
//! # From protocol to diagnosis
//!
//! ```
//! use ramphold::diagnose::{DiagnosisInput, Verdict, diagnose};
//! use ramphold::fit::{Fit, Model, PreprocessingSettings, Weighting, estimates_without_profiles};
//! use ramphold::protocol::Protocol;
//! use ramphold::rig::virtual_wrist::{Person, Setup};
//! use ramphold::schedule;
//! use ramphold::study::{SessionStorage, Unit, UnitSource, simulate_unit};
//!
//! let protocol = Protocol::parse(include_str!("../protocols/quick.json"), "quick.json")?;
//! let order = schedule::draw(&protocol, 1, None)?;
//! assert_eq!(order.len(), 8);
//!
//! // The session of a virtual subject, simulated in memory.
//! let source = UnitSource::Virtual {
//!     protocol: &protocol,
//!     setup: &Setup::default(),
//!     person: Box::new(Person::default()),
//!     seed: 1,
//!     order_number: 1,
//! };
//! let unit = Unit { index: 0, subject: "V00".into(), session: 1, is_excluded: false, source };
//! let session = simulate_unit(&unit, SessionStorage::Memory)?.ok_or("the unit is virtual")?;
//!
//! // The fit: one set of parameters for each trial.
//! let settings = PreprocessingSettings::of(&protocol);
//! let input = DiagnosisInput::new(&session, settings, &Model::paper())?;
//! let fit = Fit::new(&input.observations, &Model::paper(), Weighting::default());
//! let estimates = estimates_without_profiles(&input.observations, &fit);
//! assert!(estimates.iter().all(|trial| trial.vaf > 0.9));
//!
//! // The diagnosis. The virtual wrist follows the model here, so no mechanism is missing.
//! let diagnosis = diagnose(&input, &Model::paper(), 1, &|_stage| ());
//! assert_eq!(diagnosis.verdict, Verdict::Adequate);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The modules
//!
//! Each module imports only modules above it. `docs/explanation/architecture.md` says which ones, and a test compares it
//! with the code.
//!
//! | noun | module | what it is |
//! |---|---|---|
//! | file | [`files`] | the only place that opens files: no links, no devices, limits of size |
//! | JSON file | [`json_file`] | JSON for people: reads files, with errors that name the file, the line and the field, and writes values |
//! | number | [`number`] | numbers with derivatives, and vectors of numbers |
//! | random numbers | [`random`] | streams of random numbers, one for each purpose, all derived from one seed |
//! | statistics | [`statistics`] | tests, intervals and medians |
//! | signal | [`signal`] | the low-pass filter, the onset of the ramp, the noise of the hold |
//! | wrist | [`wrist`] | the wrist model, Eq. 1-7 of the paper, and the mechanisms that may be missing from it |
//! | protocol | [`protocol`] | the protocol file: its fields, its schema, its validation |
//! | schedule | [`schedule`] | the order of the trials, drawn from a seed |
//! | timing | [`timing`] | the clock, a periodic timer, a histogram of how late it was, and the times of samples |
//! | rig | [`rig`] | what moves the wrist and measures it: the virtual wrist, or a motor on a CAN bus |
//! | session | [`session`] | the experiment as a state machine, and the control loop around it |
//! | dataset | [`dataset`] | session folders: writing what is run, reading what was measured |
//! | consistency | [`consistency`] | what the signals of a session say against its table |
//! | lsl | [`lsl`] | a running session as streams of Lab Streaming Layer, and streams that are recorded with it |
//! | import | [`import`] | sessions from foreign recordings |
//! | attach | [`attach`] | recordings of other devices, aligned with the trials of a session |
//! | calibration | [`calibrate`] | the constants of the rig from trials without a person, and whether they are those of another day |
//! | fit | [`fit`] | the wrist's parameters from the recorded torque, and their uncertainty |
//! | diagnosis | [`diagnose`] | what the model gets wrong, why, and what adding a mechanism gains |
//! | study | [`study`] | many subjects through one protocol |
//! | report | [`report`] | figures and tables of a session or a study |
//! | console | [`console`] | what operator and subject see while a session runs, and the operator's commands |
//! | export | [`export`] | sessions in the formats of other tools |
//! | application | [`app`] | what the verbs share: messages, errors, folders, seeds |
//! | command line | [`cli`] | the command line, one file per verb |
//!
//! All values are in SI units, and the name of a field contains its unit. The ramp is positive, and a torque that resists
//! the ramp is positive.

pub mod app;
pub mod attach;
pub mod calibrate;
pub mod cli;
pub mod consistency;
pub mod console;
pub mod dataset;
pub mod diagnose;
pub mod export;
pub mod files;
pub mod fit;
pub mod import;
pub mod json_file;
pub mod lsl;
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
