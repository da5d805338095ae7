//! A drive that does not do what it is told, or something else than it says: homing that moves, quick stops that do not stop.

use std::time::Duration;

use serde_json::json;

use super::bench::{Bench, MotorKind, Outcome, follow};
use super::world::BenchFault;
use crate::rig::Armed;

/// In the middle of the ramp the drive begins to disobey, and the subject's torque goes beyond its limit.
fn disobeys_in_ramp(fault: BenchFault) -> Outcome {
    let bench = Bench::new(MotorKind::Cia402);
    let steepest = bench.ramp().position(|angle_rad| angle_rad > 0.03).unwrap();
    bench.run(bench.ramp().chain(std::iter::repeat_n(0.0, 200)), steepest, |bench| {
        bench.strike(fault);
        bench.strike(BenchFault::Push(14.0));
    })
}

fn assert_off(outcome: &Outcome, within: Duration, told: &str) {
    let recorded = outcome.recorded.join("; ");
    assert_eq!(outcome.fault.code(), "torque", "{recorded}");
    assert!(!outcome.has_power && !outcome.power_came_back, "{recorded}");
    let after = outcome.power_off_after.unwrap();
    assert!(after <= within, "power off after {after:?}: {recorded}");
    assert!(recorded.contains(told), "{recorded}");
}

/// Its power went off after the time that a quick stop from the speed limit takes.
#[test]
fn drive_that_ignores_a_quick_stop_loses_its_power_after_three_periods() {
    let outcome = disobeys_in_ramp(BenchFault::QuickStopIgnored);
    assert_off(&outcome, Duration::from_millis(14), "did not begin it in 3 periods");
}

#[test]
fn drive_that_does_not_slow_down_in_its_quick_stop_loses_its_power() {
    let outcome = disobeys_in_ramp(BenchFault::QuickStopCoasts);
    assert_off(&outcome, Duration::from_millis(30), "should have slowed down");
}

/// The program's own heartbeat kept the power on for two seconds.
#[test]
fn drive_that_ignores_every_controlword_is_left_to_its_watchdog_at_once() {
    let outcome = disobeys_in_ramp(BenchFault::ControlwordIgnored);
    assert_off(&outcome, Duration::from_millis(140), "PRESS THE EMERGENCY STOP");
}

#[test]
fn drive_that_obeys_nothing_but_is_asked_over_sdo_alone_is_left_to_its_watchdog_after_a_tenth_of_a_second() {
    let bench = Bench::new(MotorKind::Cia402);
    let outcome = bench.run(std::iter::repeat_n(0.0, 200), 100, |bench| {
        bench.strike(BenchFault::ControlwordIgnored);
        bench.strike(BenchFault::SdoOnly);
    });
    let after = outcome.power_off_after.unwrap();
    assert!(!outcome.has_power && after <= Duration::from_millis(400), "{after:?}: {:?}", outcome.recorded);
}

/// The session ended without a trace of it.
#[test]
fn drive_that_keeps_its_power_at_the_end_of_a_session_is_recorded() {
    let bench = Bench::new(MotorKind::Cia402);
    let armed = bench.arm().unwrap();
    bench.strike(BenchFault::ControlwordIgnored);
    let recorded = armed.disarm().summary().faults;
    assert!(!bench.bus.world().power.last().unwrap().1, "it has power: {recorded:?}");
    assert!(recorded.iter().any(|fault| fault.contains("kept its power for 100 ms")), "{recorded:?}");
    let bench = Bench::new(MotorKind::Cia402);
    let recorded = bench.arm().unwrap().disarm().summary().faults;
    assert!(recorded.is_empty(), "a drive that obeys: {recorded:?}");
}

/// It went on as if the drive followed: the vendor's tool moved the handle.
#[test]
fn drive_under_local_control_is_a_fault_unless_it_never_shows_remote() {
    let bench = Bench::new(MotorKind::Cia402);
    let outcome = bench.strike_while_held(BenchFault::LocalControl);
    let recorded = outcome.recorded.join("; ");
    assert_eq!(outcome.fault.code(), "local_control", "{recorded}");
    assert!(outcome.fault.to_string().contains("under local control"), "{}", outcome.fault);
    assert!(!outcome.has_power && !outcome.power_came_back, "{recorded}");
    let bench = Bench::new(MotorKind::Cia402);
    bench.strike(BenchFault::RemoteNeverShown);
    let mut armed = bench.arm().unwrap();
    for _ in 0..100 {
        armed.exchange(&follow(0.0)).unwrap();
    }
}

fn homing_fault(method: i8, fault: BenchFault) -> (String, Bench) {
    let bench = Bench::with(MotorKind::Cia402, |rig| rig["motor"]["homing"]["method"] = json!(method));
    bench.strike(fault);
    let fault = bench.arm_and_watch().unwrap_err();
    assert!(!bench.bus.world().power.last().unwrap().1, "{fault}");
    (fault.code().to_owned(), bench)
}

#[test]
fn homing_at_the_present_position_that_moves_the_motor_is_a_fault_within_a_few_milliradians() {
    for method in [35, 37] {
        for speed_rad_s in [0.1, -0.2] {
            let (code, bench) = homing_fault(method, BenchFault::HomingMoves(speed_rad_s));
            assert_eq!(code, "moved_while_homing");
            let moved_rad = (bench.bus.world().angle_rad() - 0.3).abs();
            assert!((0.005..0.008).contains(&moved_rad), "{moved_rad}");
        }
    }
}

/// It went on until the timeout, through the handle's end stops.
#[test]
fn search_for_home_that_goes_further_than_the_limits_are_apart_is_a_fault() {
    let bench = |rad_s: f64| {
        let bench = Bench::with(MotorKind::Cia402, |rig| {
            rig["motor"]["homing"]["method"] = json!(34);
            rig["motor"]["homing"]["fast_rad_s"] = json!(2.0);
            rig["motor"]["homing"]["acceleration_rad_s2"] = json!(1000);
        });
        bench.strike(BenchFault::HomingMoves(rad_s));
        bench
    };
    for rad_s in [2.0, -2.0] {
        let bench = bench(rad_s);
        let fault = bench.arm_and_watch().unwrap_err();
        assert_eq!(fault.code(), "homing_too_far", "{fault}");
        assert!(!bench.bus.world().power.last().unwrap().1, "{fault}");
    }
    bench(0.5).arm_and_watch().unwrap();
}

#[test]
fn origin_that_is_not_at_the_homing_offset_is_a_fault() {
    for misplaced_rad in [0.05, -0.3] {
        let (code, _) = homing_fault(37, BenchFault::HomingMisplaced(misplaced_rad));
        assert_eq!(code, "origin_misplaced", "{misplaced_rad}");
    }
}
