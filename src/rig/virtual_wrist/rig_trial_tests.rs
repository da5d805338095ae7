//! The loads of rig trials against closed forms.

use std::f64::consts::TAU;

use super::*;
use crate::protocol::{GRAVITY_M_S2, Multisine, Protocol, RigLoad, RigMotion, Sweep};
use crate::rig::LimitMonitor;
use crate::wrist::Lever;

const RATE: f64 = 2500.0;
const LEVER: Lever = Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };
const WEIGHT: RigLoad = RigLoad::KnownWeight { mass_kg: 1.5, arm_m: 0.12, sign: 1, relative_error: 0.01 };
const WEIGHT_NM: f64 = 1.5 * 0.12 * GRAVITY_M_S2;

/// A rig without noise, offset and steps.
fn quiet(lever: Option<Lever>) -> Setup {
    Setup {
        lever,
        gauge_noise_nm: 0.0,
        gauge_offset_nm: 0.0,
        gauge_step_nm: 0.0,
        encoder_counts_per_revolution: 1e12,
        ..Setup::default()
    }
}

fn with(mut setup: Setup, mechanisms: &str) -> Setup {
    setup.mechanisms = serde_json::from_str(mechanisms).unwrap();
    setup
}

/// The samples of a rig trial of `load` after half a second at rest.
fn run(setup: Setup, load: RigLoad, samples: usize, target_rad: impl Fn(f64) -> f64) -> Vec<Sample> {
    let text = include_str!("../../../protocols/quick.json");
    let limits = Protocol::parse(text, "quick.json").unwrap().limits.clone();
    let Ok(mut wrist) =
        VirtualWrist::new(Person::default(), setup, 1, RATE).arm(ArmingConsent::given(), &limits)
    else {
        panic!("the virtual wrist is always ready")
    };
    let mut exchange = |angle_rad: f64, stage| {
        let cue = Cue::RigTrial(UpcomingRigTrial { position: 1, rejections: 0, load, stage });
        wrist.exchange(&Command { motor: Motor::Follow { angle_rad }, cue }).unwrap()
    };
    for _ in 0..1250 {
        exchange(0.0, RigTrialStage::Settling);
    }
    (1..=samples).map(|sample| exchange(target_rad(sample as f64 / RATE), RigTrialStage::Moving)).collect()
}

/// Amplitude and phase of torque over that of the angle at a frequency, N m/rad, of whole periods at the end of the samples.
fn impedance(samples: &[Sample], frequency_hz: f64) -> [f64; 2] {
    let part = |value: fn(&Sample) -> f64| {
        let mut sum = [0.0; 2];
        for (place, sample) in samples.iter().enumerate() {
            let phase = TAU * frequency_hz * place as f64 / RATE;
            sum[0] += value(sample) * libm::cos(phase);
            sum[1] -= value(sample) * libm::sin(phase);
        }
        sum
    };
    let ([a, b], [c, d]) = (part(|sample| sample.torque_l_nm), part(|sample| sample.theta_m_rad));
    let square = c * c + d * d;
    [(a * c + b * d) / square, (b * c - a * d) / square]
}

/// The last second of a sine.
fn sine(setup: Setup, load: RigLoad, amplitude_rad: f64, frequency_hz: f64) -> Vec<Sample> {
    let samples = run(setup, load, 5000, |t_s| {
        amplitude_rad * (1.0 - libm::exp(-t_s * 10.0)) * libm::sin(TAU * frequency_hz * t_s)
    });
    samples[2500..].to_vec()
}

/// T_l / theta_m = Z (k + j w b) / (Z + k + j w b), with Z = k_load - I w^2.
fn lever_impedance(inertia: f64, spring: f64, frequency_hz: f64) -> [f64; 2] {
    let omega = TAU * frequency_hz;
    let z = spring - inertia * omega * omega;
    let [k, b] = [LEVER.stiffness_nm_per_rad, omega * LEVER.damping_nm_s_per_rad];
    let square = (z + k) * (z + k) + b * b;
    [z * (k * (z + k) + b * b) / square, z * z * b / square]
}

#[track_caller]
fn assert_close(found: [f64; 2], expected: [f64; 2], part: f64) {
    let off = libm::hypot(found[0] - expected[0], found[1] - expected[1]);
    assert!(off < part * libm::hypot(expected[0], expected[1]), "{found:?}, not {expected:?}");
}

