//! What the records of rig trials say against their table, before anything is fitted.
//!
//! A weight in grams, two weights that were exchanged, an angle in degrees, a handle that nobody clamped: the fit would find constants
//! for any of these, with small errors. Each limit is far beyond what a rig can be off by.

use rustfft::num_complex::Complex64;

use super::constants::{AtHandle, FittedConstants, LOWEST_SERVO_HZ, RigCoordinates, WIDEST_FACTOR};
use super::error::CalibrateError;
use super::prepared_rig::PreparedRig;
use super::prepared_trial::PreparedTrial;
use super::rig_contradiction::{RigContradiction, named_load};
use super::rig_model::lever_response;
use crate::protocol::{GRAVITY_M_S2, RigLoad, significant};
use crate::wrist::Lever;

/// Frequencies up to which the torque is compared with the motion, Hz: there a channel that is late by milliseconds has the sign of one
/// that is not.
const SLOW_HZ: f64 = 20.0;

/// Largest factor between what two weights say of the gain: a sensor's own nonlinearity is a tenth.
const WEIGHTS_AGREE: f64 = 1.5;

/// A factor is that of a mistake if it is within this factor of it.
const LIKE: f64 = 1.5;

/// What is off counts if it is so by more than this many standard deviations of what the records leave open.
const RESERVED_SD: f64 = 4.0;

/// A recorded over an expected value.
#[derive(Debug, Clone, Copy)]
struct RecordedOverExpected {
    value: f64,
    sd: f64,
}

impl RecordedOverExpected {
    /// Whether it is not between the factor and its inverse.
    fn is_beyond(self, factor: f64) -> bool {
        let reserve = RESERVED_SD * self.sd;
        self.value + reserve < 1.0 / factor || self.value - reserve > factor
    }
}

/// Refuses trials that cannot be those of a rig with this lever.
///
/// # Errors
/// What contradicts it.
pub fn refuse_contradictions(rig: &PreparedRig, lever: Option<Lever>) -> Result<(), CalibrateError> {
    let against = contradictions(rig, lever);
    if against.is_empty() { Ok(()) } else { Err(CalibrateError::Contradicts(against)) }
}

/// All contradictions, of the angle first: what is wrong with it is wrong with the torque that is expected of it.
pub fn contradictions(rig: &PreparedRig, lever: Option<Lever>) -> Vec<RigContradiction> {
    let moving = || rig.trials.iter().filter(|trial| trial.moves());
    // Against a stop a motor that yields may stay behind its target.
    let free = moving().filter(|trial| trial.load != RigLoad::ClampedHandle);
    let of_angle = grouped(free.filter_map(angle_mistake));
    if !of_angle.is_empty() {
        return of_angle;
    }
    let mut found = of_weights(rig);
    if lever.is_some() {
        let stated = RigCoordinates::new(lever, rig.largest_nm, Vec::new());
        let constants = stated.constants(&vec![0.0; stated.count()]);
        let handle = |load: RigLoad| stated.at_handle(&constants, load);
        let mistake = |trial: &PreparedTrial| {
            // A channel has one sign in all trials.
            let sign_is_right = || {
                let mut others = moving().filter(|other| other.load != trial.load);
                others.any(|other| torque_ratio(rig, &constants, handle(other.load), other).value > 0.0)
            };
            torque_mistake(rig, &constants, handle(trial.load), trial, sign_is_right)
        };
        found.extend(grouped(moving().filter_map(mistake)));
    }
    found
}

/// One for all trials with one load of which the same is said.
fn grouped(found: impl Iterator<Item = RigContradiction>) -> Vec<RigContradiction> {
    let mut groups: Vec<RigContradiction> = Vec::new();
    for one in found {
        let is_alike =
            |own: &&mut RigContradiction| own.load == one.load && own.likely_mistake == one.likely_mistake;
        match groups.iter_mut().find(is_alike) {
            Some(group) => group.trials.extend(one.trials),
            None => groups.push(one),
        }
    }
    groups
}

/// Coefficients of a trial up to a frequency, without that of frequency 0.
fn up_to(trial: &PreparedTrial, top_hz: f64) -> std::ops::Range<usize> {
    1..((top_hz / trial.fourier.step_hz) as usize + 1).min(trial.fourier.coefficients)
}

