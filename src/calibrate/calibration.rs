//! A calibration: all constants of a rig from its rig trials, with their joint covariance.

use nalgebra::{DMatrix, DVector};

use super::constants::RigCoordinates;
use super::covariance::{RigCovariance, grown_covariance, mean_square};
use super::error::CalibrateError;
use super::fit::{RigFit, RigFitInput, RigPrior};
use super::input_check::refuse_contradictions;
use super::loads::{LOAD_LEVEL, LoadCheck, check_loads};
use super::low_pass::without_low_pass;
use super::misfit::{RigMisfit, cells, misfit, scatter_within};
use super::moments::MomentChannel;
use super::prepared_rig::{PreparedRig, SEED};
use super::prepared_trial::PreparedTrial;
use super::reported::{Reported, stated};
use super::rig_contradiction::named_load;
use super::rig_deviations::{RigDeviations, ToldConstant};
use super::starts::fit_from_starts;
use super::stated_rig::{LoadByRig, load_by_rig};
use crate::dataset::{
    CalibrationFit, CalibrationLoad, CalibrationNoise, NoiseSpectrum, RigCalibration, RigQuantity, RigTrials,
};
use crate::protocol::RigLoad;
use crate::random::Stream;

/// Why the bandwidth of the servo is not told.
const ANGLE_IS_TARGET: &str = "the recorded angle is the target, to a step of the encoder, and not the motor's: have the drive report its \
                               actual position (CiA 402: object 6064h, not 6062h)";

/// A calibration and what was found on the way.
#[derive(Debug, Clone)]
pub struct CalibrationOutcome {
    /// The calibration, as the file has it.
    pub calibration: RigCalibration,
    /// Misfit of the model.
    pub misfit: RigMisfit,
    /// What the loads say of each other.
    pub loads: Vec<LoadCheck>,
}

