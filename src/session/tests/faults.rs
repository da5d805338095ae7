//! What must stop the motor in the same step, and how the session goes on after it.

use super::*;
use crate::rig::{Channel, Fault, Quantity};

fn assert_faults(bench: &mut Bench, sample: Sample, expected: impl Fn(Fault) -> bool) {
    let output = bench.give(Reading::Sample(sample), None);
    assert_eq!((output.phase, output.command.motor), (Phase::Faulted, Motor::Safe));
    let fault = match output.transition.unwrap().detail {
        Some(TransitionDetail::Fault(fault) | TransitionDetail::FaultInTrial { fault, .. }) => fault,
        other => panic!("{other:?}"),
    };
    assert!(expected(fault), "{fault:?}");
}

#[test]
fn a_channel_without_a_number_is_a_fault_in_the_same_step() {
    for channel in [Channel::Angle, Channel::Torque, Channel::EmgFcr, Channel::EmgEcr] {
        for value in [f64::NAN, f64::INFINITY] {
            for phase in [Phase::Rest, Phase::Hold, Phase::Ramp, Phase::Return] {
                let mut bench = Bench::in_phase(settings(), phase);
                let mut sample = bench.sample();
                match channel {
                    Channel::Angle => sample.theta_m_rad = value,
                    Channel::Torque => sample.torque_l_nm = value,
                    Channel::EmgFcr => sample.emg_fcr_mvc = Some(value),
                    Channel::EmgEcr => sample.emg_ecr_mvc = Some(value),
                }
                assert_faults(&mut bench, sample, |fault| fault == Fault::NotANumber { channel });
            }
        }
    }
}

#[test]
fn a_limit_broken_is_a_fault_in_the_same_step() {
    let limits = settings().limits;
    for (sample, quantity) in [
        (Sample { theta_m_rad: limits.angle_rad[1] + 0.001, ..Sample::default() }, Quantity::Angle),
        (Sample { theta_m_rad: limits.angle_rad[0] - 0.001, ..Sample::default() }, Quantity::Angle),
        (Sample { torque_l_nm: limits.torque_nm + 0.1, ..Sample::default() }, Quantity::Torque),
        (Sample { torque_l_nm: -limits.torque_nm - 0.1, ..Sample::default() }, Quantity::Torque),
    ] {
        let mut bench = Bench::in_phase(settings(), Phase::Hold);
        assert_faults(
            &mut bench,
            sample,
            |fault| matches!(fault, Fault::Limit { quantity: q, .. } if q == quantity),
        );
    }
}

#[test]
fn a_motor_that_is_too_fast_is_a_fault_although_its_angle_is_allowed() {
    let mut bench = Bench::in_phase(settings(), Phase::Rest);
    bench.ticks(10);
    let limit = bench.machine.settings().limits.speed_rad_s;
    // As far in one sample as the limit allows in a little less than the four that the speed is taken over.
    let jump_rad = 4.2 * limit / 500.0;
    assert!(jump_rad < bench.machine.settings().limits.angle_rad[1]);
    let sample = Sample { theta_m_rad: jump_rad, ..bench.sample() };
    assert_faults(&mut bench, sample, |fault| {
        matches!(fault, Fault::Limit { quantity: Quantity::Speed, .. })
    });
}

#[test]
fn an_armed_rig_without_a_sample_is_a_fault() {
    let mut bench = Bench::in_phase(settings(), Phase::Ramp);
    let output = bench.give(Reading::Disarmed, None);
    assert_eq!((output.phase, output.command.motor), (Phase::Faulted, Motor::Safe));
}

#[test]
fn a_fault_comes_before_the_operators_word() {
    let mut bench = Bench::in_phase(settings(), Phase::Ramp);
    let output = bench.give(Reading::Fault(Fault::NoSample), Some(Event::Pause));
    assert_eq!((output.phase, output.refused), (Phase::Faulted, Some(Event::Pause)));
}

#[test]
fn a_fault_in_a_trial_aborts_it_keeps_it_and_puts_it_back_as_it_was() {
    let mut bench = Bench::in_phase(settings(), Phase::Ramp);
    let planned = bench.machine.progress().current().unwrap().planned;
    bench.give(Reading::Fault(Fault::NoSample), None);
    assert_eq!(bench.statuses(), [Some(Status::Aborted)]);
    assert!(bench.machine.progress().queue().any(|other| *other == planned));
}

#[test]
fn a_fault_is_latched_until_the_operator_rearms_and_then_the_motor_waits_at_its_start() {
    let mut bench = Bench::in_phase(settings(), Phase::RampHold);
    bench.give(Reading::Fault(Fault::NoSample), None);
    for _ in 0..100 {
        let output = bench.give(Reading::Disarmed, None);
        assert_eq!((output.phase, output.command.motor), (Phase::Faulted, Motor::Safe));
    }
    let here = Sample { theta_m_rad: 0.0003, ..Sample::default() };
    assert_eq!(bench.give(Reading::Sample(here), Some(Event::Rearm)).phase, Phase::Homing);
    // Arming has brought the rig to its start position; no target may make it jump from there.
    while bench.machine.phase() == Phase::Homing {
        assert_eq!(bench.command.motor, Motor::Follow { angle_rad: 0.0 });
        bench.tick();
    }
    assert_eq!(
        (bench.machine.phase(), bench.command.motor),
        (Phase::Paused, Motor::Follow { angle_rad: 0.0 })
    );
    bench.say(Event::Resume);
    bench.run_to(Phase::Finished);
    assert_eq!(bench.statuses().iter().filter(|status| **status == Some(Status::Ok)).count(), 4);
}

#[test]
fn a_rig_cannot_be_rearmed_without_a_sample_or_beyond_a_limit() {
    let mut bench = Bench::in_phase(settings(), Phase::Ramp);
    bench.give(Reading::Fault(Fault::NoSample), None);
    let beyond = Sample { theta_m_rad: 1.0, ..Sample::default() };
    for reading in [Reading::Disarmed, Reading::Sample(beyond)] {
        let output = bench.give(reading, Some(Event::Rearm));
        assert_eq!((output.phase, output.refused), (Phase::Faulted, Some(Event::Rearm)));
    }
}

#[test]
fn an_effort_with_a_silent_muscle_is_a_fault_that_names_it() {
    let mut bench = Bench::in_phase(settings_with_everything(), Phase::MvcEffort);
    while bench.machine.phase() == Phase::MvcEffort {
        let sample = Sample { emg_fcr_mvc: Some(0.0), ..bench.sample() };
        bench.give(Reading::Sample(sample), None);
    }
    let detail = bench.transitions.last().unwrap().detail;
    assert_eq!(detail, Some(TransitionDetail::Fault(Fault::SilentEffort { channel: Channel::EmgFcr })));
}

#[test]
fn a_gate_on_an_antagonist_that_is_not_measured_is_a_fault_and_without_it_a_trial_goes_on() {
    for limit in [Some(0.3), None] {
        for phase in [Phase::Hold, Phase::Delay] {
            let mut settings = settings();
            settings.gate.antagonist_limit_mvc = limit;
            let mut bench = Bench::in_phase(settings, phase);
            let sample = Sample { emg_ecr_mvc: None, ..bench.sample() };
            if limit.is_some() {
                assert_faults(&mut bench, sample, |fault| {
                    fault == Fault::NotMeasured { channel: Channel::EmgEcr }
                });
            } else {
                let output = bench.give(Reading::Sample(sample), None);
                assert_ne!(output.phase, Phase::Faulted);
            }
        }
    }
}