/// The recorded angle against the target, at frequencies that every servo follows.
fn angle_mistake(trial: &PreparedTrial) -> Option<RigContradiction> {
    let (mut with_target, mut targets) = (0.0, 0.0);
    for place in up_to(trial, LOWEST_SERVO_HZ) {
        with_target += (trial.angle[place] * trial.target[place].conj()).re;
        targets += trial.target[place].norm_sqr();
    }
    let ratio = RecordedOverExpected { value: with_target / targets, sd: 0.0 };
    let degree = std::f64::consts::PI / 180.0;
    let mistake = match ratio.value {
        value if is_like(value, 1.0 / degree) => "Is theta_m_rad in degrees?",
        value if is_like(value, degree) => "Is target_rad in degrees?",
        value if is_like(value, 1e3) => "Is theta_m_rad in milliradians?",
        value if is_like(-value, 1.0) => "Has theta_m_rad the other sign than target_rad?",
        value if value.abs() < 0.1 => "Did the motor move, and was its own angle recorded?",
        _ => {
            return (targets > 0.0 && ratio.is_beyond(WIDEST_FACTOR))
                .then(|| of_motion(trial, ratio.value, None));
        }
    };
    (targets > 0.0).then(|| of_motion(trial, ratio.value, Some(mistake)))
}

fn of_motion(trial: &PreparedTrial, ratio: f64, mistake: Option<&str>) -> RigContradiction {
    RigContradiction {
        trials: vec![trial.number],
        load: trial.load,
        measured: format!(
            "the recorded angle is {} times the target; expected {}",
            significant(ratio),
            range(WIDEST_FACTOR)
        ),
        likely_mistake: mistake.map(str::to_owned),
    }
}

/// The torque against what the stated lever and load make of the recorded motion, by their products with what they make of the target.
fn torque_ratio(
    rig: &PreparedRig,
    stated: &FittedConstants,
    handle: AtHandle,
    trial: &PreparedTrial,
) -> RecordedOverExpected {
    let (mut recorded, mut expected, mut noise) = (0.0, 0.0, 0.0);
    for place in up_to(trial, SLOW_HZ) {
        let response = lever_response(stated, handle, trial.fourier.omega(place));
        let instrument: Complex64 = (response * trial.target[place]).conj();
        recorded += (trial.torque[place] * instrument).re;
        expected += (response * trial.angle[place] * instrument).re;
        noise +=
            instrument.norm_sqr() * trial.variance(rig.noise.torque.at(trial.fourier.frequency_hz(place)));
    }
    RecordedOverExpected { value: recorded / expected, sd: libm::sqrt(noise) / expected.abs() }
}

/// What is said of a trial whose torque the stated lever and load cannot make. `sign_is_right`: some trials with another load have the sign that is expected.
fn torque_mistake(
    rig: &PreparedRig,
    stated: &FittedConstants,
    handle: AtHandle,
    trial: &PreparedTrial,
    sign_is_right: impl FnOnce() -> bool,
) -> Option<RigContradiction> {
    let ratio = torque_ratio(rig, stated, handle, trial);
    // Inertia or stiffness of the lever, and a gain, may be off at once.
    let widest = WIDEST_FACTOR * WIDEST_FACTOR;
    if !ratio.is_beyond(widest) {
        return None;
    }
    let with = |handle: AtHandle| torque_ratio(rig, stated, handle, trial).value;
    let mistake = match trial.load {
        _ if is_like(-ratio.value, 1.0) && !sign_is_right() => {
            Some("Has torque_l_nm the sign of the torque that turns the handle with the angle?".to_owned())
        }
        _ if is_like(ratio.value, 1e3) => Some("Is torque_l_nm in mN m?".to_owned()),
        RigLoad::ClampedHandle if ratio.value < 1.0 => Some("Was the handle clamped?".to_owned()),
        RigLoad::KnownSpring { .. } if is_like(with(AtHandle::default()), 1.0) => {
            Some("Was the spring on?".to_owned())
        }
        RigLoad::KnownSpring { .. } => {
            let in_si = |factor: f64| AtHandle {
                stiffness_nm_per_rad: factor * handle.stiffness_nm_per_rad,
                ..handle
            };
            likely_unit(&STIFFNESS_UNITS, |factor| with(in_si(factor)))
                .map(|unit| format!("Is stiffness_nm_per_rad in {unit}?"))
        }
        RigLoad::KnownInertia { .. } if is_like(with(AtHandle::default()), 1.0) => {
            Some("Was the bar on?".to_owned())
        }
        RigLoad::KnownInertia { .. } => {
            let in_si = |factor: f64| AtHandle { inertia_kg_m2: factor * handle.inertia_kg_m2, ..handle };
            likely_unit(&INERTIA_UNITS, |factor| with(in_si(factor)))
                .map(|unit| format!("Is inertia_kg_m2 in {unit}?"))
        }
        RigLoad::EmptyHandle if ratio.value.abs() > widest => {
            Some("Was the handle empty and free?".to_owned())
        }
        _ => None,
    };
    Some(RigContradiction {
        trials: vec![trial.number],
        load: trial.load,
        measured: format!(
            "the torque is {} times what the stated lever and load make of the motion; expected {}",
            significant(ratio.value),
            range(widest)
        ),
        likely_mistake: mistake,
    })
}

