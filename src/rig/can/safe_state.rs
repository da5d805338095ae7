//! Brings the motor to a safe state, and removes its power. No step depends on the one before: if the bus does not carry
//! a command any more, the program's heartbeat ends, and the drive's own watchdog stops the motor.

use std::time::Duration;

use super::canopen::{Link, NmtCommand};
use super::cycle::{CheckLevel, Cycle};
use super::cycle_stats::CycleStats;
use super::drive::{Drive, DriveRequest, PowerState};
use super::fault::CanFault;
use super::file::{SafeState, SafeStates};
use super::units::JointAngle;
use crate::rig::FaultClass;

/// Longest duration of a quick stop. After it, the power is removed whatever the motor does.
const LONGEST_QUICK_STOP: Duration = Duration::from_millis(500);
/// How long the motor holds its angle so that the subject can let go, before the power is removed.
const HOLD_DURATION: Duration = Duration::from_millis(500);

/// The safe state that the rig file gives for the class of a fault.
pub fn state_for(fault: &CanFault, states: &SafeStates) -> SafeState {
    match fault.class() {
        FaultClass::Limit => states.limit,
        FaultClass::Sensor => states.sensor,
        FaultClass::Drive => states.drive,
        FaultClass::Bus => states.bus,
        FaultClass::Cycle => states.cycle,
    }
}

/// Brings the motor to a safe state. If frames stay away, the power is removed at once.
pub fn reach(
    state: SafeState,
    link: &mut Link,
    drive: &mut dyn Drive,
    cycle: &mut Cycle,
    stats: &mut CycleStats,
) {
    let (request, time) = match state {
        SafeState::QuickStop => (DriveRequest::QuickStop, LONGEST_QUICK_STOP),
        SafeState::Hold => (DriveRequest::Follow, HOLD_DURATION),
        SafeState::TorqueOff => (DriveRequest::RemovePower, LONGEST_QUICK_STOP),
    };
    // The target is the present angle: the motor would still go on to a later one.
    let here = drive.angle(cycle.readings(), cycle.samples() - 1);
    let here = if here.0.is_finite() { here } else { JointAngle(cycle.target_rad()) };
    let end = link.now() + time;
    while link.now() < end {
        if cycle.run(link, drive, stats, (here, 0.0, request), CheckLevel::Stopping).is_err() {
            break;
        }
        if drive.power(cycle.readings()) == PowerState::Off {
            return;
        }
    }
    // Sent even if the frames before failed.
    let _ = drive.send_target(link, here, 0.0, DriveRequest::RemovePower);
    let _ = drive.send_sync(link);
}

/// Removes the power and confirms it. A drive that does not answer is stopped by NMT, and by the end of the heartbeat.
///
/// # Errors
/// Why it could not be confirmed.
pub fn power_off(link: &mut Link, drive: &mut dyn Drive) -> Result<(), CanFault> {
    let outcome = drive.power_off(link);
    if outcome.is_err() {
        link.set_own_heartbeat(None);
        for node in drive.monitored_nodes() {
            let _ = link.nmt(NmtCommand::Stop, node.node);
        }
    }
    outcome
}
