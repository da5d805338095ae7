//! How the motor comes to rest after a fault: from the motion that it was told, never towards a reading.

use std::time::Duration;

use serde_json::{Value, json};

use super::bench::{Bench, MotorKind, Outcome, follow};
use super::world::BenchFault;
use crate::rig::Armed;
use crate::rig::can::DryRun;
use crate::rig::can::file::ValidRigFile;

const PERIOD_S: f64 = 0.002;
/// An encoder count, rad.
const COUNT_RAD: f64 = std::f64::consts::TAU / 131_072.0;

fn holding_after_everything(rig: &mut Value) {
    for class in ["limit", "sensor", "drive", "bus", "cycle"] {
        rig["safe_state"][class] = json!("hold");
    }
}

/// The fault strikes in the ramp, for one period.
fn strike_once_in_ramp(bench: &Bench, fault: BenchFault) -> Outcome {
    let steepest = bench.ramp().position(|angle_rad| angle_rad > 0.05).unwrap();
    bench.run(bench.ramp().chain(std::iter::repeat_n(0.0, 200)), steepest, |bench| {
        bench.strike(fault);
        let over = bench.clock.elapsed() + Duration::from_micros(3000);
        bench.bus.world().faults_end_at(over);
    })
}

fn assert_came_to_rest_within_limits(bench: &Bench, what: &str) {
    let targets = bench.bus.world().wire.targets;
    let limits = &bench.protocol.limits;
    assert!(targets.angles_rad[1] <= limits.angle_rad[1], "{what}: {targets:?}");
    assert!(targets.angles_rad[0] >= -COUNT_RAD, "{what}: it never goes back: {targets:?}");
    assert!(targets.largest_step_rad <= limits.speed_rad_s * PERIOD_S, "{what}: {targets:?}");
    let most_change_rad = limits.acceleration_rad_s2 * PERIOD_S * PERIOD_S + 2.0 * COUNT_RAD;
    assert!(targets.largest_step_change_rad <= most_change_rad, "{what}: {targets:?}");
}

#[test]
fn a_hold_after_a_wrong_position_comes_to_rest_from_the_motion_that_was_told() {
    for bit in [16 + 13, 16 + 15, 16 + 31] {
        let bench = Bench::with(MotorKind::Cia402, holding_after_everything);
        let outcome = strike_once_in_ramp(&bench, BenchFault::FlippedBit { id: 0x185, bit });
        let what = format!("bit {bit}, {:?}", outcome.recorded);
        assert!(!outcome.has_power, "{what}");
        assert!(outcome.power_off_after >= Some(Duration::from_millis(450)), "{what}: it was held");
        assert_came_to_rest_within_limits(&bench, &what);
    }
}

#[test]
fn a_hold_in_a_fast_ramp_decelerates_and_never_turns_back() {
    for fault in [BenchFault::TorqueInvalid, BenchFault::CounterStale, BenchFault::Dropped(0x285)] {
        let bench = Bench::with(MotorKind::Cia402, holding_after_everything);
        let outcome = bench.strike_in_ramp(fault);
        let what = format!("{fault:?}, {:?}", outcome.recorded);
        assert!(outcome.power_off_after >= Some(Duration::from_millis(450)), "{what}: it was held");
        assert!(outcome.power_off_after <= Some(Duration::from_millis(560)), "{what}");
        assert_came_to_rest_within_limits(&bench, &what);
    }
}

#[test]
fn a_hold_in_which_the_motor_runs_away_ends_without_power() {
    let bench = Bench::with(MotorKind::Cia402, holding_after_everything);
    let outcome = bench.run(std::iter::repeat_n(0.0, 200), 100, |bench| {
        bench.strike(BenchFault::TorqueInvalid);
        bench.strike(BenchFault::Runaway(2.0));
    });
    assert!(
        !outcome.has_power && outcome.power_off_after < Some(Duration::from_millis(250)),
        "{:?}",
        outcome.power_off_after
    );
    assert!(outcome.recorded.len() > 1, "what ended the hold is told: {:?}", outcome.recorded);
}

