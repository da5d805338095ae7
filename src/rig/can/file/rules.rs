//! What the types of a rig file cannot say: ranges, and what must fit together.

use super::identifiers;
use super::motors::{Cia402Motor, MotorSettings};
use super::problems::Problems;
use super::rig_file::CanRigFile;
use super::signals::Carried;
use crate::protocol::Problem;
use crate::protocol::source::JsonNode;
use crate::rig::can::budget::{Budget, HIGHEST_LOAD};
use crate::rig::can::units::BusPeriod;
use crate::rig::stream_mistakes;
use crate::signal::FilterSpec;

/// Measuring devices that are watched beside the motor.
const MOST_SENSORS: usize = 2;

/// Everything that is wrong with a file whose fields have the right types.
pub(super) fn problems(file: &CanRigFile, source: &JsonNode) -> Vec<Problem> {
    let mut problems = Problems::new(source);
    master(file, &mut problems);
    motor(file, &mut problems);
    limits(file, &mut problems);
    signals(file, &mut problems);
    channels(file, &mut problems);
    frames(file, &mut problems);
    for (path, expected) in stream_mistakes(&file.streams) {
        problems.add(&path, expected, "see docs/how-to/lsl.md");
    }
    for (path, expected) in identifiers::collisions(file) {
        problems.add(&path, expected, "give each sender on the bus identifiers of its own");
    }
    if let Some(bench) = file.bench {
        problems.in_range("bench.time_stretch", bench.time_stretch, 1.0, 1000.0);
        if !matches!(file.motor, MotorSettings::Cia402(_)) {
            problems.add("bench", "a CiA 402 motor, which can be asked whether it is the emulated one", "");
        }
    }
    problems.into_list()
}

/// More on the bus than it can carry.
pub(super) fn overload(
    file: &CanRigFile,
    budget: &Budget,
    period: BusPeriod,
    source: &JsonNode,
) -> Option<Problem> {
    let load = budget.load(period, file.bit_rate);
    if load <= HIGHEST_LOAD {
        return None;
    }
    let mut problems = Problems::new(source);
    let expected = format!(
        "a load of at most {:.0} %; {} bits a period and the heartbeats take {:.0} % at {} bit/s",
        HIGHEST_LOAD * 100.0,
        budget.bits_per_period(),
        load * 100.0,
        file.bit_rate.bits_per_s()
    );
    problems.add("period_us", expected, "a longer period with several samples in a frame, or fewer frames");
    problems.into_list().pop()
}

fn master(file: &CanRigFile, problems: &mut Problems) {
    problems.in_range("period_us", f64::from(file.period_us), 100.0, 100_000.0);
    problems.in_range("master.node", f64::from(file.master.node), 1.0, 127.0);
    problems.in_range("master.heartbeat_ms", f64::from(file.master.heartbeat_ms), 1.0, 500.0);
    let (waits, beat) = (file.master.motor_waits_ms, file.master.heartbeat_ms);
    problems.in_range("master.motor_waits_ms", f64::from(waits), 1.0, longest_wait_ms(file));
    if waits < beat.saturating_mul(2) {
        problems.add(
            "master.motor_waits_ms",
            format!("at least twice heartbeat_ms, {}", beat.saturating_mul(2)),
            "or a shorter heartbeat_ms",
        );
    }
}

