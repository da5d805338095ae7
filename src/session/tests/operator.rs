//! What the operator can say.

use super::*;

#[test]
fn a_session_runs_from_start_to_finish_in_the_order_of_the_plan() {
    let mut bench = Bench::started(settings_with_everything());
    bench.run_to(Phase::Finished);
    let attempts = bench.machine.progress().attempts();
    let order: Vec<_> = attempts.iter().map(|attempt| (attempt.planned.key, attempt.number)).collect();
    let plan: Vec<_> =
        settings_with_everything().plan.iter().map(|planned| planned.key).zip([1, 1, 2, 3, 4]).collect();
    assert_eq!(order, plan);
    let phases: Vec<Phase> = bench.transitions.iter().take(10).map(|transition| transition.to).collect();
    use Phase::*;
    assert_eq!(
        phases,
        [Offset, MvcEffort, MvcRest, MvcEffort, MvcRest, MvcEffort, MvcRest, MvcEffort, MvcRest, Rest]
    );
    assert_eq!(bench.command.motor, Motor::Safe);
}

#[test]
fn maximal_efforts_set_the_unit_of_emg() {
    let mut bench = Bench::started(settings_with_everything());
    bench.run_to(Phase::Rest);
    let [fcr, ecr] = bench.machine.progress().emg_factors().unwrap();
    assert!(fcr > 0.5 && fcr < 1.0 && ecr > 0.5 && ecr < 1.0, "{fcr} {ecr}");
}

#[test]
fn an_effort_is_repeated_in_its_direction_and_the_best_counts() {
    let mut bench = Bench::started(settings_with_everything());
    let effort = |bench: &mut Bench, level: f64| {
        bench.run_to(Phase::MvcEffort);
        bench.effort_mvc = level;
        bench.run_to(Phase::MvcRest);
        bench.effort_mvc = 1.0;
    };
    effort(&mut bench, 0.5);
    assert_eq!(bench.say(Event::RepeatEffort).phase, Phase::MvcRest);
    // Asked for once, not as often as the key is pressed.
    assert_eq!(bench.say(Event::RepeatEffort).refused, Some(Event::RepeatEffort));
    effort(&mut bench, 1.0);
    effort(&mut bench, 0.6);
    // Asked for in a pause as well, and still due after one that breaks the repeated effort off.
    bench.say(Event::Pause);
    assert_eq!(bench.say(Event::RepeatEffort).phase, Phase::Paused);
    bench.say(Event::Resume);
    bench.say(Event::Pause);
    bench.say(Event::Resume);
    effort(&mut bench, 0.7);
    assert!(bench.machine.progress().emg_factors().is_none(), "efforts of the protocol are left");
    bench.run_to(Phase::Rest);
    let progress = bench.machine.progress();
    let directions: Vec<Direction> = progress.efforts().iter().map(|effort| effort.direction).collect();
    use Direction::{Extension, Flexion};
    assert_eq!(directions, [Flexion, Flexion, Extension, Extension, Flexion, Extension]);
    let best = |direction, peak: fn(&MaximalEffort) -> f64| {
        let own = progress.efforts().iter().filter(|effort| effort.direction == direction);
        own.map(peak).fold(0.0, f64::max)
    };
    let factors = progress.emg_factors().unwrap();
    assert_eq!(factors, [best(Flexion, |own| own.peak_fcr), best(Extension, |own| own.peak_ecr)]);
    // From here on EMG has their unit, so that it is too late.
    assert_eq!(bench.say(Event::RepeatEffort).refused, Some(Event::RepeatEffort));
    bench.run_to(Phase::Finished);
}

/// The smoothing began anew when the last effort ended: what was shown of the muscles fell to zero, and rose again.
#[test]
fn what_is_shown_of_the_muscles_does_not_fall_to_zero_at_the_end_of_the_efforts() {
    let mut settings = settings_with_everything();
    settings.mvc = Some(Mvc { efforts: 1, duration_s: 0.5, rest_s: 0.02 });
    let mut bench = Bench::started(settings);
    let mut last_mvc = 0.0;
    while bench.machine.phase() != Phase::Hold {
        let factors_before = bench.machine.progress().emg_factors();
        let before_mvc = bench.machine.feedback().ecr_mvc.unwrap_or(0.0);
        bench.tick();
        let factor = match (factors_before, bench.machine.progress().emg_factors()) {
            (None, Some(factors)) => factors[1],
            _ => 1.0,
        };
        let ecr_mvc = bench.machine.feedback().ecr_mvc.unwrap_or(0.0) * factor;
        // An effort begins with smoothing of its own; apart from that a sample changes it by at most its share.
        if !matches!(bench.machine.phase(), Phase::Offset | Phase::MvcEffort) && last_mvc > 0.0 {
            assert!(ecr_mvc >= 0.97 * before_mvc, "{before_mvc} fell to {ecr_mvc}");
        }
        last_mvc = ecr_mvc;
    }
    assert!(bench.machine.progress().emg_factors().is_some());
}

#[test]
fn nothing_moves_before_the_operators_word() {
    let mut bench = Bench::new(settings());
    for _ in 0..100 {
        let output = bench.give(Reading::Disarmed, None);
        assert_eq!((output.phase, output.command.motor), (Phase::Ready, Motor::Safe));
    }
    assert_eq!(bench.give(Reading::Disarmed, Some(Event::Start)).refused, Some(Event::Start));
}

