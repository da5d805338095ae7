//! The model's own correctness: derivatives, integration error, widths, the filter on the way.

mod declarations;
mod derivatives;
mod free_laws;
mod further_channels;
mod integration;

use super::mechanisms::{CATALOGUE, Covariates, FREE_LAWS, MechanismKind};
use super::{
    Kinematics, Lever, SimulatedTorque, SimulationSettings, Smoothing, TrialInput, VectorWidth, simulate,
};
use crate::random::Stream;
use crate::signal::{FilterSpec, Section, filter};

const PERIOD_S: f64 = 4e-4;
const SAMPLES: usize = 100;
const LEAD: usize = 10;

/// The lever of the design's numbers.
const LEVER: Lever = Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };

/// A person's values: I_j, b_h, k_h, k_srs, k_dec, x_e.
const PERSON: [f64; 6] = [0.005, 1.2, 300.0, 20.0, 13.0, 0.04];

/// A ramp whose speed rises as a raised cosine in 18 ms.
fn ramp(velocity_rad_s: f64) -> TrialInput {
    ramp_sampled(velocity_rad_s, PERIOD_S)
}

/// The same, a sample every `period_s`.
fn ramp_sampled(velocity_rad_s: f64, period_s: f64) -> TrialInput {
    let rise_s = 0.018;
    let after = libm::ceil((SAMPLES + 40) as f64 * PERIOD_S / period_s) as usize;
    let knot = |sample: usize| {
        let t = (sample as f64 - 40.0) * period_s;
        if t <= 0.0 {
            return Kinematics::default();
        }
        let phase = std::f64::consts::PI * t.min(rise_s) / rise_s;
        let risen = 0.5 * (t.min(rise_s) - rise_s / std::f64::consts::PI * libm::sin(phase));
        Kinematics {
            theta: velocity_rad_s * (risen + (t - rise_s).max(0.0)),
            omega: velocity_rad_s * 0.5 * (1.0 - libm::cos(phase)),
        }
    };
    TrialInput {
        motion: (0..40 + after).map(knot).collect(),
        onset: 40,
        covariates: Covariates {
            velocity_rad_s,
            torque_before_nm: 1.5,
            progress: 0.6,
            rest_s: 7.0,
            flexor_emg_excess_mvc: 0.02,
            extensor_emg_mvc: 0.05,
        },
    }
}

fn sections() -> Vec<Section> {
    FilterSpec::PAPER.sections(1.0 / PERIOD_S).unwrap()
}

fn settings<'a>(
    kinds: &'a [MechanismKind],
    filter: &'a [Section],
    derivatives: &'a [usize],
) -> SimulationSettings<'a> {
    SimulationSettings {
        lever: Some(LEVER),
        kinds,
        period_s: PERIOD_S,
        samples: SAMPLES,
        lead_samples: LEAD,
        baseline_samples: 0,
        substeps: 2,
        filter,
        further: &[],
        derivatives,
        width: VectorWidth::One,
    }
}

fn run(settings: &SimulationSettings, trial: &TrialInput, parameters: &[f64]) -> SimulatedTorque {
    let mut response = SimulatedTorque::default();
    simulate(settings, &[trial], parameters, &mut response);
    response
}

/// A person's parameters with the typical ones of `kind`.
fn with(kind: MechanismKind) -> Vec<f64> {
    PERSON.iter().copied().chain(kind.parameters().iter().map(|parameter| parameter.typical)).collect()
}

#[test]
fn every_width_gives_the_same_bits() {
    let sections = sections();
    let mut stream = Stream::new(5, "widths");
    let trials: Vec<TrialInput> = (0..19).map(|i| ramp(1.3 + 0.1 * f64::from(i))).collect();
    let references: Vec<&TrialInput> = trials.iter().collect();
    let mut models = vec![Vec::new()];
    models.extend(CATALOGUE.iter().chain(FREE_LAWS).map(|kind| vec![*kind]));
    models.push(vec![MechanismKind::ChannelSkew, MechanismKind::StretchReflex, MechanismKind::TorqueLag]);
    for kinds in models {
        let count = 6 + kinds.iter().map(|kind| kind.parameter_count()).sum::<usize>();
        let mut parameters = Vec::new();
        for _ in &trials {
            let added = kinds.iter().flat_map(|kind| kind.parameters()).map(|p| p.typical);
            parameters.extend(
                PERSON.iter().copied().chain(added).map(|x| x * (1.0 + 0.2 * (stream.uniform() - 0.5))),
            );
        }
        let derivatives: Vec<usize> = (0..count).collect();
        let with_width = |width| {
            let mut response = SimulatedTorque::default();
            let settings = SimulationSettings { width, ..settings(&kinds, &sections, &derivatives) };
            simulate(&settings, &references, &parameters, &mut response);
            let all = response.torque_nm.into_iter().chain(response.slopes);
            all.map(f64::to_bits).collect::<Vec<_>>()
        };
        let one = with_width(VectorWidth::One);
        for width in VectorWidth::available() {
            assert!(with_width(width) == one, "{width:?} differs for {kinds:?}");
        }
    }
}

