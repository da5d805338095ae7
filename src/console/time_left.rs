//! Time that a session is expected to take still.

use crate::protocol::APPROACH_S;
use crate::session::{Attempt, Phase, PlannedTrial, Progress, Settings, Status};

/// Expected time to the end of the session without pauses, s. The time from the target to the end of the hold, and the number of
/// attempts that a trial takes, are those of the trials so far.
pub fn time_left_s(progress: &Progress, settings: &Settings, phase: Phase, in_phase_s: f64) -> f64 {
    let seconds = |samples: u64| samples as f64 / settings.sample_rate_hz;
    let rest_s = seconds(settings.rest_samples);
    let ended: Vec<&Attempt> = progress.attempts().iter().filter(|attempt| attempt.ended.is_some()).collect();
    let counting =
        ended.iter().filter(|attempt| matches!(attempt.ended, Some((Status::Ok, _)))).collect::<Vec<_>>();
    let return_s = |trial: &PlannedTrial| trial.movement.duration_s() - trial.movement.start_of_return_s();
    let record_s = |trial: &PlannedTrial| match counting.len() {
        0 => {
            let [shortest, longest] = settings.delay_samples.map(seconds);
            let gate_s = (APPROACH_S + settings.gate.duration_s).min(settings.gate.timeout_s);
            gate_s + (shortest + longest) / 2.0 + trial.movement.start_of_return_s()
        }
        count => counting.iter().map(|attempt| seconds(attempt.samples)).sum::<f64>() / count as f64,
    };
    let attempts_per_trial =
        if counting.is_empty() { 1.0 } else { ended.len() as f64 / counting.len() as f64 };
    let trial_s = |trial: &PlannedTrial| rest_s + attempts_per_trial * (record_s(trial) + return_s(trial));
    let trials_s: f64 = progress.queue().map(trial_s).sum();

    let efforts_s = settings.mvc.as_ref().map_or(0.0, |mvc| {
        progress.efforts_left() as f64 * (mvc.duration_s + mvc.rest_s)
            + if phase == Phase::MvcRest { mvc.rest_s } else { 0.0 }
    });
    let offset_s = match phase {
        Phase::Ready | Phase::Offset if progress.attempts().is_empty() && progress.efforts().is_empty() => {
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
        Phase::Offset | Phase::MvcEffort | Phase::MvcRest | Phase::Rest | Phase::Return => in_phase_s,
        phase if phase.in_trial() => in_phase_s.min(under_way_s),
        _ => 0.0,
    };
    (offset_s + efforts_s + under_way_s + trials_s - passed_s).max(0.0)
}