#[test]
fn pause_in_a_hold_aborts_the_trial_and_resume_gives_a_full_rest() {
    let mut bench = Bench::in_phase(settings(), Phase::Hold);
    assert_eq!(bench.say(Event::Pause).phase, Phase::Paused);
    assert_eq!(bench.statuses(), [Some(Status::Aborted)]);
    (0..1000).for_each(|_| assert_eq!(bench.tick().phase, Phase::Paused));
    assert_eq!(bench.say(Event::Resume).phase, Phase::Rest);
    let resumed = bench.machine.sample();
    assert_eq!(bench.run_to_event().event, Event::RestOver);
    assert_eq!(bench.machine.sample() - resumed, bench.machine.settings().rest_samples);
    bench.run_to(Phase::Finished);
    assert_eq!(bench.machine.progress().attempts().len(), 5);
}

#[test]
fn pause_in_a_ramp_waits_until_the_motor_is_home() {
    for phase in [Phase::Ramp, Phase::RampHold, Phase::Return] {
        let mut bench = Bench::in_phase(settings(), phase);
        assert_eq!(bench.say(Event::Pause).phase, phase);
        bench.run_to(Phase::Paused);
        assert_eq!(bench.statuses(), [Some(Status::Ok)]);
        bench.say(Event::Resume);
        bench.run_to(Phase::Return);
        bench.run_to(Phase::Rest);
    }
}

#[test]
fn pause_in_the_phases_before_the_trials_does_them_again() {
    for phase in [Phase::Offset, Phase::MvcEffort] {
        let mut bench = Bench::in_phase(settings_with_everything(), phase);
        bench.tick();
        assert_eq!(bench.say(Event::Pause).phase, Phase::Paused);
        assert_eq!(bench.say(Event::Resume).phase, phase);
    }
}

#[test]
fn skip_leaves_out_the_next_trial_or_the_one_under_way() {
    for (phase, aborted) in [(Phase::Rest, 0), (Phase::Hold, 1), (Phase::Delay, 1)] {
        let mut bench = Bench::in_phase(settings(), phase);
        bench.say(Event::Skip);
        bench.run_to(Phase::Finished);
        let count = |wanted| bench.statuses().iter().filter(|status| **status == Some(wanted)).count();
        assert_eq!((count(Status::Ok), count(Status::Aborted)), (3, aborted));
        assert!(!bench.machine.progress().attempts().iter().any(|attempt| {
            attempt.planned.key.position == 1 && matches!(attempt.ended, Some((Status::Ok, _)))
        }));
    }
}

#[test]
fn skipping_everything_ends_the_session() {
    let mut bench = Bench::in_phase(settings(), Phase::Rest);
    for _ in 0..4 {
        bench.say(Event::Skip);
    }
    assert_eq!(bench.machine.phase(), Phase::Finished);
    let mut bench = Bench::in_phase(settings(), Phase::Rest);
    bench.say(Event::Pause);
    for _ in 0..4 {
        bench.say(Event::Skip);
    }
    assert_eq!(bench.say(Event::Resume).phase, Phase::Finished);
}

#[test]
fn repeat_takes_the_last_trial_back_and_runs_it_next() {
    for phase in [Phase::Return, Phase::Rest] {
        let mut bench = Bench::in_phase(settings(), Phase::Return);
        bench.run_to(phase);
        bench.say(Event::Repeat);
        assert_eq!(bench.statuses(), [Some(Status::Rejected)]);
        assert_eq!(bench.say(Event::Repeat).refused, Some(Event::Repeat));
        bench.run_to(Phase::Hold);
        let [first, second] = bench.machine.progress().attempts() else { panic!("two attempts") };
        assert_eq!((second.number, second.planned.key.position), (2, first.planned.key.position));
        assert_eq!(second.planned.key.rejections, 1);
    }
}

#[test]
fn abort_makes_the_motor_safe_in_the_same_step_and_keeps_the_trial() {
    for phase in [Phase::Hold, Phase::Ramp, Phase::RampHold] {
        let mut bench = Bench::in_phase(settings(), phase);
        let output = bench.say(Event::Abort);
        assert_eq!((output.phase, output.command.motor), (Phase::Aborted, Motor::Safe));
        assert_eq!(bench.statuses(), [Some(Status::Aborted)]);
        assert_eq!(bench.machine.progress().queue().len(), 4);
    }
}

#[test]
fn a_record_runs_from_the_target_to_the_end_of_the_hold() {
    let mut bench = Bench::in_phase(settings(), Phase::Rest);
    let mut recorded = Vec::new();
    while bench.machine.phase() != Phase::Return {
        recorded.push(bench.tick().record == RecordTarget::Trial);
    }
    let first = recorded.iter().position(|inside| *inside).unwrap();
    let samples = recorded[first..].iter().filter(|inside| **inside).count() as u64;
    assert!(
        recorded[first..recorded.len() - 1].iter().all(|inside| *inside) && !recorded[recorded.len() - 1]
    );
    assert_eq!(bench.machine.progress().attempts()[0].samples, samples);
    let onset = bench.machine.progress().attempts()[0].onset_sample.unwrap();
    let movement = bench.machine.progress().attempts()[0].planned.movement;
    let after_onset = (movement.start_of_return_s() * 500.0).ceil() as u64;
    assert_eq!(samples, onset + after_onset);
}
