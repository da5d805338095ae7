//! The start position outlives the program, and the operator's stop is heard while the motor is armed.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serde_json::json;

use super::bench::{Bench, MotorKind, follow};
use super::world::BenchFault;
use crate::rig::can::{ArmedCanMotor, CanMotor, OriginError, ResumedOrigin};
use crate::rig::{Armed, ArmingConsent, Fault, Origin, Rig};
use crate::timing::Clock;

fn arm(bench: &Bench, motor: CanMotor) -> Result<ArmedCanMotor, Fault> {
    motor.arm(ArmingConsent::given(), &bench.protocol.limits).map_err(|(_, fault)| fault)
}

/// The angle of the handle from the start position that the first process set, rad.
fn handle_rad(bench: &Bench) -> f64 {
    let devices = &bench.bus.world().devices;
    devices.iter().find_map(|device| device.motor()).unwrap().1
}

/// A session is under way with the handle at an angle when its program is killed. The motor has stopped by itself.
fn killed_at(bench: &Bench, angle_rad: f64) {
    let mut armed = arm(bench, bench.motor()).unwrap();
    let steps = 200;
    for step in 0..=steps {
        armed.exchange(&follow(angle_rad * f64::from(step) / f64::from(steps))).unwrap();
    }
    for _ in 0..20 {
        armed.exchange(&follow(angle_rad)).unwrap();
    }
    std::mem::forget(armed);
    let end = bench.clock.now() + Duration::from_secs(2);
    bench.bus.world().run_until(end);
    bench.bus.world().power.clear();
}

fn with_method(method: i8) -> Bench {
    Bench::with(MotorKind::Cia402, |rig| rig["motor"]["homing"]["method"] = json!(method))
}

#[test]
fn a_drive_that_kept_its_origin_is_not_homed_by_the_process_that_resumes() {
    for method in [35, 37] {
        let bench = with_method(method);
        killed_at(&bench, 0.05);
        let mut motor = bench.motor();
        let Ok(ResumedOrigin::Kept { angle_rad }) = motor.resume_origin(true, false) else {
            panic!("the origin is kept")
        };
        assert!((angle_rad - 0.05).abs() < 1e-3 && !motor.sets_origin_here(), "{angle_rad}");
        let armed = arm(&bench, motor).unwrap();
        assert_eq!(armed.origin(), Some(Origin::Kept));
        assert!(handle_rad(&bench).abs() < 1e-3, "it went to the start position of the first process");
    }
}

#[test]
fn asking_for_the_origin_gives_no_power() {
    for kind in [MotorKind::Cia402, MotorKind::Cansimple, MotorKind::Mit] {
        let bench = Bench::new(kind);
        killed_at(&bench, 0.05);
        let before = handle_rad(&bench);
        let _ = bench.motor().resume_origin(true, false);
        let _ = bench.motor().resume_origin(true, true);
        assert!(!bench.bus.world().power.iter().any(|(_, powered)| *powered), "{kind:?}");
        assert_eq!(handle_rad(&bench), before, "{kind:?}");
    }
}

#[test]
fn a_drive_that_was_restarted_is_homed_again_on_the_operators_word_only() {
    let bench = with_method(37);
    killed_at(&bench, 0.05);
    bench.strike(BenchFault::Reboot);
    bench.bus.world().wire.faults.clear();
    let mut motor = bench.motor();
    let refused = motor.resume_origin(true, false).unwrap_err();
    assert_eq!(refused, OriginError::WordNeeded { was_restarted: true });
    let text = refused.to_string();
    assert!(text.contains("--home-here") && text.contains("where it stood when the session began"), "{text}");
    assert!(matches!(motor.resume_origin(true, true), Ok(ResumedOrigin::SetAnew { .. })));
    assert!(motor.sets_origin_here());
    assert_eq!(arm(&bench, motor).unwrap().origin(), Some(Origin::SetHere));
}

