//! The way to a safe state, and to no power. Nothing in here gives up half-way: what cannot be asked for over the bus is
//! left to the drive's own watchdog, by falling silent.

use std::time::Duration;

use super::canopen::{Link, NmtCommand};
use super::cycle::{CheckLevel, Cycle};
use super::cycle_stats::CycleStats;
use super::drive::{Drive, DriveRequest, Power};
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
pub fn reach(
    state: SafeState,
    link: &mut Link,
    drive: &mut dyn Drive,
    cycle: &mut Cycle,
    stats: &mut CycleStats,
) {
    let (request, time) = match state {
        SafeState::QuickStop => (DriveRequest::QuickStop, QUICK_STOP),
        SafeState::Hold => (DriveRequest::Follow, HOLD),
        SafeState::TorqueOff => (DriveRequest::RemovePower, QUICK_STOP),
    };
    // It stays where it is: a target further on would still be run to.
    let here = drive.angle(cycle.readings(), cycle.samples() - 1);
    let here = if here.0.is_finite() { here } else { JointAngle(cycle.target_rad()) };
    let end = link.now() + time;
    while link.now() < end {
        if cycle.run(link, drive, stats, (here, 0.0, request), CheckLevel::Stopping).is_err() {
            break;
        }
        if drive.power(cycle.readings()) == Power::Off {
            return;
        }
    }
    // One more frame, whatever became of the others.
    let _ = drive.send_target(link, here, 0.0, DriveRequest::RemovePower);
    let _ = drive.send_sync(link);
}

/// No power, confirmed; a drive that does not answer is stopped by NMT and by our silence.
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
