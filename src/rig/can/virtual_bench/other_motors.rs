//! Motors without CANopen, judged by what their shafts went through: power, torque, speed, angle.

use std::time::Duration;

use serde_json::{Value, json};

use super::bench::{Bench, follow};
use super::mit_motor::MitFirmware;
use super::odrive_axis::OdriveFirmware;
use super::world::BenchFault as B;
use crate::rig::{Armed, ArmingConsent, Fault, Rig};

/// The emulated wrist, turned by 0.14 rad, pulls with 2.8 N m.
const ARMING_NM: f64 = 4.0;
const ARMING_RAD_S: f64 = 0.6;

/// The encoder's own zero is the start position.
fn own_zero(rig: &mut Value) {
    rig["motor"]["zero_here"] = json!(false);
}

fn assert_never_had_power(bench: &Bench, what: &str) {
    let mut world = bench.bus.world();
    assert!(!world.power.iter().any(|(_, powered)| *powered), "{what}: it had power");
    assert_eq!(world.shaft().highest_torque_nm, 0.0, "{what}");
}

fn assert_without_power(bench: &Bench, what: &str) {
    assert!(!bench.bus.world().power.last().is_some_and(|(_, powered)| *powered), "{what}: it has power");
}

fn assert_gentle(bench: &Bench, what: &str) {
    let mut world = bench.bus.world();
    let shaft = world.shaft();
    assert!(shaft.highest_torque_nm < ARMING_NM, "{what}: {} N m", shaft.highest_torque_nm);
    assert!(shaft.highest_speed_rad_s < ARMING_RAD_S, "{what}: {} rad/s", shaft.highest_speed_rad_s);
}

fn refused(bench: &Bench, code: &str) -> Fault {
    let fault = bench.arm().expect_err(code);
    assert_eq!(fault.code(), code, "{fault}");
    assert_without_power(bench, code);
    fault
}