fn motor(file: &CanRigFile, problems: &mut Problems) {
    let mut ratio = |value: f64| {
        if value == 0.0 || !(-10_000.0..=10_000.0).contains(&value) {
            problems.add("motor.gear_ratio", "turns of the motor for one of the handle, not 0", "");
        }
    };
    match &file.motor {
        MotorSettings::Cia402(motor) => {
            ratio(motor.gear_ratio);
            cia402(motor, longest_wait_ms(file), problems);
            if BusPeriod::from_us(file.period_us).is_some_and(|period| period.interpolation().is_none()) {
                let expected = "1 to 255 times a power of ten, which is how 60C2h is written";
                problems.add("period_us", expected, "for instance 1000 or 1600");
            }
        }
        MotorSettings::Cansimple(motor) => {
            ratio(motor.gear_ratio);
            // 4 would be SYNC and EMCY of CANopen, 0 NMT, and those beyond PDOs.
            problems.in_range("motor.node", f64::from(motor.node), 1.0, 3.0);
            problems.in_range("motor.go_to_start_rad_s", motor.go_to_start_rad_s, 0.001, 2.0);
            for (field, given) in [("firmware", &motor.firmware), ("hardware", &motor.hardware)] {
                let is_version = |text: &String| {
                    text.split('.').map(|part| part.parse::<u8>().is_ok()).collect::<Vec<_>>() == [true; 3]
                };
                if !given.as_ref().is_none_or(is_version) {
                    problems.add(
                        &format!("motor.{field}"),
                        "three numbers, such as 0.6.10",
                        "as in flat_endpoints.json",
                    );
                }
            }
            problems.in_range("motor.torque_constant_nm_per_a", motor.torque_constant_nm_per_a, 1e-4, 100.0);
            heartbeat(
                "motor",
                (motor.heartbeat_ms, motor.heartbeat_wait_ms),
                longest_wait_ms(file),
                problems,
            );
            problems.in_range(
                "motor.encoder_ms",
                f64::from(motor.encoder_ms),
                1.0,
                f64::from(file.period_us) / 1e3,
            );
        }
        MotorSettings::Mit(motor) => {
            ratio(motor.gear_ratio);
            problems.in_range("motor.id", f64::from(motor.id), 1.0, 2047.0);
            problems.in_range("motor.reply_id", f64::from(motor.reply_id), 0.0, 2047.0);
            problems.in_range("motor.kp_nm_per_rad", motor.kp_nm_per_rad, 1.0, 500.0);
            problems.in_range("motor.kd_nm_s_per_rad", motor.kd_nm_s_per_rad, 0.0, 5.0);
            problems.in_range("motor.go_to_start_rad_s", motor.go_to_start_rad_s, 0.001, 2.0);
            let ranges = motor.ranges.unwrap_or_default();
            for (field, given) in [
                ("position_max_rad", ranges.position_max_rad),
                ("speed_max_rad_s", ranges.speed_max_rad_s),
                ("kp_max_nm_per_rad", ranges.kp_max_nm_per_rad),
                ("kd_max_nm_s_per_rad", ranges.kd_max_nm_s_per_rad),
                ("torque_max_nm", ranges.torque_max_nm),
            ] {
                problems.in_range(&format!("motor.ranges.{field}"), given.unwrap_or(1.0), 0.1, 10_000.0);
            }
            if !motor.has_no_limits_of_its_own {
                let advice =
                    "read about MIT mode in docs/how-to/real-motor.md and say so, or use a drive with limits";
                problems.add("motor.has_no_limits_of_its_own", "true", advice);
            }
        }
    }
    if file.sensors.len() > MOST_SENSORS {
        problems.add("sensors", format!("at most {MOST_SENSORS} sensors beside the motor"), "");
    }
    for (at, sensor) in file.sensors.iter().enumerate() {
        let path = format!("sensors[{at}]");
        problems.in_range(&format!("{path}.node"), f64::from(sensor.node), 1.0, 127.0);
        heartbeat(&path, (sensor.heartbeat_ms, sensor.heartbeat_wait_ms), longest_wait_ms(file), problems);
    }
}

fn cia402(motor: &Cia402Motor, longest_wait_ms: f64, problems: &mut Problems) {
    problems.in_range("motor.node", f64::from(motor.node), 1.0, 127.0);
    problems.in_range("motor.counts_per_revolution", f64::from(motor.counts_per_revolution), 100.0, 1e9);
    problems.in_range("motor.rated_torque_nm", motor.rated_torque_nm, 1e-3, 1e4);
    heartbeat("motor", (motor.heartbeat_ms, motor.heartbeat_wait_ms), longest_wait_ms, problems);
    problems.in_range("motor.target_wait_ms", f64::from(motor.target_wait_ms), 0.0, longest_wait_ms);
    problems.in_range("motor.quick_stop_rad_s2", motor.quick_stop_rad_s2, 0.1, 1e5);
    let homing = &motor.homing;
    if !(1..=37).contains(&homing.method) {
        problems.add(
            "motor.homing.method",
            "a method of CiA 402, 1 to 37",
            "35 or 37 takes the present position",
        );
    }
    problems.in_range("motor.homing.fast_rad_s", homing.fast_rad_s, 1e-3, 2.0);
    problems.in_range("motor.homing.slow_rad_s", homing.slow_rad_s, 1e-3, 2.0);
    problems.in_range("motor.homing.acceleration_rad_s2", homing.acceleration_rad_s2, 1e-2, 1e3);
    problems.in_range("motor.homing.offset_rad", homing.offset_rad, -3.2, 3.2);
    problems.in_range("motor.homing.timeout_s", homing.timeout_s, 0.1, 300.0);
    problems.in_range("motor.go_to_start.speed_rad_s", motor.go_to_start.speed_rad_s, 1e-3, 2.0);
    problems.in_range(
        "motor.go_to_start.acceleration_rad_s2",
        motor.go_to_start.acceleration_rad_s2,
        1e-2,
        1e3,
    );
}

