//! Rig trials: what comes before the subject sits down.

use super::*;
use crate::protocol::SEAT_SUBJECT;
use crate::rig::{Fault, RigTrialStage};

fn rig_statuses(bench: &Bench) -> Vec<(u32, Option<Status>)> {
    let attempts = bench.machine.progress().rig_attempts().iter();
    attempts.map(|own| (own.planned.position, own.ended.map(|(status, _)| status))).collect()
}

fn phases(bench: &Bench) -> Vec<Phase> {
    bench.transitions.iter().map(|transition| transition.to).collect()
}

const OK: Option<Status> = Some(Status::Ok);
const ABORTED: Option<Status> = Some(Status::Aborted);
const REJECTED: Option<Status> = Some(Status::Rejected);

#[test]
fn rig_trials_come_before_everything_else_and_the_operator_says_when_the_subject_is_seated() {
    let mut bench = Bench::started(settings_with_rig_trials());
    bench.run_to(Phase::Offset);
    let trial = [Phase::RigSettle, Phase::RigMotion, Phase::RigSetup];
    assert_eq!(phases(&bench), [&[Phase::RigSetup][..], &trial, &trial, &trial, &[Phase::Offset]].concat());
    assert_eq!(rig_statuses(&bench), [(1, OK), (2, OK), (3, OK)]);
    bench.run_to(Phase::Finished);
    assert!(bench.statuses().iter().all(|status| *status == OK));
    assert!(!bench.machine.progress().rig_trials_due());
}

#[test]
fn a_session_without_rig_trials_begins_as_ever() {
    let mut bench = Bench::new(settings_with_everything());
    assert_eq!(bench.say(Event::Start).phase, Phase::Offset);
    assert_eq!(Bench::new(settings()).say(Event::Start).phase, Phase::Rest);
}

#[test]
fn without_offset_and_efforts_the_seated_subject_rests() {
    let mut settings = settings_with_rig_trials();
    (settings.offset_samples, settings.mvc) = (None, None);
    let mut bench = Bench::started(settings);
    bench.run_to(Phase::Rest);
    assert_eq!(bench.transitions.last().unwrap().from, Phase::RigSetup);
}

#[test]
fn a_load_is_waited_for_and_the_next_trial_with_it_begins_by_itself() {
    let mut bench = Bench::started(settings_with_rig_trials());
    bench.ticks(1000);
    assert_eq!(bench.machine.phase(), Phase::RigSetup, "nobody has mounted anything");
    assert!(matches!(bench.command.cue, Cue::RigTrial(own) if own.stage == RigTrialStage::Mounting));
    bench.say(Event::Resume);
    assert_eq!(bench.run_to_event().event, Event::Onset);
    assert_eq!(bench.run_to_event().to, Phase::RigSetup);
    // The second trial has the same load.
    let begun = (0..10).find_map(|_| bench.tick().transition).expect("it begins after the rest");
    assert_eq!((begun.event, begun.to), (Event::RestOver, Phase::RigSettle));
    bench.run_to(Phase::RigSetup);
    bench.ticks(1000);
    assert_eq!(bench.machine.phase(), Phase::RigSetup, "the weight is still to be hung");
}

#[test]
fn the_motor_rests_then_makes_the_motion_and_ends_at_the_start_position() {
    let mut bench = Bench::in_phase(settings_with_rig_trials(), Phase::RigSettle);
    let motion = bench.machine.settings().rig_plan[0].motion;
    while bench.machine.phase() == Phase::RigSettle {
        assert_eq!(bench.command.motor, Motor::Follow { angle_rad: 0.0 });
        bench.tick();
    }
    let mut sample = 0;
    while bench.machine.phase() == Phase::RigMotion {
        sample += 1;
        let angle_rad = motion.at(f64::from(sample) / 500.0).angle_rad;
        assert_eq!(bench.command.motor, Motor::Follow { angle_rad });
        // The target of the next sample is the angle that is commanded now.
        assert_eq!(bench.tick().target_rad, angle_rad);
    }
    // The motion of 0.1 s, and 0.2 s in which the motor comes to rest; their sum is rounded up.
    assert_eq!(motion.duration_s(), 0.1 + 0.2);
    assert_eq!(sample, 151);
    assert_eq!(bench.command.motor, Motor::Follow { angle_rad: 0.0 });
}