/// A motor of each kind, with the shaft at an angle.
fn both(angle_rad: f64) -> [(&'static str, Bench); 2] {
    [
        ("mit", Bench::mit(MitFirmware { angle_rad, ..MitFirmware::default() }, own_zero)),
        ("odrive", Bench::odrive(OdriveFirmware { angle_rad, ..OdriveFirmware::default() }, own_zero)),
    ]
}

#[test]
fn arming_far_from_the_start_position_creeps_there() {
    for (kind, bench) in both(0.14) {
        let armed = bench.arm().unwrap_or_else(|fault| panic!("{kind}: {fault}"));
        assert_gentle(&bench, kind);
        let angle_rad = bench.bus.world().shaft().angle_rad;
        assert!(angle_rad.abs() < 0.02, "{kind}: {angle_rad} rad");
        armed.disarm();
        assert_without_power(&bench, kind);
    }
}

#[test]
fn motor_beyond_its_limits_is_refused_and_never_gets_power() {
    for (kind, bench) in both(-0.1) {
        let fault = bench.arm().unwrap_err();
        assert_eq!(fault.code(), "angle", "{kind}: {fault}");
        assert_never_had_power(&bench, kind);
    }
}

#[test]
fn arming_again_after_a_fault_creeps_as_the_first_arming_does() {
    for (kind, bench) in both(0.14) {
        let mut armed = bench.arm().unwrap_or_else(|fault| panic!("{kind}: {fault}"));
        bench.strike(B::TorqueInvalid);
        let fault = (0..100).find_map(|_| armed.exchange(&follow(0.0)).err()).unwrap();
        assert_eq!(fault.code(), "not_a_number", "{kind}: {fault}");
        bench.bus.world().wire.faults.clear();
        let motor = armed.disarm();
        // The wrist pulls the handle back to where it rests.
        let later = crate::timing::Clock::now(&bench.clock) + Duration::from_secs(2);
        bench.bus.world().run_until(later);
        bench.bus.world().forget();
        let again = motor.arm(ArmingConsent::given(), &bench.protocol.limits);
        let armed = again.map_err(|(_, fault)| fault).unwrap_or_else(|fault| panic!("{kind}: {fault}"));
        assert_gentle(&bench, kind);
        armed.disarm();
    }
}

#[test]
fn wrong_position_is_a_fault_at_once_and_moves_nothing() {
    for misread_rad in [0.25, -0.25, 1e30, f64::NAN] {
        for (kind, bench) in both(0.05) {
            // A field of 16 bits has no such number.
            if kind == "mit" && (misread_rad.is_nan() || misread_rad.abs() >= 1.0) {
                continue;
            }
            for fault in [B::MisreadOnce(misread_rad), B::Misread(misread_rad)] {
                let mut armed = bench.arm().unwrap_or_else(|fault| panic!("{kind}: {fault}"));
                for _ in 0..20 {
                    armed.exchange(&follow(0.0)).unwrap();
                }
                bench.bus.world().forget();
                bench.strike(fault);
                let found = (0..5).find_map(|_| armed.exchange(&follow(0.0)).err());
                let found = found.unwrap_or_else(|| panic!("{kind}: {fault:?} is not noticed"));
                let codes = ["position_jump", "not_a_number", "field_saturated"];
                assert!(codes.contains(&found.code()), "{kind} {fault:?}: {found}");
                bench.bus.world().wire.faults.clear();
                armed.disarm();
                assert_without_power(&bench, kind);
                let mut world = bench.bus.world();
                let shaft = world.shaft();
                assert!(shaft.highest_torque_nm < 2.0, "{kind} {fault:?}: {} N m", shaft.highest_torque_nm);
                assert!(shaft.angle_rad.abs() < 0.06, "{kind} {fault:?}: {} rad", shaft.angle_rad);
            }
        }
    }
}

/// One reply, or several in a row, whose position or speed is not the shaft's, in a ramp and at rest: whatever is believed of it, the
/// motor may not be made to give more than its limit.
#[test]
fn wrong_reply_of_a_motor_in_mit_mode_makes_no_more_torque_than_the_limit() {
    let mut broken = Vec::new();
    let proof = Bench::gentle_mit(|_| {}).prove();
    let bits = (8..48).map(|bit| B::FlippedBit { id: 17, bit });
    let misread = [-0.08, -0.02, 0.012, 0.02, 0.04, 0.08].map(B::MisreadOnce);
    for fault in bits.chain(misread) {
        for (strikes_at_rad, replies) in [(0.0, 1), (0.05, 1), (0.05, 4), (0.1, 1000)] {
            let bench = Bench::gentle_mit(|rig| rig["motor"]["proved_with_free_handle"] = json!(proof));
            let mut armed = bench.arm().unwrap();
            bench.bus.world().forget();
            let mut left: Option<u32> = None;
            for angle_rad in bench.ramp() {
                if left.is_none() && angle_rad >= strikes_at_rad {
                    bench.strike(fault);
                    left = Some(replies);
                }
                left = left.map(|left| left.saturating_sub(1));
                let is_over = armed.exchange(&follow(angle_rad)).is_err();
                if left == Some(0) {
                    bench.bus.world().wire.faults.clear();
                }
                if is_over {
                    break;
                }
            }
            armed.disarm();
            let highest_nm = bench.bus.world().shaft().highest_torque_nm;
            if highest_nm > 8.0 * 1.001 {
                broken.push(format!(
                    "{fault:?} in {replies} replies from {strikes_at_rad} rad: {highest_nm:.1} N m"
                ));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn motor_in_mit_mode_goes_through_a_ramp_within_its_torque_limit() {
    let bench = Bench::gentle_mit(|_| {});
    let mut armed = bench.arm().unwrap();
    bench.bus.world().forget();
    let mut worst_rad: f64 = 0.0;
    for angle_rad in bench.ramp() {
        let sample = armed.exchange(&follow(angle_rad)).unwrap();
        worst_rad = worst_rad.max((sample.theta_m_rad - angle_rad).abs());
    }
    armed.disarm();
    let highest_nm = bench.bus.world().shaft().highest_torque_nm;
    assert!(worst_rad < 0.03 && highest_nm <= 8.0, "{worst_rad} rad, {highest_nm} N m");
}

/// It took the late reply to its last target for the one to its command to let go.
#[test]
fn late_reply_of_a_motor_in_mit_mode_that_hears_nothing_does_not_confirm_that_it_has_no_power() {
    let bench = Bench::mit(MitFirmware::default(), |rig| {
        own_zero(rig);
        rig["tolerate"]["missed_cycles_in_a_row"] = json!(5);
    });
    let mut armed = bench.arm().unwrap();
    armed.exchange(&follow(0.0)).unwrap();
    bench.strike(B::Delayed(Duration::from_millis(40)));
    armed.exchange(&follow(0.0)).unwrap();
    bench.strike(B::Deaf);
    let fault = (0..500).find_map(|_| armed.exchange(&follow(0.0)).err()).expect("it is noticed");
    assert!(fault.power_may_be_on(), "{fault}");
    assert!(armed.disarm().power_may_be_on());
}

#[test]
fn motor_in_mit_mode_that_goes_on_with_an_earlier_command_does_not_jump() {
    let bench = Bench::mit(MitFirmware { keeps_last_command: true, ..MitFirmware::default() }, own_zero);
    let armed = bench.arm().unwrap();
    assert_gentle(&bench, "keeps its last command");
    armed.disarm();
}

#[test]
fn motor_in_mit_mode_without_a_watchdog_is_refused() {
    for watchdog in [None, Some(Duration::from_secs(3))] {
        let bench = Bench::mit(MitFirmware { watchdog, ..MitFirmware::default() }, |_| {});
        refused(&bench, "watchdog_not_seen");
        assert_gentle(&bench, "without a watchdog");
    }
}

#[test]
fn watchdog_of_a_motor_in_mit_mode_is_seen_with_and_without_friction() {
    for (waits_ms, friction_nm) in [(100, 0.0), (100, 0.1), (1000, 0.0), (200, 0.05)] {
        let watchdog = Some(Duration::from_millis(waits_ms));
        let bench = Bench::mit(MitFirmware { watchdog, friction_nm, ..MitFirmware::default() }, |rig| {
            rig["master"]["motor_waits_ms"] = json!(waits_ms);
            rig["period_us"] = json!(10_000);
        });
        bench.arm().unwrap_or_else(|fault| panic!("{waits_ms} ms, {friction_nm} N m: {fault}")).disarm();
        let dead = Bench::mit(MitFirmware { watchdog: None, friction_nm, ..MitFirmware::default() }, |rig| {
            rig["master"]["motor_waits_ms"] = json!(waits_ms);
        });
        refused(&dead, "watchdog_not_seen");
    }
}

#[test]
fn motor_in_mit_mode_that_does_not_move_is_refused() {
    let bench = Bench::mit(MitFirmware { friction_nm: 5.0, ..MitFirmware::default() }, |_| {});
    refused(&bench, "not_moved_for_proof");
}

#[test]
fn firmware_with_other_ranges_is_refused_in_the_small_motion() {
    let usual = MitFirmware::default();
    for (what, firmware) in [
        ("P", MitFirmware { position_rad: 95.5, ..usual }),
        ("P", MitFirmware { position_rad: 4.0 * std::f64::consts::PI, speed_rad_s: 25.0, ..usual }),
        ("V", MitFirmware { speed_rad_s: 20.0, ..usual }),
        ("V", MitFirmware { speed_rad_s: 100.0, ..usual }),
        ("KP", MitFirmware { kp_nm_per_rad: 1000.0, ..usual }),
        ("T", MitFirmware { torque_nm: 36.0, ..usual }),
        ("T", MitFirmware { torque_nm: 9.0, ..usual }),
    ] {
        let bench = Bench::mit(firmware, |_| {});
        refused(&bench, "wrong_scale");
        assert_gentle(&bench, what);
    }
}

#[test]
fn ranges_of_the_rig_file_are_those_of_the_frames() {
    let firmware =
        MitFirmware { position_rad: 3.2, speed_rad_s: 20.0, torque_nm: 36.0, ..MitFirmware::default() };
    let bench = Bench::mit(firmware, |rig| {
        rig["limits"]["motor_torque_nm"] = json!(36);
        rig["motor"]["ranges"] = json!({"position_max_rad": 3.2, "speed_max_rad_s": 20, "torque_max_nm": 36});
    });
    bench.arm().unwrap().disarm();
}

#[test]
fn limits_beyond_the_ranges_of_a_motor_in_mit_mode_are_refused_before_there_is_power() {
    let bench = Bench::mit(MitFirmware::default(), |rig| {
        rig["motor"]["gear_ratio"] = json!(100);
        rig["motor"]["ranges"] = json!({ "torque_max_nm": 9 });
        rig["limits"]["motor_torque_nm"] = json!(900);
    });
    let fault = refused(&bench, "beyond_motor_range");
    assert!(fault.to_string().contains("position"), "{fault}");
    assert_never_had_power(&bench, "beyond its range");
}

#[test]
fn motor_in_mit_mode_that_heard_nothing_for_too_long_is_not_switched_on_again() {
    let watchdog = Some(Duration::from_millis(100));
    let bench = Bench::mit(MitFirmware { watchdog, ..MitFirmware::default() }, |rig| {
        rig["master"]["motor_waits_ms"] = json!(100);
    });
    let mut armed = bench.arm().unwrap();
    let ramp: Vec<f64> = bench.ramp().take_while(|angle_rad| *angle_rad < 0.05).collect();
    for angle_rad in ramp {
        armed.exchange(&follow(angle_rad)).unwrap();
    }
    let woken = bench.bus.world().devices[0].times_woken();
    let later = crate::timing::Clock::now(&bench.clock) + Duration::from_millis(150);
    bench.bus.world().run_until(later);
    assert!((0..3).any(|_| armed.exchange(&follow(0.05)).is_err()), "it is noticed");
    armed.disarm();
    assert_eq!(bench.bus.world().devices[0].times_woken(), woken);
    assert_without_power(&bench, "silent");
}

#[test]
fn ramp_of_a_motor_in_mit_mode_reaches_its_speed() {
    let bench = Bench::mit(MitFirmware::default(), |_| {});
    let mut armed = bench.arm().unwrap();
    let angles_rad = bench.ramp().map(|angle_rad| {
        armed.exchange(&follow(angle_rad)).unwrap();
        bench.bus.world().synced_rad
    });
    let angles_rad: Vec<f64> = angles_rad.collect();
    let steepest_rad = angles_rad.windows(5).map(|angles| angles[4] - angles[0]).fold(0.0, f64::max);
    let reached_rad_s = steepest_rad / 4.0 * bench.protocol.signal.sample_rate_hz;
    let asked_rad_s = bench.protocol.velocities_rad_s[0];
    assert!((reached_rad_s / asked_rad_s - 1.0).abs() < 0.05, "{reached_rad_s} of {asked_rad_s} rad/s");
    armed.disarm();
}

#[test]
fn endpoints_of_another_firmware_are_refused_before_anything_is_written() {
    for shift in [1, 7, 300] {
        let bench = Bench::odrive(OdriveFirmware { shift, ..OdriveFirmware::default() }, |_| {});
        refused(&bench, "wrong_endpoint");
        assert_eq!(bench.bus.world().devices[0].times_written(), 0);
        assert_never_had_power(&bench, "another firmware");
    }
}

#[test]
fn version_of_the_rig_file_is_that_of_the_axis() {
    let other = |rig: &mut Value| rig["motor"]["firmware"] = json!("0.6.11");
    refused(&Bench::odrive(OdriveFirmware::default(), other), "wrong_version");
    let silent = OdriveFirmware { tells_version: false, ..OdriveFirmware::default() };
    refused(&Bench::odrive(silent, other), "version_unknown");
    let same = Bench::odrive(OdriveFirmware::default(), |rig| {
        rig["motor"]["firmware"] = json!("0.6.10");
        rig["motor"]["hardware"] = json!("4.4.58");
    });
    same.arm().unwrap().disarm();
}

#[test]
fn firmware_that_confirms_writes_is_accepted_and_a_confirmation_is_no_reading_back() {
    let firmware = OdriveFirmware { confirms_writes: true, ..OdriveFirmware::default() };
    Bench::odrive(firmware, |_| {}).arm().unwrap().disarm();
    for confirms_writes in [false, true] {
        let bench = Bench::odrive(OdriveFirmware { confirms_writes, ..OdriveFirmware::default() }, |_| {});
        bench.strike(B::IgnoredWrite(195));
        refused(&bench, "not_taken");
        assert_never_had_power(&bench, "not taken");
    }
}

#[test]
fn torque_constant_that_is_not_that_of_the_rig_file_is_refused() {
    let firmware = OdriveFirmware { torque_constant_nm_per_a: 3.0, ..OdriveFirmware::default() };
    refused(&Bench::odrive(firmware, |_| {}), "wrong_torque_constant");
    let unknown = Bench::odrive(firmware, |rig| {
        rig["motor"]["endpoints"].as_object_mut().unwrap().remove("torque_constant");
    });
    refused(&unknown, "torque_constant_unknown");
    assert_never_had_power(&unknown, "unknown constant");
}

#[test]
fn axis_without_a_watchdog_is_refused_while_it_stands_still() {
    let bench = Bench::odrive(OdriveFirmware { has_no_watchdog: true, ..OdriveFirmware::default() }, |_| {});
    refused(&bench, "watchdog_not_seen");
    let mut world = bench.bus.world();
    assert!(world.shaft().highest_torque_nm < 0.5 && world.shaft().highest_speed_rad_s < 0.05);
}

#[test]
fn torque_of_an_axis_is_limited_on_both_sides_whatever_the_sign_of_its_gear() {
    for (gear_ratio, with_minimum) in [(1.0, true), (1.0, false)] {
        let bench = Bench::odrive(OdriveFirmware::default(), |rig| {
            rig["motor"]["gear_ratio"] = json!(gear_ratio);
            rig["limits"]["motor_torque_nm"] = json!(3);
            rig["limits"]["following_error_ms"] = json!(1000);
            rig["limits"]["following_error_rad"] = json!(1.0);
            if !with_minimum {
                rig["motor"]["endpoints"].as_object_mut().unwrap().remove("torque_soft_min");
            }
        });
        let mut armed = bench.arm().unwrap();
        bench.bus.world().forget();
        bench.bus.world().shaft().is_jammed = true;
        for angle_rad in bench.ramp() {
            if armed.exchange(&follow(angle_rad)).is_err() {
                break;
            }
        }
        armed.disarm();
        let highest_nm = bench.bus.world().shaft().highest_torque_nm;
        assert!((2.0..3.001).contains(&highest_nm), "{highest_nm} N m");
    }
}

#[test]
fn angle_of_an_axis_is_the_one_at_sync() {
    let bench = Bench::odrive(OdriveFirmware::default(), |_| {});
    let mut armed = bench.arm().unwrap();
    let mut worst_rad: f64 = 0.0;
    for angle_rad in bench.ramp().take_while(|angle_rad| *angle_rad < 0.13) {
        let sample = armed.exchange(&follow(angle_rad)).unwrap();
        let at_sync_rad = bench.bus.world().synced_rad;
        worst_rad = worst_rad.max((sample.theta_m_rad - at_sync_rad).abs());
    }
    armed.disarm();
    assert!(worst_rad < 1e-3, "{worst_rad} rad");
}

#[test]
fn ramp_of_fewer_steps_than_the_fit_needs_is_refused_before_the_session() {
    let dry_run = |position_max_rad: f64| {
        let bench = Bench::mit(MitFirmware::default(), |rig| {
            rig["motor"]["ranges"] = json!({ "position_max_rad": position_max_rad });
        });
        bench.dry_run().map_err(|error| error.to_string())
    };
    assert!(dry_run(12.5).is_ok());
    let refused = dry_run(95.5).unwrap_err();
    assert!(refused.contains("steps of 2.914 mrad"), "{refused}");
}

/// A rig file that says which motor was proved arms that one without a small motion, and no other.
#[test]
fn proof_of_a_rig_file_holds_for_one_motor() {
    let odrive = |serial_number: u32, proof: Option<&str>| {
        let firmware = OdriveFirmware { serial_number, ..OdriveFirmware::default() };
        Bench::odrive(firmware, |rig| rig["motor"]["proved_with_free_handle"] = json!(proof))
    };
    let proof = odrive(7, None).prove();
    assert!(proof.starts_with("odrive 00000007h, hardware 4.4.58, firmware 0.6.10"), "{proof}");
    odrive(7, Some(&proof)).arm().unwrap().disarm();
    let other = odrive(8, Some(&proof));
    refused(&other, "proof_of_other_motor");
    assert_never_had_power(&other, "another axis");
    let silent = Bench::odrive(OdriveFirmware::default(), |rig| {
        rig["motor"]["proved_with_free_handle"] = json!(proof);
        rig["motor"]["endpoints"].as_object_mut().unwrap().remove("serial_number");
    });
    refused(&silent, "proof_without_serial_number");

    let proof = Bench::gentle_mit(|_| {}).prove();
    let mit = |change: fn(&mut Value)| {
        Bench::gentle_mit(|rig| {
            rig["motor"]["proved_with_free_handle"] = json!(proof);
            change(rig);
        })
    };
    mit(|_| {}).arm().unwrap().disarm();
    for change in [
        (|rig| rig["motor"]["ranges"] = json!({ "position_max_rad": 12.6 })) as fn(&mut Value),
        |rig| rig["motor"]["ranges"] = json!({ "torque_max_nm": 19 }),
        |rig| rig["motor"]["reply_id"] = json!(18),
        |rig| rig["master"]["motor_waits_ms"] = json!(200),
    ] {
        let bench = mit(change);
        refused(&bench, "proof_of_other_motor");
        assert_never_had_power(&bench, "another setting");
    }
}

#[test]
fn quick_stop_of_the_dry_run_brakes_with_the_tighter_acceleration() {
    let narrow = |high_rad: f64| move |rig: &mut Value| rig["limits"]["angle_rad"] = json!([-0.1, high_rad]);
    for (mut bench, gentle_rad_s2) in [
        (Bench::gentle_mit(narrow(0.1445)), 210.0),
        (Bench::odrive(OdriveFirmware::default(), narrow(0.151)), 42.0),
    ] {
        assert!(bench.dry_run().is_ok());
        let mut protocol = crate::protocol::Protocol::clone(&bench.protocol);
        protocol.limits.acceleration_rad_s2 = gentle_rad_s2;
        bench.protocol = protocol.validate().unwrap();
        let refused = bench.dry_run().unwrap_err().to_string();
        assert!(refused.contains("a quick stop ends at"), "{refused}");
    }
}

#[test]
fn gains_that_could_make_more_than_the_torque_limit_are_refused_before_the_session_and_before_there_is_power()
{
    let stiff = |rig: &mut Value| {
        rig["motor"]["kp_nm_per_rad"] = json!(400);
        rig["motor"]["kd_nm_s_per_rad"] = json!(4);
    };
    let dry_run = |limit_nm: f64| {
        let bench = Bench::gentle_mit(|rig| {
            stiff(rig);
            rig["limits"]["motor_torque_nm"] = json!(limit_nm);
        });
        bench.dry_run().map_err(|error| error.to_string())
    };
    let refused = dry_run(8.0).unwrap_err();
    assert!(refused.contains("too high for limits.motor_torque_nm"), "{refused}");
    assert!(dry_run(17.0).is_err());
    assert!(dry_run(18.0).is_ok(), "all that the motor has");
}

#[test]
fn rig_file_without_the_fields_of_later_versions_is_read() {
    let bench = Bench::odrive(OdriveFirmware::default(), |rig| {
        let endpoints = rig["motor"]["endpoints"].as_object_mut().unwrap();
        endpoints.remove("torque_constant");
        endpoints.remove("torque_soft_min");
    });
    let fault = refused(&bench, "torque_constant_unknown");
    assert!(fault.to_string().contains("endpoints.torque_constant"), "{fault}");
}
