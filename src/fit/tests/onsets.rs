//! Onsets that a session states late or early, or does not state.

use super::*;

fn fitted(session: &Session) -> (Observations, Vec<Vec<f64>>) {
    let observations = Observations::new(session, PreprocessingSettings::default()).unwrap();
    let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    let parameters = SessionFit::new(&observations, &fit).unwrap().fit.parameters;
    (observations, parameters)
}

fn with_onsets(session: &Session, onset_s: impl Fn(f64) -> Option<f64>) -> Session {
    let mut session = session.clone();
    session.trials.iter_mut().for_each(|trial| trial.onset_s = trial.onset_s.and_then(&onset_s));
    session
}

/// What the motor had moved before the onset counted as rest: of an onset 8 ms late, a diagnosis made causes of the lever with 80 standard
/// errors.
#[test]
fn onsets_that_are_late_or_early_or_not_stated_give_the_same_wrist() {
    let session = SyntheticSession { noise_nm: 0.005, ..SyntheticSession::new(2) }.session();
    let (exact, truth) = fitted(&session);
    assert_eq!([exact.stated_onsets_late_s(), exact.stated_onsets_early_s()], [0.0, 0.0]);
    for (name, changed) in [
        ("late", with_onsets(&session, |onset_s| Some(onset_s + 0.008))),
        ("early", with_onsets(&session, |onset_s| Some(onset_s - 0.012))),
        ("none", with_onsets(&session, |_| None)),
    ] {
        let (observations, parameters) = fitted(&changed);
        assert_eq!(observations.stated_onsets_late_s() > 0.004, name == "late", "{name}");
        assert_eq!(observations.stated_onsets_early_s() > 0.008, name == "early", "{name}");
        for (trial, exact) in observations.trials.iter().zip(&exact.trials) {
            let late_s = trial.onset_s - exact.onset_s;
            assert!((-0.004..0.002).contains(&late_s), "{name}, trial {}: {late_s} s", trial.number);
        }
        for (own, truth) in parameters.iter().zip(&truth) {
            for (parameter, tolerance) in [(I_J, 0.02), (K_SRS, 0.03), (X_E, 0.06)] {
                let off = relative_error(own[parameter], truth[parameter]);
                assert!(off < tolerance, "{name}: parameter {parameter}, {own:?} for {truth:?}");
            }
        }
    }
}
