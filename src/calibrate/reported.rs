//! From fitted coordinates to reported quantities: which the loads tell, their values, errors and reasons.

use nalgebra::{DMatrix, DVector};

use super::constants::{CoordinateScale, DELAY_PLACE, LAG_PLACE, LEVER_PLACES, REPORTED, RigCoordinates};
use super::covariance::{INTERVAL, NOTHING_KNOWN, RigCovariance, covariance};
use super::fit::RigFitInput;
use super::linear_algebra::inverse;
use crate::dataset::{CalibratedQuantity, RigQuantity, corner_frequency_hz};
use crate::protocol::RigLoad;
use crate::wrist::Lever;

/// What is reported of the coordinates.
#[derive(Debug, Clone)]
pub struct Reported {
    /// The quantities, in the order of the file.
    pub quantities: Vec<CalibratedQuantity>,
    /// Covariance of those that have a value.
    pub covariance: Vec<Vec<f64>>,
}

impl Reported {
    /// The reported quantities of a fit.
    pub fn new(
        input: &RigFitInput<'_>,
        point: &DVector<f64>,
        found: &RigCovariance,
        lever: Option<Lever>,
    ) -> Self {
        let scales = &input.coordinates.scales;
        let state = |place: usize| {
            // A coordinate whose interval is wider than what engineering allows is not told.
            let by_slope = if INTERVAL * found.data_se[place] > 1.0 {
                Told::Unknown
            } else {
                let se = libm::sqrt(found.covariance[(place, place)]);
                told(RigQuantity::ALL[place], scales[place], point[place], se)
            };
            if place == LAG_PLACE { by_slope.or_above(|| fast_low_pass(input, point)) } else { by_slope }
        };
        let mut states: Vec<Told> = (0..REPORTED).map(state).collect();
        if lever.is_none() {
            keep_whole_lever(&mut states[LEVER_PLACES]);
        }
        let mut in_delay = DMatrix::identity(point.len(), point.len());
        if !matches!(states[LAG_PLACE], Told::Value { .. }) {
            // A low-pass that is too fast to be seen delays, and nobody takes it into account otherwise.
            in_delay[(DELAY_PLACE, LAG_PLACE)] = scales[LAG_PLACE].range() / scales[DELAY_PLACE].range();
            states[DELAY_PLACE] = whole_delay(input, point, found, &in_delay);
        }
        let covariance = combined(&in_delay, &found.covariance);
        let unknown: Vec<usize> =
            (0..REPORTED).filter(|place| matches!(states[*place], Told::Unknown)).collect();
        let quantities = (0..REPORTED).map(|place| {
            let name = RigQuantity::ALL[place];
            let stated = stated(name, lever);
            let untold = |reason: String, above: Option<f64>| CalibratedQuantity {
                name,
                value: None,
                se: None,
                stated,
                reason: Some(reason),
                above,
            };
            match &states[place] {
                Told::Value { value, se, .. } => {
                    let (value, se) = (Some(*value), Some(*se));
                    CalibratedQuantity { name, value, se, stated, reason: None, above: None }
                }
                Told::Above { reason, hz } => untold(reason.clone(), Some(*hz)),
                Told::Contradicted(reason) => untold(reason.clone(), None),
                Told::Unknown => untold(reason(input, found, place, &unknown), None),
            }
        });
        let quantities: Vec<CalibratedQuantity> = quantities.collect();
        let known: Vec<(usize, f64)> = states
            .iter()
            .enumerate()
            .filter_map(|(place, state)| match state {
                Told::Value { se, sign, .. } => Some((place, se * sign)),
                _ => None,
            })
            .collect();
        let correlation = |row: usize, column: usize| {
            let variance = |place: usize| covariance[(place, place)];
            covariance[(row, column)] / libm::sqrt(variance(row) * variance(column))
        };
        let covariance = known
            .iter()
            .map(|(row, se)| {
                let with = |(column, other): &(usize, f64)| {
                    if row == column {
                        se * se
                    } else {
                        correlation(*row, *column).clamp(-1.0, 1.0) * se * other
                    }
                };
                known.iter().map(with).collect()
            })
            .collect();
        Self { quantities, covariance }
    }
}

