//! Every fault of a motor, in virtual time: which fault is reported, and when the power is off.

use std::time::Duration;

use proptest::prelude::*;
use serde_json::json;

use super::bench::{Bench, MotorKind, Outcome, follow};
use super::world::BenchFault;
use crate::rig::can::HandleLimits;
use crate::rig::can::bus::ControllerError;
use crate::rig::{Armed, ArmingConsent, Command, Cue, FaultClass, Motor, Rig};

/// DurationSummary to the loss of power. A cycle is 2 ms; a hold takes half a second; the drive waits 100 ms for a heartbeat.
const AT_ONCE_MS: u64 = 20;
/// The ramp from the speed limit, 4 rad/s at 60 rad/s2, five periods to begin and end it, two until a target is reached.
const QUICK_STOP_MS: u64 = 100;
const HOLD_MS: u64 = 550;
const WATCHDOG_MS: u64 = 250;

use BenchFault as B;

/// Fault, codes that may be reported (where two checks see the same, either may be first), time to no power.
const HELD: &[(BenchFault, &[&str], u64)] = &[
    (B::HeartbeatStop, &["heartbeat_lost"], WATCHDOG_MS),
    (B::Error { code: 0x4310, fatal: false }, &["emergency"], AT_ONCE_MS),
    (B::Error { code: 0x2310, fatal: true }, &["emergency"], AT_ONCE_MS),
    (B::NmtDrop, &["missed_cycle", "not_operational"], QUICK_STOP_MS),
    (B::Reboot, &["rebooted"], AT_ONCE_MS),
    (B::PowerLoss, &["missed_cycle"], AT_ONCE_MS),
    (B::Runaway(1.0), &["following_error"], 120),
    (B::Runaway(8.0), &["speed"], QUICK_STOP_MS),
    (B::Push(14.0), &["torque"], AT_ONCE_MS),
    (B::TorqueInvalid, &["not_a_number"], HOLD_MS),
    (B::TorqueStale, &["stale_sample"], HOLD_MS),
    // It is found after the tolerated periods.
    (B::EmgFrozen, &["frozen_emg"], HOLD_MS + 100),
    (B::CounterStale, &["stale_sample"], HOLD_MS),
    (B::Silent, &["missed_cycle"], WATCHDOG_MS),
    (B::Deaf, &["missed_cycle"], WATCHDOG_MS),
    (B::Dropped(0x185), &["missed_cycle"], WATCHDOG_MS),
    (B::Dropped(0x285), &["missed_cycle"], WATCHDOG_MS),
    (B::Delayed(Duration::from_millis(1)), &[], 0),
    (B::Delayed(Duration::from_millis(5)), &["missed_cycle"], WATCHDOG_MS),
    (B::Duplicated(0x185), &["duplicated"], AT_ONCE_MS),
    (B::FlippedBit { id: 0x185, bit: 0 }, &["not_enabled"], AT_ONCE_MS),
    (B::FlippedBit { id: 0x185, bit: 11 }, &["drive_limit"], AT_ONCE_MS),
    (B::FlippedBit { id: 0x185, bit: 12 }, &["target_ignored"], AT_ONCE_MS),
    (B::FlippedBit { id: 0x185, bit: 13 }, &["drive_limit"], AT_ONCE_MS),
    (B::SdoOnly, &["missed_cycle"], AT_ONCE_MS),
    (B::FlippedBit { id: 0x185, bit: 40 }, &["angle"], QUICK_STOP_MS),
    (B::FlippedBit { id: 0x185, bit: 27 }, &["speed"], QUICK_STOP_MS),
    (B::Shortened(0x185), &["malformed"], HOLD_MS),
    (B::Flood(2000), &["flood"], 120),
    (B::Controller(ControllerError::BusOff), &["bus_off"], WATCHDOG_MS),
    (B::Controller(ControllerError::Passive), &["bus_trouble"], AT_ONCE_MS),
    (B::Controller(ControllerError::Warning), &["bus_trouble"], AT_ONCE_MS),
    (B::Controller(ControllerError::Overrun), &["bus_trouble"], AT_ONCE_MS),
    (B::Controller(ControllerError::BusError), &["bus_trouble"], AT_ONCE_MS),
    (B::Garbled, &["garbled"], AT_ONCE_MS),
    (B::AdapterGone, &["bus_gone"], WATCHDOG_MS),
];

