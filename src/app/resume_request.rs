//! A session that goes on after any end, as the operator asks for it on the command line or in the page of a laboratory.

use std::path::Path;

use crate::dataset::{self, Disk, Resumable, Resumed};

use super::session_rig::{ran_on_can_motor, stored_streams};
use super::{
    Console, ConsoleOptions, Failure, Pace, SessionDescription, SessionRig, SessionRun, SessionStreams,
    finish_session,
};

/// What is asked of a session that goes on.
pub struct ResumeRequest<'a> {
    /// The session's folder.
    pub session: &'a Path,
    /// Whether arming a motor was confirmed on the command line.
    pub is_confirmed: bool,
    /// Whether the present place of the motor's handle is taken for the start position.
    pub home_here: bool,
    /// Seed of the effect that is hidden in the virtual wrist.
    pub hide: Option<u64>,
    /// Speed on the virtual wrist.
    pub pace: Pace,
    /// The file of liblsl; without one, it is where the operating system finds it.
    pub lsl_library: Option<&'a Path>,
    /// Options of the console.
    pub console: &'a ConsoleOptions,
}

impl ResumeRequest<'_> {
    /// Runs the session to its end and makes its results. One that is complete makes a message.
    ///
    /// # Errors
    /// If the session cannot be resumed, before anything in its folder is changed; or if it fails.
    pub fn run(self, console: &Console) -> Result<(), Failure> {
        let has_console = self.console.check()?;
        let session = Resumable::open(self.session, Disk::default())?;
        if session.is_complete() {
            let folder = self.session.display();
            console.message(format_args!(
                "every trial is done and the results are complete; nothing was changed. To make the results again: \
                 ramphold fit {folder}"
            ));
            return Ok(());
        }
        if session.lacks_sums() {
            console.message(
                "the journal was begun by an older version, which did not note what the files of the session were; whether \
                 rig, order and subject are those of the beginning cannot be told. From now on the journal has it",
            );
        }
        let (subject, seed) = (session.subject().to_owned(), session.seed());
        // Before the bus of a motor is open: from then on, somebody must listen to it.
        let streams = if session.is_finished() { None } else { self.connect_streams(console)? };
        // The rig is checked before anything in the folder is changed.
        let rig = match session.is_finished() {
            true => None,
            false => Some(SessionRig::of_session(
                self.session,
                &session,
                self.pace,
                self.hide,
                self.home_here,
                console,
            )?),
        };
        if let Some(rig) = &rig {
            rig.check_operator(has_console, session.rig_trials_due())?;
        }
        let Resumed { recorder, machine, interrupted, torn } = session.resume()?;
        if let Some(torn) = torn {
            console.message(format_args!(
                "the journal is damaged at its end, from byte {}: {} bytes were cut off ({})",
                torn.offset, torn.length, torn.reason
            ));
        }
        if let Some(trial) = interrupted {
            let kind = if trial.is_rig_trial { "rig trial" } else { "trial" };
            console.message(format_args!(
                "{kind} {} was under way: its {} samples are kept with status aborted, and it is run again later",
                trial.number, trial.samples
            ));
        }
        let Some(rig) = rig else {
            console.message("every trial is done; making the results");
            drop(recorder);
            return finish_session(&machine, true, self.session, console);
        };
        console.message(format_args!("session {}, subject {subject}, seed {seed}", self.session.display()));
        let setup = if has_console {
            let Some(protocol) = dataset::stored_protocol(self.session)? else {
                let session = self.session.display();
                return Err(Failure::Usage(format!("{session}: has no protocol.json; put it back")));
            };
            let description = SessionDescription {
                protocol: &protocol,
                subject: &subject,
                lever: rig.lever(),
                recorded_filter: rig.recorded_filter(),
                rig: rig.name(),
                questions: rig.questions(),
                folder: self.session,
                earlier_trials: dataset::load(self.session)?.trials,
            };
            self.console.setup(description, self.is_confirmed, rig.may_wait())?
        } else {
            None
        };
        let (folder, options, is_confirmed) = (self.session.to_owned(), self.console, self.is_confirmed);
        SessionRun { folder, rig, machine, recorder, setup, options, is_confirmed, lsl: None, streams }
            .run(console)
    }

    /// Finds the streams of the session's rig file, if it has any.
    fn connect_streams(&self, console: &Console) -> Result<Option<SessionStreams>, Failure> {
        let streams = stored_streams(self.session)?;
        if self.lsl_library.is_some() && streams.is_empty() {
            let why = "nothing needs the library; the rig file of the session has no streams";
            return Err(Failure::Usage(format!("--lsl-library: {why}")));
        }
        let in_real_time = self.pace.is_real_time() || ran_on_can_motor(self.session)?;
        SessionStreams::connect(&streams, self.lsl_library, in_real_time, console)
    }
}
