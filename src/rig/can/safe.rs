//! The way to a safe state, and to no power. Nothing in here gives up half-way: what cannot be asked for over the bus is
//! left to the drive's own watchdog, by falling silent.

use std::time::Duration;

use super::canopen::{Link, NmtCommand};
use super::cycle::{Cycle, Scrutiny, Tally};
use super::drive::{Drive, Power, Wish};
use super::fault::CanFault;
use super::file::{SafeState, SafeStates};
use super::units::JointAngle;
use crate::rig::FaultClass;

/// How long a quick stop may take before the power is taken off regardless.
const QUICK_STOP: Duration = Duration::from_millis(500);
/// How long a motor holds still so that the person can let go.
const HOLD: Duration = Duration::from_millis(500);

/// What the rig file wants done about a fault.
pub fn state_for(fault: &CanFault, states: &SafeStates) -> SafeState {
    match fault.class() {
        FaultClass::Limit => states.limit,
        FaultClass::Sensor => states.sensor,
        FaultClass::Drive => states.drive,
        FaultClass::Bus => states.bus,
        FaultClass::Cycle => states.cycle,
    }
}

/// Brings the motor there. When frames stay away, the power goes.
pub fn reach(state: SafeState, link: &mut Link, drive: &mut dyn Drive, cycle: &mut Cycle, tally: &mut Tally) {
    let (wish, time) = match state {
        SafeState::QuickStop => (Wish::QuickStop, QUICK_STOP),
        SafeState::Hold => (Wish::Follow, HOLD),
        SafeState::TorqueOff => (Wish::NoPower, QUICK_STOP),
    };
    // It stays where it is: a target further on would still be run to.
    let here = drive.angle(cycle.readings(), cycle.samples() - 1);
    let here = if here.0.is_finite() { here } else { JointAngle(cycle.target_rad()) };
    let end = std::time::Instant::now() + time;
    while std::time::Instant::now() < end {
        if cycle.run(link, drive, tally, (here, 0.0, wish), Scrutiny::Stopping).is_err() {
            break;
        }
        if drive.power(cycle.readings()) == Power::Off {
            return;
        }
    }
    // One more frame, whatever became of the others.
    let _ = drive.send_target(link, here, 0.0, Wish::NoPower);
    let _ = drive.send_sync(link);
}

/// No power, confirmed; a drive that does not answer is stopped by NMT and by our silence.
///
/// # Errors
/// Why it could not be confirmed.
pub fn power_off(link: &mut Link, drive: &mut dyn Drive) -> Result<(), CanFault> {
    let outcome = drive.power_off(link);
    if outcome.is_err() {
        link.set_beat(None);
        for producer in drive.producers() {
            let _ = link.nmt(NmtCommand::Stop, producer.node);
        }
    }
    outcome
}
