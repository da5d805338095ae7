//! The table itself, and that the machine does what it says and nothing else.

use std::collections::BTreeSet;

use super::*;
use crate::random::Stream;
use crate::rig::Fault;
use crate::session::transitions::{self, Effect, Guard, TRANSITIONS};

/// A session in each phase.
fn in_every_phase() -> Vec<Bench> {
    let everything = settings_with_rig_trials;
    let mut benches = vec![Bench::new(everything())];
    for phase in [
        Phase::RigSetup,
        Phase::RigSettle,
        Phase::RigMotion,
        Phase::Offset,
        Phase::MvcEffort,
        Phase::MvcRest,
        Phase::Rest,
        Phase::Hold,
        Phase::Delay,
        Phase::Ramp,
        Phase::RampHold,
        Phase::Return,
        Phase::Finished,
    ] {
        benches.push(Bench::in_phase(everything(), phase));
    }
    for word in [Event::Pause, Event::Abort] {
        let mut bench = Bench::in_phase(everything(), Phase::Rest);
        bench.say(word);
        benches.push(bench);
    }
    let mut faulted = Bench::in_phase(everything(), Phase::Ramp);
    faulted.ticks(20);
    faulted.give(Reading::Fault(Fault::NoSample), None);
    let mut homing = faulted.clone();
    homing.give(Reading::Sample(Sample { theta_m_rad: 0.05, ..Sample::default() }), Some(Event::Rearm));
    benches.extend([faulted, homing]);
    benches
}

#[test]
fn every_phase_is_reached() {
    let reached: BTreeSet<Phase> = in_every_phase().iter().map(|bench| bench.machine.phase()).collect();
    assert_eq!(reached, Phase::ALL.into_iter().collect());
}

#[test]
fn every_word_of_the_operator_in_every_phase_does_what_the_table_says_or_is_refused() {
    for bench in in_every_phase() {
        for word in Event::COMMANDS {
            let mut bench = bench.clone();
            let from = bench.machine.phase();
            let allowed =
                transitions::lines(from, word).find(|line| bench.machine.progress().holds(line.guard));
            let output = bench.say(word);
            match allowed {
                Some(line) => {
                    let transition = output.transition.expect("the word is allowed");
                    assert_eq!((transition.from, transition.event, transition.to), (from, word, line.to));
                    assert_eq!(output.phase, line.to);
                }
                None => {
                    assert_eq!(output.refused, Some(word), "{word:?} in {from:?}");
                    let natural = output.transition.is_some_and(|it| it.event.source() != Source::Operator);
                    assert!(
                        natural || output.phase == from,
                        "{word:?} in {from:?} led to {:?}",
                        output.phase
                    );
                }
            }
        }
    }
}

#[test]
fn a_word_that_the_table_does_not_have_is_refused_whatever_the_guards() {
    // Written out, so that a line added to the table by mistake is noticed.
    let forbidden = [
        (Phase::Ready, "pause resume skip repeat repeat_effort rearm"),
        (Phase::RigSetup, "start repeat_effort rearm"),
        (Phase::RigSettle, "start resume repeat repeat_effort rearm"),
        (Phase::RigMotion, "start resume skip repeat repeat_effort rearm"),
        (Phase::Offset, "start resume skip repeat repeat_effort rearm"),
        (Phase::MvcEffort, "start resume skip repeat repeat_effort rearm"),
        (Phase::MvcRest, "start resume skip repeat rearm"),
        (Phase::Rest, "start resume repeat_effort rearm"),
        (Phase::Hold, "start resume repeat repeat_effort rearm"),
        (Phase::Delay, "start resume repeat repeat_effort rearm"),
        (Phase::Ramp, "start resume skip repeat repeat_effort rearm"),
        (Phase::RampHold, "start resume skip repeat repeat_effort rearm"),
        (Phase::Return, "start resume skip repeat_effort rearm"),
        (Phase::Homing, "start pause resume skip repeat repeat_effort rearm"),
        (Phase::Paused, "start pause rearm"),
        (Phase::Faulted, "start pause resume skip repeat repeat_effort"),
        (Phase::Finished, "start pause resume skip repeat repeat_effort abort rearm"),
        (Phase::Aborted, "start pause resume skip repeat repeat_effort abort rearm"),
    ];
    for (phase, words) in forbidden {
        let refused: Vec<&str> = Event::COMMANDS
            .into_iter()
            .filter(|word| transitions::lines(phase, *word).next().is_none())
            .map(Event::name)
            .collect();
        assert_eq!(refused.join(" "), words, "in {phase:?}");
    }
}

#[test]
fn a_fault_stops_every_phase_in_which_the_motor_has_power_and_no_other() {
    for mut bench in in_every_phase() {
        let from = bench.machine.phase();
        let output = bench.give(Reading::Fault(Fault::NoSample), None);
        let stays = matches!(from, Phase::Faulted | Phase::Finished | Phase::Aborted);
        assert_eq!(output.phase, if stays { from } else { Phase::Faulted });
        assert_eq!(output.command.motor, Motor::Safe, "in {from:?}");
    }
}

