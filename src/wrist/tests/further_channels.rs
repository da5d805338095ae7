//! Further channels against the trace of a trial, and their derivatives against difference formulas of high order.

use super::*;
use crate::wrist::mechanisms::CATALOGUE;
use crate::wrist::{FurtherChannel, ScaledChannel, trace};

/// All further channels; a scale of one keeps their units.
const ALL: [ScaledChannel; FurtherChannel::COUNT] = [
    ScaledChannel { channel: FurtherChannel::HandleAngle, nm_per_unit: 1.0 },
    ScaledChannel { channel: FurtherChannel::HandleAcceleration, nm_per_unit: 1.0 },
    ScaledChannel { channel: FurtherChannel::HandTorque, nm_per_unit: 1.0 },
    ScaledChannel { channel: FurtherChannel::JointAngle, nm_per_unit: 1.0 },
];

fn with_further<'a>(
    kinds: &'a [MechanismKind],
    filter: &'a [Section],
    derivatives: &'a [usize],
) -> SimulationSettings<'a> {
    SimulationSettings { further: &ALL, ..settings(kinds, filter, derivatives) }
}

/// The values of the further channel number `place`.
fn channel(values: &[f64], place: usize) -> &[f64] {
    &values[(1 + place) * SAMPLES..(2 + place) * SAMPLES]
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.map(f64::abs).fold(0.0, f64::max)
}

#[test]
fn further_channels_show_the_states_and_torques_of_the_model() {
    let trial = ramp(2.6);
    for kinds in [vec![], vec![MechanismKind::LeverStiffness], vec![MechanismKind::AngleGain]] {
        let parameters = kinds.first().map_or(PERSON.to_vec(), |kind| with(*kind));
        let settings = with_further(&kinds, &[], &[]);
        let got = run(&settings, &trial, &parameters).torque_nm;
        let instants = trace(&settings, &trial, &parameters);
        for (sample, instant) in instants.iter().enumerate() {
            let of = |place: usize| channel(&got, place)[sample];
            // The trace takes Runge-Kutta steps, the simulation exact ones.
            let same = |got: f64, want: f64, tolerance: f64| {
                let is_same = (got - want).abs() < tolerance;
                assert!(is_same, "{kinds:?}, sample {sample}: {got} instead of {want}");
            };
            same(got[sample], instant.torques.measured, 1e-5);
            same(of(0), instant.state.theta_l, 1e-7);
            same(of(2), instant.torques.interface, 1e-5);
            same(of(3), instant.state.theta_j, 1e-7);
        }
        // The acceleration against the difference of the speed.
        let speed = |sample: usize| instants[sample].state.omega_l;
        let scale = largest(channel(&got, 1).iter().copied());
        for sample in 2..SAMPLES - 2 {
            let slope = (8.0 * (speed(sample + 1) - speed(sample - 1)) - speed(sample + 2)
                + speed(sample - 2))
                / (12.0 * PERIOD_S);
            let error = (channel(&got, 1)[sample] - slope).abs();
            assert!(error < 0.02 * scale, "{kinds:?}, sample {sample}: {error} of {scale} rad/s2");
        }
    }
}

#[test]
fn a_rigid_lever_moves_with_the_motor_and_carries_the_torque_of_the_hand() {
    let trial = ramp(2.6);
    let settings = SimulationSettings { lever: None, ..with_further(&[], &[], &[]) };
    let got = run(&settings, &trial, &PERSON).torque_nm;
    let motor = |sample: usize| trial.motion[trial.onset + sample];
    let scale = largest(channel(&got, 1).iter().copied());
    assert!(scale > 10.0, "the handle is accelerated: {scale} rad/s2");
    for sample in 1..SAMPLES - 1 {
        assert_eq!(channel(&got, 0)[sample], motor(sample).theta);
        assert_eq!(channel(&got, 2)[sample], got[sample]);
        let slope = (motor(sample + 1).omega - motor(sample - 1).omega) / (2.0 * PERIOD_S);
        assert!((channel(&got, 1)[sample] - slope).abs() < 0.05 * scale, "sample {sample}");
    }
}

