//! A ramp whose motion was not as asked is rejected and run again.

use super::*;
use crate::rig::Fault;

fn in_ramp() -> Bench {
    in_ramp_of(settings())
}

fn in_ramp_of(settings: Settings) -> Bench {
    Bench { is_motor: true, ..Bench::in_phase(settings, Phase::Ramp) }
}

fn lost(lost_periods: u64) -> Option<Punctuality> {
    Some(Punctuality { lost_periods, longest_gap_us: 60_000, latest_us: 58_000 })
}

#[track_caller]
fn end_of(mut bench: Bench) -> (Bench, TransitionRecord) {
    loop {
        let transition = bench.run_to_event();
        if transition.to == Phase::Return {
            return (bench, transition);
        }
    }
}

fn deviation(transition: &TransitionRecord) -> Option<MotionDeviation> {
    match transition.detail {
        Some(TransitionDetail::Ended { deviation, .. }) => deviation,
        other => panic!("no end of a trial: {other:?}"),
    }
}

#[test]
fn a_ramp_that_lost_periods_is_rejected_and_run_again() {
    for phase in [Phase::Ramp, Phase::RampHold] {
        let mut bench = Bench::in_phase(settings(), phase);
        bench.ticks(2);
        bench.punctuality = lost(29);
        let (bench, end) = end_of(bench);
        assert_eq!((end.event, bench.statuses()), (Event::MotionDeviated, vec![Some(Status::Rejected)]));
        assert_eq!(deviation(&end), Some(MotionDeviation::LostPeriods { lost_periods: 29 }));
        let trial = bench.machine.progress().attempts()[0];
        assert_eq!(trial.punctuality, lost(29), "the longest gap and the latest begin are kept");
        let again = bench.machine.progress().queue().find(|other| other.key.rejections == 1).unwrap();
        assert_eq!(again.velocity_rad_s, trial.planned.velocity_rad_s);
    }
}

#[test]
fn periods_that_are_lost_before_the_onset_or_after_the_hold_spoil_no_ramp() {
    let mut bench = Bench::in_phase(settings(), Phase::Hold);
    bench.punctuality = lost(3);
    bench.run_to(Phase::Return);
    bench.punctuality = lost(3);
    bench.run_to(Phase::Rest);
    assert_eq!(bench.statuses(), [Some(Status::Ok)]);
    let kept = bench.machine.progress().attempts()[0].punctuality;
    assert_eq!(kept, Some(Punctuality { lost_periods: 0, ..lost(3).unwrap() }));
    bench.run_to(Phase::Ramp);
    let (bench, _) = end_of(bench);
    assert_eq!(bench.machine.progress().attempts()[1].punctuality, None, "each trial has its own");
}

#[test]
fn a_trial_that_a_fault_ends_keeps_how_punctual_it_was() {
    let mut bench = in_ramp();
    bench.punctuality = lost(1);
    bench.give(Reading::Fault(Fault::NoSample), None);
    assert_eq!(bench.machine.progress().attempts()[0].punctuality, lost(1));
}

/// As of a motor that reaches 2.62 rad/s at most.
#[test]
fn a_ramp_that_was_slower_than_asked_is_rejected_with_both_velocities() {
    let mut bench = in_ramp();
    bench.astray = |t_s| -0.63 * t_s.min(0.06);
    let asked = bench.machine.progress().current().unwrap().planned.velocity_rad_s;
    let (bench, end) = end_of(bench);
    assert_eq!((end.event, bench.statuses()), (Event::MotionDeviated, vec![Some(Status::Rejected)]));
    let Some(MotionDeviation::Velocity { measured_rad_s, asked_rad_s, tolerance, .. }) = deviation(&end)
    else {
        panic!("{end:?}")
    };
    assert!((asked_rad_s - asked).abs() < 1e-9 && (measured_rad_s - (asked - 0.63)).abs() < 1e-6, "{end:?}");
    assert_eq!(tolerance, 0.1);
    let text = deviation(&end).unwrap().to_string();
    assert!(
        text.contains(&format!("{:.3}", asked - 0.63)) && text.contains(&format!("{asked:.3}")),
        "{text}"
    );
}