#[test]
fn the_motion_waits_for_the_disk() {
    let mut bench = Bench::in_phase(settings_with_rig_trials(), Phase::RigSettle);
    for _ in 0..100 {
        let reading = Reading::Sample(bench.sample());
        bench.feed(Input { reading, operator: None, on_disk: false, punctuality: None });
    }
    assert_eq!(bench.machine.phase(), Phase::RigSettle);
    let onset = bench.tick().transition.unwrap();
    assert!(
        matches!(onset.detail, Some(TransitionDetail::Onset { waited_samples, .. }) if waited_samples > 80)
    );
}

#[test]
fn after_a_fault_the_load_is_confirmed_anew_and_the_rig_trial_runs_again() {
    let mut bench = Bench::in_phase(settings_with_rig_trials(), Phase::RigMotion);
    bench.ticks(20);
    let output = bench.give(Reading::Fault(Fault::NoSample), None);
    assert_eq!((output.phase, output.command.motor), (Phase::Faulted, Motor::Safe));
    bench.say(Event::Rearm);
    bench.run_to(Phase::Paused);
    bench.say(Event::Resume);
    bench.ticks(1000);
    assert_eq!(bench.machine.phase(), Phase::RigSetup, "nothing moves before the operator has looked");
    bench.run_to(Phase::Offset);
    assert_eq!(rig_statuses(&bench), [(1, ABORTED), (1, OK), (2, OK), (3, OK)]);
}

#[test]
fn a_fault_while_the_subject_is_seated_leads_back_to_that_question() {
    let mut bench = Bench::started(settings_with_rig_trials());
    while !bench.machine.progress().rig_queue().len().eq(&0) || bench.machine.phase() != Phase::RigSetup {
        bench.run_to_event();
    }
    bench.give(Reading::Fault(Fault::NoSample), None);
    bench.say(Event::Rearm);
    bench.run_to(Phase::Paused);
    assert_eq!(bench.say(Event::Resume).phase, Phase::RigSetup);
    assert_eq!(bench.say(Event::Skip).refused, Some(Event::Skip), "there is no rig trial left to skip");
    assert_eq!(bench.say(Event::Resume).phase, Phase::Offset);
    assert!(SEAT_SUBJECT.contains("seat the subject"));
}

#[test]
fn a_rig_trial_can_be_left_out_before_and_while_it_rests_but_not_while_the_motor_moves() {
    let mut bench = Bench::started(settings_with_rig_trials());
    bench.say(Event::Skip);
    bench.say(Event::Resume);
    assert_eq!(bench.machine.phase(), Phase::RigSettle);
    bench.say(Event::Skip);
    assert_eq!(bench.machine.phase(), Phase::RigSetup);
    bench.run_to(Phase::RigMotion);
    assert_eq!(bench.say(Event::Skip).refused, Some(Event::Skip));
    bench.run_to(Phase::Offset);
    assert_eq!(rig_statuses(&bench), [(2, ABORTED), (3, OK)]);
    assert_eq!(bench.statuses(), [], "no trial of the subject was touched");
}

#[test]
fn a_rig_trial_that_is_repeated_is_rejected_and_its_load_confirmed_anew() {
    let mut bench = Bench::in_phase(settings_with_rig_trials(), Phase::RigMotion);
    bench.run_to(Phase::RigSetup);
    bench.say(Event::Repeat);
    bench.ticks(1000);
    assert_eq!(bench.machine.phase(), Phase::RigSetup, "the next load may be on the handle already");
    bench.run_to(Phase::Offset);
    assert_eq!(rig_statuses(&bench), [(1, REJECTED), (1, OK), (2, OK), (3, OK)]);
    assert_eq!(bench.machine.progress().rig_attempts()[1].planned.rejections, 1);
}

