//! Time that a session is expected to take still.

use crate::protocol::{APPROACH_S, RIG_SETTLE_S};
use crate::session::{Phase, PlannedTrial, Progress, Settings, Status};

/// Expected time to the end of the session without pauses, s. The time from the target to the end of the hold, and the number of
/// attempts that a trial takes, are those of the trials so far.
pub fn time_left_s(progress: &Progress, settings: &Settings, phase: Phase, in_phase_s: f64) -> f64 {
    let seconds = |samples: u64| samples as f64 / settings.sample_rate_hz;
    let rest_s = seconds(settings.rest_samples);
    let (mut ended, mut counting, mut counting_samples) = (0, 0, 0);
    for attempt in progress.attempts() {
        ended += u64::from(attempt.ended.is_some());
        if matches!(attempt.ended, Some((Status::Ok, _))) {
            (counting, counting_samples) = (counting + 1, counting_samples + attempt.samples);
        }
    }
    let per_counting = |sum: f64| (counting > 0).then(|| sum / counting as f64);
    let mean_record_s = per_counting(seconds(counting_samples));
    let attempts_per_trial = per_counting(ended as f64).unwrap_or(1.0);
    let return_s = |trial: &PlannedTrial| trial.movement.duration_s() - trial.movement.start_of_return_s();
    let record_s = |trial: &PlannedTrial| {
        mean_record_s.unwrap_or_else(|| {
            let [shortest_s, longest_s] = settings.delay_samples.map(seconds);
            let gate_s = (APPROACH_S + settings.gate.duration_s).min(settings.gate.timeout_s);
            gate_s + (shortest_s + longest_s) / 2.0 + trial.movement.start_of_return_s()
        })
    };
    let trial_s = |trial: &PlannedTrial| attempts_per_trial * (rest_s + record_s(trial) + return_s(trial));
    let trials_s: f64 = progress.queue().map(trial_s).sum();

    let efforts_s = settings.mvc.as_ref().map_or(0.0, |mvc| {
        progress.efforts_left() as f64 * (mvc.duration_s + mvc.rest_s)
            + if phase == Phase::MvcRest { mvc.rest_s } else { 0.0 }
    });
    let rig_s = rig_trials_s(progress, phase);
    let offset_s = match phase {
        Phase::Ready | Phase::Offset | Phase::RigSetup | Phase::RigSettle | Phase::RigMotion
            if progress.attempts().is_empty() && progress.efforts().is_empty() =>
        {
            settings.offset_samples.map_or(0.0, seconds)
        }
        _ => 0.0,
    };
    let under_way_s = progress.attempts().last().map_or(0.0, |attempt| match phase {
        phase if phase.in_trial() => record_s(&attempt.planned) + return_s(&attempt.planned),
        Phase::Return => return_s(&attempt.planned),
        _ => 0.0,
    });
    let passed_s = match phase {
        // A wait for the operator is no progress.
        Phase::RigSetup => 0.0,
        phase if phase.in_rig_trial() => in_phase_s.min(rig_under_way_s(progress, phase)),
        Phase::Offset | Phase::MvcEffort | Phase::MvcRest | Phase::Rest | Phase::Return => in_phase_s,
        phase if phase.in_trial() => in_phase_s.min(under_way_s),
        _ => 0.0,
    };
    (rig_s + offset_s + efforts_s + under_way_s + trials_s - passed_s).max(0.0)
}

/// Expected time of the rig trials that are left and of the one under way, mounting included, s.
fn rig_trials_s(progress: &Progress, phase: Phase) -> f64 {
    if !progress.rig_trials_due() {
        return 0.0;
    }
    let mut mounted = progress.mounted();
    let left_s = progress.rig_queue().map(|trial| trial.expected_s(mounted.replace(trial.load)));
    left_s.sum::<f64>() + rig_under_way_s(progress, phase)
}

/// Expected time from the beginning of the present phase to the end of the rig trial under way, s.
fn rig_under_way_s(progress: &Progress, phase: Phase) -> f64 {
    progress.current_rig_trial().map_or(0.0, |trial| match phase {
        Phase::RigSettle => RIG_SETTLE_S + trial.planned.motion.duration_s(),
        _ => trial.planned.motion.duration_s(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Mvc, Protocol};
    use crate::schedule;

    #[test]
    fn what_is_left_is_that_of_the_protocol_and_falls_while_time_passes() {
        let text = include_str!("../../protocols/quick.json");
        let protocol = Protocol::parse(text, "quick.json").unwrap();
        let order = schedule::draw(&protocol, 1, None).unwrap();
        let mut settings = Settings::new(&protocol, 1, &order).unwrap();
        settings.offset_samples = Some(settings.samples(3.0));
        settings.mvc = Some(Mvc { efforts: 2, duration_s: 5.0, rest_s: 30.0 });
        let progress = Progress::new(&settings);
        let left_s = |phase, in_phase_s| time_left_s(&progress, &settings, phase, in_phase_s);
        let before_s = 3.0 + 4.0 * 35.0;
        let trials_s = left_s(Phase::Ready, 0.0) - before_s;
        let rests_s = settings.plan.len() as f64 * protocol.rest_s;
        let gates_s = settings.plan.len() as f64 * (APPROACH_S + protocol.gate.duration_s);
        assert!(trials_s > rests_s + gates_s && trials_s < 2.0 * (rests_s + gates_s), "{trials_s}");
        assert_eq!(left_s(Phase::Ready, 100.0), left_s(Phase::Ready, 0.0), "a wait is no progress");
        assert!((left_s(Phase::Offset, 2.0) - (left_s(Phase::Ready, 0.0) - 2.0)).abs() < 1e-9);
        assert!((left_s(Phase::Rest, 1.0) - left_s(Phase::Rest, 0.0) + 1.0).abs() < 1e-9);
        settings.plan.clear();
        settings.mvc = None;
        assert_eq!(time_left_s(&Progress::new(&settings), &settings, Phase::Rest, 0.0), 0.0);
    }
}
