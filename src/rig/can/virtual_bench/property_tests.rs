//! Any sequence of disturbed frames, operator's words and interruptions: judged by what the drive was told and by its power.

use std::cell::Cell;
use std::time::Duration;

use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use serde_json::{Value, json};

use super::bench::{Bench, MotorKind, follow};
use super::world::BenchFault;
use crate::rig::can::bus::ControllerError;
use crate::rig::{Armed, ArmingConsent, Command, Cue, Motor, Rig};
use crate::timing::Clock;

/// Longest time from the period in which a fault is found to no power: half a second of holding, then a quick stop from the
/// speed limit, or, where the bus is dead, the drive's watchdog of 100 ms and its own ramp.
const NO_POWER_AFTER: Duration = Duration::from_millis(500 + 100 + 50);

#[derive(Debug, Clone)]
enum Happening {
    /// Nothing for so many samples.
    Quiet(u16),
    /// A disturbance that lasts for so many samples.
    Disturbed(BenchFault, u16),
    /// The program is kept from running, ms.
    Frozen(u16),
    /// The session asks for an angle out of the blue.
    Jump(f64),
    /// The session has the motor stopped.
    Stop,
    /// A ramp begins.
    Ramp,
}

/// Identifiers of the motor's frame of 8 bytes and of the torque's, of at least 6.
type FrameIds = [u16; 2];

const OF_DRIVE: FrameIds = [0x185, 0x285];
const OF_MIT: FrameIds = [17, 0x1A0];
const OF_ODRIVE: FrameIds = [0x29, 0x1A0];

fn bench_fault([motor, torque]: FrameIds) -> impl Strategy<Value = BenchFault> {
    use BenchFault as B;
    let id = prop_oneof![Just(motor), Just(torque)];
    prop_oneof![
        3 => (0usize..64).prop_map(move |bit| B::FlippedBit { id: motor, bit }),
        1 => (0usize..48).prop_map(move |bit| B::FlippedBit { id: torque, bit }),
        2 => id.clone().prop_map(B::Dropped),
        2 => id.clone().prop_map(B::Duplicated),
        1 => id.prop_map(B::Shortened),
        2 => (1u64..12).prop_map(|ms| B::Delayed(Duration::from_millis(ms))),
        1 => Just(B::TorqueInvalid),
        1 => Just(B::TorqueStale),
        1 => Just(B::CounterStale),
        1 => (-15.0..15.0f64).prop_map(B::Push),
        1 => (-10.0..10.0f64).prop_map(B::Runaway),
        1 => Just(B::PositionFreeze),
        1 => Just(B::Silent),
        1 => Just(B::Deaf),
        1 => Just(B::NmtDrop),
        1 => Just(B::Garbled),
        1 => Just(B::Flood(2000)),
        1 => any::<bool>().prop_map(|fatal| B::Error { code: 0x4310, fatal }),
        1 => prop_oneof![
            Just(ControllerError::BusError), Just(ControllerError::Passive), Just(ControllerError::BusOff)
        ].prop_map(B::Controller),
    ]
}

/// Positions that motors without a counter beside them may report.
fn misread() -> impl Strategy<Value = BenchFault> {
    prop_oneof![
        (-1.0..1.0f64).prop_map(BenchFault::MisreadOnce),
        (-0.1..0.2f64).prop_map(BenchFault::MisreadOnce),
        (-1.0..1.0f64).prop_map(BenchFault::Misread)
    ]
}

fn happening(fault: impl Strategy<Value = BenchFault>) -> impl Strategy<Value = Happening> {
    prop_oneof![
        6 => (1u16..120).prop_map(Happening::Quiet),
        6 => (fault, 1u16..40).prop_map(|(fault, samples)| Happening::Disturbed(fault, samples)),
        1 => (1u16..300).prop_map(Happening::Frozen),
        1 => prop_oneof![-1.0..1.0f64, Just(f64::NAN)].prop_map(Happening::Jump),
        1 => Just(Happening::Stop),
        5 => Just(Happening::Ramp),
    ]
}