const IN_RAMP: &[(BenchFault, &[&str], u64)] = &[
    (B::Jam { noticed: true }, &["emergency", "following_error", "not_enabled"], 120),
    (B::Jam { noticed: false }, &["following_error"], QUICK_STOP_MS),
    (B::PositionFreeze, &["following_error"], QUICK_STOP_MS),
    (B::Error { code: 0x4310, fatal: false }, &["emergency"], AT_ONCE_MS),
    (B::TorqueInvalid, &["not_a_number"], HOLD_MS),
    (B::Dropped(0x185), &["missed_cycle"], WATCHDOG_MS),
    (B::Controller(ControllerError::BusOff), &["bus_off"], WATCHDOG_MS),
    (B::AdapterGone, &["bus_gone"], WATCHDOG_MS),
];

fn assert_made_safe(what: &str, outcome: &Outcome, codes: &[&str], within_ms: u64) {
    let code = outcome.fault.code();
    assert!(codes.contains(&code), "{what}: {code}, expected one of {codes:?} ({})", outcome.fault);
    assert!(!outcome.has_power, "{what}: the motor still has power");
    assert!(!outcome.power_came_back, "{what}: the power came back");
    let after = outcome.power_off_after.unwrap_or_else(|| panic!("{what}: the power did not go off"));
    assert!(after <= Duration::from_millis(within_ms), "{what}: power off after {after:?}");
    assert!(outcome.recorded.contains(&outcome.fault.to_string()), "{what}: {:?}", outcome.recorded);
}

#[test]
fn a_fault_while_the_drive_holds_still_removes_the_power_in_its_time() {
    for (fault, codes, within_ms) in HELD.iter().filter(|(_, codes, _)| !codes.is_empty()) {
        let outcome = Bench::new(MotorKind::Cia402).strike_while_held(*fault);
        assert_made_safe(&format!("{fault:?}"), &outcome, codes, *within_ms);
    }
}

#[test]
fn a_fault_in_the_ramp_removes_the_power_in_its_time() {
    for (fault, codes, within_ms) in IN_RAMP {
        let outcome = Bench::new(MotorKind::Cia402).strike_in_ramp(*fault);
        assert_made_safe(&format!("{fault:?}"), &outcome, codes, *within_ms);
        let [low, high] = outcome.angles_rad;
        assert!(low >= -0.05 && high <= 0.2, "{fault:?}: the handle was at {low} to {high} rad");
    }
}

#[test]
fn a_ramp_is_followed_and_read_back_two_periods_later() {
    let bench = Bench::new(MotorKind::Cia402);
    let mut armed = bench.arm().unwrap();
    let targets: Vec<f64> = bench.ramp().collect();
    let angles: Vec<f64> =
        targets.iter().map(|target| armed.exchange(&follow(*target)).unwrap().theta_m_rad).collect();
    for (target, angle) in targets.iter().zip(&angles[1..]) {
        assert!((target - angle).abs() < 1e-4, "{target} is read as {angle}");
    }
    let summary = armed.disarm().summary();
    assert_eq!((summary.missed_cycles, summary.overruns, summary.faults.len()), (0, 0, 0), "{summary}");
    assert_eq!(summary.lateness.longest_us, 0, "virtual time is exact");
    assert!(!bench.bus.world().power.last().unwrap().1, "a disarmed motor has no power");
}

#[test]
fn frames_that_are_late_within_their_period_are_no_fault() {
    let bench = Bench::new(MotorKind::Cia402);
    let mut armed = bench.arm().unwrap();
    bench.strike(B::Delayed(Duration::from_millis(1)));
    for _ in 0..200 {
        armed.exchange(&follow(0.0)).unwrap();
    }
    assert_eq!(armed.disarm().summary().missed_cycles, 0);
}

#[test]
fn the_adapter_of_an_odrive_axis_makes_the_motor_safe() {
    for (fault, codes, within_ms) in [
        (B::Runaway(8.0), &["speed", "following_error", "angle", "position_jump"][..], 700),
        (B::Push(14.0), &["torque"], 700),
        (B::TorqueInvalid, &["not_a_number"], 700),
        (B::TorqueStale, &["stale_sample"], 700),
        (B::EmgFrozen, &["frozen_emg"], 1200),
        (B::Error { code: 4, fatal: false }, &["motor_error"], 60),
        (B::HeartbeatStop, &["heartbeat_lost"], 1200),
        (B::Silent, &["missed_cycle"], 1200),
        (B::PowerLoss, &["missed_cycle", "heartbeat_lost"], 60),
        (B::Dropped(0x1A0), &["missed_cycle"], 1200),
        (B::AdapterGone, &["bus_gone"], 1200),
    ] {
        let outcome = Bench::new(MotorKind::Cansimple).strike_while_held(fault);
        assert_made_safe(&format!("{fault:?}"), &outcome, codes, within_ms);
    }
}

