//! Whether a session has the data that a mechanism needs.

use crate::fit::{EmgGaps, Observations};
use crate::wrist::mechanisms::{Covariates, DataRequirement, MechanismKind};

/// The data that the session lacks for a mechanism to be tested; `None` if it has them.
pub fn missing(observations: &Observations, kind: MechanismKind) -> Option<String> {
    let covariates: Vec<Covariates> =
        observations.trials.iter().map(|trial| trial.input.covariates).collect();
    kind.needs().iter().find_map(|need| {
        let reason = need.unmet(observations.lever, &covariates)?;
        Some(gaps(observations.emg_gaps, *need).unwrap_or_else(|| reason.into()))
    })
}

/// The reason where the session has the channel of a requirement, and single trials lack it.
fn gaps(gaps: EmgGaps, need: DataRequirement) -> Option<String> {
    let (channel, without) = match need {
        DataRequirement::FlexorEmg => ("flexor", gaps.without_flexor),
        DataRequirement::ExtensorEmg => ("extensor", gaps.without_extensor),
        DataRequirement::Lever | DataRequirement::Rest | DataRequirement::Velocities => return None,
    };
    let of = gaps.of;
    (without > 0).then(|| {
        format!("{channel} EMG is missing in {without} of {of} trials, and a trial without it cannot be set beside the others")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn emg_that_single_trials_lack_is_told_from_a_session_without_it() {
        let some = EmgGaps { without_flexor: 2, without_extensor: 0, of: 24 };
        let reason = gaps(some, DataRequirement::FlexorEmg).unwrap();
        assert!(reason.contains("flexor EMG is missing in 2 of 24 trials"), "{reason}");
        assert_eq!(gaps(some, DataRequirement::ExtensorEmg), None);
        assert_eq!(gaps(some, DataRequirement::Lever), None);
        assert_eq!(gaps(EmgGaps::default(), DataRequirement::FlexorEmg), None);
    }
}
