//! Whether a load's stated value is wrong, by what the session states of the rig.
//!
//! One weight and one bar leave nothing by which the other loads could tell the bar. But a wrong bar turns all constants that follow from
//! it by one factor, and a fault of the rig turns one of them: the lever's inertia, damping and stiffness and the gain of the angle are as
//! stated, all but one or two, or all off in one way. A lever that is not the stated one, or a rig of which nothing is as stated, tells
//! nothing of its loads.

use nalgebra::DVector;

use super::sound_rig::{CommonError, RigDeviations, ToldConstant};
use crate::wrist::mechanisms::MechanismClass;

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
    let count = deviations.told.len();
    let odds = FAULT / (1.0 - FAULT) / count.max(1) as f64;
    let (wrong, sd) = WRONG_LOAD;
    let error = CommonError { effect, sd };
    // The constants that are at fault, with the weight of such a rig.
    let mut faults: Vec<(Vec<usize>, f64)> = vec![(Vec::new(), 1.0)];
    for one in 0..count {
        faults.push((vec![one], odds));
        faults.extend((one + 1..count).map(|other| (vec![one, other], odds * odds)));
    }
    let of_lever = (0..count).filter(|place| deviations.told[*place].kind.class() == MechanismClass::Rig);
    faults.push((of_lever.collect(), OTHER_LEVER));
    faults.push(((0..count).collect(), NOTHING_STATED));
    // Logarithm of the weight of each hypothesis, whether the load is wrong in it, and by how much.
    let mut weighed: Vec<(f64, bool, f64)> = Vec::new();
    for (faulty, weight) in &faults {
        let is_faulty =
            |own: &ToldConstant| faulty.iter().any(|place| deviations.told[*place].kind == own.kind);
        let prior = |own: &ToldConstant| if is_faulty(own) { own.caused } else { (0.0, own.tolerance) };
        let of_faults = libm::log(*weight);
        let (right, _) = deviations.log_density(prior, None);
        weighed.push((of_faults + libm::log(1.0 - wrong) + right, false, 0.0));
        let (with_error, size) = deviations.log_density(prior, Some(&error));
        weighed.push((of_faults + libm::log(wrong) + with_error, true, size));
    }
    let most = weighed.iter().fold(f64::NEG_INFINITY, |most, own| most.max(own.0));
    let sum = |of: &dyn Fn(&(f64, bool, f64)) -> f64| -> f64 {
        weighed.iter().map(|own| libm::exp(own.0 - most) * of(own)).sum()
    };
    let wrong = sum(&|own| f64::from(u8::from(own.1)));
    LoadByRig {
        probability: wrong / sum(&|_| 1.0),
        // A constant is wrong by as much as the load, in the other direction.
        difference: -sum(&|own| own.2) / wrong.max(f64::MIN_POSITIVE),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::calibrate::sound_rig::CAUSED;
    use crate::dataset::{CalibratedQuantity, RigCalibration, RigQuantity};
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

    /// A calibration with these factors of what is stated, to 0.7 % of their own and 1 % of the bar, and what it says of the bar.
    fn of_bar(factors: [f64; 4]) -> LoadByRig {
        let quantity = |name: RigQuantity| {
            let factor = OF_BAR.iter().position(|own| *own == name).map_or(1.0, |place| factors[place]);
            let value = stated(name).map(|value| factor * value);
            let se = value
                .map(|value| value * if OF_BAR.contains(&name) { libm::hypot(0.007, 0.01) } else { 0.003 });
            CalibratedQuantity {
                name,
                value,
                se,
                stated: stated(name),
                reason: value.is_none().then(String::new),
            }
        };
        let quantities: Vec<CalibratedQuantity> = RigQuantity::ALL.map(quantity).to_vec();
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
        let deviations = RigDeviations::of(&calibration, Some(LEVER), stated);
        assert_eq!(deviations.told.len(), CAUSED.len() - 2);
        assert!(deviations.covariance.clone().symmetric_eigenvalues().iter().all(|own| *own > 0.0));
        let effect = |own: &ToldConstant| if OF_BAR.contains(&own.quantity) { 1.0 } else { 0.0 };
        load_by_rig(&deviations, DVector::from_iterator(5, deviations.told.iter().map(effect)))
    }

    #[test]
    fn a_bar_that_turns_all_that_follows_from_it_is_wrong() {
        for factor in [0.87, 1.14] {
            let found = of_bar([factor, factor * 1.02, factor * 0.99, factor * 1.005]);
            assert!(found.probability > 0.9, "{found:?}");
            assert!((found.difference + (factor - 1.0)).abs() < 0.03, "{found:?}");
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

    #[test]
    fn what_nothing_tells_stays_as_probable_as_it_was() {
        let nothing = RigDeviations { told: Vec::new(), covariance: DMatrix::zeros(0, 0) };
        let found = load_by_rig(&nothing, DVector::zeros(0));
        assert!((found.probability - WRONG_LOAD.0).abs() < 1e-12, "{found:?}");
    }
}