#[test]
fn the_adapter_of_a_motor_in_mit_mode_makes_the_motor_safe() {
    for (fault, codes, within_ms) in [
        (B::Runaway(8.0), &["speed", "following_error", "angle"][..], 700),
        (B::Push(14.0), &["torque"], 700),
        (B::TorqueInvalid, &["not_a_number"], 700),
        (B::TorqueStale, &["stale_sample"], 700),
        (B::Error { code: 4, fatal: false }, &["motor_error"], 60),
        (B::Silent, &["missed_cycle"], 1200),
        (B::Deaf, &["missed_cycle"], 1200),
        (B::PowerLoss, &["missed_cycle"], 60),
        (B::Dropped(0x1A0), &["missed_cycle"], 1200),
        (B::AdapterGone, &["bus_gone"], 1200),
    ] {
        let outcome = Bench::new(MotorKind::Mit).strike_while_held(fault);
        assert_made_safe(&format!("{fault:?}"), &outcome, codes, within_ms);
    }
}

#[test]
fn a_drive_that_does_not_take_a_setting_is_not_armed_and_gets_no_power() {
    for (fault, code, words) in [
        (B::Aborted(0x6072, 0x0609_0031), "sdo_aborted", "6072h:00 with 06090031h: value too high"),
        (B::Unanswered(0x607D), "sdo_silent", "607Dh"),
        (B::WrongReading(0x607D, 2, 999_999), "not_taken", "607Dh:02 is 000F423Fh after"),
        (B::IgnoredWrite(0x6065), "not_taken", "6065h:00"),
        (B::IgnoredWrite(0x6066), "not_taken", "6066h:00"),
        (B::WrongReading(0x6072, 0, 9999), "not_taken", "6072h:00"),
        (B::IgnoredWrite(0x6080), "not_taken", "6080h:00"),
        (B::IgnoredWrite(0x1016), "not_taken", "1016h:01"),
        (B::IgnoredWrite(0x1017), "not_taken", "1017h:00"),
        (B::WrongReading(0x6007, 0, 0), "not_taken", "6007h:00"),
        (B::IgnoredWrite(0x60C2), "not_taken", "60C2h:0"),
        (B::WrongReading(0x1018, 2, 7), "wrong_device", "another device?"),
        (B::WrongReading(0x608F, 1, 4096), "wrong_device", "608Fh:01"),
        (B::WrongReading(0x6076, 0, 1), "wrong_device", "6076h:00"),
        (B::HomingStuck, "homing_failed", "homing did not end"),
    ] {
        let bench = Bench::new(MotorKind::Cia402);
        bench.strike(fault);
        let refused = bench.arm().unwrap_err();
        assert_eq!(refused.code(), code, "{fault:?}: {refused}");
        assert!(refused.to_string().contains(words), "{fault:?}: {refused}");
        let world = bench.bus.world();
        assert!(!world.power.last().is_some_and(|(_, powered)| *powered), "{fault:?}: it has power");
        assert!(world.power.is_empty() || fault == B::HomingStuck, "{fault:?}: it had power");
    }
}

#[test]
fn a_statusword_that_ends_the_motion_is_told_as_what_it_is() {
    for (bit, words) in [
        (11, "holds the motion back at one of its limits: bit 11"),
        (12, "does not follow the target"),
        (13, "following error: bit 13"),
    ] {
        let outcome = Bench::new(MotorKind::Cia402).strike_while_held(B::FlippedBit { id: 0x185, bit });
        assert!(outcome.fault.to_string().contains(words), "bit {bit}: {}", outcome.fault);
    }
}