#[test]
fn further_channels_change_no_bit_of_the_torque_and_have_the_same_bits_in_every_width() {
    let sections = sections();
    let trials: Vec<TrialInput> = [1.3, 1.95, 2.6, 3.25, 2.0].into_iter().map(ramp).collect();
    let inputs: Vec<&TrialInput> = trials.iter().collect();
    for kinds in [vec![], vec![MechanismKind::ChannelSkew], vec![MechanismKind::TorqueLag]] {
        let one = kinds.first().map_or(PERSON.to_vec(), |kind| with(*kind));
        let parameters = one.repeat(trials.len());
        let wanted: Vec<usize> = (0..one.len()).collect();
        let results: Vec<SimulatedTorque> = VectorWidth::available()
            .into_iter()
            .map(|width| {
                let settings = SimulationSettings { width, ..with_further(&kinds, &sections, &wanted) };
                let mut response = SimulatedTorque::default();
                simulate(&settings, &inputs, &parameters, &mut response);
                response
            })
            .collect();
        for other in &results[1..] {
            assert!(
                results[0].torque_nm == other.torque_nm && results[0].slopes == other.slopes,
                "{kinds:?}"
            );
        }
        let mut alone = SimulatedTorque::default();
        simulate(&settings(&kinds, &sections, &wanted), &inputs, &parameters, &mut alone);
        let rows = SAMPLES * (1 + ALL.len());
        for trial in 0..trials.len() {
            let (own, with) = (trial * SAMPLES, trial * rows);
            let same = alone.torque_nm[own..own + SAMPLES] == results[0].torque_nm[with..with + SAMPLES];
            assert!(same, "{kinds:?}, trial {trial}");
        }
    }
}

#[test]
fn a_late_torque_channel_is_late_behind_the_further_channels() {
    let (kinds, trial) = ([MechanismKind::ChannelSkew], ramp(2.6));
    let late: Vec<f64> = PERSON.into_iter().chain([0.0012]).collect();
    // Small steps: Runge-Kutta ones with a mechanism and exact ones without differ by their errors.
    let fine = |settings| SimulationSettings { substeps: 8, ..settings };
    let on_time = run(&fine(with_further(&[], &[], &[])), &trial, &PERSON).torque_nm;
    let got = run(&fine(with_further(&kinds, &[], &[6])), &trial, &late);
    for place in 0..ALL.len() {
        let error =
            largest(channel(&got.torque_nm, place).iter().zip(channel(&on_time, place)).map(|(a, b)| a - b));
        let size = largest(channel(&on_time, place).iter().copied());
        assert!(error < 1e-6 * size, "channel {place}: {error} of {size}");
        assert_eq!(largest(channel(&got.slopes, place).iter().copied()), 0.0, "channel {place}");
    }
    for sample in 3..SAMPLES {
        assert!((got.torque_nm[sample] - on_time[sample - 3]).abs() < 1e-6, "sample {sample}");
    }
}

#[test]
fn derivatives_of_further_channels_agree_with_differences_for_every_mechanism() {
    let (sections, trial) = (sections(), ramp(2.6));
    for kinds in std::iter::once(Vec::new()).chain(CATALOGUE.iter().map(|kind| vec![*kind])) {
        let mut parameters = kinds.first().map_or(PERSON.to_vec(), |kind| with(*kind));
        let mut wanted: Vec<usize> = (0..6).collect();
        for (place, parameter) in kinds.iter().flat_map(|kind| kind.parameters()).enumerate() {
            if parameter.fitted {
                wanted.push(6 + place);
                // Off the value that has no effect, and off the corners of what is not smooth.
                parameters[6 + place] +=
                    0.013 * (parameter.high - parameter.low).min(parameter.typical.abs().max(1e-3));
            }
        }
        let ours = run(&with_further(&kinds, &sections, &wanted), &trial, &parameters);
        for (index, parameter) in wanted.iter().enumerate() {
            let values = |by: f64| {
                let mut moved = parameters.clone();
                moved[*parameter] += by;
                run(&with_further(&kinds, &sections, &[]), &trial, &moved).torque_nm
            };
            let slope = |step: f64| -> Vec<f64> {
                let [a, b, c, d] = [step, -step, 2.0 * step, -2.0 * step].map(values);
                let fourth_order = |i: usize| (8.0 * (a[i] - b[i]) - (c[i] - d[i])) / (12.0 * step);
                (0..a.len()).map(fourth_order).collect()
            };
            let steps = [1e-2, 1e-3, 1e-4, 1e-5];
            let differences = steps.map(|step| slope(step * parameters[*parameter].abs().max(1e-4)));
            for place in 0..ALL.len() {
                let column: Vec<f64> = (0..SAMPLES)
                    .map(|sample| ours.slopes[((1 + place) * SAMPLES + sample) * wanted.len() + index])
                    .collect();
                let size = largest(column.iter().copied());
                let value_size = largest(channel(&ours.torque_nm, place).iter().copied());
                let error = differences
                    .iter()
                    .map(|other| largest(column.iter().zip(channel(other, place)).map(|(a, b)| a - b)))
                    .fold(f64::INFINITY, f64::min);
                let scale = size.max(1e-6 * value_size / parameters[*parameter].abs().max(1e-4));
                assert!(
                    error < 1e-5 * scale,
                    "{kinds:?}, parameter {parameter}, channel {place}: {error:e} of {scale:e}"
                );
            }
        }
    }
}
