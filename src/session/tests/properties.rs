//! What holds for any sequence of inputs.

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;
use crate::rig::Fault;

/// A stretch of samples that are alike, begun by a command or ended by a fault.
#[derive(Debug, Clone)]
struct Stretch {
    samples: usize,
    word: Option<Event>,
    error_nm: f64,
    ecr_mvc: f64,
    ends: Ending,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Ending {
    Well,
    Fault,
    NotANumber,
    BeyondLimit,
}

fn stretches() -> impl Strategy<Value = Vec<Stretch>> {
    let word = prop_oneof![
        10 => Just(None),
        4 => Just(Some(Event::Start)),
        2 => Just(Some(Event::Pause)),
        4 => Just(Some(Event::Resume)),
        1 => Just(Some(Event::Skip)),
        1 => Just(Some(Event::Repeat)),
        1 => Just(Some(Event::RepeatEffort)),
        4 => Just(Some(Event::Rearm)),
        1 => Just(Some(Event::GateOpened)),
    ];
    let ends = prop_oneof![
        20 => Just(Ending::Well),
        1 => Just(Ending::Fault),
        1 => Just(Ending::NotANumber),
        1 => Just(Ending::BeyondLimit),
    ];
    let error = prop_oneof![4 => Just(0.0), 1 => -0.1..0.1f64];
    let stretch = (1usize..400, word, error, prop_oneof![6 => Just(0.0), 1 => Just(1.0)], ends).prop_map(
        |(samples, word, error_nm, ecr_mvc, ends)| Stretch { samples, word, error_nm, ecr_mvc, ends },
    );
    prop::collection::vec(stretch, 1..60)
}

/// The bench with an eye on what must always be so.
struct Observed {
    bench: Bench,
    /// Samples in the band without a break, counted apart from the machine.
    in_band: u64,
    last_angle_rad: f64,
    ended: BTreeMap<usize, Status>,
}

impl Observed {
    fn step(&mut self, reading: Reading, word: Option<Event>, broken: bool) -> Result<(), TestCaseError> {
        let before = self.bench.machine.phase();
        let output = self.bench.give(reading, word);
        if broken && !matches!(before, Phase::Finished | Phase::Aborted) {
            prop_assert_eq!(output.phase, Phase::Faulted, "a broken limit is a fault in the same step");
        }
        self.count_band(before);
        if matches!(output.transition, Some(TransitionRecord { from: Phase::Delay, event: Event::Onset, .. }))
        {
            let needed = self.bench.machine.settings().gate_samples;
            prop_assert!(self.in_band > needed, "the ramp starts {} samples into the gate", self.in_band);
        }
        self.check_command(&output)?;
        for (place, attempt) in self.bench.machine.progress().attempts().iter().enumerate() {
            let Some((status, reason)) = attempt.ended else { continue };
            let known = *self.ended.entry(place).or_insert(status);
            let taken_back = known == Status::Ok && reason == Event::Repeat;
            prop_assert!(known == status || taken_back, "trial {} ended twice", attempt.number);
        }
        Ok(())
    }

    fn count_band(&mut self, before: Phase) {
        let machine = &self.bench.machine;
        let target = machine.progress().attempts().last().map(|attempt| attempt.planned.torque_nm);
        let shown_nm = machine.feedback().torque_nm - machine.progress().offset_nm();
        let inside = matches!(before, Phase::Hold | Phase::Delay)
            && target.is_some_and(|target| (shown_nm - target).abs() < 0.025 * target.abs());
        self.in_band = if inside { self.in_band + 1 } else { 0 };
    }

    fn check_command(&mut self, output: &Output) -> Result<(), TestCaseError> {
        let limits = &self.bench.machine.settings().limits;
        match output.command.motor {
            Motor::Safe => prop_assert!(!output.phase.is_armed()),
            Motor::Follow { angle_rad } => {
                prop_assert!(output.phase.is_armed());
                prop_assert!(angle_rad >= limits.angle_rad[0] && angle_rad <= limits.angle_rad[1]);
                let speed_rad_s = (angle_rad - self.last_angle_rad).abs() * 500.0;
                prop_assert!(speed_rad_s <= limits.speed_rad_s, "commanded at {speed_rad_s} rad/s");
                self.last_angle_rad = angle_rad;
            }
        }
        Ok(())
    }