#[test]
fn a_drive_whose_units_are_not_those_of_the_rig_file_is_not_armed_and_gets_no_power() {
    for (fault, code, words) in [
        (
            B::WrongReading(0x60A8, 0, 0x0041_0000),
            "wrong_unit",
            "60A8h:00 is 00410000h, and 00B50000h is expected",
        ),
        (B::WrongReading(0x60A9, 0, 0x00B4_4700), "wrong_unit", "set 60A9h to 00B50300h"),
        (B::WrongReading(0x60AA, 0, 0x00C0_0300), "wrong_unit", "60AAh:00"),
        (B::WrongReading(0x6091, 1, 5), "wrong_unit", "6091h:01 is 00000005h"),
        (B::WrongReading(0x6092, 1, 3600), "wrong_unit", "6092h:01"),
        (B::WrongReading(0x607E, 0, 0x80), "wrong_unit", "set 607Eh to 0"),
    ] {
        let bench = Bench::new(MotorKind::Cia402);
        bench.strike(fault);
        if let B::WrongReading(index @ (0x6091 | 0x6092), ..) = fault {
            bench.strike(B::WrongReading(index, 2, 1));
        }
        let refused = bench.arm().unwrap_err();
        assert_eq!(refused.code(), code, "{fault:?}: {refused}");
        assert!(refused.to_string().contains(words), "{fault:?}: {refused}");
        assert!(bench.bus.world().power.is_empty(), "{fault:?}: it had power");
    }
}

#[test]
fn a_drive_whose_units_say_what_the_rig_file_says_is_armed() {
    let bench = Bench::new(MotorKind::Cia402);
    for (index, sub, value) in [
        (0x60A8, 0, 0x00B5_0000),
        (0x60A9, 0, 0x00B5_0300),
        (0x607E, 0, 0),
        (0x6091, 1, 1),
        (0x6091, 2, 1),
        (0x6092, 1, 131_072),
        (0x6092, 2, 1),
    ] {
        bench.strike(B::WrongReading(index, sub, value));
    }
    bench.arm().unwrap();
}

const NO_SUCH_OBJECT: u32 = 0x0602_0000;

#[test]
fn a_drive_without_an_optional_object_is_armed_and_one_without_a_guard_is_not() {
    for index in [0x1029, 0x605A, 0x605E, 0x6065, 0x6066, 0x607C, 0x6080, 0x6099, 0x609A] {
        let bench = Bench::new(MotorKind::Cia402);
        bench.strike(B::Aborted(index, NO_SUCH_OBJECT));
        bench.arm().unwrap_or_else(|fault| panic!("{index:04X}h: {fault}"));
    }
    for index in [0x1016, 0x1017, 0x6007, 0x6072, 0x6076, 0x607D, 0x6085, 0x608F, 0x6098, 0x60C2] {
        let bench = Bench::new(MotorKind::Cia402);
        bench.strike(B::Aborted(index, NO_SUCH_OBJECT));
        let refused = bench.arm().unwrap_err();
        assert_eq!(refused.code(), "object_missing", "{index:04X}h: {refused}");
        assert!(bench.bus.world().power.is_empty(), "{index:04X}h: it had power");
    }
}

/// A wrong number of counts is the same factor in targets and positions: no motion shows it, and no limit holds.
#[test]
fn a_drive_that_does_not_tell_its_counts_is_armed_only_if_they_were_checked_by_hand() {
    let bench = |is_checked: bool| {
        let bench = Bench::with(MotorKind::Cia402, |rig| {
            rig["motor"]["counts_checked_by_hand"] = json!(is_checked);
        });
        bench.strike(B::Aborted(0x608F, NO_SUCH_OBJECT));
        bench.arm()
    };
    let refused = bench(false).unwrap_err();
    assert!(refused.to_string().contains("set motor.counts_checked_by_hand to true"), "{refused}");
    bench(true).unwrap();
}

/// By the standard the origin is home plus the offset, by some drives home minus it: the start position was twice the offset beside.
#[test]
fn the_start_position_does_not_depend_on_what_the_drive_means_by_its_home_offset() {
    for method in [37, 34] {
        for offset_rad in [0.15, -0.04] {
            let bench = Bench::with(MotorKind::Cia402, |rig| {
                rig["motor"]["homing"]["offset_rad"] = json!(offset_rad);
                rig["motor"]["homing"]["method"] = json!(method);
            });
            // What somebody set before.
            bench.strike(B::Held(0x607C, 5000));
            bench.arm().unwrap_or_else(|fault| panic!("{method}, {offset_rad}: {fault}"));
            // It counts from home, which the program has at the offset.
            let at_rad = bench.bus.world().devices[0].motor().unwrap().1;
            assert!((at_rad + offset_rad).abs() < 1e-3, "{method}, {offset_rad}: {at_rad}");
        }
    }
}