/// Of a handle that is stated as rigid, the trials tell a whole lever or none.
fn keep_whole_lever(states: &mut [Told]) {
    if states.iter().any(|own| !matches!(own, Told::Value { .. })) {
        states.fill_with(|| Told::Unknown);
    }
}

/// Covariance of linear combinations, a row of `combinations` each. Where large parts cancel, rounding leaves each half of the product
/// its own, and a covariance that is not symmetric is none.
fn combined(combinations: &DMatrix<f64>, covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let product = combinations * covariance * combinations.transpose();
    (&product + product.transpose()) * 0.5
}

/// The delay together with the low-pass's time constant, which `in_delay` adds to it.
fn whole_delay(
    input: &RigFitInput<'_>,
    point: &DVector<f64>,
    found: &RigCovariance,
    in_delay: &DMatrix<f64>,
) -> Told {
    let sum = in_delay.row(DELAY_PLACE);
    let variance = |covariance: &DMatrix<f64>| (sum * covariance * sum.transpose())[(0, 0)];
    let is_told = |own: &DMatrix<f64>| INTERVAL * libm::sqrt(variance(own)) <= 1.0;
    if !found.of_data().is_ok_and(|own| is_told(&own)) {
        return Told::Unknown;
    }
    let se = libm::sqrt(variance(&found.covariance));
    let scales = &input.coordinates.scales;
    let lag_start = scales[LAG_PLACE].value(0.0) / scales[DELAY_PLACE].range();
    told(RigQuantity::TorqueDelay, input.coordinates.scales[DELAY_PLACE], (sum * point)[0] + lag_start, se)
}

/// What is known of a low-pass whose slope tells nothing.
///
/// Beside a delay its effect goes with the square of its time constant, so that a fast one has no slope. A slow one has: there the trials
/// say how well they know the square.
fn fast_low_pass(input: &RigFitInput<'_>, point: &DVector<f64>) -> Told {
    let [delay, lag] = [DELAY_PLACE, LAG_PLACE].map(|place| input.coordinates.scales[place]);
    let (own_s, slow_s) = (lag.value(point[LAG_PLACE]), lag.value(0.0));
    let mut slow = point.clone();
    slow[LAG_PLACE] = lag.coordinate(slow_s);
    slow[DELAY_PLACE] = delay.coordinate(delay.value(point[DELAY_PLACE]) - (slow_s - own_s));
    let of_data = input.at(slow).and_then(|fit| covariance(input, &fit)).and_then(|own| own.of_data());
    let Ok(of_data) = of_data else { return Told::Unknown };
    let variance = of_data[(LAG_PLACE, LAG_PLACE)];
    let error_s = INTERVAL * libm::sqrt(variance) * lag.range();
    let bound_s = libm::sqrt(own_s * own_s + 2.0 * slow_s * error_s);
    if bound_s < lag.range() { no_sign_of("a low-pass", bound_s) } else { Told::Unknown }
}

fn no_sign_of(what: &str, bound_s: f64) -> Told {
    let bound_hz = corner_frequency_hz(bound_s);
    let reason =
        format!("no sign of {what} in the trials: it is above {bound_hz:.0} Hz (95 %), if there is one");
    Told::Above { reason, hz: bound_hz }
}

/// What is known of a quantity.
enum Told {
    /// Value, standard error, and the sign of its change with the coordinate.
    Value { value: f64, se: f64, sign: f64 },
    /// Why there is no value, and what it lies above (95 %), Hz.
    Above { reason: String, hz: f64 },
    /// Why there can be none.
    Contradicted(String),
    /// Nothing.
    Unknown,
}

impl Told {
    /// This, or the higher of two frequencies that a quantity without a value lies above.
    fn or_above(self, other: impl FnOnce() -> Self) -> Self {
        match self {
            Self::Value { .. } | Self::Contradicted(_) => self,
            Self::Unknown => other(),
            Self::Above { hz: own, .. } => match other() {
                Self::Above { hz, reason } if hz > own => Self::Above { hz, reason },
                _ => self,
            },
        }
    }
}

