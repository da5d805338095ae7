//! `ramphold resume`: resumes a session.

use std::path::PathBuf;

use crate::app::{
    Console, ConsoleOptions, Failure, Pace, SessionDescription, SessionRig, SessionRun, SessionStreams,
    finish_session, parse_seed, ran_on_can_motor, stored_streams,
};
use crate::dataset::{self, Disk, Resumable, Resumed};

use super::verb::Verb;

/// Resume a session that was stopped, killed or ended by a fault.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold resume sessions/quick-V00-7\n  ramphold resume sessions/quick-V00-7 --yes\n\n\
                        The trial that was under way is kept with status aborted and is run again later."
)]
pub struct ResumeArgs {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// Confirm that the motor may move, instead of being asked. It does not say where the handle is.
    #[arg(long)]
    yes: bool,
    /// The handle of the motor stands at the start position: take its present place for it. Needed only for a motor that takes
    /// the present place for its start position and cannot show that it still has that of the session.
    #[arg(long)]
    home_here: bool,
    /// Seed that was given to `run --hide`, if the session has a hidden effect.
    #[arg(long, value_name = "SEED", allow_negative_numbers = true, value_parser = parse_seed)]
    hide: Option<u64>,
    /// Run in real time [default: as fast as possible].
    #[arg(long, conflicts_with = "speed")]
    real_time: bool,
    /// Run at this multiple of real time; for a virtual wrist.
    #[arg(long, value_name = "FACTOR")]
    speed: Option<f64>,
    /// The file of liblsl, for the streams of the rig file [default: where the operating system finds it].
    #[arg(long, value_name = "FILE")]
    lsl_library: Option<PathBuf>,
    #[command(flatten)]
    console: ConsoleOptions,
}

impl Verb for ResumeArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let has_console = self.console.check()?;
        let pace = Pace::new(self.real_time, self.speed)?;
        let session = Resumable::open(&self.session, Disk::default())?;
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
        let streams = if session.is_finished() { None } else { self.connect_streams(pace, console)? };
        // The rig is checked before anything in the folder is changed.
        let rig = match session.is_finished() {
            true => None,
            false => Some(SessionRig::of_session(
                &self.session,
                &session,
                pace,
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
            return finish_session(&machine, true, &self.session, console);
        };
        console.message(format_args!("session {}, subject {subject}, seed {seed}", self.session.display()));
        let setup = if has_console {
            let Some(protocol) = dataset::stored_protocol(&self.session)? else {
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
                folder: &self.session,
                earlier_trials: dataset::load(&self.session)?.trials,
            };
            self.console.setup(description, self.yes, rig.may_wait())?
        } else {
            None
        };
        let (folder, options, is_confirmed) = (self.session, &self.console, self.yes);
        SessionRun { folder, rig, machine, recorder, setup, options, is_confirmed, lsl: None, streams }
            .run(console)
    }
}

impl ResumeArgs {
    /// Finds the streams of the session's rig file, if it has any.
    fn connect_streams(&self, pace: Pace, console: &Console) -> Result<Option<SessionStreams>, Failure> {
        let streams = stored_streams(&self.session)?;
        let library = self.lsl_library.as_deref();
        if library.is_some() && streams.is_empty() {
            let why = "nothing needs the library; the rig file of the session has no streams";
            return Err(Failure::Usage(format!("--lsl-library: {why}")));
        }
        let in_real_time = pace.is_real_time() || ran_on_can_motor(&self.session);
        SessionStreams::connect(&streams, library, in_real_time, console)
    }
}