#[test]
fn everything_that_a_drive_lacks_or_refuses_is_found_at_once() {
    let bench = Bench::new(MotorKind::Cia402);
    for fault in [
        B::Aborted(0x6080, NO_SUCH_OBJECT),
        B::Aborted(0x6072, 0x0609_0031),
        B::Aborted(0x607D, NO_SUCH_OBJECT),
        B::IgnoredWrite(0x6065),
        B::WrongReading(0x60A9, 0, 0x00B4_4700),
    ] {
        bench.strike(fault);
    }
    let mut connection = bench.connection();
    let limits = HandleLimits::of_rig(&connection.file().limits);
    connection.prepare(&limits).unwrap_err();
    let told: Vec<String> = connection.findings().iter().map(ToString::to_string).collect();
    for words in [
        "6080h:00 (highest speed of the motor) is not there, and is optional: only the program limits the speed",
        "6072h:00 (highest torque of the motor): node 5 aborts",
        "607Dh:01 (lowest and highest target position) is not there, and is needed",
        "607Dh:02",
        "6065h:00",
        "set 60A9h to 00B50300h",
    ] {
        assert!(told.iter().any(|line| line.contains(words)), "{words}: {told:#?}");
    }
    connection.release().unwrap();
}

#[test]
fn a_drive_that_moves_in_another_unit_than_it_is_told_is_found_by_a_small_slow_motion() {
    for (scale, codes) in [
        (0.5, &["moved_otherwise"][..]),
        (0.0, &["moved_otherwise"]),
        (-1.0, &["moved_otherwise"]),
        (3.0, &["faster_than_asked"]),
        (60.0, &["faster_than_asked", "speed"]),
    ] {
        let bench = Bench::new(MotorKind::Cia402);
        bench.strike(B::TargetScaled(scale));
        let refused = bench.arm_and_watch().unwrap_err();
        assert!(codes.contains(&refused.code()), "{scale}: {refused}");
        let world = bench.bus.world();
        assert!(!world.power.last().unwrap().1, "{scale}: it has power");
        // A power that is removed leaves the emulated shaft where it is.
        let moved_rad = world.angle_rad();
        assert!(moved_rad.abs() < 0.06, "{scale}: the handle moved by {moved_rad} rad");
    }
}

#[test]
fn a_drive_that_homes_faster_than_it_was_told_is_stopped_within_a_few_periods() {
    // A method that moves the motor.
    let bench = Bench::with(MotorKind::Cia402, |rig| rig["motor"]["homing"]["method"] = json!(1));
    bench.strike(B::HomingStuck);
    bench.strike(B::Runaway(4.0));
    let refused = bench.arm_and_watch().unwrap_err();
    assert_eq!(refused.code(), "faster_than_asked", "{refused}");
    let world = bench.bus.world();
    assert!(!world.power.last().unwrap().1);
    let moved_rad = world.angle_rad() - 0.3;
    assert!(moved_rad < 0.07, "the handle moved by {moved_rad} rad");
}

#[test]
fn the_operator_is_not_told_that_a_motor_is_safe_whose_power_may_be_on() {
    let silent = Bench::new(MotorKind::Cia402).strike_while_held(B::AdapterGone);
    assert!(silent.fault.power_may_be_on());
    let told = silent.fault.told_when_armed();
    assert!(told.contains("MAY STILL HAVE POWER") && !told.contains("made safe"), "{told}");
    let answering = Bench::new(MotorKind::Cia402).strike_while_held(B::SdoOnly);
    assert!(!answering.fault.power_may_be_on());
    let told = answering.fault.told_when_armed();
    assert!(told.contains("made safe"), "{told}");
    assert!(
        !answering.recorded.iter().any(|fault| fault.contains("could not be confirmed")),
        "{:?}",
        answering.recorded
    );
}

#[test]
fn a_motor_on_its_own_way_to_the_start_is_supervised() {
    for (fault, code) in [
        (B::Push(14.0), "torque"),
        (B::TorqueInvalid, "not_a_number"),
        (B::CounterStale, "stale_sample"),
        (B::Dropped(0x185), "missed_cycle"),
        (B::HeartbeatStop, "heartbeat_lost"),
    ] {
        let bench = Bench::with(MotorKind::Cia402, |rig| rig["motor"]["homing"]["offset_rad"] = json!(0.15));
        // The drive counts from home, where the handle is at 0.15 rad; the fault strikes on its way to the start position.
        bench.bus.world().strike_below_rad = Some((-0.01, fault));
        let refused = bench.arm().unwrap_err();
        assert_eq!(refused.code(), code, "{fault:?}: {refused}");
        assert!(!bench.bus.world().power.last().unwrap().1, "{fault:?}: it has power");
    }
}