/// Fits all constants of the rig to all its rig trials of status ok.
///
/// `program` and `session` are the names that the file gets; the date is the caller's.
///
/// # Errors
/// If no trial can be analysed, or the numbers are such that the equations cannot be solved.
pub fn calibrate(
    trials: &RigTrials,
    program: &str,
    session: &str,
) -> Result<CalibrationOutcome, CalibrateError> {
    let prepared = PreparedRig::new(trials, |_| true, None)?;
    refuse_contradictions(&prepared, trials.lever)?;
    let coordinates = RigCoordinates::new(trials.lever, prepared.largest_nm, prepared.loads.clone());
    let mut input = RigFitInput {
        trials: &prepared.trials,
        prior: RigPrior::of_engineering(&coordinates),
        coordinates,
        noise: &prepared.noise,
        mean_sd_nm: prepared.mean_sd_nm,
        friction_speed_rad_s: prepared.friction_speed_rad_s,
        torque_scale: 1.0,
        servo_scale: 1.0,
    };
    let mut fit = fit_with_scatter(&mut input)?;
    let mut found = grown_covariance(&input, &fit)?;
    let mut reported = Reported::new(&input, &fit.point, &found, trials.lever);
    let mut no_low_pass = None;
    if let Some(without) = without_low_pass(&mut input, &fit, &reported, trials.lever)? {
        (fit, no_low_pass) = (without.fit, Some((without.reason, without.above_hz)));
        found = grown_covariance(&input, &fit)?;
        reported = Reported::new(&input, &fit.point, &found, trials.lever);
    }
    let misfit = misfit(&input, &fit, &mut Stream::new(SEED, "calibrate/misfit"))?;
    let mut loads = check_loads(&input, &fit)?;
    let is_target = prepared.angle_against_target.is_some_and(|own| own.is_target());
    let no_servo = is_target.then(|| (ANGLE_IS_TARGET.to_owned(), None));
    let no_low_pass = no_low_pass.map(|(reason, above_hz)| (reason, Some(above_hz)));
    for (name, known) in [(RigQuantity::ServoBandwidth, no_servo), (RigQuantity::TorqueCutoff, no_low_pass)] {
        let Some((reason, above)) = known else { continue };
        for own in reported.quantities.iter_mut().filter(|own| own.name == name && own.value.is_none()) {
            (own.reason, own.above) = (Some(reason.clone()), above);
        }
    }
    let mut calibration =
        RigCalibration::new(program.to_owned(), session.to_owned(), reported.quantities, reported.covariance);
    calibration.measured_utc.clone_from(&trials.measured_utc);
    calibration.sources.clone_from(&trials.sources);
    calibration.loads = described_loads(&prepared.trials);
    calibration.noise = CalibrationNoise {
        torque_nm: prepared.noise.torque_nm,
        spectrum: NoiseSpectrum {
            frequency_hz: prepared.noise.torque.frequency_hz.clone(),
            power_nm2_per_hz: prepared.noise.torque.power_per_hz.clone(),
        },
    };
    calibration.fit = CalibrationFit {
        samples: prepared.trials.iter().map(|trial| trial.samples).sum(),
        p_value_of_misfit: Some(misfit.p_value),
    };
    calibration.angle_against_target = prepared.angle_against_target;
    let deviations = RigDeviations::of(&calibration, |quantity| stated(quantity, trials.lever));
    let of_data = found.of_data()?;
    for (check, place) in loads.iter_mut().zip(RigCoordinates::first_load()..) {
        if check.difference.is_none() {
            let effect = effect_of_loads(&deviations, &found, &of_data, &[place]);
            check.by_rig = effect.map(|effect| load_by_rig(&deviations, effect));
        }
    }
    // Weights hang on one arm: they agree with each other when it is not as stated.
    let weights: Vec<usize> = (loads.iter().zip(RigCoordinates::first_load()..))
        .filter(|(check, _)| matches!(check.load, RigLoad::KnownWeight { .. }) && check.difference.is_some())
        .map(|(_, place)| place)
        .collect();
    let all_weights = (weights.len() > 1)
        .then(|| effect_of_loads(&deviations, &found, &of_data, &weights))
        .flatten()
        .map(|effect| load_by_rig(&deviations, effect));
    calibration.warnings =
        loads.iter().filter_map(|check| disagreement(check, &misfit).or_else(|| doubt(check))).collect();
    calibration.warnings.extend(all_weights.and_then(doubt_of_arm));
    Ok(CalibrationOutcome { calibration, misfit, loads })
}

/// Change of each deviation with true over stated value of the loads whose coordinates are at `places`, all alike. The scatter of whole
/// trials is no part of it: it follows from the covariance `of_data` alone. `None` if the loads' covariance has no inverse.
fn effect_of_loads(
    deviations: &RigDeviations,
    found: &RigCovariance,
    of_data: &DMatrix<f64>,
    places: &[usize],
) -> Option<DVector<f64>> {
    let own = DMatrix::from_fn(places.len(), places.len(), |i, j| of_data[(places[i], places[j])]);
    let weights = own.cholesky()?.solve(&DVector::from_element(places.len(), 1.0));
    let effect = |own: &ToldConstant| {
        let coordinate = RigQuantity::ALL.iter().position(|name| *name == own.quantity).unwrap_or_default();
        // A cut-off falls as its coordinate, the time constant, rises.
        let sign = if own.quantity == RigQuantity::TorqueCutoff { -1.0 } else { 1.0 };
        let per_coordinate = sign * own.se / libm::sqrt(found.covariance[(coordinate, coordinate)]);
        let followed =
            places.iter().zip(weights.iter()).map(|(place, weight)| of_data[(coordinate, *place)] * weight);
        own.slope * per_coordinate * followed.sum::<f64>()
    };
    Some(DVector::from_iterator(deviations.told.len(), deviations.told.iter().map(effect)))
}

