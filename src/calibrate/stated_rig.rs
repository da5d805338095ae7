//! Whether a load's stated value is wrong, by what the session states of the rig.
//!
//! One weight and one bar leave nothing by which the other loads could tell the bar. But a wrong bar turns all constants that follow from
//! it by one factor, and a fault of the rig turns one of them: the lever's inertia, damping and stiffness and the gain of the angle are as
//! stated, all but one or two, or all off in one way. A lever that is not the stated one, or a rig of which nothing is as stated, tells
//! nothing of its loads.

use nalgebra::DVector;

use super::rig_deviations::{CommonError, RigDeviations};
use super::sound_rig::RigFaults;
use crate::statistics::probabilities;
use crate::wrist::mechanisms::{MechanismClass, MechanismKind};

/// Probability that a load's stated value is wrong, and the standard deviation of its relative error then. Assumed: a bar that was not
/// measured anew, an arm that was read from the wrong side.
const WRONG_LOAD: (f64, f64) = (0.01, 0.15);

/// Probability that a rig has a fault at all, spread evenly over its constants.
const FAULT: f64 = 0.5;

/// Probabilities, relative to a rig as stated, that its lever is another one than stated, and that nothing is as stated. Assumed: a lever
/// that was made anew, a description that was copied.
const OTHER_LEVER: f64 = 0.1;
const NOTHING_STATED: f64 = 0.02;

/// What the stated rig says of a load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadByRig {
    /// Probability that the load's stated value is wrong.
    pub probability: f64,
    /// True over stated value, less one, if it is.
    pub difference: f64,
}

/// What the stated rig says of a load by which the measured constants change as `effect` says, for an error of one of true over stated
/// value.
///
/// Compared are rigs with no, one or two faults, with another lever, and with nothing as stated, each with the load as stated and with it
/// wrong.
pub fn load_by_rig(deviations: &RigDeviations, effect: DVector<f64>) -> LoadByRig {
    let (wrong, sd) = WRONG_LOAD;
    let error = CommonError { effect, sd };
    // Logarithm of the weight of each hypothesis, and the load's error where it is wrong in it.
    let mut weighed: Vec<(f64, Option<f64>)> = Vec::new();
    for rig in faulty_rigs(deviations) {
        let right = deviations.agreement(rig.faults(), None);
        weighed.push((libm::log(rig.weight * (1.0 - wrong)) + right.log_density, None));
        let with_error = deviations.agreement(rig.faults(), Some(&error));
        weighed.push((libm::log(rig.weight * wrong) + with_error.log_density, Some(with_error.error)));
    }
    let (log_weights, errors): (Vec<f64>, Vec<Option<f64>>) = weighed.into_iter().unzip();
    let (found, _) = probabilities(&log_weights);
    let where_wrong = || found.iter().zip(&errors).filter_map(|(own, error)| Some((own, (*error)?)));
    let probability: f64 = where_wrong().map(|(own, _)| own).sum();
    let size: f64 = where_wrong().map(|(own, error)| own * error).sum();
    // A constant is wrong by the same factor as the load, in the other direction; the errors are logarithms of it.
    LoadByRig { probability, difference: libm::exp(-size / probability.max(f64::MIN_POSITIVE)) - 1.0 }
}

/// Probability that the constant which `kind` is about is at fault, by all measured constants together.
pub fn probability_of_fault(deviations: &RigDeviations, kind: MechanismKind) -> f64 {
    let rigs = faulty_rigs(deviations);
    let log_weight =
        |own: &FaultyRig| libm::log(own.weight) + deviations.agreement(own.faults(), None).log_density;
    let (found, _) = probabilities(&rigs.iter().map(log_weight).collect::<Vec<_>>());
    rigs.iter().zip(&found).filter(|(own, _)| own.causes.contains(&kind)).map(|(_, found)| found).sum()
}

/// A rig with constants that are at fault.
struct FaultyRig {
    /// The causes that are about them.
    causes: Vec<MechanismKind>,
    /// Probability relative to a rig as stated.
    weight: f64,
}

impl FaultyRig {
    fn faults(&self) -> RigFaults<'_> {
        RigFaults { causes: &self.causes, ..RigFaults::default() }
    }
}

