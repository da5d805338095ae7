//! Runs a session, new or resumed, on any rig, with or without a console, and makes its results.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::console::{CommandQuestions, ConsoleSetup, Live, OperatorNotice, SETS_ORIGIN_HERE};
use crate::dataset::{BackgroundRecorder, Recorder};
use crate::lsl::{LslClock, LslFeed, LslPublisher, WatchedRig};
use crate::rig::Rig;
use crate::session::{Machine, Operator, Pacing, RealTime, Unpaced, run_control_loop};

use super::command_line_operator::CommandLineOperator;
use super::day_check::DayCheck;
use super::motor_operator::MotorOperator;
use super::session_rig::write_bus_summary;
use super::session_streams::{RecordedStreams, SessionStreams};
use super::signals::{stop_on_signals, stop_when_suspended};
use super::{Console, ConsoleOptions, Failure, Pace, SessionRig, finish_session};

/// A session that is about to run.
pub struct SessionRun<'a> {
    /// The session's folder.
    pub folder: PathBuf,
    /// Rig that the session runs on.
    pub rig: SessionRig,
    /// State machine of the session.
    pub machine: Machine,
    /// Recorder of the session.
    pub recorder: Recorder,
    /// Console of the session, if it has one.
    pub setup: Option<ConsoleSetup>,
    /// Options of the console.
    pub options: &'a ConsoleOptions,
    /// Whether the first arming of a motor was confirmed on the command line.
    pub is_confirmed: bool,
    /// The session's streams of Lab Streaming Layer, if it is published.
    pub lsl: Option<(LslPublisher, LslFeed)>,
    /// The streams that are recorded with it, if its rig file has any.
    pub streams: Option<SessionStreams>,
}

impl SessionRun<'_> {
    /// Runs the session until it is over, fits it if it is finished, and shows the outcome in the console.
    ///
    /// # Errors
    /// If the session cannot be recorded, ends before its last trial, or cannot be fitted.
    pub fn run(self, console: &Console) -> Result<(), Failure> {
        let folder = self.folder.clone();
        let stop = stop_on_signals()?;
        let (machine, live) = self.run_to_the_end(stop, console)?;
        let finished = finish_session(&machine, false, &folder, console);
        if let Some(live) = live {
            live.close(&match &finished {
                Ok(()) => format!("the results are in {}", folder.join("results").display()),
                Err(failure) => failure.to_string(),
            });
        }
        finished
    }

    /// Runs the session; the console stays open for the closing message.
    fn run_to_the_end(
        self,
        stop: Arc<AtomicBool>,
        console: &Console,
    ) -> Result<(Machine, Option<Live>), Failure> {
        let Self { folder, rig, mut machine, recorder, setup, options, is_confirmed, lsl, streams } = self;
        let (publisher, feed) = lsl.unzip();
        let rate_hz = machine.settings().sample_rate_hz;
        let work = Work {
            machine: &mut machine,
            recorder,
            folder: &folder,
            setup,
            options,
            console,
            stop: stop.clone(),
            lsl: feed,
            streams,
        };
        let live = match rig {
            SessionRig::Virtual { wrist, pace: Pace::Unlimited, .. } => work.without_deadlines(*wrist)?,
            SessionRig::Virtual { wrist, pace: pace @ Pace::TimesRealTime(speed), .. } => {
                let mut pacing = RealTime::new(speed * rate_hz);
                let operator = |machine: &Machine| CommandLineOperator::new(stop, machine, console);
                // Only at real time is a second of the session one of the clocks.
                let ended = work.with_deadlines(*wrist, &mut pacing, pace.is_real_time(), operator);
                console.message(pacing.lateness());
                ended?.1
            }
            SessionRig::Can(mut motor) => {
                stop_when_suspended(&stop)?;
                motor.stop_on(stop.clone());
                let sets_origin_here = motor.sets_origin_here();
                if sets_origin_here && work.setup.is_some() {
                    console.announce(SETS_ORIGIN_HERE);
                }
                let questions = CommandQuestions::for_motor(
                    sets_origin_here,
                    motor.rearms_at_start(),
                    motor.homes_by_moving(),
                );
                let operator = |_: &Machine| {
                    MotorOperator::new(stop, is_confirmed, sets_origin_here, questions, console)
                };
                let (motor, live) = work.with_deadlines(*motor, &mut Unpaced, true, operator)?;
                write_bus_summary(&motor.summary(), &folder, console)?;
                live
            }
        };
        if let Some(lost) = publisher.map(LslPublisher::finish).filter(|lost| *lost > 0) {
            console.announce(format_args!(
                "Lab Streaming Layer: {lost} samples were not published; the session has them"
            ));
        }
        Ok((machine, live))
    }
}

/// What the control loop of a session needs beside rig and clock.
struct Work<'a> {
    machine: &'a mut Machine,
    recorder: Recorder,
    folder: &'a Path,
    setup: Option<ConsoleSetup>,
    options: &'a ConsoleOptions,
    console: &'a Console,
    /// Set by signals and by the operator: the session ends at once.
    stop: Arc<AtomicBool>,
    /// The session's end of its streams; only in real time.
    lsl: Option<LslFeed>,
    /// The streams that are recorded with it; only in real time.
    streams: Option<SessionStreams>,
}