/// Fits, and once more with the noise that the scatter of repetitions shows, where it is larger than that at rest.
///
/// # Errors
/// As [`RigFitInput::fit`].
pub fn fit_with_scatter(input: &mut RigFitInput<'_>) -> Result<RigFit, CalibrateError> {
    let first = fit_from_starts(input)?;
    let cells = cells(input.trials);
    let standardised: Vec<DVector<f64>> =
        first.equations.iter().map(|own| own.standardised.clone()).collect();
    let (sum, freedom) = scatter_within(&cells, &first.equations, &standardised, MomentChannel::Torque);
    input.torque_scale = if freedom > 0.0 { libm::sqrt((sum / freedom).max(1.0)) } else { 1.0 };
    // No motor is exactly of second order: what the model of the servo leaves is its noise.
    input.servo_scale = libm::sqrt(mean_square(&first, |channel| channel == MomentChannel::Servo).max(1.0));
    input.fit(&first.point)
}

/// The loads of the file: what was at the handle in how many trials.
fn described_loads(trials: &[PreparedTrial]) -> Vec<CalibrationLoad> {
    let mut found: Vec<(RigLoad, usize)> = Vec::new();
    for trial in trials {
        let load = trial.load.without_sign();
        match found.iter_mut().find(|(own, _)| *own == load) {
            Some((_, count)) => *count += 1,
            None => found.push((load, 1)),
        }
    }
    let described = |(load, trials): (RigLoad, usize)| {
        let mut own = CalibrationLoad {
            load: load.name().to_owned(),
            mass_kg: None,
            arm_m: None,
            inertia_kg_m2: None,
            stiffness_nm_per_rad: None,
            relative_error: load.relative_error(),
            trials,
        };
        match load {
            RigLoad::KnownWeight { mass_kg, arm_m, .. } => {
                own.mass_kg = Some(mass_kg);
                own.arm_m = Some(arm_m);
            }
            RigLoad::KnownInertia { inertia_kg_m2, .. } => own.inertia_kg_m2 = Some(inertia_kg_m2),
            RigLoad::KnownSpring { stiffness_nm_per_rad, .. } => {
                own.stiffness_nm_per_rad = Some(stiffness_nm_per_rad);
            }
            RigLoad::EmptyHandle | RigLoad::ClampedHandle => {}
        }
        own
    };
    found.into_iter().map(described).collect()
}

/// The warning of a load that disagrees with the others.
fn disagreement(check: &LoadCheck, misfit: &RigMisfit) -> Option<String> {
    let difference = check.difference.filter(|_| check.disagrees())?;
    let or: Vec<String> = check.or.iter().map(|load| named_load(*load)).collect();
    let or =
        if or.is_empty() { String::new() } else { format!("; or {} is wrong in its place", or.join(" or ")) };
    let or_the_model = if misfit.p_value > LOAD_LEVEL {
        String::new()
    } else {
        format!("; or the rig has a law that its model lacks, as the misfit (p = {:.3}) says", misfit.p_value)
    };
    Some(format!(
        "{} disagrees with the other loads: by them it is {:+.1} % from its stated value (standard error {:.1} %, p = {:.2e}){or}{or_the_model}",
        named_load(check.load),
        100.0 * difference,
        100.0 * check.se,
        check.p_value
    ))
}

/// The warning of a load that the other loads do not tell and with which the rig is not as stated.
fn doubt(check: &LoadCheck) -> Option<String> {
    let LoadByRig { probability, difference } = check.wrong_by_rig()?;
    Some(format!(
        "{} is probably {:+.0} % from its stated value (probability {probability:.2}): with it as stated, all constants of the rig that \
         follow from it are off by one factor from what the session states; the other loads do not tell it",
        named_load(check.load),
        100.0 * difference,
    ))
}

/// The warning of weights that agree with each other, and with which the rig is not as stated.
fn doubt_of_arm(all: LoadByRig) -> Option<String> {
    let LoadByRig { probability, difference } = all;
    (probability > 0.5).then(|| {
        format!(
            "the known weights are probably all {:+.0} % from their stated torques (probability {probability:.2}): with them as stated, the \
             gains of torque and angle are off by one factor, and no other load tells both; measure arm_m and mass_kg again",
            100.0 * difference,
        )
    })
}