/// The mark was written before the drive had its home, and outlived a homing that failed: the place where the handle was when the drive
/// started passed for the session's origin.
#[test]
fn an_arming_whose_homing_failed_leaves_no_origin_that_could_be_kept() {
    for fault in [BenchFault::TorqueInvalid, BenchFault::HomingStuck, BenchFault::HomingMisplaced(0.02)] {
        let bench = with_method(37);
        killed_at(&bench, 0.05);
        bench.strike(BenchFault::Reboot);
        bench.bus.world().wire.faults.clear();
        let mut motor = bench.motor();
        assert!(matches!(motor.resume_origin(true, true), Ok(ResumedOrigin::SetAnew { .. })));
        bench.strike(fault);
        assert!(arm(&bench, motor).is_err(), "{fault:?}");
        bench.bus.world().wire.faults.clear();
        let refused = bench.motor().resume_origin(true, false).unwrap_err();
        assert_eq!(refused, OriginError::WordNeeded { was_restarted: true }, "{fault:?}");
        let mut motor = bench.motor();
        assert!(matches!(motor.resume_origin(true, true), Ok(ResumedOrigin::SetAnew { .. })), "{fault:?}");
        assert_eq!(arm(&bench, motor).unwrap().origin(), Some(Origin::SetHere), "{fault:?}");
    }
}

/// An encoder whose plug was loose counts nothing meanwhile, and the drive says so only until its fault is reset.
#[test]
fn a_drive_whose_encoder_failed_has_lost_its_origin_for_every_process() {
    for code in [0x7300, 0x7305, 0x7306, 0x7320] {
        let bench = with_method(37);
        let mut armed = arm(&bench, bench.motor()).unwrap();
        bench.strike(BenchFault::Error { code, fatal: true });
        assert!((0..20).any(|_| armed.exchange(&follow(0.0)).is_err()));
        let refused = arm(&bench, armed.disarm()).unwrap_err();
        assert_eq!(refused.code(), "origin_lost", "{code:04X}h: {refused}");
        let refused = bench.motor().resume_origin(true, false).unwrap_err();
        assert_eq!(refused, OriginError::WordNeeded { was_restarted: true }, "{code:04X}h");
    }
    // While nobody listened.
    let bench = with_method(37);
    killed_at(&bench, 0.05);
    bench.strike(BenchFault::Error { code: 0x7305, fatal: true });
    let later = bench.clock.now() + Duration::from_secs(1);
    bench.bus.world().run_until(later);
    let refused = bench.motor().resume_origin(true, false).unwrap_err();
    assert_eq!(refused, OriginError::WordNeeded { was_restarted: true });
}

#[test]
fn a_drive_that_was_too_hot_has_kept_its_origin() {
    let bench = with_method(37);
    let mut armed = arm(&bench, bench.motor()).unwrap();
    bench.strike(BenchFault::Error { code: 0x4310, fatal: true });
    assert!((0..20).any(|_| armed.exchange(&follow(0.0)).is_err()));
    assert_eq!(arm(&bench, armed.disarm()).unwrap().origin(), Some(Origin::Kept));
}

#[test]
fn a_handle_that_the_kept_origin_has_elsewhere_contradicts_the_operators_word() {
    let bench = with_method(37);
    killed_at(&bench, 0.05);
    let refused = bench.motor().resume_origin(true, true).unwrap_err();
    let OriginError::HandleElsewhere { angle_rad, is_sure: true } = refused else { panic!("{refused}") };
    assert!((angle_rad - 0.05).abs() < 1e-3, "{refused}");
    // At the start position there is no contradiction, and nothing is homed either.
    let bench = with_method(37);
    killed_at(&bench, 0.0);
    assert!(matches!(bench.motor().resume_origin(true, true), Ok(ResumedOrigin::Kept { .. })));
}

#[test]
fn a_drive_that_is_restarted_between_the_question_and_arming_is_not_armed() {
    let bench = with_method(37);
    killed_at(&bench, 0.05);
    let mut motor = bench.motor();
    assert!(matches!(motor.resume_origin(true, false), Ok(ResumedOrigin::Kept { .. })));
    bench.strike(BenchFault::Reboot);
    bench.bus.world().wire.faults.clear();
    assert_eq!(arm(&bench, motor).unwrap_err().code(), "origin_lost");
}

#[test]
fn a_drive_that_finds_its_origin_by_itself_and_a_session_that_never_began_need_no_word() {
    let bench = with_method(1);
    assert_eq!(bench.motor().resume_origin(true, false), Ok(ResumedOrigin::FoundByMotor));
    assert_eq!(arm(&bench, bench.motor()).unwrap().origin(), Some(Origin::Found));
    let bench = with_method(37);
    assert!(matches!(bench.motor().resume_origin(false, false), Ok(ResumedOrigin::SetAnew { .. })));
    assert_eq!(arm(&bench, bench.motor()).unwrap().origin(), Some(Origin::SetHere));
}