/// Other usual units of a stiffness, in N m/rad.
const STIFFNESS_UNITS: [(&str, f64); 4] = [
    ("N m/deg", 180.0 / std::f64::consts::PI),
    ("N cm/rad", 1e-2),
    ("N mm/rad", 1e-3),
    ("N mm/deg", 0.18 / std::f64::consts::PI),
];

/// Other usual units of an inertia, in kg m2.
const INERTIA_UNITS: [(&str, f64); 4] = [("g m2", 1e-3), ("kg cm2", 1e-4), ("kg mm2", 1e-6), ("g cm2", 1e-7)];

/// The unit in which a stated value makes of the motion what was recorded; `ratio` is that of the torque with a factor on the value.
fn likely_unit(units: &[(&'static str, f64)], ratio: impl Fn(f64) -> f64) -> Option<&'static str> {
    let fitting = units.iter().map(|(unit, factor)| (*unit, ratio(*factor)));
    let distance = |value: f64| libm::log(value).abs();
    fitting
        .filter(|(_, value)| is_like(*value, 1.0))
        .min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))
        .map(|(unit, _)| unit)
}

/// The mean torque of a trial with a weight, without that of the empty handle.
struct HungWeight {
    number: u32,
    load: RigLoad,
    stated_nm: f64,
    recorded_nm: f64,
    ratio: RecordedOverExpected,
}

fn of_weights(rig: &PreparedRig) -> Vec<RigContradiction> {
    let empty: Vec<f64> = rig
        .trials
        .iter()
        .filter(|trial| trial.load == RigLoad::EmptyHandle)
        .map(|trial| trial.torque[0].re)
        .collect();
    if empty.is_empty() {
        return Vec::new();
    }
    let offset_nm = empty.iter().sum::<f64>() / empty.len() as f64;
    // How far a mean may be off is seen without weights: those of one load may be the ones that were exchanged.
    let squares: f64 = empty.iter().map(|own| (own - offset_nm) * (own - offset_nm)).sum();
    let of_empty_nm = libm::sqrt(squares / (empty.len() - 1).max(1) as f64);
    let hung: Vec<HungWeight> = rig
        .trials
        .iter()
        .filter_map(|trial| {
            let stated_nm = trial.load.weight_nm()?;
            let recorded_nm = trial.torque[0].re - offset_nm;
            let noise_nm = libm::sqrt(trial.variance(rig.noise.torque.at(0.0)));
            let sd_nm = std::f64::consts::SQRT_2 * of_empty_nm.max(noise_nm);
            let ratio = RecordedOverExpected { value: recorded_nm / stated_nm, sd: sd_nm / stated_nm.abs() };
            Some(HungWeight { number: trial.number, load: trial.load, stated_nm, recorded_nm, ratio })
        })
        .collect();
    let wrong: Vec<&HungWeight> = hung.iter().filter(|own| own.ratio.is_beyond(WIDEST_FACTOR)).collect();
    if wrong.is_empty() {
        return exchanged_weights(&hung);
    }
    let all_turned = hung.iter().all(|own| own.ratio.value < 0.0);
    grouped(wrong.into_iter().map(|own| RigContradiction {
        trials: vec![own.number],
        load: own.load,
        measured: format!(
            "the torque beside that of the empty handle is {} N m, {} times the weight's {} N m; expected {}",
            significant(own.recorded_nm),
            significant(own.ratio.value),
            significant(own.stated_nm),
            range(WIDEST_FACTOR)
        ),
        likely_mistake: weight_mistake(own, &hung, all_turned),
    }))
}

fn weight_mistake(own: &HungWeight, hung: &[HungWeight], all_turned: bool) -> Option<String> {
    let other = hung.iter().find(|other| {
        other.load.without_sign() != own.load.without_sign()
            && is_like(own.recorded_nm / other.stated_nm, 1.0)
    });
    if is_like(-own.ratio.value, 1.0) {
        return Some(if all_turned {
            "Has torque_l_nm the other sign, or do all weights hang on the other side than their sign says?"
                .into()
        } else {
            "Did it hang on the other side than its sign says?".into()
        });
    }
    if let Some(other) = other {
        return Some(format!("Was it the {}?", named_load(other.load)));
    }
    let factor = own.ratio.value.abs();
    let mistake = match factor {
        _ if is_like(factor, 1e-3) => "Is mass_kg in grams, or arm_m in millimetres?",
        _ if is_like(factor, 1e-2) => "Is arm_m in centimetres?",
        _ if is_like(factor, 0.0254) => "Is arm_m in inches?",
        _ if is_like(factor, 1.0 / GRAVITY_M_S2) => "Is mass_kg the weight in newtons?",
        _ if is_like(factor, 1e3) => "Is torque_l_nm in mN m?",
        _ if factor < 0.1 => "Did the weight hang on the handle?",
        _ => return None,
    };
    Some(mistake.into())
}

/// A weight on all sides and in all repetitions.
struct Weight {
    load: RigLoad,
    trials: Vec<u32>,
    ratios: Vec<RecordedOverExpected>,
}

impl Weight {
    /// Recorded over stated torque: the mean, with the error of one, as they share that of the empty handle.
    fn ratio(&self) -> RecordedOverExpected {
        let count = self.ratios.len() as f64;
        RecordedOverExpected {
            value: self.ratios.iter().map(|own| own.value).sum::<f64>() / count,
            sd: self.ratios[0].sd,
        }
    }
}

/// Two weights of which one makes far more of its stated torque than the other: the fit would take it for a nonlinearity of the sensor.
fn exchanged_weights(hung: &[HungWeight]) -> Vec<RigContradiction> {
    let mut weights: Vec<Weight> = Vec::new();
    for own in hung {
        let load = own.load.without_sign();
        match weights.iter_mut().find(|weight| weight.load == load) {
            Some(weight) => {
                weight.trials.push(own.number);
                weight.ratios.push(own.ratio);
            }
            None => weights.push(Weight { load, trials: vec![own.number], ratios: vec![own.ratio] }),
        }
    }
    let by_ratio = |a: &&Weight, b: &&Weight| a.ratio().value.total_cmp(&b.ratio().value);
    let (Some(least), Some(most)) = (weights.iter().min_by(by_ratio), weights.iter().max_by(by_ratio)) else {
        return Vec::new();
    };
    let reserve = |own: RecordedOverExpected| RESERVED_SD * own.sd;
    let at_least = most.ratio().value - reserve(most.ratio());
    let at_most = least.ratio().value + reserve(least.ratio());
    if at_least < WEIGHTS_AGREE * at_most {
        return Vec::new();
    }
    let of = |one: &Weight, other: &Weight| RigContradiction {
        trials: one.trials.clone(),
        load: one.load,
        measured: format!(
            "the torque is {} times what this weight makes, and {} times for the {}; expected less than a factor {WEIGHTS_AGREE} between them",
            significant(one.ratio().value),
            significant(other.ratio().value),
            named_load(other.load)
        ),
        likely_mistake: Some("Were the weights exchanged, or does the torque channel end before?".into()),
    };
    vec![of(most, least), of(least, most)]
}

fn is_like(value: f64, mistake: f64) -> bool {
    value > mistake / LIKE && value < mistake * LIKE
}

fn range(factor: f64) -> String {
    format!("1/{factor} to {factor}")
}