/// A quantity from its coordinate. The standard error is such that 1.96 of them reach the farther end of the coordinate's interval.
fn told(quantity: RigQuantity, scale: CoordinateScale, coordinate: f64, se: f64) -> Told {
    let value = scale.value(coordinate);
    let (low, high) = (scale.value(coordinate - INTERVAL * se), scale.value(coordinate + INTERVAL * se));
    if !quantity.is_frequency() {
        return Told::Value { value, se: (high - value).max(value - low) / INTERVAL, sign: 1.0 };
    }
    let is_low_pass = quantity == RigQuantity::TorqueCutoff;
    // Beside a delay a low-pass acts by the square of its time constant, whose interval is twice as wide in proportion.
    let none_below = if is_low_pass { 0.5 * value } else { 0.0 };
    if low > none_below.max(0.0) {
        let frequency = corner_frequency_hz(value);
        let farther = (corner_frequency_hz(low) - frequency).max(frequency - corner_frequency_hz(high));
        return Told::Value { value: frequency, se: farther / INTERVAL, sign: -1.0 };
    }
    let what = if is_low_pass { "a low-pass" } else { "a limit of the motor" };
    if high > 0.0 {
        return no_sign_of(what, high);
    }
    Told::Contradicted(format!(
        "the trials contradict {what}: the time constant is below zero; look for a delay of the other channel"
    ))
}

/// What the session states: its lever, and a rig without errors for the rest.
pub fn stated(quantity: RigQuantity, lever: Option<Lever>) -> Option<f64> {
    match quantity {
        RigQuantity::LeverInertia => lever.map(|own| own.inertia_kg_m2),
        RigQuantity::LeverDamping => lever.map(|own| own.damping_nm_s_per_rad),
        RigQuantity::LeverStiffness => lever.map(|own| own.stiffness_nm_per_rad),
        RigQuantity::TorqueGain | RigQuantity::AngleGain => Some(1.0),
        RigQuantity::TorqueOffset
        | RigQuantity::TorqueNonlinearity
        | RigQuantity::TorqueDelay
        | RigQuantity::BearingFriction => Some(0.0),
        RigQuantity::TorqueCutoff | RigQuantity::ServoBandwidth => None,
    }
}

/// Why a quantity has no value: what it is known together with, and which load would tell it.
fn reason(input: &RigFitInput<'_>, found: &RigCovariance, place: usize, untold: &[usize]) -> String {
    let others: Vec<usize> = untold.iter().copied().filter(|other| *other != place).collect();
    let names = |places: &[usize]| {
        places.iter().map(|place| RigQuantity::ALL[*place].name()).collect::<Vec<_>>().join(" and ")
    };
    let one: Vec<[usize; 1]> = others.iter().map(|other| [*other]).collect();
    let mut together: Vec<Vec<usize>> =
        one.iter().filter(|own| told_with(found, place, *own)).map(|own| own.to_vec()).collect();
    if together.is_empty() {
        for (index, first) in others.iter().enumerate() {
            for second in &others[index + 1..] {
                if told_with(found, place, &[*first, *second]) {
                    together.push(vec![*first, *second]);
                }
            }
        }
    }
    let known = if together.is_empty() {
        String::new()
    } else {
        let sets: Vec<String> = together.iter().map(|own| names(own)).collect();
        format!("known only together with {}; ", sets.join(", or with "))
    };
    format!("{known}{}", remedy(RigQuantity::ALL[place], &input.coordinates, input))
}

/// Whether data and stated loads would tell a coordinate if they told others.
fn told_with(found: &RigCovariance, place: usize, given: &[usize]) -> bool {
    let size = found.information.nrows();
    let kept: Vec<usize> = (0..size).filter(|own| !given.contains(own)).collect();
    let information = DMatrix::from_fn(kept.len(), kept.len(), |row, column| {
        found.information[(kept[row], kept[column])] + if row == column { NOTHING_KNOWN } else { 0.0 }
    });
    let Some(own) = kept.iter().position(|kept| *kept == place) else { return false };
    inverse(information).is_some_and(|inverse| INTERVAL * libm::sqrt(inverse[(own, own)]) <= 1.0)
}

