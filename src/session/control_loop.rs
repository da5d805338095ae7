//! The loop around the machine: reads the rig, steps the session, hands what happened to the recorder, writes the command.

use std::time::{Duration, Instant};

use super::event::Event;
use super::io::{Input, Output, Reading, TransitionDetail};
use super::lateness::Lateness;
use super::machine::Machine;
use super::phase::Phase;
use crate::rig::{Armed, Command, Cue, Fault, Motor, OperatorsWord, Rig, Vitals};

/// The operator, at a console or on a command line.
pub trait Operator {
    /// What was said since the last sample, if anything. Must not make the loop wait.
    fn heard(&mut self, machine: &Machine) -> Option<Event>;

    /// Waits for a word while the rig is disarmed.
    fn asked(&mut self, machine: &Machine) -> Event;

    /// A word was not possible.
    fn refused(&mut self, word: Event, phase: Phase);

    /// The rig could not be armed.
    fn not_armed(&mut self, fault: Fault);

    /// A fault stopped the session; the motor is safe.
    fn faulted(&mut self, fault: Fault);

    /// How the loop fares, now and then. Must not make it wait.
    fn vitals(&mut self, _vitals: Vitals) {}
}

/// Samples between two looks at how the loop fares.
const VITALS_EVERY: u64 = 512;

/// Who owns the time: as fast as it goes, or true periods.
pub trait Clock {
    /// Waits for the next period.
    fn wait(&mut self);

    /// How it keeps its time, if it keeps one.
    fn vitals(&self) -> Option<Vitals> {
        None
    }
}

/// Simulated time: as fast as it goes.
#[derive(Debug, Default)]
pub struct AsFastAsItGoes;

impl Clock for AsFastAsItGoes {
    fn wait(&mut self) {}
}

/// True time: each period begins at its own moment, however long the one before took.
#[derive(Debug)]
pub struct RealTime {
    period: Duration,
    next: Option<Instant>,
    lateness: Lateness,
}

impl RealTime {
    /// So many periods a second.
    pub fn new(rate_hz: f64) -> Self {
        Self { period: Duration::from_secs_f64(1.0 / rate_hz), next: None, lateness: Lateness::default() }
    }

    /// How late the periods began.
    pub fn lateness(&self) -> &Lateness {
        &self.lateness
    }
}

impl Clock for RealTime {
    fn wait(&mut self) {
        let now = Instant::now();
        let next = self.next.map_or(now, |last| last + self.period);
        if let Some(left) = next.checked_duration_since(now) {
            std::thread::sleep(left);
        }
        self.lateness.add(Instant::now().saturating_duration_since(next));
        self.next = Some(next);
    }

    fn vitals(&self) -> Option<Vitals> {
        Some(Vitals {
            periods: self.lateness.periods(),
            late_p99_us: self.lateness.quantile_us(0.99),
            latest_us: self.lateness.latest().as_micros() as u64,
            missed: self.lateness.later_than(self.period),
            ..Vitals::default()
        })
    }
}

/// Who keeps what happens. What it was told is safe when it returns, or as soon as it says so: the session acts on it then.
pub trait Recorder {
    /// Why something could not be kept.
    type Error;

    /// Whether everything that it was told so far is on disk; the ramp waits for it.
    fn on_disk(&self) -> bool {
        true
    }

    /// One step of the session.
    fn take(&mut self, input: &Input, output: &Output, machine: &Machine) -> Result<(), Self::Error>;
}

/// Runs the session until it is over.
///
/// # Errors
/// The recorder's, after the motor was made safe and the rig disarmed.
pub fn conduct<R: Rig, K: Recorder>(
    mut rig: R,
    machine: &mut Machine,
    operator: &mut impl Operator,
    clock: &mut impl Clock,
    recorder: &mut K,
) -> Result<R, K::Error> {
    let mut emg_is_scaled = false;
    while !machine.phase().is_final() {
        let word = operator.asked(machine);
        if !matches!(word, Event::Start | Event::Rearm) {
            let input = Input { reading: Reading::Disarmed, operator: Some(word), on_disk: true };
            let output = machine.step(&input);
            tell(&input, &output, machine, operator, recorder)?;
            continue;
        }
        rig = match rig.arm(OperatorsWord::given(), &machine.settings().limits) {
            Err((rig, fault)) => {
                operator.not_armed(fault);
                rig
            }
            Ok(mut armed) => {
                if let (false, Some(factors)) = (emg_is_scaled, machine.progress().emg_factors()) {
                    armed.rescale_emg(factors);
                }
                let ended = run_armed(&mut armed, word, machine, operator, clock, recorder);
                emg_is_scaled = machine.progress().emg_factors().is_some();
                let rig = armed.disarm();
                ended?;
                rig
            }
        };
    }
    Ok(rig)
}

const SAFE: Command = Command { motor: Motor::Safe, cue: Cue::Rest };

/// The motor is made safe when this returns, whatever ended it.
fn run_armed<A: Armed, K: Recorder>(
    armed: &mut A,
    word: Event,
    machine: &mut Machine,
    operator: &mut impl Operator,
    clock: &mut impl Clock,
    recorder: &mut K,
) -> Result<(), K::Error> {
    let mut command = SAFE;
    let mut word = Some(word);
    loop {
        let reading = match armed.exchange(&command) {
            Ok(sample) => Reading::Sample(sample.rounded()),
            Err(fault) => Reading::Fault(fault),
        };
        let said = word.take().or_else(|| operator.heard(machine));
        let scaled_before = machine.progress().emg_factors().is_some();
        let input = Input { reading, operator: said, on_disk: recorder.on_disk() };
        let output = machine.step(&input);
        let is_over = !output.phase.is_armed();
        if is_over {
            // A fault stops the motor first, and is reported and written down second.
            let _ = armed.exchange(&SAFE);
        }
        let kept = tell(&input, &output, machine, operator, recorder);
        if kept.is_err() && !is_over {
            let _ = armed.exchange(&SAFE);
        }
        if is_over || kept.is_err() {
            return kept;
        }
        if let (false, Some(factors)) = (scaled_before, machine.progress().emg_factors()) {
            armed.rescale_emg(factors);
        }
        if machine.sample().is_multiple_of(VITALS_EVERY)
            && let Some(vitals) = armed.vitals().or_else(|| clock.vitals())
        {
            operator.vitals(vitals);
        }
        command = output.command;
        clock.wait();
    }
}

fn tell<K: Recorder>(
    input: &Input,
    output: &Output,
    machine: &Machine,
    operator: &mut impl Operator,
    recorder: &mut K,
) -> Result<(), K::Error> {
    if let Some(TransitionDetail::Fault(fault) | TransitionDetail::FaultInTrial { fault, .. }) =
        output.happened.and_then(|it| it.detail)
    {
        operator.faulted(fault);
    }
    if let Some(word) = output.refused {
        operator.refused(word, output.phase);
    }
    recorder.take(input, output, machine)
}