#[test]
fn a_program_that_was_frozen_finds_a_drive_that_stopped_by_itself() {
    let bench = Bench::new(MotorKind::Cia402);
    let outcome = bench.run(std::iter::repeat_n(0.0, 200), 100, |bench| {
        bench.clock.advance(Duration::from_millis(700));
    });
    let late = ["overrun", "emergency", "not_operational", "heartbeat_lost", "not_enabled", "missed_cycle"];
    assert_made_safe("frozen", &outcome, &late, 750);
}

#[test]
fn a_wake_up_later_than_a_period_is_a_fault_beyond_the_tolerated_number() {
    let outcome = |tolerated: u32| {
        let bench = Bench::with(MotorKind::Cia402, |rig| {
            rig["tolerate"]["missed_cycles_in_a_row"] = json!(tolerated);
        });
        let mut armed = bench.arm().unwrap();
        bench.clock.advance(Duration::from_millis(5));
        let result = armed.exchange(&follow(0.0)).map_err(|fault| fault.code().to_owned());
        (result.err(), armed.disarm().summary().overruns)
    };
    assert_eq!(outcome(0), (Some("overrun".to_owned()), 1));
    assert_eq!(outcome(1), (None, 1));
}

#[test]
fn a_session_that_ends_in_mid_ramp_stops_the_motor_on_the_ramp_and_removes_the_power() {
    let bench = Bench::new(MotorKind::Cia402);
    let mut armed = bench.arm().unwrap();
    for angle_rad in bench.ramp().take_while(|angle_rad| *angle_rad < 0.05) {
        armed.exchange(&follow(angle_rad)).unwrap();
    }
    armed.exchange(&Command { motor: Motor::Safe, cue: Cue::Rest }).unwrap();
    assert!(armed.exchange(&follow(0.0)).is_err(), "it moves no more");
    assert!(armed.disarm().summary().faults.is_empty());
    let world = bench.bus.world();
    assert!(!world.power.last().unwrap().1);
    assert!(world.angles_rad[1] < 0.16, "the handle went on to {} rad", world.angles_rad[1]);
}

#[test]
fn a_drive_that_was_restarted_after_a_fault_has_lost_its_origin_and_is_not_armed() {
    let bench = Bench::new(MotorKind::Cia402);
    let mut armed = bench.arm().unwrap();
    bench.strike(B::Reboot);
    let fault = (0..100).find_map(|_| armed.exchange(&follow(0.0)).err()).unwrap();
    assert_eq!(fault.code(), "rebooted");
    bench.bus.world().wire.faults.clear();
    let (motor, fault) = armed.disarm().arm(ArmingConsent::given(), &bench.protocol.limits).unwrap_err();
    assert_eq!((fault.code(), fault.class()), ("origin_lost", Some(FaultClass::Drive)));
    assert_eq!(motor.summary().faults.len(), 2);
}

#[test]
fn a_motor_is_armed_again_after_a_fault_that_is_over() {
    let bench = Bench::new(MotorKind::Cia402);
    let mut armed = bench.arm().unwrap();
    bench.strike(B::Error { code: 0x4310, fatal: true });
    while armed.exchange(&follow(0.0)).is_ok() {}
    bench.bus.world().wire.faults.clear();
    let again = armed.disarm().arm(ArmingConsent::given(), &bench.protocol.limits);
    let mut armed = again.map_err(|(_, fault)| fault).unwrap();
    assert!(armed.exchange(&follow(0.0)).is_ok());
}

#[test]
fn a_target_beyond_the_limits_is_never_sent() {
    let bench = Bench::new(MotorKind::Cia402);
    let mut armed = bench.arm().unwrap();
    assert_eq!(armed.exchange(&follow(0.21)).unwrap_err().code(), "command_beyond_limit");
    armed.disarm();
    assert!(bench.bus.world().angles_rad[1] < 0.2);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever strikes, and whenever: the power is off in the end, and does not come back.
    #[test]
    fn no_fault_at_any_sample_leaves_the_power_on(which in 0..HELD.len(), at in 0usize..400) {
        let (fault, codes, _) = HELD[which];
        prop_assume!(!codes.is_empty());
        let bench = Bench::new(MotorKind::Cia402);
        let outcome = bench.run(bench.ramp().chain(std::iter::repeat_n(0.0, 400)), at, |bench| bench.strike(fault));
        prop_assert!(!outcome.has_power && !outcome.power_came_back, "{fault:?} at {at}");
    }
}
