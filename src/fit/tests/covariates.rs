//! Tests of what is known of the trials besides angle and torque.

use super::*;

/// A session in which both muscles are active, more from trial to trial.
fn with_emg() -> Session {
    let mut session = SyntheticSession::new(2).session();
    for (place, trial) in session.trials.iter_mut().enumerate() {
        let samples = trial.record.theta_m_rad.len();
        trial.record.emg_fcr_mvc = Some(vec![0.2 + 0.001 * place as f64; samples]);
        trial.record.emg_ecr_mvc = Some(vec![0.1 + 0.001 * place as f64; samples]);
    }
    session
}

#[test]
fn a_trial_without_emg_is_no_trial_without_activity() {
    let observed = |session: &Session| Observations::new(session, PreprocessingSettings::default()).unwrap();
    let extensor = |own: &Observations| -> Vec<f64> {
        own.trials.iter().map(|trial| trial.input.covariates.extensor_emg_mvc).collect()
    };
    let flexor = |own: &Observations| -> Vec<f64> {
        own.trials.iter().map(|trial| trial.input.covariates.flexor_emg_excess_mvc).collect()
    };
    let mut session = with_emg();
    let all = observed(&session);
    assert!(extensor(&all).iter().all(|level| *level > 0.09) && flexor(&all).iter().any(|own| *own != 0.0));
    assert_eq!((all.emg_gaps.without_flexor, all.emg_gaps.without_extensor), (0, 0));

    session.trials[3].record.emg_ecr_mvc = None;
    let without = observed(&session);
    assert!(extensor(&without).iter().all(|level| *level == 0.0), "{:?}", extensor(&without));
    assert_eq!(flexor(&without), flexor(&all), "the other muscle is as it was");
    assert_eq!(without.emg_gaps, EmgGaps { without_flexor: 0, without_extensor: 1, of: 24 });

    session.trials[5].record.emg_fcr_mvc = None;
    let without = observed(&session);
    assert!(flexor(&without).iter().all(|level| *level == 0.0), "{:?}", flexor(&without));
    assert_eq!(without.emg_gaps.without_flexor, 1);
}

#[test]
fn a_session_without_emg_has_no_gaps_in_it() {
    assert_eq!(SyntheticSession::new(2).observations().emg_gaps, EmgGaps { of: 24, ..EmgGaps::default() });
}