    fn run(&mut self, stretch: &Stretch) -> Result<(), TestCaseError> {
        (self.bench.error_nm, self.bench.ecr_mvc) = (stretch.error_nm, stretch.ecr_mvc);
        for sample in 0..stretch.samples {
            let word = stretch.word.filter(|_| sample == 0);
            let arms = matches!(word, Some(Event::Start | Event::Rearm));
            if arms && !self.bench.machine.phase().is_armed() {
                // A rig that is armed again starts from where it is.
                self.last_angle_rad = 0.0;
            }
            let armed = self.bench.machine.phase().is_armed() || arms;
            let reading = if armed { Reading::Sample(self.bench.sample()) } else { Reading::Disarmed };
            self.step(reading, word, false)?;
        }
        if !self.bench.machine.phase().is_armed() {
            return Ok(());
        }
        let sample = self.bench.sample();
        let limit_nm = self.bench.machine.settings().limits.torque_nm;
        let reading = match stretch.ends {
            Ending::Well => return Ok(()),
            Ending::Fault => Reading::Fault(Fault::NoSample),
            Ending::NotANumber => Reading::Sample(Sample { torque_l_nm: f64::NAN, ..sample }),
            Ending::BeyondLimit => Reading::Sample(Sample { torque_l_nm: -1.01 * limit_nm, ..sample }),
        };
        self.step(reading, None, true)
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn any_sequence_of_inputs_keeps_the_invariants(stretches in stretches()) {
        let mut settings = settings_with_rig_trials();
        settings.gate.antagonist_limit_mvc = Some(0.5);
        let bench = Bench::new(settings);
        let mut observed = Observed { bench, in_band: 0, last_angle_rad: 0.0, ended: BTreeMap::new() };
        for stretch in &stretches {
            observed.run(stretch)?;
        }

        // The journal's happenings alone build the same progress again.
        let bench = observed.bench;
        let mut again = Progress::new(bench.machine.settings());
        for transition in &bench.transitions {
            let line = serde_json::to_string(transition).unwrap();
            again.apply(&serde_json::from_str(&line).unwrap());
        }
        prop_assert_eq!(&again, bench.machine.progress());
    }

    #[test]
    fn the_trials_that_count_at_the_end_are_those_of_the_protocol(stretches in stretches()) {
        let mut observed =
            Observed { bench: Bench::new(settings()), in_band: 0, last_angle_rad: 0.0, ended: BTreeMap::new() };
        for stretch in &stretches {
            // All but leaving out, which leaves out.
            let word = stretch.word.filter(|word| *word != Event::Skip);
            observed.run(&Stretch { word, ..stretch.clone() })?;
        }
        // Whatever transition, the session can be brought to its end.
        let bench = &mut observed.bench;
        (bench.error_nm, bench.ecr_mvc) = (0.0, 0.0);
        for _ in 0..200_000 {
            match bench.machine.phase() {
                Phase::Finished => break,
                Phase::Ready => bench.say(Event::Start),
                Phase::Faulted => bench.say(Event::Rearm),
                Phase::Paused => bench.say(Event::Resume),
                _ => bench.tick(),
            };
        }
        prop_assert_eq!(bench.machine.phase(), Phase::Finished);
        let attempts = bench.machine.progress().attempts();
        prop_assert!(attempts.iter().all(|attempt| attempt.ended.is_some()));
        let ok = attempts.iter().filter(|attempt| matches!(attempt.ended, Some((Status::Ok, _))));
        let mut positions: Vec<u32> = ok.map(|attempt| attempt.planned.key.position).collect();
        positions.sort();
        prop_assert_eq!(positions, [1, 2, 3, 4]);
    }
}
