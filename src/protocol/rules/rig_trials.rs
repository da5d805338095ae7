//! Rules on rig trials: no motion may exceed a limit with the load it is made with, and all of them take ten minutes at most.

use super::context::Rules;
use crate::protocol::units::{minutes, significant};
use crate::protocol::{
    BlockMotion, MOUNTING_S, Motion, Multisine, Protocol, RigLoad, RigMotion, RigTrialBlock,
};

/// Longest time that all rig trials may take, with the time for mounting the loads, s.
const MOST_RIG_TRIALS_S: f64 = 600.0;

/// Most blocks of rig trials, more than there is time for.
const MOST_BLOCKS: usize = 100;

/// Inertia of the lever, kg m2, damping, N m s/rad, and stiffness, N m/rad, that torques are foreseen with: those that the
/// virtual rig is assumed to have. A protocol does not know its rig; there the measured torque is limited.
const FORESEEN_LEVER: [f64; 3] = [0.0016, 0.4, 900.0];

/// Steps in a radian of the fastest oscillation.
const STEPS_PER_RADIAN: f64 = 10.0;

/// The number of blocks, and the frequencies of each.
pub(super) fn check(rules: &mut Rules) {
    let count = rules.length("rig_trials");
    if count > MOST_BLOCKS {
        let expected = format!("at most {MOST_BLOCKS} blocks; these are {count}");
        return rules.add("rig_trials", expected, "take some away".to_owned());
    }
    for block in 0..count {
        frequencies(rules, &format!("rig_trials[{block}].motion"));
    }
}

/// The time of all rig trials, and the limits of each motion with its load, of a document whose fields are right.
pub(super) fn check_motions(rules: &mut Rules, protocol: &Protocol) {
    let all_s = protocol.rig_trials_s();
    if all_s > MOST_RIG_TRIALS_S {
        let expected = format!(
            "rig trials that take {} at most, {MOUNTING_S} s for each mounting included; these take {}",
            minutes(MOST_RIG_TRIALS_S),
            minutes(all_s)
        );
        return rules.add(
            "rig_trials",
            expected,
            "lower repetitions or durations, or take loads away".to_owned(),
        );
    }
    for (number, block) in protocol.rig_trials.iter().enumerate() {
        let path = format!("rig_trials[{number}]");
        for motion in block.motions(protocol) {
            motion_is_within_limits(rules, &path, protocol, &motion);
        }
        torque_is_within_its_limit(rules, &path, protocol, block);
    }
}

/// The frequencies of a multisine must be in order, fit its duration, and be sampled.
fn frequencies(rules: &mut Rules, motion: &str) {
    let field = |name: &str| format!("{motion}.{name}");
    let (Some(lowest_hz), Some(highest_hz)) =
        (rules.number(&field("lowest_hz")), rules.number(&field("highest_hz")))
    else {
        return;
    };
    if let Some(rate_hz) = rules.number("signal.sample_rate_hz")
        && highest_hz >= rate_hz / 2.0
    {
        let expected = format!("below half the sample rate, {} Hz", rate_hz / 2.0);
        rules.add(&field("highest_hz"), expected, "lower it, or sample faster".to_owned());
        return;
    }
    if highest_hz < lowest_hz {
        let expected = format!("at least lowest_hz, {lowest_hz} Hz");
        rules.add(&field("highest_hz"), expected, "exchange the two".to_owned());
    } else if let Some(duration_s) = rules.number(&field("duration_s"))
        && Multisine::new(1.0, [lowest_hz, highest_hz], duration_s).is_none()
    {
        let expected = format!(
            "a duration in which a frequency from {lowest_hz} to {highest_hz} Hz has a whole number of periods"
        );
        let advice = format!("at least {} s", significant(1.0 / lowest_hz));
        rules.add(&field("duration_s"), expected, advice);
    }
}