#[test]
fn a_simulated_servo_may_be_as_slow_as_it_likes() {
    let mut bench = Bench::in_phase(settings(), Phase::Ramp);
    bench.astray = |t_s| -0.63 * t_s.min(0.06);
    let (bench, _) = end_of(bench);
    assert_eq!(bench.statuses(), [Some(Status::Ok)]);
}

#[test]
fn a_ramp_that_was_nearly_as_asked_is_ok() {
    let mut bench = in_ramp();
    bench.astray = |t_s| -0.1 * t_s.min(0.06);
    assert_eq!(bench.machine.progress().current().unwrap().planned.velocity_rad_s, 3.25);
    let (bench, _) = end_of(bench);
    assert_eq!(bench.statuses(), [Some(Status::Ok)]);
}

#[test]
fn an_angle_with_the_steps_of_a_coarse_encoder_is_no_deviation() {
    let mut bench = in_ramp();
    bench.astray = |t_s| 0.19e-3 * (t_s * 500.0 * 2.4).sin().signum();
    let (bench, end) = end_of(bench);
    assert_eq!(bench.statuses(), [Some(Status::Ok)], "{end:?}");
}

#[test]
fn a_motion_too_rough_to_tell_its_velocity_is_not_as_asked() {
    let mut rough = settings();
    rough.limits.speed_rad_s = 100.0;
    let mut bench = in_ramp_of(rough);
    bench.astray = |t_s| 0.01 * (t_s * 500.0 * 1.9).sin();
    let (bench, end) = end_of(bench);
    assert_eq!((end.event, bench.statuses()), (Event::MotionDeviated, vec![Some(Status::Rejected)]));
}

#[test]
fn the_velocity_is_judged_at_the_time_at_which_the_motor_follows() {
    let settings = Settings { motion_delay_samples: 3, ..settings() };
    let mut bench = in_ramp_of(settings);
    let movement = bench.machine.progress().current().unwrap().planned.movement;
    bench.astray = |_| 0.0;
    loop {
        let since = bench.machine.sample()
            - bench.transitions.iter().rev().find(|it| it.event == Event::Onset).unwrap().sample;
        let theta_m_rad = movement.at((since as f64 - 3.0) / 500.0).angle_rad;
        let output = bench.give(Reading::Sample(Sample { theta_m_rad, ..bench.sample() }), None);
        if output.phase == Phase::Return {
            break;
        }
    }
    assert_eq!(bench.statuses(), [Some(Status::Ok)]);
}

/// A ramp at the shortest amplitude that its velocity allows has no part at constant speed.
#[test]
fn a_ramp_without_a_part_at_constant_speed_is_judged_over_its_middle_half() {
    for (error_rad_s, event) in [(0.02, Event::HoldOver), (-0.2, Event::MotionDeviated)] {
        let mut settings = settings();
        let ramp = crate::protocol::Ramp {
            amplitude_rad: 0.045,
            rise_time_s: 0.04,
            hold_s: 0.2,
            return_velocity_rad_s: 0.5,
            velocity_tolerance: 0.1,
        };
        for planned in &mut settings.plan {
            (planned.velocity_rad_s, planned.movement) =
                (1.0, crate::protocol::RampAndHold::new(&ramp, 1.0).unwrap());
        }
        let mut bench = in_ramp_of(settings);
        bench.astray = if error_rad_s > 0.0 { |t_s| 0.02 * t_s.min(0.1) } else { |t_s| -0.2 * t_s.min(0.1) };
        let (_, end) = end_of(bench);
        assert_eq!(end.event, event, "{error_rad_s}: {end:?}");
    }
}