/// What would tell a quantity.
fn remedy(quantity: RigQuantity, coordinates: &RigCoordinates, input: &RigFitInput<'_>) -> String {
    let is_measured = |name: &str| {
        coordinates.loads.iter().any(|load: &RigLoad| load.name() == name)
            || input.trials.iter().any(|trial| trial.load.name() == name)
    };
    let missing = missing_loads(quantity, is_measured);
    let wanted = match missing.as_slice() {
        [] => "more repetitions, or a motion of more and higher frequencies,".to_owned(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    };
    format!("these trials cannot tell it better than engineering allows; {wanted} would tell it")
}

/// Loads that tell a quantity, together with all that it is known together with, and that the session lacks. The torque of a lever or a
/// friction is recorded times the gain of the torque, and its motion times that of the angle.
fn missing_loads(quantity: RigQuantity, is_measured: impl Fn(&str) -> bool) -> Vec<&'static str> {
    let weight = (is_measured("known_weight"), "a known_weight on both sides");
    let bar = (is_measured("known_inertia"), "a known_inertia");
    let bar_or_spring =
        (is_measured("known_inertia") || is_measured("known_spring"), "a known_inertia or a known_spring");
    let clamp = (is_measured("clamped_handle"), "a clamped_handle");
    let free = (is_measured("empty_handle"), "an empty_handle in motion");
    let telling = match quantity {
        RigQuantity::TorqueGain | RigQuantity::TorqueOffset => vec![weight],
        RigQuantity::TorqueNonlinearity => {
            return vec!["known_weights of several masses up to the largest torque"];
        }
        RigQuantity::AngleGain => vec![weight, bar_or_spring],
        RigQuantity::LeverInertia => vec![weight, bar, free],
        RigQuantity::LeverStiffness | RigQuantity::LeverDamping => vec![weight, bar_or_spring, clamp],
        RigQuantity::BearingFriction => vec![weight, free],
        RigQuantity::TorqueDelay | RigQuantity::TorqueCutoff | RigQuantity::ServoBandwidth => Vec::new(),
    };
    telling.into_iter().filter(|(is_there, _)| !is_there).map(|(_, load)| load).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damping_without_inertia_and_stiffness_is_no_lever() {
        let known = || Told::Value { value: 1.0, se: 0.1, sign: 1.0 };
        let told = |mut states: [Told; 3]| {
            keep_whole_lever(&mut states);
            states.iter().filter(|own| matches!(own, Told::Value { .. })).count()
        };
        assert_eq!(told([Told::Unknown, known(), Told::Unknown]), 0);
        assert_eq!(told([known(), known(), known()]), 3);
    }

    #[test]
    fn the_loads_that_would_tell_a_quantity_tell_what_it_is_known_together_with() {
        for (measured, quantity, expected) in [
            (
                "clamped_handle",
                RigQuantity::LeverStiffness,
                vec!["a known_weight on both sides", "a known_inertia or a known_spring"],
            ),
            ("empty_handle", RigQuantity::BearingFriction, vec!["a known_weight on both sides"]),
            (
                "clamped_handle",
                RigQuantity::BearingFriction,
                vec!["a known_weight on both sides", "an empty_handle in motion"],
            ),
            ("empty_handle known_weight known_inertia", RigQuantity::LeverDamping, vec!["a clamped_handle"]),
            ("known_weight known_spring", RigQuantity::AngleGain, vec![]),
        ] {
            let is_measured = |name: &str| measured.split(' ').any(|own| own == name);
            assert_eq!(missing_loads(quantity, is_measured), expected, "{measured}: {quantity:?}");
        }
    }

    #[test]
    fn the_covariance_of_a_sum_whose_parts_cancel_is_symmetric() {
        // The second and the third of three quantities are known together far better than each of them.
        let [own, shared] = [[0.3, -0.7, 0.1], [1.1e4, -1.7e6, 1.7e6]];
        let mut covariance =
            DMatrix::from_fn(3, 3, |i, j| own[i] * own[j] + shared[i] * shared[j] + f64::from(i == j));
        // What an inverse leaves.
        covariance[(0, 1)] *= 1.0 + 4.0 * f64::EPSILON;
        let mut sum = DMatrix::identity(3, 3);
        sum[(1, 2)] = 1.0;
        let product = &sum * &covariance * sum.transpose();
        assert_ne!(product, product.transpose(), "rounding leaves something to mend");
        let found = combined(&sum, &covariance);
        assert_eq!(found, found.transpose());
        assert!((found[(1, 1)] - (0.36 + 2.0)).abs() < 1e-2, "{found}");
    }
}