/// Angle, speed and acceleration of a multisine; those of the ramps are checked with the velocities.
fn motion_is_within_limits(rules: &mut Rules, path: &str, protocol: &Protocol, motion: &RigMotion) {
    let RigMotion::Multisine(multisine) = motion else { return };
    let rate = std::f64::consts::TAU * multisine.frequencies_hz().last().unwrap_or(1.0);
    let mut most = Motion::default();
    let mut angles_rad = [0f64; 2];
    for motion in instants(motion, rate) {
        angles_rad = [angles_rad[0].min(motion.angle_rad), angles_rad[1].max(motion.angle_rad)];
        most.velocity_rad_s = most.velocity_rad_s.max(motion.velocity_rad_s.abs());
        most.acceleration_rad_s2 = most.acceleration_rad_s2.max(motion.acceleration_rad_s2.abs());
    }
    let limits = &protocol.limits;
    let path = format!("{path}.motion.amplitude_rad");
    let room_rad =
        |limit_rad: f64, angle_rad: f64| if angle_rad == 0.0 { f64::INFINITY } else { limit_rad / angle_rad };
    // How many times the amplitude each limit allows.
    let allowed = [
        (room_rad(limits.angle_rad[0], angles_rad[0]), "limits.angle_rad[0]", angles_rad[0], "rad"),
        (room_rad(limits.angle_rad[1], angles_rad[1]), "limits.angle_rad[1]", angles_rad[1], "rad"),
        (limits.speed_rad_s / most.velocity_rad_s, "limits.speed_rad_s", most.velocity_rad_s, "rad/s"),
        (
            limits.acceleration_rad_s2 / most.acceleration_rad_s2,
            "limits.acceleration_rad_s2",
            most.acceleration_rad_s2,
            "rad/s2",
        ),
    ];
    let [first, others @ ..] = allowed;
    let (times, limit, reached, unit) = others.into_iter().fold(first, |a, b| if b.0 < a.0 { b } else { a });
    if times < 1.0 {
        let amplitude_rad = rules.number(&path).unwrap_or(0.0);
        let expected = format!("a motion within {limit}; this one reaches {} {unit}", significant(reached));
        rules.add(&path, expected, at_most(amplitude_rad * times, "rad, or a lower highest_hz"));
    }
}

/// The torque that each motion of a block must be expected to reach in the lever, with its load.
fn torque_is_within_its_limit(rules: &mut Rules, path: &str, protocol: &Protocol, block: &RigTrialBlock) {
    let limit_nm = protocol.limits.torque_nm;
    let torques = block.loads().into_iter().flat_map(|load| {
        block.motions(protocol).into_iter().map(move |motion| expected_torque_nm(&motion, &load))
    });
    let peak_nm = torques.fold(0.0, f64::max);
    // A torque that overflowed is beyond every limit.
    if peak_nm <= limit_nm {
        return;
    }
    let expected = format!(
        "a load and a motion that stay below {limit_nm} N m (limits.torque_nm); up to {} N m must be expected",
        significant(peak_nm)
    );
    let times = limit_nm / peak_nm;
    let (field, advice) = match block {
        RigTrialBlock::KnownWeight { mass_kg, .. } => ("mass_kg", at_most(mass_kg * times, "kg")),
        RigTrialBlock::EmptyHandle { motion, .. }
        | RigTrialBlock::KnownInertia { motion, .. }
        | RigTrialBlock::ClampedHandle { motion, .. }
        | RigTrialBlock::KnownSpring { motion, .. } => match motion {
            BlockMotion::Ramps => {
                ("motion", "use a multisine of a small amplitude_rad, or a lighter load".to_owned())
            }
            BlockMotion::Multisine { amplitude_rad, .. } => (
                "motion.amplitude_rad",
                at_most(amplitude_rad * times, "rad, or a lower highest_hz, or a lighter load"),
            ),
        },
    };
    rules.add(&format!("{path}.{field}"), expected, advice);
}

/// Advice with a value that is itself within the limit: four digits, not rounded up.
fn at_most(value: f64, unit: &str) -> String {
    format!("at most {} {unit}", significant(value * (1.0 - 5e-4)))
}