#[test]
fn a_motor_that_cannot_show_its_origin_is_zeroed_again_at_the_start_position_only() {
    for kind in [MotorKind::Cansimple, MotorKind::Mit] {
        let bench = Bench::new(kind);
        killed_at(&bench, 0.05);
        {
            // The wrist has pulled the handle back; somebody holds it elsewhere.
            let mut world = bench.bus.world();
            let shaft = world.shaft();
            shaft.angle_rad += 0.05;
            shaft.is_jammed = true;
        }
        let mut motor = bench.motor();
        let refused = motor.resume_origin(true, false).unwrap_err();
        assert_eq!(refused, OriginError::WordNeeded { was_restarted: false }, "{kind:?}");
        let refused = motor.resume_origin(true, true).unwrap_err();
        let OriginError::HandleElsewhere { angle_rad, is_sure: false } = refused else { panic!("{refused}") };
        assert!((angle_rad - 0.05).abs() < 2e-3, "{kind:?}: {refused}");

        let bench = Bench::new(kind);
        killed_at(&bench, 0.0);
        assert!(
            matches!(bench.motor().resume_origin(true, true), Ok(ResumedOrigin::SetAnew { .. })),
            "{kind:?}"
        );
    }
}

#[test]
fn the_same_process_arms_again_with_the_origin_that_it_has() {
    for kind in [MotorKind::Cia402, MotorKind::Cansimple, MotorKind::Mit] {
        let bench = match kind {
            MotorKind::Cia402 => with_method(37),
            kind => Bench::new(kind),
        };
        let armed = arm(&bench, bench.motor()).unwrap();
        assert_eq!(armed.origin(), Some(Origin::SetHere), "{kind:?}");
        let again = arm(&bench, armed.disarm()).unwrap();
        assert_eq!(again.origin(), Some(Origin::Kept), "{kind:?}");
    }
}

/// A motor on its way to a start position 0.3 rad off, and the operator's stop a while after arming has begun.
fn stopped_after(wait: Duration) -> (Bench, Fault, Duration) {
    let bench = Bench::with(MotorKind::Cia402, |rig| {
        rig["motor"]["homing"]["method"] = json!(37);
        rig["motor"]["homing"]["offset_rad"] = json!(0.15);
    });
    let stop = Arc::new(AtomicBool::new(false));
    bench.bus.world().stop_at = Some((bench.clock.now() + wait, stop.clone()));
    let mut motor = bench.motor();
    motor.stop_on(stop.clone());
    let begun = bench.clock.now();
    let fault = arm(&bench, motor).unwrap_err();
    assert!(stop.load(Ordering::Relaxed));
    let taken = bench.clock.now().duration_since(begun + wait);
    (bench, fault, taken)
}

#[test]
fn the_operators_stop_ends_arming_within_a_period_and_the_power_stays_off() {
    for wait_ms in (0..380).step_by(13) {
        let (bench, fault, taken) = stopped_after(Duration::from_millis(wait_ms));
        assert_eq!(fault.code(), "interrupted", "{wait_ms} ms: {fault}");
        let world = bench.bus.world();
        assert!(!world.power.last().is_some_and(|(_, powered)| *powered), "{wait_ms} ms: the power is on");
        let stopped_at = world.stop_at.as_ref().unwrap().0;
        let after: Vec<_> = world.power.iter().filter(|(at, _)| *at > stopped_at).collect();
        assert!(after.len() <= 1, "{wait_ms} ms: power goes off, and not on again: {after:?}");
        assert!(taken < Duration::from_millis(60), "{wait_ms} ms: it took {taken:?}");
    }
}

#[test]
fn an_operator_who_stops_while_a_fault_is_made_safe_does_not_disturb_that() {
    let bench = Bench::new(MotorKind::Cia402);
    let stop = Arc::new(AtomicBool::new(false));
    let mut motor = bench.motor();
    motor.stop_on(stop.clone());
    let mut armed = arm(&bench, motor).unwrap();
    stop.store(true, Ordering::Relaxed);
    for _ in 0..10 {
        armed.exchange(&follow(0.0)).expect("an armed motor listens to the session");
    }
    bench.strike(BenchFault::TorqueInvalid);
    let fault = (0..20).find_map(|_| armed.exchange(&follow(0.0)).err()).unwrap();
    assert_eq!(fault.code(), "not_a_number");
    let summary = armed.disarm().summary();
    assert_eq!(summary.faults.len(), 1, "{:?}", summary.faults);
    assert!(!bench.bus.world().power.last().unwrap().1);
}
