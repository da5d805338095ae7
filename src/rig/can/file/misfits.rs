//! What only a whole file without any other mistake can be asked for: whether drive, sensor and tolerances can do what the limits
//! rest on.

use super::drive_numbers::unholdable;
use super::motors::MotorSettings;
use super::problems::Problems;
use super::rig_file::CanRigFile;
use crate::protocol::Problem;
use crate::protocol::source::JsonNode;
use crate::rig::can::canopen::DataType;

/// Everything in which the parts of a file do not fit each other.
pub(super) fn misfits(file: &CanRigFile, source: &JsonNode) -> Vec<Problem> {
    let mut problems = Problems::new(source);
    if let MotorSettings::Cia402(motor) = &file.motor {
        for (field, expected, advice) in unholdable(motor, &file.limits) {
            problems.add(field, expected, advice);
        }
    }
    torque_reach(file, &mut problems);
    unseen_time(file, &mut problems);
    problems.into_list()
}

/// A torque beyond its limit must have a number, on either side: a sensor at the end of its range shows no more than that.
fn torque_reach(file: &CanRigFile, problems: &mut Problems<'_>) {
    let (torque, limit_nm) = (&file.signals.torque, file.limits.torque_nm);
    let ends = match torque.kind {
        DataType::F32 => [f64::NEG_INFINITY, f64::INFINITY],
        DataType::U8 | DataType::U16 | DataType::U32 => [0.0, highest(torque.kind.bytes(), 8)],
        // The lowest number is often that of a torque that was not measured.
        DataType::I8 | DataType::I16 | DataType::I32 => {
            let high = highest(torque.kind.bytes(), 7);
            [-high, high]
        }
    };
    let [one_nm, other_nm] = ends.map(|end| end * torque.nm_per_count);
    let mut check = |path: &str, low_nm: f64, high_nm: f64, advice: &str| {
        if -low_nm > limit_nm && high_nm > limit_nm {
            return;
        }
        let expected = format!(
            "torques beyond limits.torque_nm, {limit_nm} N m, on both sides; these end at {low_nm:.4} and {high_nm:.4} N m, \
             and a larger torque would not be seen"
        );
        problems.add(path, expected, advice);
    };
    check(
        "signals.torque",
        one_nm.min(other_nm),
        one_nm.max(other_nm),
        "lower limits.torque_nm, or let the sensor send a wider type or a coarser scale",
    );
    if let Some([low_nm, high_nm]) = file.channels.torque.range {
        check("channels.torque.range", low_nm, high_nm, "lower limits.torque_nm, or use a stronger sensor");
    }
}

/// Largest number of so many bytes, the last of which has `bits_of_last` bits.
fn highest(bytes: usize, bits_of_last: u32) -> f64 {
    let bits = 8 * (bytes as u32 - 1) + bits_of_last;
    f64::from(bits).exp2() - 1.0
}

