//! The control loop of a session: reads the rig, steps the session, hands the step to its consumers,
//! commands the motor.

use super::event::Event;
use super::io::{Input, Output, Reading, TransitionDetail};
use super::machine::Machine;
use super::motion::MotionDeviation;
use super::pacing::Pacing;
use super::phase::Phase;
use super::step::{Step, StepConsumer};
use crate::rig::{Armed, ArmingConsent, Command, Cue, Fault, Motor, Rig, Vitals};

/// Source of the operator's commands: a console or the command line.
pub trait Operator {
    /// Returns a command given since the last sample, if there is one. Must not block.
    fn poll_command(&mut self, machine: &Machine) -> Option<Event>;

    /// Waits for a command while the rig is disarmed.
    fn wait_for_command(&mut self, machine: &Machine) -> Event;

    /// Tells the operator that a command is not possible in this phase. The motor may have power: must not block.
    fn command_refused(&mut self, command: Event, phase: Phase);

    /// Tells the operator that the rig could not be armed.
    fn arming_failed(&mut self, fault: Fault);

    /// Tells the operator that a fault stopped the session. The rig is disarmed.
    fn fault_occurred(&mut self, fault: Fault);

    /// Tells the operator that it could not be confirmed, when the rig was disarmed, that the motor has no power.
    fn power_not_confirmed(&mut self);

    /// Tells the operator that a trial was rejected because its motion was not as asked. The motor has power: must not
    /// block.
    fn motion_deviated(&mut self, _deviation: &MotionDeviation) {}

    /// Receives the timing and the bus load of the loop every few hundred samples. Must not block.
    fn vitals(&mut self, _vitals: Vitals) {}
}

/// Samples between two reports of the loop's timing.
const VITALS_EVERY: u64 = 512;

/// Runs the session until it is over, and returns the disarmed rig.
///
/// # Errors
/// The consumer's error, after the rig was disarmed.
pub fn run_control_loop<R: Rig, C: StepConsumer>(
    mut rig: R,
    machine: &mut Machine,
    operator: &mut impl Operator,
    pacing: &mut impl Pacing,
    consumer: &mut C,
) -> Result<R, C::Error> {
    let mut emg_is_scaled = false;
    while !machine.phase().is_final() {
        let command = operator.wait_for_command(machine);
        if !matches!(command, Event::Start | Event::Rearm) {
            let input = Input {
                reading: Reading::Disarmed,
                operator: Some(command),
                on_disk: true,
                punctuality: None,
            };
            let output = machine.step(&input);
            report(&input, &output, machine, operator, consumer)?;
            continue;
        }
        rig = match rig.arm(ArmingConsent::given(), &machine.settings().limits) {
            Err((rig, fault)) => {
                operator.arming_failed(fault);
                rig
            }
            Ok(mut armed) => {
                if let (false, Some(factors)) = (emg_is_scaled, machine.progress().emg_factors()) {
                    armed.rescale_emg(factors);
                }
                let ended = run_armed(&mut armed, command, machine, operator, pacing, consumer);
                emg_is_scaled = machine.progress().emg_factors().is_some();
                // Nobody is told anything, and nothing is written down, before the motor has no power: both may block.
                let rig = armed.disarm();
                if rig.power_may_be_on() {
                    operator.power_not_confirmed();
                }
                let (input, output) = ended?;
                report(&input, &output, machine, operator, consumer)?;
                rig
            }
        };
    }
    Ok(rig)
}

const SAFE: Command = Command { motor: Motor::Safe, cue: Cue::Rest };

/// Runs the session while the rig is armed. The motor is safe when this returns, whatever ended it. Returns the step that
/// ended it, which nobody has been told yet.
fn run_armed<A: Armed, C: StepConsumer>(
    armed: &mut A,
    first_command: Event,
    machine: &mut Machine,
    operator: &mut impl Operator,
    pacing: &mut impl Pacing,
    consumer: &mut C,
) -> Result<(Input, Output), C::Error> {
    if let Some(origin) = armed.origin() {
        // Before the first movement of the session, so that whoever resumes it knows.
        make_safe_on_error(consumer.note_origin(origin, machine.sample()), armed)?;
    }
    let mut to_rig = SAFE;
    let mut first_command = Some(first_command);
    loop {
        let reading = match armed.exchange(&to_rig) {
            Ok(sample) => Reading::Sample(sample.rounded()),
            Err(fault) => Reading::Fault(fault),
        };
        let operators_command = first_command.take().or_else(|| operator.poll_command(machine));
        let scaled_before = machine.progress().emg_factors().is_some();
        let input = Input {
            reading,
            operator: operators_command,
            on_disk: consumer.is_on_disk(),
            punctuality: armed.take_punctuality(),
        };
        let output = machine.step(&input);
        if !output.phase.is_armed() {
            // What stopped the session is in the output; a fault of stopping is the rig's to record.
            let _ = armed.exchange(&SAFE);
            return Ok((input, output));
        }
        make_safe_on_error(report(&input, &output, machine, operator, consumer), armed)?;
        if let (false, Some(factors)) = (scaled_before, machine.progress().emg_factors()) {
            armed.rescale_emg(factors);
        }
        if machine.sample().is_multiple_of(VITALS_EVERY)
            && let Some(vitals) = armed.vitals().or_else(|| pacing.vitals())
        {
            operator.vitals(vitals);
        }
        to_rig = output.command;
        pacing.wait();
    }
}

/// Makes the motor safe if what was done could not be kept.
fn make_safe_on_error<A: Armed, E>(kept: Result<(), E>, armed: &mut A) -> Result<(), E> {
    if kept.is_err() {
        // The error that ends the session is the one to report.
        let _ = armed.exchange(&SAFE);
    }
    kept
}

/// Tells the operator about faults, rejected motions and refused commands, and hands the step to the consumers.
fn report<C: StepConsumer>(
    input: &Input,
    output: &Output,
    machine: &Machine,
    operator: &mut impl Operator,
    consumer: &mut C,
) -> Result<(), C::Error> {
    match output.transition.and_then(|it| it.detail) {
        Some(TransitionDetail::Fault(fault) | TransitionDetail::FaultInTrial { fault, .. }) => {
            operator.fault_occurred(fault);
        }
        Some(TransitionDetail::Ended { deviation: Some(deviation), .. }) => {
            operator.motion_deviated(&deviation)
        }
        _ => {}
    }
    if let Some(command) = output.refused {
        operator.command_refused(command, output.phase);
    }
    consumer.consume(&Step::new(input, output, machine), machine.progress())
}