#[test]
fn a_lost_frame_is_tolerated_as_often_as_the_rig_file_allows() {
    let tolerating = |rig: &mut Value| rig["tolerate"]["missed_cycles_in_a_row"] = json!(2);
    for id in [0x185, 0x285] {
        let bench = Bench::with(MotorKind::Cia402, tolerating);
        let mut armed = bench.arm().unwrap();
        for (sample, angle_rad) in bench.ramp().enumerate() {
            // One of ten frames is lost.
            let faults = if sample % 10 == 5 { vec![BenchFault::Dropped(id)] } else { Vec::new() };
            bench.bus.world().wire.faults = faults;
            armed.exchange(&follow(angle_rad)).unwrap_or_else(|fault| panic!("sample {sample}: {fault}"));
        }
        assert!(armed.disarm().summary().missed_cycles > 10);
        bench.bus.world().wire.faults.clear();
        let outcome = bench.strike_while_held(BenchFault::Dropped(id));
        assert_eq!(outcome.fault.code(), "missed_cycle", "three in a row are too many");
    }
}

#[test]
fn a_frame_that_is_late_by_periods_is_neither_double_nor_stale() {
    let bench = Bench::with(MotorKind::Cia402, |rig| rig["tolerate"]["missed_cycles_in_a_row"] = json!(5));
    let mut armed = bench.arm().unwrap();
    for sample in 0..200 {
        let late = BenchFault::Delayed(Duration::from_micros(3200));
        bench.bus.world().wire.faults = if sample % 40 == 5 { vec![late] } else { Vec::new() };
        armed.exchange(&follow(0.0)).unwrap_or_else(|fault| panic!("sample {sample}: {fault}"));
    }
    let summary = armed.disarm().summary();
    assert_eq!((summary.missed_cycles, summary.duplicate_frames), (5, 0), "{summary}");
}

#[test]
fn a_freeze_in_the_ramp_is_counted_and_the_motor_accelerates_anew() {
    let bench = Bench::with(MotorKind::Cia402, |rig| {
        rig["tolerate"]["missed_cycles_in_a_row"] = json!(50);
        rig["master"]["motor_waits_ms"] = json!(100);
    });
    let mut armed = bench.arm().unwrap();
    for (sample, angle_rad) in bench.ramp().enumerate() {
        if sample == 30 {
            bench.clock.advance(Duration::from_millis(60));
        }
        armed.exchange(&follow(angle_rad)).unwrap_or_else(|fault| panic!("sample {sample}: {fault}"));
    }
    let lost = armed.disarm().summary().lost_periods;
    assert!((29..=30).contains(&lost), "{lost}");
    let targets = bench.bus.world().wire.targets;
    // From rest after the gap: the drive's own view has a step of zero there.
    assert!(targets.largest_step_rad <= 4.0 * PERIOD_S, "{targets:?}");
}

#[test]
fn a_freeze_as_long_as_the_motor_waits_is_never_tolerated() {
    let bench = Bench::with(MotorKind::Cia402, |rig| {
        rig["tolerate"]["missed_cycles_in_a_row"] = json!(50);
    });
    let mut armed = bench.arm().unwrap();
    bench.clock.advance(Duration::from_millis(120));
    let fault = (0..3).find_map(|_| armed.exchange(&follow(0.0)).err()).expect("it is noticed");
    assert!(["overrun", "emergency", "missed_cycle", "heartbeat_lost"].contains(&fault.code()), "{fault}");
    drop(armed);
    assert!(!bench.bus.world().power.last().unwrap().1);
}

#[test]
fn a_motor_that_is_dropped_without_being_disarmed_is_made_safe() {
    let bench = Bench::new(MotorKind::Cia402);
    let mut armed = bench.arm().unwrap();
    for angle_rad in bench.ramp().take_while(|angle_rad| *angle_rad < 0.05) {
        armed.exchange(&follow(angle_rad)).unwrap();
    }
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(move || {
        let _armed = armed;
        panic!("the session has a bug");
    }));
    assert!(panicked.is_err());
    let world = bench.bus.world();
    assert!(!world.power.last().unwrap().1, "the motor has no power");
    assert!(world.angles_rad[1] < 0.16, "it braked: {:?}", world.angles_rad);
}

#[test]
fn a_quick_stop_that_would_end_beyond_the_end_stop_is_refused_before_arming() {
    let bench = Bench::new(MotorKind::Cia402);
    let mut rig: Value =
        serde_json::from_str(include_str!("../../../../fixtures/can/rigs/plain.json")).unwrap();
    rig["motor"]["quick_stop_rad_s2"] = json!(15);
    let file = ValidRigFile::parse(&rig.to_string(), "rig.json").unwrap();
    let refused = DryRun::of(&bench.protocol, &file).unwrap_err().to_string();
    assert!(
        refused.contains("a quick stop ends at") && refused.contains("motor.quick_stop_rad_s2"),
        "{refused}"
    );
}
