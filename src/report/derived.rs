//! Quantities derived from a fitted trial: the time at which elastic torque exceeds inertial torque, strain, work.

use crate::wrist::TraceSample;

/// Wrist rotation and the stretch of each half-sarcomere of the wrist flexors that belongs to it, rad and nm
/// (section 4.1 of the paper, from van Eesbeek et al. 2010).
const ROTATION_RAD: f64 = 0.066;
const STRETCH_NM: f64 = 17.0;

/// Half the length L_0 of a sarcomere at the neutral wrist, nm (section 4.1, from Friden and Lieber 2002: 2.8 um).
const HALF_SARCOMERE_NM: f64 = 1400.0;

/// Time from which the elastic torque exceeds the inertial torque until the end of the window, s; `None` if it does not.
///
/// The search starts at the peak of the inertial torque: before it both are near zero and may cross at random.
pub fn overtaking_s(instants: &[TraceSample], window_s: f64) -> Option<f64> {
    let window = &instants[..instants.iter().take_while(|instant| instant.time_s <= window_s).count()];
    let ahead = |instant: &TraceSample| instant.elastic_nm - instant.inertial_nm;
    let peak = (0..window.len()).max_by(|a, b| window[*a].inertial_nm.total_cmp(&window[*b].inertial_nm))?;
    let pair = window[peak..].windows(2).find(|pair| ahead(&pair[0]) < 0.0 && ahead(&pair[1]) >= 0.0)?;
    let (before, after) = (ahead(&pair[0]), ahead(&pair[1]));
    Some(pair[0].time_s + (pair[1].time_s - pair[0].time_s) * before / (before - after))
}

/// Stretch of a half-sarcomere, nm, at a wrist rotation.
pub fn stretch_nm(rotation_rad: f64) -> f64 {
    rotation_rad * STRETCH_NM / ROTATION_RAD
}

/// Strain of a half-sarcomere at a wrist rotation, as a fraction of L_0.
pub fn strain(rotation_rad: f64) -> f64 {
    stretch_nm(rotation_rad) / HALF_SARCOMERE_NM
}

/// The elastic work of a trial within the window, J.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticWork {
    /// ElasticWork done on the muscle: the area under elastic torque against joint angle (the paper's Fig. 6).
    pub taken_up_j: f64,
    /// Recoverable part, which short-range stiffness returns when unloaded: T^2 / (2 k_srs).
    pub given_back_j: f64,
}

impl ElasticWork {
    /// ElasticWork from the onset to the end of the window.
    pub fn of(instants: &[TraceSample], window_s: f64, short_range_stiffness: f64) -> Option<Self> {
        let window = &instants[..instants.iter().take_while(|instant| instant.time_s <= window_s).count()];
        let last = window.last()?;
        let area = |pair: &[TraceSample]| {
            (pair[1].state.theta_j - pair[0].state.theta_j) * (pair[0].elastic_nm + pair[1].elastic_nm) / 2.0
        };
        Some(Self {
            taken_up_j: window.windows(2).map(area).sum(),
            given_back_j: last.elastic_nm * last.elastic_nm / (2.0 * short_range_stiffness),
        })
    }

    /// Dissipated by the yield, J.
    pub fn dissipated_j(&self) -> f64 {
        self.taken_up_j - self.given_back_j
    }
}

/// Differences of equal values, as a part of them, that come from rounding alone.
const EQUAL_WITHIN: f64 = 1e-9;

/// Whether `difference` is more than the rounding of values of the size of `value`.
pub fn is_difference(difference: f64, value: f64) -> bool {
    difference.abs() > EQUAL_WITHIN * value.abs()
}

/// Mean and standard deviation of the values that exist; no standard deviation for fewer than two.
pub fn mean_sd(values: impl IntoIterator<Item = Option<f64>>) -> Option<(f64, Option<f64>)> {
    let values: Vec<f64> = values.into_iter().flatten().filter(|value| value.is_finite()).collect();
    let count = values.len() as f64;
    if values.is_empty() {
        return None;
    }
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    Some((mean, (values.len() > 1).then(|| libm::sqrt(squares / (count - 1.0)))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wrist::{Kinematics, State, Torques};

    fn instants(motion: impl Fn(f64) -> (f64, f64, f64)) -> Vec<TraceSample> {
        (0..=400)
            .map(|step| {
                let time_s = f64::from(step) * 1e-4;
                let (theta_j, elastic_nm, inertial_nm) = motion(time_s);
                let mut state = State::rest();
                state.theta_j = theta_j;
                let none = Torques { lever: 0.0, interface: 0.0, joint: 0.0, beyond: 0.0, measured: 0.0 };
                TraceSample {
                    time_s,
                    motor: Kinematics::default(),
                    state,
                    torques: none,
                    elastic_nm,
                    inertial_nm,
                }
            })
            .collect()
    }

    #[test]
    fn the_overtaking_is_found_between_samples_and_not_in_the_beginning() {
        let crossing = instants(|t| (t, 20.0 * t, if t < 0.01 { 100.0 * t } else { 1.46 - 46.0 * t }));
        let found = overtaking_s(&crossing, 0.04).unwrap();
        assert!((found - 1.46 / 66.0).abs() < 1e-9, "{found}");
        assert_eq!(overtaking_s(&crossing, 0.02), None);
    }

    #[test]
    fn a_spring_dissipates_nothing_and_a_yielding_one_what_lies_above_its_unloading_line() {
        let spring = ElasticWork::of(&instants(|t| (t, 20.0 * t, 0.0)), 0.04, 20.0).unwrap();
        assert!(spring.dissipated_j().abs() < 1e-12 && (spring.taken_up_j - 0.016).abs() < 1e-9);
        let plastic = ElasticWork::of(&instants(|t| (t, 20.0 * t.min(0.02), 0.0)), 0.04, 20.0).unwrap();
        assert!((plastic.dissipated_j() - 0.4 * 0.02).abs() < 1e-9, "{plastic:?}");
    }

    #[test]
    fn strain_is_converted_as_in_the_paper() {
        assert!((stretch_nm(0.066) - 17.0).abs() < 1e-12);
        assert!((strain(0.066) - 0.0121).abs() < 1e-4);
    }
}