impl Work<'_> {
    /// Runs a rig in simulated time: the loop waits for the disk, and for the console.
    fn without_deadlines<R: Rig>(mut self, rig: R) -> Result<Option<Live>, Failure> {
        if let Some(setup) = self.setup.take() {
            let recorder = BackgroundRecorder::start_waiting(self.recorder, self.machine.progress().clone());
            let (console, options) = (self.console, self.options);
            return with_console(
                rig,
                self.machine,
                &mut Unpaced,
                (recorder, None, None),
                self.folder,
                setup,
                options,
                console,
                self.stop,
            )
            .map(|(_, live)| Some(live));
        }
        let check = DayCheck::of_session(self.folder, self.machine.progress(), self.tell())?;
        let mut operator = CommandLineOperator::new(self.stop, self.machine, self.console);
        let mut consumers = (self.recorder, check);
        let ended = run_control_loop(rig, self.machine, &mut operator, &mut Unpaced, &mut consumers);
        operator.finish();
        let settled = consumers.0.settle();
        consumers.1.finish();
        // An error that ended the session comes first.
        ended?;
        settled?;
        Ok(None)
    }

    /// Runs a rig in real time: the recorder is on a thread of its own, and the loop waits for nobody.
    fn with_deadlines<R: Rig, O: Operator>(
        self,
        rig: R,
        pacing: &mut impl Pacing,
        keeps_clocks: bool,
        operator: impl FnOnce(&Machine) -> O,
    ) -> Result<(R, Option<Live>), Failure> {
        let published = self.lsl.as_ref().map(LslFeed::clock);
        let lsl = published.or_else(|| self.streams.as_ref().map(SessionStreams::clock));
        let watches = self.streams.as_ref().map_or(Vec::new(), SessionStreams::watches);
        let rig = WatchedRig::new(rig, watches);
        let rate_hz = self.machine.settings().sample_rate_hz;
        let recorder = |recorder, machine: &Machine| {
            let started = BackgroundRecorder::start(recorder, machine.progress().clone());
            if keeps_clocks {
                started.with_clocks(rate_hz, move || lsl.as_ref().and_then(LslClock::ahead_s))
            } else {
                started
            }
        };
        if let Some(setup) = self.setup {
            let recorder = recorder(self.recorder, self.machine);
            return with_console(
                rig,
                self.machine,
                pacing,
                (recorder, self.lsl, self.streams),
                self.folder,
                setup,
                self.options,
                self.console,
                self.stop,
            )
            .map(|(rig, live)| (rig.into_rig(), Some(live)));
        }
        let tell = self.tell();
        let check = DayCheck::of_session(self.folder, self.machine.progress(), tell.clone())?;
        let mut operator = operator(self.machine);
        let recorder = recorder(self.recorder, self.machine);
        let streams = self.streams.map(|streams| streams.record(self.folder, tell, recorder.actions()));
        let mut consumers = ((recorder, (self.lsl, streams.transpose()?)), check);
        let ended = run_control_loop(rig, self.machine, &mut operator, pacing, &mut consumers);
        let ((recorder, (_, streams)), mut check) = consumers;
        streams.into_iter().for_each(RecordedStreams::finish);
        let written = recorder.finish();
        check.finish();
        // An error of the disk that ended the session comes first.
        let rig = ended?;
        written?;
        Ok((rig.into_rig(), None))
    }

    /// Tells the operator on the command line.
    fn tell(&self) -> Arc<dyn Fn(OperatorNotice) + Send + Sync> {
        let console = *self.console;
        Arc::new(move |notice| match notice {
            OperatorNotice::Alarm(text) | OperatorNotice::Message(text) => console.announce(text),
            // Actions are those of a page.
            OperatorNotice::Action(_) => {}
        })
    }
}

/// Runs a session with its console until it is over. The console stays open for the closing message.
#[allow(clippy::too_many_arguments, reason = "the parts of a session, named where they are made")]
fn with_console<R: Rig>(
    rig: R,
    machine: &mut Machine,
    pacing: &mut impl Pacing,
    (recorder, lsl, streams): (BackgroundRecorder, Option<LslFeed>, Option<SessionStreams>),
    folder: &Path,
    setup: ConsoleSetup,
    options: &ConsoleOptions,
    console: &Console,
    stop: Arc<AtomicBool>,
) -> Result<(R, Live), Failure> {
    let (mut live, feed, mut operator) = Live::open(setup, machine, recorder.actions(), stop)?;
    if let Some(pages) = live.pages() {
        options.pages.announce(&pages, console);
    }
    let tell = Arc::new(live.notices());
    let check = DayCheck::of_session(folder, machine.progress(), tell.clone())?;
    let streams = streams.map(|streams| streams.record(folder, tell, recorder.actions())).transpose()?;
    live.take_terminal()?;
    let mut consumers = (((recorder, (lsl, streams)), feed), check);
    let ended = run_control_loop(rig, machine, &mut operator, pacing, &mut consumers);
    let (((recorder, (_, streams)), _), mut check) = consumers;
    streams.into_iter().for_each(RecordedStreams::finish);
    let written = recorder.finish();
    check.finish();
    live.release_terminal();
    // An error of the disk that ended the session comes first.
    let rig = ended?;
    written?;
    Ok((rig, live))
}