/// Cases of each property: few in every run of the tests, many with `scripts/motor-properties`.
fn cases() -> u32 {
    std::env::var("RAMPHOLD_PROPERTY_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(200)
}

/// What the cases of a property went through.
#[derive(Debug, Default)]
struct Seen {
    periods: Cell<u64>,
    highest_nm: Cell<f64>,
}

impl Seen {
    fn add(&self, bench: &Bench, highest_nm: f64) {
        self.periods.set(self.periods.get() + bench.bus.world().syncs_sent);
        self.highest_nm.set(self.highest_nm.get().max(highest_nm));
    }
}

/// Tries a property with as many random cases as are asked for, and prints what they went through.
fn for_any<S: Strategy>(
    name: &str,
    strategy: &S,
    property: impl Fn(S::Value, &Seen) -> Result<(), TestCaseError>,
) {
    let (cases, seen) = (cases(), Seen::default());
    let config = ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() };
    let outcome = TestRunner::new(config).run(strategy, |value| property(value, &seen));
    let (periods, highest_nm) = (seen.periods.get(), seen.highest_nm.get());
    let torque =
        if highest_nm > 0.0 { format!("{highest_nm:.2} N m") } else { "judged by its targets".to_owned() };
    println!("property | {name} | {cases} | {periods} | {torque}");
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

fn happenings(fault: impl Strategy<Value = BenchFault>) -> impl Strategy<Value = Vec<Happening>> {
    prop::collection::vec(happening(fault), 1..40)
}

fn safe_states() -> impl Strategy<Value = [&'static str; 5]> {
    prop::array::uniform5(prop_oneof![Just("hold"), Just("quick_stop"), Just("torque_off")])
}

#[test]
fn whatever_happens_targets_keep_the_limits_and_the_power_ends_in_its_time() {
    let strategy = (happenings(bench_fault(OF_DRIVE)), safe_states(), 0u32..6);
    for_any("CiA 402", &strategy, |(happenings, states, tolerated), seen| {
        let bench = Bench::with(MotorKind::Cia402, |rig| {
            set_safe_states(rig, states);
            set_tolerated(rig, tolerated);
        });
        let is_deaf = happenings.iter().any(|one| matches!(one, Happening::Disturbed(BenchFault::Deaf, _)));
        arm_again_and_again(&bench, happenings)?;
        seen.add(&bench, 0.0);
        let targets = bench.bus.world().wire.targets;
        let limits = &bench.protocol.limits;
        let period_s = 0.002;
        let count_rad = std::f64::consts::TAU / 131_072.0;
        prop_assert!(targets.count > 0);
        prop_assert!(targets.angles_rad[0] >= limits.angle_rad[0] - count_rad, "{targets:?}");
        prop_assert!(targets.angles_rad[1] <= limits.angle_rad[1] + count_rad, "{targets:?}");
        if is_deaf {
            // What a drive misses while it hears nothing comes as one step, no larger than the following error.
            prop_assert!(targets.largest_step_rad <= 0.05 + count_rad, "{targets:?}");
        } else {
            prop_assert!(
                targets.largest_step_rad <= limits.speed_rad_s * period_s + count_rad,
                "{targets:?}"
            );
            let most_change_rad = limits.acceleration_rad_s2 * period_s * period_s + 2.0 * count_rad;
            prop_assert!(targets.largest_step_change_rad <= most_change_rad, "{targets:?}");
        }
        Ok(())
    });
}

#[test]
fn whatever_happens_a_motor_in_mit_mode_keeps_its_torque_and_the_power_ends_in_its_time() {
    let strategy = (other_faults(OF_MIT), safe_states(), 0u32..6);
    // Arming is proved elsewhere, many times slower than what is looked at here.
    let mit_proof = Bench::gentle_mit(|_| {}).prove();
    for_any("MIT mode", &strategy, |(happenings, states, tolerated), seen| {
        let bench = Bench::gentle_mit(|rig| {
            set_safe_states(rig, states);
            rig["motor"]["proved_with_free_handle"] = json!(mit_proof);
            set_tolerated(rig, tolerated);
        });
        shaft_lives_through(&bench, happenings, seen)
    });
}

#[test]
fn whatever_happens_an_odrive_keeps_its_torque_and_the_power_ends_in_its_time() {
    let strategy = (other_faults(OF_ODRIVE), safe_states());
    let odrive_proof = odrive(|_| {}).prove();
    for_any("ODrive", &strategy, |(happenings, states), seen| {
        let bench = odrive(|rig| {
            set_safe_states(rig, states);
            rig["motor"]["proved_with_free_handle"] = json!(odrive_proof);
        });
        shaft_lives_through(&bench, happenings, seen)
    });
}

fn odrive(change: impl FnOnce(&mut Value)) -> Bench {
    Bench::with(MotorKind::Cansimple, |rig| {
        rig["motor"]["zero_here"] = json!(false);
        rig["master"]["motor_waits_ms"] = json!(100);
        rig["limits"]["motor_torque_nm"] = json!(8);
        change(rig);
    })
}

/// Often in the numbers that the motor's torque rests on.
fn other_faults(ids: FrameIds) -> impl Strategy<Value = Vec<Happening>> {
    let number = (8usize..48).prop_map(move |bit| BenchFault::FlippedBit { id: ids[0], bit });
    happenings(prop_oneof![6 => bench_fault(ids), 3 => number, 2 => misread()])
}

/// A motor without CANopen, judged by its shaft: the torque that commands make there, and the power.
fn shaft_lives_through(bench: &Bench, happenings: Vec<Happening>, seen: &Seen) -> Result<(), TestCaseError> {
    let limit_nm = 8.0;
    // Servos that turn the shaft by themselves obey no command.
    let runs_away =
        happenings.iter().any(|one| matches!(one, Happening::Disturbed(BenchFault::Runaway(_), _)));
    arm_again_and_again(bench, happenings)?;
    let highest_nm = bench.bus.world().shaft().highest_torque_nm;
    seen.add(bench, if runs_away { 0.0 } else { highest_nm });
    prop_assert!(highest_nm > 0.0, "it had power");
    prop_assert!(runs_away || highest_nm <= limit_nm * 1.001, "{highest_nm} N m");
    Ok(())
}

fn set_tolerated(rig: &mut Value, tolerated: u32) {
    rig["tolerate"]["missed_cycles_in_a_row"] = json!(tolerated);
    rig["tolerate"]["duplicate_frames"] = json!(tolerated);
}

fn set_safe_states(rig: &mut Value, states: [&str; 5]) {
    for (class, state) in ["limit", "sensor", "drive", "bus", "cycle"].iter().zip(states) {
        rig["safe_state"][class] = json!(state);
    }
}

/// Arms the motor up to four times, as an operator does after a fault.
fn arm_again_and_again(bench: &Bench, happenings: Vec<Happening>) -> Result<(), TestCaseError> {
    let mut motor = bench.motor();
    let mut happenings = happenings.into_iter();
    for _ in 0..4 {
        motor = match motor.arm(ArmingConsent::given(), &bench.protocol.limits) {
            Ok(armed) => live_through(bench, armed, &mut happenings)?,
            Err((disarmed, _)) => {
                assert_no_power(bench)?;
                disarmed
            }
        };
        bench.bus.world().wire.faults.clear();
    }
    Ok(())
}

/// Runs the motor until it is made safe or nothing more happens, and disarms it.
fn live_through<A: Armed>(
    bench: &Bench,
    mut armed: A,
    happenings: &mut impl Iterator<Item = Happening>,
) -> Result<A::Disarmed, TestCaseError> {
    let ramp: Vec<f64> = bench.ramp().collect();
    'alive: for happening in happenings.by_ref() {
        let commands: Vec<Motor> = match &happening {
            Happening::Quiet(samples) | Happening::Disturbed(_, samples) => {
                // A disturbance strikes while the handle moves as well as while it is held.
                let from = usize::from(*samples) % 2 * ramp.len();
                let moving = ramp[from.min(ramp.len())..].iter().copied();
                moving.chain(std::iter::repeat(0.0)).take(usize::from(*samples)).map(at).collect()
            }
            Happening::Frozen(_) => vec![at(0.0)],
            Happening::Jump(angle_rad) => vec![at(*angle_rad)],
            Happening::Stop => vec![Motor::Safe],
            Happening::Ramp => ramp.iter().copied().map(at).collect(),
        };
        let strikes_at = commands.len() / 2;
        for (sample, motor) in commands.into_iter().enumerate() {
            match &happening {
                Happening::Disturbed(fault, _) if sample == strikes_at => bench.strike(*fault),
                Happening::Frozen(ms) => bench.clock.advance(Duration::from_millis(u64::from(*ms))),
                _ => {}
            }
            let begun = bench.clock.now();
            if armed.exchange(&Command { motor, cue: Cue::Moving }).is_err() {
                let quiet = bench.clock.now() + Duration::from_millis(250);
                bench.bus.world().run_until(quiet);
                let world = bench.bus.world();
                let off = world.power.last().copied();
                prop_assert!(off.is_none_or(|(_, powered)| !powered), "{happening:?}: the motor has power");
                let after = off.map_or(Duration::ZERO, |(time, _)| time.saturating_duration_since(begun));
                prop_assert!(after <= NO_POWER_AFTER, "{happening:?}: no power after {after:?}");
                drop(world);
                prop_assert!(armed.exchange(&follow(0.0)).is_err(), "a fault is latched");
                break 'alive;
            }
        }
        bench.bus.world().wire.faults.clear();
    }
    let disarmed = armed.disarm();
    let quiet = bench.clock.now() + Duration::from_millis(250);
    bench.bus.world().run_until(quiet);
    assert_no_power(bench)?;
    Ok(disarmed)
}

fn at(angle_rad: f64) -> Motor {
    Motor::Follow { angle_rad }
}

fn assert_no_power(bench: &Bench) -> Result<(), TestCaseError> {
    prop_assert!(bench.bus.world().power.last().is_none_or(|(_, powered)| !powered), "it has power");
    Ok(())
}
