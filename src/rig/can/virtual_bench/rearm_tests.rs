//! A motor that cannot show its origin is armed again by one process: it may have been switched off since.

use std::time::Duration;

use super::bench::{Bench, MotorKind, follow};
use super::mit_motor::MitFirmware;
use super::odrive_axis::OdriveFirmware;
use super::world::BenchFault;
use crate::rig::can::CanMotor;
use crate::rig::{Armed, ArmingConsent, Fault, Origin, Rig};
use crate::timing::Clock;

/// A bench of each kind that takes the present place for the start position and tells nothing of a restart.
fn benches() -> [Bench; 2] {
    let saving = OdriveFirmware { saves_settings: true, ..OdriveFirmware::default() };
    [Bench::odrive(saving, |_| {}), Bench::mit(MitFirmware::default(), |_| {})]
}

/// The motor after its first arming and a fault; it has no power.
fn faulted(bench: &Bench) -> CanMotor {
    let mut armed = bench.arm_and_watch().unwrap();
    assert_eq!(armed.origin(), Some(Origin::SetHere));
    bench.strike(BenchFault::TorqueInvalid);
    let fault = (0..100).find_map(|_| armed.exchange(&follow(0.0)).err());
    assert!(fault.is_some(), "it is noticed");
    bench.bus.world().wire.faults.clear();
    let motor = armed.disarm();
    bench.bus.world().power.clear();
    motor
}

/// Somebody moves the handle by an angle, and holds it there.
fn move_handle(bench: &Bench, by_rad: f64) {
    let mut world = bench.bus.world();
    let now = world.clock.now();
    world.run_until(now + Duration::from_millis(100));
    world.shaft().angle_rad += by_rad;
    world.shaft().is_jammed = true;
}

fn let_go(bench: &Bench) {
    bench.bus.world().shaft().is_jammed = false;
}

fn restart(bench: &Bench) {
    bench.strike(BenchFault::Reboot);
    bench.bus.world().wire.faults.clear();
}

#[allow(clippy::result_large_err, reason = "the rig comes back with its fault")]
fn arm_again(bench: &Bench, motor: CanMotor) -> Result<Origin, (CanMotor, Fault)> {
    motor.arm(ArmingConsent::given(), &bench.protocol.limits).map(|armed| {
        let origin = armed.origin().unwrap();
        armed.disarm();
        origin
    })
}

fn assert_refused(bench: &Bench, motor: CanMotor, code: &str) -> CanMotor {
    let (motor, fault) = arm_again(bench, motor).expect_err("it is not armed");
    assert_eq!(fault.code(), code, "{fault}");
    assert!(!bench.bus.world().power.iter().any(|(_, powered)| *powered), "it had power");
    motor
}

/// It went on with the old targets, which then were 0.17 rad further.
#[test]
fn motor_that_was_switched_off_between_a_fault_and_arming_again_does_not_go_by_its_old_origin() {
    for bench in benches() {
        let motor = faulted(&bench);
        move_handle(&bench, 0.06);
        restart(&bench);
        move_handle(&bench, -0.06);
        let motor = assert_refused(&bench, motor, "origin_not_confirmed");
        assert!(motor.rearms_at_start(), "the operator is asked where the handle is");
    }
}

#[test]
fn odrive_axis_without_the_settings_that_it_was_armed_with_was_restarted() {
    let bench = Bench::new(MotorKind::Cansimple);
    let motor = faulted(&bench);
    move_handle(&bench, 0.06);
    restart(&bench);
    assert_refused(&bench, motor, "origin_lost");
}

#[test]
fn motor_that_was_not_switched_off_is_armed_again_where_the_handle_stands_at_the_start_position_only() {
    for bench in benches() {
        let motor = faulted(&bench);
        move_handle(&bench, 0.03);
        let motor = assert_refused(&bench, motor, "origin_not_confirmed");
        move_handle(&bench, -0.03);
        let_go(&bench);
        assert_eq!(arm_again(&bench, motor).map_err(|(_, fault)| fault), Ok(Origin::Kept));
    }
}

#[test]
fn odrive_axis_that_does_not_take_its_position_is_not_armed() {
    let stubborn = OdriveFirmware { takes_no_position: true, ..OdriveFirmware::default() };
    let bench = Bench::odrive(stubborn, |_| {});
    let fault = bench.arm_and_watch().unwrap_err();
    assert_eq!(fault.code(), "origin_not_taken", "{fault}");
    assert!(!bench.bus.world().power.iter().any(|(_, powered)| *powered), "it had power");
}
