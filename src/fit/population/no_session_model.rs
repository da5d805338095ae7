//! Why a session is fitted trial by trial.

/// Why a session has no model of its own: each trial is fitted independently.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoSessionModel {
    /// The user asked for independent fits.
    #[error("as asked")]
    NotAsked,
    /// Without the covariance of the noise, nobody knows what a trial's torque is worth beside what the others say.
    #[error("the noise of the torque is not known from holds, or not used as a weight")]
    UnknownNoise,
    /// Parameters are shared or given by a law already.
    #[error("in this model a trial has no parameters of its own")]
    OtherModel,
    /// The spread of the trials cannot be told from that of the conditions.
    #[error("no condition was repeated")]
    NoRepetitions,
    /// The derivatives of the model rest on the recorded angle: where its error outweighs the noise, all trials are biased alike.
    #[error(
        "the error of the recorded angle (steps of {:.2} mrad) has {ratio:.1} times the variance of the torque's noise: parameters are \
         biased beyond their errors (I_j and x_e too low, k_h and k_srs too high); measure with a finer encoder",
        1e3 * step_rad
    )]
    CoarseAngle {
        /// Variance of the torque error from the angle, by that of the torque's own noise.
        ratio: f64,
        /// Step of the encoder, rad.
        step_rad: f64,
    },
    /// There is no regression.
    #[error("there is only one condition")]
    OneCondition,
    /// The trials are not those of one person, or not of this model.
    #[error(
        "{parameter} spreads by {:.1} % about its regression on velocity and torque, where one person's spreads by at most {:.1} %: \
         trials of several persons or rigs, or a model that does not describe them",
        100.0 * spread, 100.0 * most
    )]
    SpreadBeyondPerson {
        /// Name of the parameter.
        parameter: &'static str,
        /// Standard deviation of its logarithm.
        spread: f64,
        /// The largest that is taken to be one person's.
        most: f64,
    },
    /// The trials are those of two persons, or of one whose grip changed.
    #[error(
        "{} of {trials} trials are a group of their own, whose {parameter} differs by {} from that of the others in all conditions \
         alike: trials of two persons or rigs, a grip that changed, or a model that does not describe them; trials {}",
        smaller.len(), in_words(*difference), numbers(smaller)
    )]
    TwoGroups {
        /// Numbers of the trials of the smaller group.
        smaller: Vec<u32>,
        /// Number of all trials.
        trials: usize,
        /// Name of the parameter that differs most, beside its error.
        parameter: &'static str,
        /// Part by which the larger is above the smaller.
        difference: f64,
    },
    /// The search ended where the trials are not described, or their parameters do not follow the regression.
    #[error(
        "the trials together leave more of the torque than trials whose true parameters are known would: a window too short to tell the \
         parameters, or a model that does not describe the trials"
    )]
    LeavesMore,
    /// The approximation of the likelihood is not finite.
    #[error("the trials' likelihood cannot be approximated")]
    NotFinite,
}

/// Ratio of two groups above which its size says nothing: in one of them the data leave the parameter open.
const LARGEST_RATIO: f64 = 10.0;

/// Numbers of trials, separated by commas.
fn numbers(trials: &[u32]) -> String {
    trials.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}

/// The part by which one is above the other.
fn in_words(difference: f64) -> String {
    if difference < LARGEST_RATIO - 1.0 {
        format!("{:.0} %", 100.0 * difference)
    } else {
        format!("more than a factor of {LARGEST_RATIO:.0}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_of_which_one_leaves_a_parameter_open_are_said_to_differ_by_more_than_a_factor() {
        let text = |difference| {
            NoSessionModel::TwoGroups {
                smaller: vec![4, 9, 17],
                trials: 18,
                parameter: "x_e_rad",
                difference,
            }
            .to_string()
        };
        assert!(text(0.4).contains("differs by 40 % from"), "{}", text(0.4));
        assert!(text(1e50).contains("differs by more than a factor of 10 from"), "{}", text(1e50));
        assert!(
            text(0.4).starts_with("3 of 18 trials") && text(0.4).ends_with("; trials 4, 9, 17"),
            "{}",
            text(0.4)
        );
    }
}