/// Rigs with no, one or two faults, with another lever, and with nothing as stated.
fn faulty_rigs(deviations: &RigDeviations) -> Vec<FaultyRig> {
    let kinds: Vec<MechanismKind> = deviations.kinds().collect();
    let odds = FAULT / (1.0 - FAULT) / kinds.len().max(1) as f64;
    let rig = |causes: Vec<MechanismKind>, weight: f64| FaultyRig { causes, weight };
    let mut all = vec![rig(Vec::new(), 1.0)];
    for (place, one) in kinds.iter().enumerate() {
        all.push(rig(vec![*one], odds));
        all.extend(kinds[place + 1..].iter().map(|other| rig(vec![*one, *other], odds * odds)));
    }
    let of_rig = kinds.iter().copied().filter(|own| own.class() == MechanismClass::Rig);
    all.push(rig(of_rig.collect(), OTHER_LEVER));
    all.push(rig(kinds, NOTHING_STATED));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::rig_deviations::ToldConstant;
    use crate::calibrate::sound_rig::CAUSED;
    use crate::dataset::{CalibratedQuantity, RigCalibration, RigQuantity, corner_frequency_hz};
    use crate::statistics::HALF_INTERVAL_95;
    use crate::wrist::Lever;

    const LEVER: Lever =
        Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };

    /// What follows from the bar: inertia, damping and stiffness of the lever and the gain of the angle.
    const OF_BAR: [RigQuantity; 4] = [
        RigQuantity::LeverInertia,
        RigQuantity::LeverDamping,
        RigQuantity::LeverStiffness,
        RigQuantity::AngleGain,
    ];

    fn stated(quantity: RigQuantity) -> Option<f64> {
        match quantity {
            RigQuantity::LeverInertia => Some(LEVER.inertia_kg_m2),
            RigQuantity::LeverDamping => Some(LEVER.damping_nm_s_per_rad),
            RigQuantity::LeverStiffness => Some(LEVER.stiffness_nm_per_rad),
            RigQuantity::TorqueGain | RigQuantity::AngleGain => Some(1.0),
            _ => None,
        }
    }

    /// A quantity that was measured as `told`, with its standard error, or not at all.
    fn quantity(name: RigQuantity, told: Option<(f64, f64)>) -> CalibratedQuantity {
        let (value, se) = told.unzip();
        let reason = told.is_none().then(String::new);
        CalibratedQuantity { name, value, se, stated: None, reason, above: None }
    }

    /// A calibration with these factors of what is stated, to 0.7 % of their own and 1 % of the bar, and what it says of the bar.
    fn of_bar(factors: [f64; 4]) -> LoadByRig {
        let measured = |name: RigQuantity| {
            let factor = OF_BAR.iter().position(|own| *own == name).map_or(1.0, |place| factors[place]);
            let value = stated(name).map(|value| factor * value);
            let se = value
                .map(|value| value * if OF_BAR.contains(&name) { libm::hypot(0.007, 0.01) } else { 0.003 });
            CalibratedQuantity { stated: stated(name), ..quantity(name, value.zip(se)) }
        };
        let quantities: Vec<CalibratedQuantity> = RigQuantity::ALL.map(measured).to_vec();
        let told: Vec<&CalibratedQuantity> = quantities.iter().filter(|own| own.value.is_some()).collect();
        let between = |one: &CalibratedQuantity, other: &CalibratedQuantity| match (
            one.name == other.name,
            one.value.zip(other.value),
        ) {
            (true, _) => one.se.unwrap_or(0.0).powi(2),
            (_, Some((a, b))) if OF_BAR.contains(&one.name) && OF_BAR.contains(&other.name) => 1e-4 * a * b,
            _ => 0.0,
        };
        let covariance =
            told.iter().map(|one| told.iter().map(|other| between(one, other)).collect()).collect();
        let calibration = RigCalibration::new("test".into(), "rig".into(), quantities.clone(), covariance);
        let deviations = RigDeviations::of(&calibration, stated);
        assert_eq!(deviations.told.len(), CAUSED.len() - 2);
        assert!(deviations.covariance.clone().symmetric_eigenvalues().iter().all(|own| *own > 0.0));
        let effect = |own: &ToldConstant| if OF_BAR.contains(&own.quantity) { 1.0 } else { 0.0 };
        load_by_rig(&deviations, DVector::from_iterator(5, deviations.told.iter().map(effect)))
    }

    #[test]
    fn a_bar_that_turns_all_that_follows_from_it_is_wrong() {
        for factor in [0.5, 0.87, 1.14, 2.0] {
            let found = of_bar([factor, factor * 1.02, factor * 0.99, factor * 1.005]);
            assert!(found.probability > 0.9, "{found:?}");
            let difference = 1.0 / factor - 1.0;
            assert!((found.difference / difference - 1.0).abs() < 0.1, "{found:?} for {difference}");
        }
    }

    #[test]
    fn a_rig_as_stated_or_with_faults_of_its_own_has_a_right_bar() {
        let sound = [1.01, 0.98, 0.99, 1.003];
        let one_fault =
            [[1.5, 1.0, 1.0, 1.0], [1.0, 1.6, 1.0, 1.0], [1.0, 1.0, 0.7, 1.0], [1.0, 1.0, 1.0, 1.2]];
        let two_faults = [[1.3, 1.0, 1.0, 0.9], [0.8, 1.0, 0.7, 1.0]];
        let other_lever = [[0.8, 0.6, 0.7, 1.0], [1.3, 1.1, 1.6, 1.0]];
        let nothing_stated = [1.3, 0.7, 1.2, 0.9];
        let all = [sound, nothing_stated].into_iter().chain(one_fault).chain(two_faults).chain(other_lever);
        for factors in all {
            let found = of_bar(factors);
            assert!(found.probability < 0.5, "{factors:?}: {found:?}");
        }
    }

    /// Delay and time constant of a torque channel, s, known to `sd` each and better together.
    fn of_channel([delay_s, lag_s]: [f64; 2], sd: f64) -> RigDeviations {
        let se_hz = (corner_frequency_hz(lag_s - HALF_INTERVAL_95 * sd) - corner_frequency_hz(lag_s))
            / HALF_INTERVAL_95;
        let measured = |name: RigQuantity| match name {
            RigQuantity::TorqueDelay => quantity(name, Some((delay_s, sd))),
            RigQuantity::TorqueCutoff => quantity(name, Some((corner_frequency_hz(lag_s), se_hz))),
            _ => quantity(name, None),
        };
        let quantities = RigQuantity::ALL.map(measured).to_vec();
        // The later the torque, the shorter the time constant, and the higher the cut-off.
        let covariance = vec![vec![sd * sd, 0.999 * sd * se_hz], vec![0.999 * sd * se_hz, se_hz * se_hz]];
        let calibration = RigCalibration::new("test".into(), "rig".into(), quantities, covariance);
        RigDeviations::of(&calibration, |name| (name == RigQuantity::TorqueDelay).then_some(0.0))
    }

    #[test]
    fn a_low_pass_that_only_undoes_an_early_torque_is_improbable_and_one_by_itself_is_not() {
        let lag = |deviations: RigDeviations| probability_of_fault(&deviations, MechanismKind::TorqueLag);
        let undone = lag(of_channel([-1.49e-3, 1.5e-3], 0.63e-3));
        assert!(undone < 0.2, "{undone}");
        let alone = lag(of_channel([0.02e-3, 0.6e-3], 0.1e-3));
        assert!(alone > 0.9, "{alone}");
        let both = lag(of_channel([-1.49e-3, 1.5e-3], 0.05e-3));
        assert!(both > 0.99, "{both}");
    }

    #[test]
    fn a_late_torque_is_no_sure_delay_where_the_trials_tell_no_low_pass() {
        let late = |above_hz: Option<f64>| {
            let measured = |name: RigQuantity| {
                let told = (name == RigQuantity::TorqueDelay).then_some((1.06e-3, 3e-5));
                let above = above_hz.filter(|_| name == RigQuantity::TorqueCutoff);
                CalibratedQuantity { above, ..quantity(name, told) }
            };
            let quantities = RigQuantity::ALL.map(measured).to_vec();
            let calibration = RigCalibration::new("test".into(), "rig".into(), quantities, vec![vec![9e-10]]);
            RigDeviations::of(&calibration, |_| None)
        };
        let fault = |deviations: &RigDeviations, kind| probability_of_fault(deviations, kind);
        // A low-pass of 150 Hz is late by 1.06 ms.
        let either = late(Some(100.0));
        for kind in [MechanismKind::ChannelSkew, MechanismKind::TorqueLag] {
            let found = fault(&either, kind);
            assert!((0.2..0.8).contains(&found), "{kind:?}: {found}");
        }
        for without in [late(Some(600.0)), late(None)] {
            assert!(fault(&without, MechanismKind::ChannelSkew) > 0.95);
            assert!(fault(&without, MechanismKind::TorqueLag) < 0.1);
        }
    }

    #[test]
    fn what_nothing_tells_stays_as_probable_as_it_was() {
        let nothing = RigDeviations::none();
        let found = load_by_rig(&nothing, DVector::zeros(0));
        assert!((found.probability - WRONG_LOAD.0).abs() < 1e-12, "{found:?}");
    }
}