#[test]
fn a_weight_gives_its_torque_in_both_directions_and_bends_the_servo() {
    for lever in [Some(LEVER), None] {
        for sign in [1, -1] {
            let load = RigLoad::KnownWeight { mass_kg: 1.5, arm_m: 0.12, sign, relative_error: 0.01 };
            let torque_nm = f64::from(sign) * WEIGHT_NM;
            for sample in run(quiet(lever), load, 500, |_| 0.0) {
                assert!((sample.torque_l_nm - torque_nm).abs() < 1e-6, "{sample:?}");
                assert!((sample.theta_m_rad + torque_nm / 1000.0).abs() < 1e-8, "{sample:?}");
            }
        }
    }
}

#[test]
fn gain_offset_and_saturation_of_the_channel_act_on_the_whole_torque_of_a_weight() {
    let gain = with(quiet(Some(LEVER)), r#"[{"mechanism":"torque_gain","parameters":{"factor":1.1}}]"#);
    let setup = Setup { gauge_offset_nm: 0.05, ..gain };
    let sample = run(setup, WEIGHT, 1, |_| 0.0)[0];
    assert!((sample.torque_l_nm - 0.05 - 1.1 * WEIGHT_NM).abs() < 1e-6, "{sample:?}");
    let clips =
        with(quiet(Some(LEVER)), r#"[{"mechanism":"torque_saturation","parameters":{"level_nm":1.2}}]"#);
    assert!((run(clips, WEIGHT, 1, |_| 0.0)[0].torque_l_nm - 1.2).abs() < 1e-6);
}

#[test]
fn empty_handle_bar_spring_and_clamp_have_the_impedance_of_their_equations() {
    let bar = RigLoad::KnownInertia { inertia_kg_m2: 0.004, relative_error: 0.01 };
    let spring = RigLoad::KnownSpring { stiffness_nm_per_rad: 20.0, relative_error: 0.01 };
    for frequency_hz in [2.0, 10.0, 40.0] {
        let of = |load| impedance(&sine(quiet(Some(LEVER)), load, 0.002, frequency_hz), frequency_hz);
        assert_close(of(RigLoad::EmptyHandle), lever_impedance(0.0016, 0.0, frequency_hz), 0.01);
        assert_close(of(bar), lever_impedance(0.0056, 0.0, frequency_hz), 0.01);
        assert_close(of(spring), lever_impedance(0.0016, 20.0, frequency_hz), 0.01);
        assert_close(of(RigLoad::ClampedHandle), [900.0, TAU * frequency_hz * 0.4], 0.01);
    }
}

#[test]
fn the_motor_is_at_rest_where_it_began_when_the_record_of_a_ramp_ends() {
    let text = include_str!("../../../protocols/de-vlugt-2011-rig-trials.json");
    let protocol = Protocol::parse(text, "protocol.json").unwrap();
    for planned in protocol.rig_plan() {
        let RigMotion::Ramp { .. } = planned.motion else { continue };
        let samples = (planned.motion.duration_s() * RATE) as usize;
        let record = run(quiet(Some(LEVER)), planned.load, samples, |t_s| planned.motion.at(t_s).angle_rad);
        let last = record.last().unwrap();
        assert!(last.theta_m_rad.abs() < 1e-6, "{} rad", last.theta_m_rad);
        assert!(last.torque_l_nm.abs() < 1e-4, "{} N m", last.torque_l_nm);
    }
}

#[test]
fn the_further_sensors_of_the_handle_obey_the_equations_of_lever_and_load() {
    let bar = RigLoad::KnownInertia { inertia_kg_m2: 0.004, relative_error: 0.01 };
    let spring = RigLoad::KnownSpring { stiffness_nm_per_rad: 20.0, relative_error: 0.01 };
    for lever in [Some(LEVER), None] {
        let setup = Setup {
            handle_encoder_counts_per_revolution: Some(1e9),
            accelerometer_noise_rad_s2: Some(0.0),
            hand_load_cell_noise_nm: Some(0.0),
            ..quiet(lever)
        };
        for load in [RigLoad::EmptyHandle, WEIGHT, bar, spring, RigLoad::ClampedHandle] {
            for sample in &sine(setup.clone(), load, 0.002, 10.0) {
                let [Some(theta_l), Some(alpha_l), Some(hand_nm), None] = sample.further else {
                    panic!("not the sensors of the rig: {sample:?}")
                };
                let inertia = lever.map_or(0.0, |lever| lever.inertia_kg_m2);
                assert!(
                    (sample.torque_l_nm - inertia * alpha_l - hand_nm).abs() < 2e-3,
                    "{load:?} {sample:?}"
                );
                let expected_nm = match load {
                    RigLoad::KnownInertia { inertia_kg_m2, .. } => inertia_kg_m2 * alpha_l,
                    RigLoad::KnownSpring { stiffness_nm_per_rad, .. } => stiffness_nm_per_rad * theta_l,
                    RigLoad::ClampedHandle => sample.torque_l_nm,
                    other => other.weight_nm().unwrap_or_default(),
                };
                assert!((hand_nm - expected_nm).abs() < 2e-3, "{load:?} {sample:?}");
                let bent_rad = sample.theta_m_rad - theta_l;
                match lever {
                    // The damper's part: 0.4 N m s/rad at the speed of the sine.
                    Some(lever) => {
                        let left_nm = sample.torque_l_nm - lever.stiffness_nm_per_rad * bent_rad;
                        assert!(left_nm.abs() < 0.06, "{load:?} {sample:?}");
                    }
                    None => assert!(bent_rad.abs() < 1e-7, "{load:?} {sample:?}"),
                }
                assert!(load != RigLoad::ClampedHandle || theta_l.abs() < 1e-5, "{sample:?}");
            }
        }
    }
}

#[test]
fn the_peak_torque_of_a_bar_in_a_ramp_is_inertia_times_acceleration() {
    // A slow rise, which the lever's own oscillation does not answer.
    let sweep = Sweep::new(0.14, 0.4, 0.3).unwrap();
    for (lever, inertia) in [(Some(LEVER), 0.0116), (None, 0.01)] {
        let bar = RigLoad::KnownInertia { inertia_kg_m2: 0.01, relative_error: 0.01 };
        let samples = run(quiet(lever), bar, 800, |t_s| sweep.at(t_s).angle_rad);
        let peak_nm = samples.iter().map(|sample| sample.torque_l_nm).fold(0.0, f64::max);
        let expected_nm = inertia * sweep.peak_acceleration_rad_s2();
        assert!((peak_nm / expected_nm - 1.0).abs() < 0.02, "{peak_nm}, not {expected_nm}");
    }
}

#[test]
fn at_a_rigid_lever_the_handle_is_the_motor() {
    let of = |load| impedance(&sine(quiet(None), load, 0.002, 10.0), 10.0);
    let omega = TAU * 10.0;
    assert_close(
        of(RigLoad::KnownInertia { inertia_kg_m2: 0.004, relative_error: 0.01 }),
        [-0.004 * omega * omega, 0.0],
        0.02,
    );
    assert_close(
        of(RigLoad::KnownSpring { stiffness_nm_per_rad: 20.0, relative_error: 0.01 }),
        [20.0, 0.0],
        0.01,
    );
    let empty = sine(quiet(None), RigLoad::EmptyHandle, 0.002, 10.0);
    assert!(empty.iter().all(|sample| sample.torque_l_nm.abs() < 1e-9), "nothing is behind the sensor");
    // A clamp holds the motor itself: what the command asks for turns the servo's spring.
    for sample in run(quiet(None), RigLoad::ClampedHandle, 10, |_| 0.002) {
        assert_eq!(sample.theta_m_rad, 0.0);
        assert!((sample.torque_l_nm - 2.0).abs() < 1e-9, "{sample:?}");
    }
}

#[test]
fn a_spring_holds_its_slope_at_a_still_angle() {
    let spring = RigLoad::KnownSpring { stiffness_nm_per_rad: 20.0, relative_error: 0.01 };
    let sweep = Sweep::new(0.1, 0.5, 0.02).unwrap();
    let last = run(quiet(Some(LEVER)), spring, 2500, |t_s| sweep.at(t_s).angle_rad)[2499];
    // Spring and lever in series.
    let slope = 20.0 * 900.0 / 920.0;
    assert!((last.torque_l_nm / last.theta_m_rad / slope - 1.0).abs() < 1e-6, "{last:?}");
}

#[test]
fn friction_of_the_bearing_resists_the_turn_and_lets_a_still_handle_be() {
    let setup = Setup { bearing_friction_nm: 0.05, ..quiet(Some(LEVER)) };
    let sweep = Sweep::new(0.14, 0.5, 0.02).unwrap();
    let samples = run(setup.clone(), RigLoad::EmptyHandle, 600, |t_s| sweep.at(t_s).angle_rad);
    assert!((samples[500].torque_l_nm - 0.05).abs() < 1e-3, "{:?}", samples[500]);
    let back = run(setup.clone(), RigLoad::EmptyHandle, 600, |t_s| -sweep.at(t_s).angle_rad);
    assert!((back[500].torque_l_nm + 0.05).abs() < 1e-3, "{:?}", back[500]);
    assert!(run(setup, RigLoad::EmptyHandle, 10, |_| 0.0).iter().all(|sample| sample.torque_l_nm == 0.0));
}

#[test]
fn mechanisms_of_the_lever_and_the_channels_are_at_work_without_a_hand_and_those_of_the_wrist_are_not() {
    let of = |mechanisms: &str, load| {
        impedance(&sine(with(quiet(Some(LEVER)), mechanisms), load, 0.002, 10.0), 10.0)
    };
    let stiff = r#"[{"mechanism":"lever_stiffness","parameters":{"stiffness_nm_per_rad":1200}}]"#;
    let found = of(stiff, RigLoad::ClampedHandle);
    assert_close(found, [1200.0, TAU * 10.0 * 0.4], 0.01);
    let lag = r#"[{"mechanism":"torque_lag","parameters":{"cutoff_hz":100}}]"#;
    let ratio = of(lag, RigLoad::ClampedHandle)[1] / of(lag, RigLoad::ClampedHandle)[0];
    let phase = libm::atan2(TAU * 10.0 * 0.4, 900.0) - libm::atan(10.0 / 100.0);
    assert!((libm::atan(ratio) - phase).abs() < 0.01, "{ratio}");
    let wrist = r#"[{"mechanism":"joint_damping","parameters":{"b_j_nm_s_per_rad":0.5}}]"#;
    assert_eq!(of(wrist, RigLoad::EmptyHandle), of("[]", RigLoad::EmptyHandle));
}

#[test]
fn a_rig_trial_draws_the_same_noise_however_long_its_load_was_mounted() {
    let text = include_str!("../../../protocols/quick.json");
    let limits = Protocol::parse(text, "quick.json").unwrap().limits.clone();
    let multisine = Multisine::new(0.005, [2.0, 40.0], 0.5).unwrap();
    let record = |mounting: usize| {
        let wrist = VirtualWrist::new(Person::default(), Setup::default(), 1, RATE);
        let Ok(mut wrist) = wrist.arm(ArmingConsent::given(), &limits) else { panic!("always ready") };
        let mut exchange = |angle_rad: f64, stage| {
            let cue = Cue::RigTrial(UpcomingRigTrial { position: 3, rejections: 0, load: WEIGHT, stage });
            wrist.exchange(&Command { motor: Motor::Follow { angle_rad }, cue }).unwrap().rounded()
        };
        for _ in 0..mounting {
            exchange(0.0, RigTrialStage::Mounting);
        }
        let mut samples: Vec<Sample> = (0..100).map(|_| exchange(0.0, RigTrialStage::Settling)).collect();
        samples.extend(
            (1..1000).map(|n| exchange(multisine.at(f64::from(n) / RATE).angle_rad, RigTrialStage::Moving)),
        );
        samples
    };
    assert_eq!(record(0), record(12_345));
}

#[test]
fn a_load_that_is_put_on_and_taken_off_turns_the_motor_within_the_limit_of_its_speed() {
    let text = include_str!("../../../protocols/quick.json");
    let limits = Protocol::parse(text, "quick.json").unwrap().limits.clone();
    let rate_hz = 5000.0;
    let Ok(mut wrist) = VirtualWrist::new(Person::default(), quiet(Some(LEVER)), 1, rate_hz)
        .arm(ArmingConsent::given(), &limits)
    else {
        panic!("always ready")
    };
    let mut monitor = LimitMonitor::new((&limits).into(), rate_hz);
    let mut exchange = |cue: Cue| {
        let sample = wrist.exchange(&Command { motor: Motor::Follow { angle_rad: 0.0 }, cue }).unwrap();
        assert_eq!(monitor.check_sample(&sample).err(), None);
        sample.theta_m_rad
    };
    let heavy = |sign| RigLoad::KnownWeight { mass_kg: 5.0, arm_m: 0.12, sign, relative_error: 0.01 };
    let turned = 5.0 * 0.12 * GRAVITY_M_S2 / Setup::default().servo_stiffness_nm_per_rad;
    for (position, sign) in [(1, 1), (2, -1)] {
        for stage in [RigTrialStage::Mounting, RigTrialStage::Settling] {
            let upcoming = UpcomingRigTrial { position, rejections: 0, load: heavy(sign), stage };
            let angle = (0..1250).map(|_| exchange(Cue::RigTrial(upcoming))).last().unwrap();
            assert!((angle.abs() - turned).abs() < 1e-6, "{angle}");
        }
    }
    let angle = (0..1250).map(|_| exchange(Cue::Rest)).last().unwrap();
    assert!(angle.abs() < 1e-4, "{angle}");
}