#[test]
fn a_pause_waits_for_the_end_of_the_motion_and_aborts_a_trial_that_rests() {
    let mut bench = Bench::in_phase(settings_with_rig_trials(), Phase::RigMotion);
    bench.say(Event::Pause);
    assert_eq!(bench.run_to_event().to, Phase::Paused);
    assert_eq!(rig_statuses(&bench), [(1, OK)]);
    assert_eq!(bench.say(Event::Resume).phase, Phase::RigSetup);
    bench.run_to(Phase::RigSettle);
    assert_eq!(bench.say(Event::Pause).phase, Phase::Paused);
    bench.say(Event::Resume);
    bench.run_to(Phase::Offset);
    assert_eq!(rig_statuses(&bench), [(1, OK), (2, ABORTED), (2, OK), (3, OK)]);
}

#[test]
fn a_motion_with_lost_periods_or_a_ramp_of_another_velocity_is_rejected_and_comes_again() {
    let mut bench = Bench::new(settings_with_rig_trials());
    bench.is_motor = true;
    bench.say(Event::Start);
    bench.run_to(Phase::RigMotion);
    bench.punctuality = Some(Punctuality { lost_periods: 2, ..Punctuality::default() });
    let ended = bench.run_to_event();
    assert_eq!(ended.event, Event::MotionDeviated);
    let deviation = Some(MotionDeviation::LostPeriods { lost_periods: 2 });
    assert!(matches!(ended.detail, Some(TransitionDetail::Ended { deviation: own, .. }) if own == deviation));
    bench.run_to(Phase::Offset);
    assert_eq!(rig_statuses(&bench), [(1, REJECTED), (1, OK), (2, OK), (3, OK)]);
}

#[test]
fn a_rig_trial_under_way_when_the_program_died_is_kept_as_aborted_and_comes_first() {
    for phase in [Phase::RigSettle, Phase::RigMotion] {
        let bench = Bench::in_phase(settings_with_rig_trials(), phase);
        let mut progress = bench.machine.progress().clone();
        assert_eq!(progress.interrupt(7), Some(1));
        let mut resumed = Bench::new(settings_with_rig_trials());
        resumed.machine = Machine::with_progress(Arc::new(settings_with_rig_trials()), progress);
        assert_eq!(resumed.say(Event::Start).phase, Phase::RigSetup);
        resumed.ticks(1000);
        assert_eq!(resumed.machine.phase(), Phase::RigSetup, "the load is confirmed anew");
        resumed.run_to(Phase::Finished);
        assert_eq!(rig_statuses(&resumed), [(1, ABORTED), (1, OK), (2, OK), (3, OK)]);
        assert_eq!(resumed.machine.progress().rig_attempts()[0].samples, 7);
    }
}

#[test]
fn a_session_killed_while_a_load_is_mounted_asks_for_it_again() {
    let bench = Bench::in_phase(settings_with_rig_trials(), Phase::RigSetup);
    let mut progress = bench.machine.progress().clone();
    assert_eq!(progress.interrupt(0), None);
    let mut resumed = Bench::new(settings_with_rig_trials());
    resumed.machine = Machine::with_progress(Arc::new(settings_with_rig_trials()), progress);
    assert_eq!(resumed.say(Event::Start).phase, Phase::RigSetup);
    resumed.run_to(Phase::Offset);
    assert_eq!(rig_statuses(&resumed), [(1, OK), (2, OK), (3, OK)]);
}

#[test]
fn a_wait_for_the_operator_changes_nothing_but_counts_of_samples() {
    let mut bench = Bench::started(settings_with_rig_trials());
    bench.ticks(5000);
    let before = bench.machine.clone();
    bench.tick();
    assert!(bench.machine.only_waits_since(&before));
    bench.run_to(Phase::RigMotion);
    bench.run_to(Phase::RigSetup);
    let before = bench.machine.clone();
    bench.tick();
    assert!(!bench.machine.only_waits_since(&before), "the next trial begins by itself");
}
