//! What must be known of a CiA 402 drive before it gets power: measured values.

use serde_json::json;

use super::bench::{Bench, MotorKind};
use super::world::BenchFault as B;

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