/// Sessions in which everything goes wrong now and then.
fn random_walk(seed: u64, samples: usize) -> Vec<TransitionRecord> {
    let mut stream = Stream::new(seed, "walk");
    let mut settings = settings_with_rig_trials();
    settings.gate.antagonist_limit_mvc = Some(0.5);
    if stream.uniform() < 0.5 {
        settings.rig_plan.clear();
    }
    if stream.uniform() < 0.2 {
        settings.offset_samples = None;
    }
    if stream.uniform() < 0.2 {
        settings.mvc = None;
    }
    let abort_share = if stream.uniform() < 0.3 { 1.0 } else { 0.02 };
    let mut bench = Bench::new(settings);
    for _ in 0..samples {
        let word = (stream.uniform() < 0.01)
            .then(|| Event::COMMANDS[stream.below(Event::COMMANDS.len() as u64) as usize]);
        // Aborts are rarer, or no walk would get far.
        let word = word.filter(|word| *word != Event::Abort || stream.uniform() < abort_share);
        if stream.uniform() < 0.02 {
            bench.error_nm = [0.0, 0.0, 0.0, 0.0, 1.0][stream.below(5) as usize];
            bench.ecr_mvc = [0.0, 0.0, 0.0, 0.0, 2.0][stream.below(5) as usize];
        }
        let lost_periods = u64::from(bench.machine.sample().is_multiple_of(997));
        bench.punctuality = Some(Punctuality { lost_periods, ..Punctuality::default() });
        let fault = stream.uniform() < 0.0005;
        let armed = bench.machine.phase().is_armed() || matches!(word, Some(Event::Start | Event::Rearm));
        let reading = match (fault, armed) {
            (true, _) => Reading::Fault(Fault::NoSample),
            (false, true) => Reading::Sample(bench.sample()),
            (false, false) => Reading::Disarmed,
        };
        bench.give(reading, word);
        if bench.machine.phase().is_final() {
            break;
        }
    }
    bench.transitions
}

#[test]
fn every_line_of_the_table_happens_and_nothing_else_does() {
    let line = |transition: &TransitionRecord| (transition.from, transition.event, transition.to);
    let mut seen: BTreeSet<_> =
        (0..4000).flat_map(|seed| random_walk(seed, 20_000)).map(|transition| line(&transition)).collect();
    // A session whose program died on the way home from its last trial has nothing left to do when it is resumed.
    let done = Bench::in_phase(settings(), Phase::Finished);
    let progress = done.machine.progress().clone();
    let mut resumed = Bench::new(settings());
    resumed.machine = Machine::with_progress(Arc::new(settings()), progress);
    seen.insert(line(&resumed.say(Event::Start).transition.unwrap()));
    let table: BTreeSet<_> = TRANSITIONS.iter().map(|line| (line.from, line.event, line.to)).collect();
    let missing: Vec<_> = table.difference(&seen).collect();
    let unknown: Vec<_> = seen.difference(&table).collect();
    assert!(missing.is_empty(), "never transition: {missing:?}");
    assert!(unknown.is_empty(), "not in the table: {unknown:?}");
}

#[test]
fn no_line_hides_behind_another() {
    for (place, line) in TRANSITIONS.iter().enumerate() {
        let earlier = &TRANSITIONS[..place];
        let hidden = |other: &transitions::Transition| {
            (other.from, other.event) == (line.from, line.event)
                && (other.guard == Guard::Always || other.guard == line.guard || other.to == line.to)
        };
        assert!(!earlier.iter().any(hidden), "{line:?}");
    }
}

#[test]
fn trials_begin_and_end_only_where_they_can() {
    for line in TRANSITIONS {
        let (inside, outside) = (line.from.in_trial(), !line.to.in_trial());
        match line.effect {
            Effect::Begin => {
                assert!(!inside && matches!(line.to, Phase::Hold | Phase::RigSettle), "{line:?}");
            }
            Effect::Ok | Effect::Reject | Effect::Abort | Effect::LeaveOut => {
                assert!(inside && outside, "{line:?}")
            }
            _ => assert_eq!(inside, line.to.in_trial(), "{line:?}"),
        }
    }
}

#[test]
fn the_table_is_printed_as_it_is_drawn() {
    insta::assert_snapshot!(transitions::text());
    for line in TRANSITIONS {
        let edge = format!("{} -> {} [label=\"{}", line.from.name(), line.to.name(), line.event.name());
        assert!(transitions::dot().contains(&edge), "{edge}");
    }
    let drawn = transitions::mermaid().lines().filter(|line| line.contains(": ")).count();
    let others = TRANSITIONS.iter().filter(|line| !matches!(line.event, Event::Fault | Event::Abort)).count();
    assert_eq!(drawn, others);
}
