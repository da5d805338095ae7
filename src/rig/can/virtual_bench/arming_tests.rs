//! What must be known of a CiA 402 drive before it gets power: measured values, offsets of its targets, whether it was restarted.

use std::time::Duration;

use serde_json::json;

use super::bench::{Bench, MotorKind, follow};
use super::world::BenchFault as B;
use crate::rig::can::{CanMotor, OriginError};
use crate::rig::{Armed, ArmingConsent, Rig};
use crate::timing::Clock;

const NO_SUCH_OBJECT: u32 = 0x0602_0000;

/// The drive after a fault, without power, and restarted; its settings are in a memory that keeps them.
fn restarted_with_settings(bench: &Bench) -> CanMotor {
    let mut armed = bench.arm().unwrap();
    bench.strike(B::TorqueInvalid);
    let fault = (0..100).find_map(|_| armed.exchange(&follow(0.0)).err());
    assert!(fault.is_some(), "it is noticed");
    let motor = armed.disarm();
    bench.bus.world().wire.faults.clear();
    bench.bus.world().power.clear();
    bench.strike(B::RebootWithSettings);
    bench.bus.world().wire.faults.clear();
    motor
}

#[test]
fn a_drive_that_keeps_its_settings_shows_by_its_boot_up_message_that_it_was_restarted() {
    let bench = Bench::new(MotorKind::Cia402);
    // It has nothing that a restart clears.
    bench.strike(B::Aborted(0x6071, NO_SUCH_OBJECT));
    let mut motor = restarted_with_settings(&bench);
    // However often it is tried.
    for _ in 0..3 {
        let (again, fault) = motor.arm(ArmingConsent::given(), &bench.protocol.limits).unwrap_err();
        assert_eq!(fault.code(), "origin_lost", "{fault}");
        assert!(bench.bus.world().power.is_empty(), "it had power");
        motor = again;
    }
}

#[test]
fn a_drive_that_was_restarted_stays_without_an_origin_however_often_it_is_armed() {
    let bench = Bench::new(MotorKind::Cia402);
    let mut armed = bench.arm().unwrap();
    bench.strike(B::Reboot);
    while armed.exchange(&follow(0.0)).is_ok() {}
    bench.bus.world().wire.faults.clear();
    let mut motor = armed.disarm();
    bench.bus.world().power.clear();
    let later = bench.clock.now() + Duration::from_secs(1);
    bench.bus.world().run_until(later);
    for _ in 0..3 {
        let (again, fault) = motor.arm(ArmingConsent::given(), &bench.protocol.limits).unwrap_err();
        assert_eq!(fault.code(), "origin_lost", "{fault}");
        assert!(bench.bus.world().power.is_empty(), "it had power");
        motor = again;
    }
    let resumed = bench.motor().resume_origin(true, false);
    assert!(matches!(resumed, Err(OriginError::WordNeeded { was_restarted: true })), "{resumed:?}");
}

#[test]
fn a_drive_that_keeps_its_settings_shows_a_restart_that_nobody_heard_by_its_target_torque() {
    let bench = Bench::new(MotorKind::Cia402);
    let motor = restarted_with_settings(&bench);
    let later = bench.clock.now() + Duration::from_secs(1);
    // Whatever came is lost, as in a full queue.
    bench.bus.world().run_until(later);
    let (_, fault) = motor.arm(ArmingConsent::given(), &bench.protocol.limits).unwrap_err();
    assert_eq!(fault.code(), "origin_lost", "{fault}");
    assert!(bench.bus.world().power.is_empty(), "it had power");
}

#[test]
fn a_drive_that_clears_its_target_torque_by_itself_is_armed_again_as_before() {
    let bench = Bench::new(MotorKind::Cia402);
    bench.strike(B::IgnoredWrite(0x6071));
    let armed = bench.arm().unwrap();
    let motor = armed.disarm();
    motor.arm(ArmingConsent::given(), &bench.protocol.limits).map_err(|(_, fault)| fault).unwrap();
}

