//! What must be known of a CiA 402 drive before it gets power: measured values, and offsets of its targets.

use serde_json::json;

use super::bench::{Bench, MotorKind};
use super::world::BenchFault as B;

const NO_SUCH_OBJECT: u32 = 0x0602_0000;

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