/// How long anybody may wait for a sign of life, ms. On the bench it is stretched as the cycle is.
fn longest_wait_ms(file: &CanRigFile) -> f64 {
    1000.0 * file.bench.map_or(1.0, |bench| bench.time_stretch)
}

fn heartbeat(path: &str, (beat_ms, wait_ms): (u16, u16), longest_ms: f64, problems: &mut Problems) {
    problems.in_range(&format!("{path}.heartbeat_ms"), f64::from(beat_ms), 1.0, 500.0);
    if wait_ms < beat_ms.saturating_mul(2) || f64::from(wait_ms) > longest_ms {
        let expected = format!("from twice heartbeat_ms, {}, to {longest_ms}", beat_ms.saturating_mul(2));
        problems.add(&format!("{path}.heartbeat_wait_ms"), expected, "");
    }
}

fn limits(file: &CanRigFile, problems: &mut Problems) {
    let limits = &file.limits;
    let [low, high] = limits.angle_rad;
    if !(low < 0.0 && high > 0.0 && low >= -3.2 && high <= 3.2) {
        problems.add(
            "limits.angle_rad",
            "[lowest, highest] from the start position, which lies between them",
            "",
        );
    }
    problems.in_range("limits.speed_rad_s", limits.speed_rad_s, 0.01, 100.0);
    problems.in_range("limits.acceleration_rad_s2", limits.acceleration_rad_s2, 0.1, 1e5);
    problems.in_range("limits.torque_nm", limits.torque_nm, 0.1, 100.0);
    problems.in_range("limits.motor_torque_nm", limits.motor_torque_nm, 0.1, 1000.0);
    problems.in_range("limits.following_error_rad", limits.following_error_rad, 1e-4, 1.0);
    problems.in_range("limits.following_error_ms", f64::from(limits.following_error_ms), 0.0, 1000.0);
}

fn signals(file: &CanRigFile, problems: &mut Problems) {
    let signals = &file.signals;
    problems.in_range("signals.torque.samples", signals.torque.samples as f64, 1.0, 8.0);
    let scale = |value: f64| value.is_finite() && value != 0.0;
    if !scale(signals.torque.nm_per_count) {
        problems.add("signals.torque.nm_per_count", "N m for each count, not 0", "");
    }
    let steps = signals.position_steps.map_or(1, |steps| steps.samples);
    if signals.torque.samples != steps {
        problems.add(
            "signals.torque.samples",
            format!("{steps}, as many as position_steps"),
            "torque and angle must be measured at the same times",
        );
    }
    for (field, emg) in [("emg_fcr", signals.emg_fcr), ("emg_ecr", signals.emg_ecr)] {
        let Some(emg) = emg else { continue };
        if !scale(emg.mvc_per_count) {
            problems.add(&format!("signals.{field}.mvc_per_count"), "MVC for each count, not 0", "");
        }
        if emg.samples != 1 && emg.samples != signals.torque.samples {
            problems.add(
                &format!("signals.{field}.samples"),
                format!("1, or {} as torque", signals.torque.samples),
                "EMG that is not measured with the torque would have to be resampled",
            );
        }
    }
    if let Some(display) = file.display
        && (!scale(display.nm_per_count) || !matches!(file.motor, MotorSettings::Cia402(_)))
    {
        problems.add("display", "an object of a CiA 402 drive, with N m for each count", "");
    }
}