/// Arming went on without a watchdog: the boot-up message was heard, and nobody looked.
#[test]
fn a_drive_that_restarts_while_it_is_configured_gets_no_power() {
    for index in [0x607D, 0x6098, 0x60C2, 0x6060] {
        let bench = Bench::new(MotorKind::Cia402);
        bench.strike(B::RebootWhenWritten(index));
        let (motor, fault) = bench.motor().arm(ArmingConsent::given(), &bench.protocol.limits).unwrap_err();
        assert_eq!(fault.code(), "rebooted", "{index:04X}h: {fault}");
        assert!(!bench.bus.world().power.iter().any(|(_, powered)| *powered), "{index:04X}h: it had power");
        // Configured anew, it can be used: it had no origin to lose.
        let again = motor.arm(ArmingConsent::given(), &bench.protocol.limits).map_err(|(_, fault)| fault);
        assert!(again.is_ok(), "{index:04X}h: {again:?}");
    }
}

/// After its restart such a drive passed for one with its origin.
#[test]
fn a_drive_without_a_mark_is_armed_again_at_the_start_position_only() {
    let bench = Bench::new(MotorKind::Cia402);
    bench.strike(B::Aborted(0x6071, NO_SUCH_OBJECT));
    let mut armed = bench.arm().unwrap();
    for step in 0..200 {
        armed.exchange(&follow(0.03 * f64::from(step) / 200.0)).unwrap();
    }
    let motor = armed.disarm();
    assert!(motor.rearms_at_start(), "the operator is asked where the handle is");
    let (_, fault) = motor.arm(ArmingConsent::given(), &bench.protocol.limits).unwrap_err();
    assert_eq!(fault.code(), "origin_not_confirmed", "{fault}");
}

/// It kept its limits through a restart that nobody heard, and the session went on 0.05 rad beside its start position.
#[test]
fn a_drive_without_a_mark_does_not_pass_for_one_that_kept_its_origin() {
    let bench = Bench::new(MotorKind::Cia402);
    bench.strike(B::Aborted(0x6071, NO_SUCH_OBJECT));
    let _ = bench.arm().unwrap().disarm();
    bench.strike(B::RebootWithSettings);
    let later = bench.clock.now() + Duration::from_secs(1);
    bench.bus.world().run_until(later);
    let resumed = bench.motor().resume_origin(true, false);
    assert!(matches!(resumed, Err(OriginError::WordNeeded { was_restarted: false })), "{resumed:?}");
}

#[test]
fn no_power_is_given_before_position_and_torque_were_seen() {
    for (fault, code, words) in [
        (B::Dropped(0x285), "not_measured", "given no power: frame 285h"),
        (B::Dropped(0x185), "not_measured", "given no power: frame 185h"),
        (B::TorqueInvalid, "not_a_number", "torque channel gave no number"),
        (B::TorqueStale, "stale_sample", "the sample counter"),
        (B::Push(14.0), "torque", "beyond the limit"),
    ] {
        for tolerated in [0, 10] {
            let bench = Bench::with(MotorKind::Cia402, |rig| {
                rig["tolerate"]["missed_cycles_in_a_row"] = json!(tolerated);
            });
            bench.strike(fault);
            let refused = bench.arm().unwrap_err();
            assert_eq!(refused.code(), code, "{fault:?}: {refused}");
            assert!(refused.to_string().contains(words), "{fault:?}: {refused}");
            assert!(bench.bus.world().power.is_empty(), "{fault:?}: it had power");
        }
    }
}

#[test]
fn offsets_that_a_drive_adds_to_its_targets_are_set_to_0_or_the_motor_is_not_armed() {
    for index in [0x60B0, 0x60B1, 0x60B2] {
        let bench = Bench::new(MotorKind::Cia402);
        bench.strike(B::Held(index, 4000));
        bench.arm().unwrap_or_else(|fault| panic!("{index:04X}h: {fault}"));
        // 4000 counts are 0.19 rad beside the start position.
        assert!(
            bench.bus.world().angle_rad().abs() < 1e-3,
            "{index:04X}h: {}",
            bench.bus.world().angle_rad()
        );

        let bench = Bench::new(MotorKind::Cia402);
        bench.strike(B::WrongReading(index, 0, 4000));
        let refused = bench.arm().unwrap_err();
        assert_eq!(refused.code(), "not_taken", "{index:04X}h: {refused}");
        assert!(refused.to_string().contains(&format!("{index:04X}h:00 is 00000FA0h after")), "{refused}");
        assert!(bench.bus.world().power.is_empty(), "{index:04X}h: it had power");

        let bench = Bench::new(MotorKind::Cia402);
        bench.strike(B::Aborted(index, NO_SUCH_OBJECT));
        bench.arm().unwrap_or_else(|fault| panic!("{index:04X}h: {fault}"));
    }
}