/// A motor or a torque that is not seen must be noticed within the time after which a motor that does not hear the program stops by
/// itself. The emulated motor of a bench file waits for the program instead.
fn unseen_time(file: &CanRigFile, problems: &mut Problems<'_>) {
    if file.bench.is_some() {
        return;
    }
    let most = u64::from(file.master.motor_waits_ms) * 1000 / u64::from(file.period_us.max(1));
    let tolerate = &file.tolerate;
    for (path, periods) in [
        ("tolerate.missed_cycles_in_a_row", tolerate.missed_cycles_in_a_row),
        ("tolerate.unchanged_torque_periods", tolerate.unchanged_torque_periods),
    ] {
        if u64::from(periods) > most {
            let expected = format!(
                "at most {most} periods, so that a motor or a torque that is not seen is noticed within master.motor_waits_ms, {} ms",
                file.master.motor_waits_ms
            );
            problems.add(path, expected, "with a subject at the handle, no missed cycle is tolerated");
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::{CanRigFileError, ValidRigFile};

    const PLAIN: &str = include_str!("../../../../fixtures/can/rigs/plain.json");

    /// What is told about a file for a real motor with some fields changed: path and whole line.
    fn told(change: impl FnOnce(&mut Value)) -> Vec<(String, String)> {
        let mut rig: Value = serde_json::from_str(PLAIN).unwrap();
        rig["bench"] = Value::Null;
        rig["master"]["motor_waits_ms"] = json!(100);
        rig["motor"]["heartbeat_wait_ms"] = json!(100);
        rig["motor"]["target_wait_ms"] = json!(0);
        rig["tolerate"]["missed_cycles_in_a_row"] = json!(0);
        change(&mut rig);
        match ValidRigFile::parse(&rig.to_string(), "rig.json") {
            Ok(_) => Vec::new(),
            Err(CanRigFileError::Invalid { problems, .. }) => {
                problems.iter().map(|problem| (problem.path.clone(), problem.to_string())).collect()
            }
            Err(other) => panic!("{other}"),
        }
    }

    fn assert_told(path: &str, words: &[&str], change: impl FnOnce(&mut Value)) {
        let told = told(change);
        let [(found, line)] = told.as_slice() else { panic!("{path}: {told:?}") };
        assert_eq!(found, path, "{line}");
        assert!(words.iter().all(|word| line.contains(word)), "{line}");
    }

    #[test]
    fn number_that_an_object_of_the_drive_cannot_hold_is_refused_with_the_largest_that_it_holds() {
        assert_eq!(told(|_| {}), []);
        assert_told("motor.quick_stop_rad_s2", &["6085h", "4294967295", "encoder"], |rig| {
            rig["motor"]["gear_ratio"] = json!(100);
            rig["motor"]["quick_stop_rad_s2"] = json!(10_000);
        });
        assert_told("motor.homing.acceleration_rad_s2", &["609Ah", "4294967295"], |rig| {
            rig["motor"]["gear_ratio"] = json!(500);
            rig["motor"]["homing"]["acceleration_rad_s2"] = json!(999);
        });
        assert_told("limits.motor_torque_nm", &["6072h", "65535", "this one is 75000"], |rig| {
            rig["motor"]["rated_torque_nm"] = json!(0.4);
        });
        let told = told(|rig| {
            rig["motor"]["counts_per_revolution"] = json!(1_000_000_000);
            rig["motor"]["gear_ratio"] = json!(60);
            rig["motor"]["quick_stop_rad_s2"] = json!(0.4);
            rig["motor"]["homing"]["acceleration_rad_s2"] = json!(0.4);
            rig["motor"]["rated_torque_nm"] = json!(1);
        });
        let paths: Vec<_> = told.iter().map(|(path, _)| path.as_str()).collect();
        assert_eq!(paths, ["limits.angle_rad"], "607Ah: {told:?}");
        assert!(told[0].1.contains("2147483647"), "{told:?}");
    }

    #[test]
    fn limit_that_is_less_than_a_count_of_the_drive_is_refused() {
        assert_told("limits.speed_rad_s", &["6080h", "this one is 0"], |rig| {
            rig["limits"]["speed_rad_s"] = json!(0.1);
        });
        assert_told("limits.following_error_rad", &["6065h", "this one is 0"], |rig| {
            rig["motor"]["counts_per_revolution"] = json!(100);
        });
        assert_told("limits.motor_torque_nm", &["6072h", "this one is 0"], |rig| {
            rig["motor"]["rated_torque_nm"] = json!(8000);
            rig["motor"]["gear_ratio"] = json!(50);
            rig["limits"]["motor_torque_nm"] = json!(0.1);
        });
    }

    #[test]
    fn torque_limit_beyond_what_the_sensor_can_show_is_refused() {
        assert_told("signals.torque", &["12 N m", "-1.2700 and 1.2700"], |rig| {
            rig["signals"]["torque"]["type"] = json!("i8");
            rig["signals"]["torque"]["nm_per_count"] = json!(0.01);
            rig["signals"]["torque"]["invalid"] = json!(-128);
        });
        assert_told("signals.torque", &["both sides", "0.0000"], |rig| {
            rig["signals"]["torque"]["type"] = json!("u16");
            rig["signals"]["torque"]["invalid"] = Value::Null;
        });
        assert_told("signals.torque", &["16.3835"], |rig| rig["limits"]["torque_nm"] = json!(20));
        for range in [[-5, 20], [-20, 12], [-12, 12]] {
            assert_told("channels.torque.range", &["12 N m"], |rig| {
                rig["channels"] = json!({ "torque": { "range": range } });
            });
        }
        assert_eq!(told(|rig| rig["channels"] = json!({ "torque": { "range": [-15, 15] } })), []);
    }

    #[test]
    fn motor_and_torque_may_be_unseen_no_longer_than_the_motor_waits_for_the_program() {
        for field in ["missed_cycles_in_a_row", "unchanged_torque_periods"] {
            let path = format!("tolerate.{field}");
            assert_told(&path, &["at most 50 periods", "100 ms"], |rig| rig["tolerate"][field] = json!(51));
            assert_eq!(told(|rig| rig["tolerate"][field] = json!(50)), []);
        }
    }
}
