//! The gate of the paper, and what makes a trial be rejected.

use super::*;

fn in_hold() -> Bench {
    Bench::in_phase(settings(), Phase::Hold)
}

/// The smoothing of the display takes a few samples; this many are enough for it to be on target.
fn settle(bench: &mut Bench) {
    bench.ticks(20);
}

#[test]
fn gate_opens_after_its_time_in_the_band_without_a_break() {
    let mut bench = in_hold();
    bench.error_nm = 1.0;
    settle(&mut bench);
    bench.error_nm = 0.0;
    let first_in_band = loop {
        let output = bench.tick();
        if output.gate_fraction > 0.0 {
            break bench.machine.sample() - 1;
        }
    };
    let opened = bench.run_to_event();
    assert_eq!(opened.event, Event::GateOpened);
    assert_eq!(opened.sample - first_in_band + 1, bench.machine.settings().gate_samples);
}

#[test]
fn gate_restarts_when_torque_leaves_the_band() {
    let mut bench = in_hold();
    settle(&mut bench);
    bench.ticks(20);
    bench.error_nm = 0.5;
    settle(&mut bench);
    assert_eq!(bench.tick().gate_fraction, 0.0);
    bench.error_nm = 0.0;
    let before = bench.machine.sample();
    assert_eq!(bench.run_to_event().event, Event::GateOpened);
    assert!(bench.machine.sample() - before >= bench.machine.settings().gate_samples);
}

#[test]
fn gate_stays_shut_at_the_edge_of_the_band_and_opens_inside() {
    let target_nm = |bench: &Bench| bench.machine.progress().current().unwrap().planned.torque_nm;
    for (fraction, event) in [(1.02, Event::GateTimedOut), (0.98, Event::GateOpened)] {
        for sign in [-1.0, 1.0] {
            let mut bench = in_hold();
            bench.error_nm =
                sign * fraction * bench.machine.settings().gate.band_fraction * target_nm(&bench);
            assert_eq!(bench.run_to_event().event, event, "at {fraction} of the band");
        }
    }
}

#[test]
fn gate_looks_at_the_torque_less_the_offset() {
    let mut settings = settings();
    settings.offset_samples = Some(30);
    let mut bench = Bench::new(settings);
    bench.offset_nm = 0.4;
    bench.say(Event::Start);
    bench.run_to(Phase::Hold);
    assert!((bench.machine.progress().offset_nm() - 0.4).abs() < 1e-12);
    assert_eq!(bench.run_to_event().event, Event::GateOpened);
}

#[test]
fn a_trial_whose_gate_does_not_open_in_time_is_rejected_kept_and_put_back() {
    let mut bench = in_hold();
    bench.error_nm = 1.0;
    let planned = bench.machine.progress().current().unwrap().planned;
    let left = bench.machine.progress().queue().len();
    let transition = bench.run_to_event();
    assert_eq!((transition.event, transition.to), (Event::GateTimedOut, Phase::Rest));
    let samples = bench.machine.settings().timeout_samples;
    assert_eq!(
        transition.detail,
        Some(TransitionDetail::Ended {
            number: 1,
            status: Status::Rejected,
            samples,
            deviation: None,
            punctuality: None
        })
    );
    let progress = bench.machine.progress();
    assert_eq!(progress.queue().len(), left + 1);
    let again = progress.queue().find(|other| other.key.position == planned.key.position).unwrap();
    assert_eq!(
        (again.torque_nm, again.velocity_rad_s, again.key.rejections),
        (planned.torque_nm, planned.velocity_rad_s, 1)
    );
}

#[test]
fn torque_that_leaves_the_band_between_gate_and_onset_rejects_the_trial() {
    let mut bench = Bench::in_phase(settings(), Phase::Delay);
    bench.error_nm = 5.0;
    let transition = bench.run_to_event();
    assert_eq!(
        (transition.from, transition.event, transition.to),
        (Phase::Delay, Event::LeftBand, Phase::Rest)
    );
    assert_eq!(bench.statuses(), [Some(Status::Rejected)]);
}

#[test]
fn an_active_antagonist_rejects_the_trial_in_hold_and_delay_but_not_below_its_limit() {
    for phase in [Phase::Hold, Phase::Delay] {
        for (ecr_mvc, rejects) in [(0.2, false), (0.6, true)] {
            let mut settings = settings();
            settings.gate.antagonist_limit_mvc = Some(0.3);
            settings.delay_samples = [300, 300];
            let mut bench = Bench::in_phase(settings, phase);
            bench.ecr_mvc = ecr_mvc;
            let transition = bench.run_to_event();
            assert_eq!(transition.event == Event::AntagonistActive, rejects, "{ecr_mvc} in {phase:?}");
        }
    }
}

#[test]
fn an_active_antagonist_does_not_matter_while_the_torque_is_out_of_the_band() {
    let mut settings = settings();
    settings.gate.antagonist_limit_mvc = Some(0.3);
    let mut bench = Bench::in_phase(settings, Phase::Hold);
    (bench.error_nm, bench.ecr_mvc) = (1.0, 0.6);
    assert_eq!(bench.run_to_event().event, Event::GateTimedOut);
}

#[test]
fn the_delay_after_the_gate_is_within_its_limits_and_not_always_the_same() {
    let mut bench = Bench::started(settings());
    let mut delays = Vec::new();
    while bench.machine.phase() != Phase::Finished {
        let opened = *bench.transitions.last().unwrap();
        let transition = bench.run_to_event();
        if transition.event == Event::Onset {
            delays.push(transition.sample - opened.sample);
        }
    }
    let [shortest, longest] = bench.machine.settings().delay_samples;
    assert_eq!(delays.len(), 4);
    assert!(delays.iter().all(|delay| (shortest..=longest).contains(delay)), "{delays:?}");
    assert!(delays.iter().any(|delay| delay != &delays[0]), "{delays:?}");
}

#[test]
fn the_ramp_waits_until_everything_before_it_is_on_disk() {
    let mut bench = Bench::in_phase(settings(), Phase::Delay);
    for _ in 0..100 {
        let reading = Reading::Sample(bench.sample());
        let output = bench.feed(Input { reading, operator: None, on_disk: false, punctuality: None });
        assert_eq!(output.phase, Phase::Delay);
    }
    let onset = bench.run_to_event();
    let Some(TransitionDetail::Onset { waited_samples, .. }) = onset.detail else { panic!("{onset:?}") };
    let [shortest, longest] = bench.machine.settings().delay_samples;
    assert!((101 - longest..=101 - shortest).contains(&waited_samples), "{waited_samples}");
}

#[test]
fn rejected_trials_do_not_always_come_back_at_the_same_place() {
    let places: std::collections::BTreeSet<usize> = (0..30)
        .map(|seed| {
            let mut bench = Bench::in_phase(Settings { seed, ..settings() }, Phase::Hold);
            bench.error_nm = 1.0;
            bench.run_to_event();
            bench.machine.progress().queue().position(|planned| planned.key.rejections == 1).unwrap()
        })
        .collect();
    assert_eq!(places, (0..4).collect());
}