fn channels(file: &CanRigFile, problems: &mut Problems) {
    let channels = &file.channels;
    for (name, details) in [
        ("position", &channels.position),
        ("torque", &channels.torque),
        ("emg_fcr", &channels.emg_fcr),
        ("emg_ecr", &channels.emg_ecr),
    ] {
        for (field, expected) in details.mistakes() {
            problems.add(&format!("channels.{name}.{field}"), expected, "");
        }
    }
    let Some(filter) = file.recorded_filter else { return };
    let FilterSpec::Butterworth { order, cutoff_hz, .. } = filter;
    problems.in_range("recorded_filter.order", f64::from(order), 1.0, f64::from(*FilterSpec::ORDERS.end()));
    let rate_hz = file.signals.torque.samples as f64 * 1e6 / f64::from(file.period_us.max(1));
    if !(cutoff_hz > 0.0 && cutoff_hz < rate_hz / 2.0) {
        let expected = format!("a frequency below half the sample rate of {rate_hz} Hz");
        problems.add("recorded_filter.cutoff_hz", expected, "");
    }
}

fn frames(file: &CanRigFile, problems: &mut Problems) {
    for (at, frame) in file.frames.iter().enumerate() {
        let path = format!("frames[{at}]");
        let bytes = file.frame_bytes(frame);
        if !(1..=8).contains(&bytes) {
            problems.add(
                &format!("{path}.carries"),
                format!("1 to 8 bytes; this is {bytes}"),
                "use another frame",
            );
        }
        let is_tpdo = frame.tpdo.is_some_and(|number| (1..=4).contains(&number));
        if frame.identifier().is_none_or(|id| id > 0x7FF) || (frame.node.is_some() && !is_tpdo) {
            problems.add(&path, "a node with tpdo 1 to 4, or without CANopen an id below 2048", "");
        }
        if let Some(node) = frame.node
            && !nodes(file).contains(&node)
        {
            problems.add(
                &format!("{path}.node"),
                format!("the motor or a sensor: one of {:?}", nodes(file)),
                "",
            );
        }
        for carried in
            frame.carries.iter().filter(|carried| frame.node.is_some() && !has_object(file, **carried))
        {
            problems.add(&format!("{path}.carries"), format!("an object for {carried:?} under signals"), "");
        }
    }
    let count =
        |wanted| file.frames.iter().flat_map(|frame| &frame.carries).filter(|c| **c == wanted).count();
    let cia402 = usize::from(matches!(file.motor, MotorSettings::Cia402(_)));
    let signals = &file.signals;
    for (carried, wanted) in [
        (Carried::Statusword, cia402),
        (Carried::Position, cia402),
        (Carried::PositionSteps, usize::from(signals.position_steps.is_some())),
        (Carried::Torque, 1),
        (Carried::Counter, usize::from(signals.counter.is_some())),
        (Carried::EmgFcr, usize::from(signals.emg_fcr.is_some())),
        (Carried::EmgEcr, usize::from(signals.emg_ecr.is_some())),
    ] {
        if count(carried) != wanted {
            let expected = format!("{carried:?} in {wanted} of the frames, not in {}", count(carried));
            problems.add("frames", expected, "every signal of this motor travels once");
        }
    }
}

fn has_object(file: &CanRigFile, carried: Carried) -> bool {
    let signals = &file.signals;
    match carried {
        Carried::Statusword | Carried::Position => true,
        Carried::Torque => signals.torque.object.is_some(),
        Carried::PositionSteps => signals.position_steps.is_some_and(|steps| steps.object.is_some()),
        Carried::Counter => signals.counter.is_some_and(|counter| counter.object.is_some()),
        Carried::EmgFcr => signals.emg_fcr.is_some_and(|emg| emg.object.is_some()),
        Carried::EmgEcr => signals.emg_ecr.is_some_and(|emg| emg.object.is_some()),
    }
}

fn nodes(file: &CanRigFile) -> Vec<u8> {
    let motor = match &file.motor {
        MotorSettings::Cia402(motor) => Some(motor.node),
        MotorSettings::Cansimple(_) | MotorSettings::Mit(_) => None,
    };
    motor.into_iter().chain(file.sensors.iter().map(|sensor| sensor.node)).collect()
}
