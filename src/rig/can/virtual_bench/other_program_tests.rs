//! Another program commands the same motor: before it is armed, and while it follows.

use std::time::Duration;

use serde_json::json;

use super::bench::{Bench, MotorKind, follow};
use crate::rig::Armed;
use crate::rig::can::bus::{Arrival, Frame, Received};
use crate::timing::Clock;

/// A frame of the other program, in a while.
fn sends(bench: &Bench, after: Duration, id: u16, data: &[u8]) {
    let heard = bench.clock.now() + after;
    bench.bus.world().wire.put(heard, Received::Frame(Frame::new(id, data), Arrival::at(heard)));
}

/// What only one program may send: targets, requests to change an object, SYNC, network management, its own heartbeat.
const COMMANDS: [(MotorKind, u16, &[u8]); 13] = [
    (MotorKind::Cia402, 0x080, &[]),
    (MotorKind::Cia402, 0x701, &[5]),
    (MotorKind::Cia402, 0x205, &[0x0F, 0, 0, 0, 0, 0]),
    (MotorKind::Cia402, 0x605, &[0x2F, 0x60, 0x60, 0, 1, 0, 0, 0]),
    (MotorKind::Cia402, 0x000, &[2, 5]),
    (MotorKind::Cia402, 0x000, &[2, 0]),
    (MotorKind::Cansimple, 0x701, &[5]),
    (MotorKind::Cansimple, 0x02C, &[0; 8]),
    (MotorKind::Cansimple, 0x027, &[8, 0, 0, 0]),
    (MotorKind::Cansimple, 0x024, &[0; 8]),
    (MotorKind::Mit, 0x080, &[]),
    (MotorKind::Mit, 0x001, &[0xFF; 8]),
    (MotorKind::Mit, 0x701, &[5]),
];

#[test]
fn a_bus_that_another_program_commands_is_left_alone() {
    for (kind, id, data) in COMMANDS {
        let bench = Bench::new(kind);
        sends(&bench, Duration::from_millis(15), id, data);
        let fault = bench.arm().unwrap_err();
        assert_eq!(fault.code(), "other_master", "{kind:?} {id:03X}h: {fault}");
        assert_eq!(bench.bus.world().frames_sent, 0, "{kind:?}: the motor of the other program is let go");
    }
}

/// It counted as one of the foreign frames that are tolerated, and the drive took its target.
#[test]
fn a_motor_that_another_program_commands_as_well_is_stopped_at_once_and_not_held() {
    for (kind, id, data) in COMMANDS {
        let bench = Bench::with(kind, |rig| {
            rig["tolerate"]["foreign_frames_per_s"] = json!(100);
            rig["safe_state"]["bus"] = json!("hold");
        });
        let outcome = bench.run(std::iter::repeat_n(0.0, 200), 100, |bench| {
            sends(bench, Duration::from_micros(100), id, data);
        });
        assert_eq!(outcome.fault.code(), "other_master", "{kind:?} {id:03X}h: {}", outcome.fault);
        assert!(outcome.fault.to_string().contains(&format!("{id:03X}h")), "{}", outcome.fault);
        assert!(!outcome.has_power && !outcome.power_came_back, "{kind:?} {id:03X}h");
        let longest = Duration::from_millis(450);
        assert!(outcome.power_off_after < Some(longest), "{id:03X}h: {:?}", outcome.power_off_after);
    }
}

#[test]
fn frames_between_other_devices_are_foreign_and_no_commands() {
    let bench = Bench::with(MotorKind::Cia402, |rig| rig["tolerate"]["foreign_frames_per_s"] = json!(100));
    let mut armed = bench.arm().unwrap();
    let others: [(u16, &[u8]); 5] =
        [(0x000, &[1, 9]), (0x206, &[0; 6]), (0x606, &[0x40; 8]), (0x706, &[5]), (0x585, &[0x60; 8])];
    for (id, data) in others {
        sends(&bench, Duration::from_micros(100), id, data);
        for _ in 0..5 {
            armed.exchange(&follow(0.0)).unwrap_or_else(|fault| panic!("{id:03X}h: {fault}"));
        }
    }
}