/// The motion at instants so close that an oscillation of `rate` rad/s is followed.
fn instants(motion: &RigMotion, rate: f64) -> impl Iterator<Item = Motion> {
    let steps = (motion.duration_s() * rate * STEPS_PER_RADIAN).ceil();
    (0..=steps as u64).map(move |step| motion.at(step as f64 / steps * motion.duration_s()))
}

/// The highest torque in a lever of the usual kind, N m, either sign.
fn expected_torque_nm(motion: &RigMotion, load: &RigLoad) -> f64 {
    let [inertia, damping, stiffness] = FORESEEN_LEVER;
    if let Some(weight_nm) = load.weight_nm() {
        return weight_nm.abs();
    }
    let (inertia, spring) = match load {
        RigLoad::ClampedHandle => {
            let torques = instants(motion, libm::sqrt(stiffness / inertia))
                .map(|motion| (stiffness * motion.angle_rad + damping * motion.velocity_rad_s).abs());
            return torques.fold(0.0, f64::max);
        }
        RigLoad::EmptyHandle | RigLoad::KnownWeight { .. } => (inertia, 0.0),
        RigLoad::KnownInertia { inertia_kg_m2, .. } => (inertia + inertia_kg_m2, 0.0),
        RigLoad::KnownSpring { stiffness_nm_per_rad, .. } => (inertia, *stiffness_nm_per_rad),
    };
    // The lever's own oscillation, the motion's, and the fastest decay there is.
    let natural = libm::sqrt((stiffness + spring) / inertia).max(damping / inertia);
    let rate = natural.max(libm::sqrt(stiffness / FORESEEN_LEVER[0]));
    let steps = (motion.duration_s() * rate * STEPS_PER_RADIAN).ceil();
    let step_s = motion.duration_s() / steps;
    let torque = |motor: &Motion, [angle, speed]: [f64; 2]| {
        stiffness * (motor.angle_rad - angle) + damping * (motor.velocity_rad_s - speed)
    };
    let slope =
        |motor: &Motion, state: [f64; 2]| [state[1], (torque(motor, state) - spring * state[0]) / inertia];
    let along = |state: [f64; 2], slope: [f64; 2], time_s: f64| {
        [state[0] + time_s * slope[0], state[1] + time_s * slope[1]]
    };
    let mut state = [0.0; 2];
    let mut from = motion.at(0.0);
    let mut peak_nm = 0f64;
    for step in 0..steps as u64 {
        // Runge's and Kutta's scheme of fourth order.
        let (middle, to) = (motion.at((step as f64 + 0.5) * step_s), motion.at((step as f64 + 1.0) * step_s));
        let first = slope(&from, state);
        let second = slope(&middle, along(state, first, 0.5 * step_s));
        let third = slope(&middle, along(state, second, 0.5 * step_s));
        let fourth = slope(&to, along(state, third, step_s));
        for (own, mean) in
            state.iter_mut().zip([0, 1].map(|place: usize| {
                (first[place] + 2.0 * (second[place] + third[place]) + fourth[place]) / 6.0
            }))
        {
            *own += step_s * mean;
        }
        from = to;
        peak_nm = peak_nm.max(torque(&from, state).abs());
    }
    peak_nm
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::GRAVITY_M_S2;

    fn sine(amplitude_rad: f64, frequency_hz: f64) -> RigMotion {
        RigMotion::Multisine(Multisine::new(amplitude_rad, [frequency_hz; 2], 4.0).unwrap())
    }

    #[test]
    fn the_expected_torque_of_a_sine_is_that_of_the_transfer_function() {
        let [_, damping, stiffness] = FORESEEN_LEVER;
        for (load, inertia, spring) in [
            (RigLoad::EmptyHandle, 0.0016, 0.0),
            (RigLoad::KnownInertia { inertia_kg_m2: 0.004, relative_error: 0.01 }, 0.0056, 0.0),
            (RigLoad::KnownSpring { stiffness_nm_per_rad: 200.0, relative_error: 0.01 }, 0.0016, 200.0),
        ] {
            for frequency_hz in [5.0, 30.0, 60.0] {
                let omega = std::f64::consts::TAU * frequency_hz;
                // T_l = Z (k + j w b) theta_m / (Z + k + j w b), Z = k_spring - I w^2.
                let z = spring - inertia * omega * omega;
                let along = libm::hypot(stiffness, omega * damping);
                let across = libm::hypot(z + stiffness, omega * damping);
                let torque_nm = 0.001 * (z * along / across).abs();
                let found_nm = expected_torque_nm(&sine(0.001, frequency_hz), &load);
                // The amplitude of a sine is scaled down a little, see Multisine.
                assert!(
                    (found_nm / torque_nm - 1.0).abs() < 0.02,
                    "{load:?} {frequency_hz}: {found_nm}, {torque_nm}"
                );
            }
        }
    }

    #[test]
    fn a_clamp_takes_the_whole_turn_and_a_weight_its_own_torque() {
        let clamped_nm = expected_torque_nm(&sine(0.002, 1.0), &RigLoad::ClampedHandle);
        assert!((clamped_nm / 1.8 - 1.0).abs() < 0.01, "{clamped_nm}");
        let weight = RigLoad::KnownWeight { mass_kg: 1.0, arm_m: 0.1, sign: -1, relative_error: 0.002 };
        assert_eq!(expected_torque_nm(&RigMotion::Still { duration_s: 1.0 }, &weight), 0.1 * GRAVITY_M_S2);
    }

    /// The paper's protocol with a list of rig trials.
    fn problems(rig_trials: &str) -> String {
        let text = include_str!("../../../protocols/de-vlugt-2011.json");
        let end = text.rfind('}').unwrap();
        let text = format!("{},\n\"rig_trials\": {rig_trials}}}", &text[..end]);
        Protocol::parse(&text, "p.json").err().map_or(String::new(), |error| error.to_string())
    }

    fn multisine(amplitude_rad: f64, highest_hz: f64) -> String {
        format!(
            r#"{{ "kind": "multisine", "amplitude_rad": {amplitude_rad}, "lowest_hz": 1, "highest_hz": {highest_hz}, "duration_s": 4 }}"#
        )
    }

    fn empty(motion: &str, repetitions: u32) -> String {
        format!(r#"[{{ "kind": "empty_handle", "motion": {motion}, "repetitions": {repetitions} }}]"#)
    }

    #[track_caller]
    fn assert_refused(rig_trials: &str, parts: &[&str]) {
        let found = problems(rig_trials);
        for part in parts {
            assert!(found.contains(part), "{part} is not in {found:?}");
        }
    }

    #[test]
    fn one_block_is_enough_and_an_empty_list_is_none() {
        assert_eq!(problems(&empty(r#"{ "kind": "ramps" }"#, 1)), "");
        assert_eq!(problems("[]"), "");
    }

    #[test]
    fn each_limit_that_a_multisine_would_exceed_is_named_and_the_advice_is_accepted() {
        for (amplitude_rad, highest_hz, limit) in [
            (0.12, 2.0, "limits.angle_rad[0]"),
            (0.005, 200.0, "limits.acceleration_rad_s2"),
            (0.048, 40.0, "limits."),
        ] {
            let found = problems(&empty(&multisine(amplitude_rad, highest_hz), 1));
            assert!(
                found.contains("rig_trials[0].motion.amplitude_rad") && found.contains(limit),
                "{found:?}"
            );
            let advice = found.split("at most ").last().unwrap().split(' ').next().unwrap();
            assert_eq!(problems(&empty(&multisine(advice.parse().unwrap(), highest_hz), 1)), "", "{advice}");
        }
    }

    #[test]
    fn a_load_that_would_break_the_limit_of_the_torque_is_refused() {
        let weight = |mass_kg: f64| {
            format!(
                r#"[{{ "kind": "known_weight", "mass_kg": {mass_kg}, "arm_m": 0.1, "relative_error": 0.002,
                    "duration_s": 2, "repetitions": 1 }}]"#
            )
        };
        assert_refused(
            &weight(25.0),
            &["rig_trials[0].mass_kg is 25", "20 N m (limits.torque_nm)", "at most 20.38"],
        );
        assert_eq!(problems(&weight(20.38)), "");
        let bar = |inertia_kg_m2: f64| {
            let motion = multisine(0.004, 60.0);
            format!(
                r#"[{{ "kind": "known_inertia", "inertia_kg_m2": {inertia_kg_m2}, "relative_error": 0.01,
                    "motion": {motion}, "repetitions": 1 }}]"#
            )
        };
        assert_eq!(problems(&bar(0.004)), "");
        let ramps = r#"[{ "kind": "known_inertia", "inertia_kg_m2": 0.5, "relative_error": 0.01,
            "motion": { "kind": "ramps" }, "repetitions": 1 }]"#;
        assert_refused(ramps, &["rig_trials[0].motion", "limits.torque_nm", "lighter load"]);
        let clamped = r#"[{ "kind": "clamped_handle", "motion": { "kind": "ramps" }, "repetitions": 1 }]"#;
        assert_refused(clamped, &["rig_trials[0].motion", "limits.torque_nm"]);
    }

    #[test]
    fn mistakes_in_a_block_are_told_with_their_field() {
        assert_refused(
            &empty(r#"{ "kind": "ramps" }"#, 0),
            &["rig_trials[0].repetitions is 0", "from 1 to 100"],
        );
        assert_refused(
            &empty(r#"{ "kind": "chirp" }"#, 1),
            &["rig_trials[0].motion.kind", "ramps, multisine"],
        );
        assert_refused(
            r#"[{ "kind": "empty_handel", "motion": { "kind": "ramps" }, "repetitions": 1 }]"#,
            &["rig_trials[0].kind", "did you mean \"empty_handle\"?"],
        );
        assert_refused(
            r#"[{ "kind": "clamped_handle", "motion": { "kind": "ramps" }, "repetitions": 1, "mass_kg": 1 }]"#,
            &["rig_trials[0].mass_kg", "no field of this name"],
        );
        assert_refused(
            &empty(&multisine(0.001, 1250.0), 1),
            &["motion.highest_hz is 1250", "below half the sample rate"],
        );
        assert_refused(
            &empty(&multisine(0.001, 0.5), 1),
            &["motion.highest_hz is 0.5", "at least lowest_hz"],
        );
        let short = r#"{ "kind": "multisine", "amplitude_rad": 0.001, "lowest_hz": 0.1, "highest_hz": 0.2, "duration_s": 1 }"#;
        assert_refused(&empty(short, 1), &["motion.duration_s is 1", "whole number of periods"]);
        assert_refused("{}", &["rig_trials"]);
    }

    #[test]
    fn more_than_ten_minutes_are_refused_however_many_trials_they_are() {
        assert_eq!(problems(&empty(&multisine(0.001, 10.0), 100)), "");
        let long = multisine(0.001, 10.0).replace("\"duration_s\": 4", "\"duration_s\": 8");
        assert_refused(&empty(&long, 100), &["rig_trials", "10 min 00 s at most"]);
        let block = empty(r#"{ "kind": "ramps" }"#, 100);
        let many = vec![block.trim_matches(['[', ']']); 101].join(",");
        assert_refused(&format!("[{many}]"), &["at most 100 blocks; these are 101"]);
    }

    #[test]
    fn the_protocol_of_the_paper_with_all_loads_takes_ten_minutes_at_most() {
        let text = include_str!("../../../protocols/de-vlugt-2011-rig-trials.json");
        let protocol = Protocol::parse(text, "de-vlugt-2011-rig-trials.json").unwrap();
        let plan = protocol.rig_plan();
        let mut mounted = None;
        let all_s: f64 = plan.iter().map(|trial| trial.expected_s(mounted.replace(trial.load))).sum();
        assert!((all_s - protocol.rig_trials_s()).abs() < 1e-9 && all_s <= 600.0, "{all_s}");
        let loads: std::collections::BTreeSet<&str> = plan.iter().map(|trial| trial.load.name()).collect();
        assert_eq!(loads.len(), 5);
        let positions: Vec<u32> = plan.iter().map(|trial| trial.position).collect();
        assert_eq!(positions, (1..=plan.len() as u32).collect::<Vec<_>>());
    }
}