#[test]
fn a_trial_does_not_depend_on_its_neighbours() {
    let sections = sections();
    let trials = [ramp(1.3), ramp(3.25), ramp(2.0)];
    let derivatives = [0, 5];
    let parameters: Vec<f64> = [1.0, 1.3, 0.8].iter().flat_map(|f| PERSON.map(|x| x * f)).collect();
    let settings =
        SimulationSettings { width: VectorWidth::fastest(), ..settings(&[], &sections, &derivatives) };
    let mut together = SimulatedTorque::default();
    simulate(&settings, &trials.iter().collect::<Vec<_>>(), &parameters, &mut together);
    for (index, trial) in trials.iter().enumerate() {
        let alone = run(&settings, trial, &parameters[index * 6..index * 6 + 6]);
        assert_eq!(alone.torque_nm, together.torque_nm[index * SAMPLES..(index + 1) * SAMPLES]);
    }
}

#[test]
fn the_prediction_is_filtered_as_a_recorded_torque_would_be() {
    let sections = sections();
    // From the sample before the ramp on, where torque and filter are both at rest.
    let from_rest = |filter| SimulationSettings { lead_samples: 0, ..settings(&[], filter, &[]) };
    let raw = run(&from_rest(&[]), &ramp(2.6), &PERSON).torque_nm;
    let filtered = run(&from_rest(&sections), &ramp(2.6), &PERSON).torque_nm;
    for (sample, (got, want)) in filtered.iter().zip(filter(&sections, &raw)).enumerate() {
        assert!((got - want).abs() < 1e-12, "sample {sample}: {got} and {want}");
    }
    let largest = raw.iter().zip(&filtered).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(largest > 0.1, "the filter does something: {largest} N m");
}

/// Once, half a sample of delay brought what an encoder's steps leave in the angle into the speed: a delay of the channels
/// fitted 8 % short, and a servo was blamed for it.
#[test]
fn a_delay_by_part_of_a_sample_leaves_the_torque_as_steady_as_one_by_whole_samples() {
    let clean = ramp(2.6);
    let step = std::f64::consts::TAU / 131_072.0;
    let record: Vec<f64> = clean.motion.iter().map(|knot| step * libm::round(knot.theta / step)).collect();
    let smoothing = Smoothing { half_s: 0.004, twice: true };
    let recorded = TrialInput { motion: smoothing.motion(&record, PERIOD_S), ..clean.clone() };
    let settings = settings(&[MechanismKind::ChannelSkew], &[], &[]);
    let error_nm = |samples: f64| {
        let parameters: Vec<f64> = PERSON.into_iter().chain([samples * PERIOD_S]).collect();
        let [from_record, from_truth] =
            [&recorded, &clean].map(|trial| run(&settings, trial, &parameters).torque_nm);
        let squares: f64 = from_record.iter().zip(&from_truth).map(|(a, b)| (a - b) * (a - b)).sum();
        libm::sqrt(squares / SAMPLES as f64)
    };
    for samples in [-1.5, 0.5, 2.25] {
        let (part, whole) = (error_nm(samples), error_nm(2.0));
        assert!(part < 1.2 * whole, "{samples} samples: {part:e} N m instead of {whole:e}");
    }
}

/// Once the simulation began 4 ms before the onset, and a torque that had drifted for 7 ms fitted 1.6 times as steep.
#[test]
fn what_drifted_before_the_onset_is_in_the_torque_and_in_the_level_that_is_taken_off() {
    let kinds = [MechanismKind::TorqueDrift];
    let settings = |lead, level| SimulationSettings {
        lead_samples: lead,
        baseline_samples: level,
        ..settings(&kinds, &[], &[])
    };
    let drifting = |start_s: f64| PERSON.into_iter().chain([3.0, start_s]).collect::<Vec<f64>>();
    let trial = ramp(2.6);
    let as_it_is = run(&settings(30, 0), &trial, &drifting(-0.010)).torque_nm;
    let levelled = run(&settings(30, 25), &trial, &drifting(-0.010)).torque_nm;
    // The same seen from 24 samples earlier: the 25 that make the level come first.
    let earlier = TrialInput { onset: trial.onset - 24, ..trial.clone() };
    let before = run(&settings(6, 0), &earlier, &drifting(-0.010 + 24.0 * PERIOD_S)).torque_nm;
    let level_nm = before[..25].iter().sum::<f64>() / 25.0;
    assert!(level_nm > 1e-3, "the drift is in the level: {level_nm} N m");
    for (sample, (got, raw)) in levelled.iter().zip(&as_it_is).enumerate() {
        assert!((got - (raw - level_nm)).abs() < 1e-9, "sample {sample}: {got}, {raw} less {level_nm}");
    }
}

#[test]
fn before_the_first_of_its_samples_the_motor_stands() {
    let whole = ramp(2.6);
    let short = TrialInput { motion: whole.motion[30..].to_vec(), onset: whole.onset - 30, ..whole.clone() };
    for kinds in [vec![], vec![MechanismKind::ChannelSkew]] {
        let settings = SimulationSettings { lead_samples: 35, ..settings(&kinds, &[], &[]) };
        let parameters: Vec<f64> = PERSON.into_iter().chain(kinds.iter().map(|_| 0.0008)).collect();
        let [a, b] = [&whole, &short].map(|trial| run(&settings, trial, &parameters).torque_nm);
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-12), "{kinds:?}");
    }
}
