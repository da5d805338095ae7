//! Any sequence of disturbed frames, operator's words and interruptions: judged by what the drive was told and by its power.

use std::time::Duration;

use proptest::prelude::*;
use serde_json::json;

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

fn bench_fault() -> impl Strategy<Value = BenchFault> {
    use BenchFault as B;
    let id = prop_oneof![Just(0x185u16), Just(0x285)];
    prop_oneof![
        3 => (0usize..64).prop_map(|bit| B::FlippedBit { id: 0x185, bit }),
        1 => (0usize..48).prop_map(|bit| B::FlippedBit { id: 0x285, bit }),
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

fn happening() -> impl Strategy<Value = Happening> {
    prop_oneof![
        6 => (1u16..120).prop_map(Happening::Quiet),
        6 => (bench_fault(), 1u16..40).prop_map(|(fault, samples)| Happening::Disturbed(fault, samples)),
        1 => (1u16..300).prop_map(Happening::Frozen),
        1 => prop_oneof![-1.0..1.0f64, Just(f64::NAN)].prop_map(Happening::Jump),
        1 => Just(Happening::Stop),
        5 => Just(Happening::Ramp),
    ]
}

fn safe_state() -> impl Strategy<Value = &'static str> {
    prop_oneof![Just("hold"), Just("quick_stop"), Just("torque_off")]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_happens_targets_keep_the_limits_and_the_power_ends_in_its_time(
        happenings in prop::collection::vec(happening(), 1..40),
        states in prop::array::uniform5(safe_state()),
        tolerated in 0u32..6,
    ) {
        let bench = Bench::with(MotorKind::Cia402, |rig| {
            for (class, state) in ["limit", "sensor", "drive", "bus", "cycle"].iter().zip(states) {
                rig["safe_state"][class] = json!(state);
            }
            rig["tolerate"]["missed_cycles_in_a_row"] = json!(tolerated);
            rig["tolerate"]["duplicate_frames"] = json!(tolerated);
        });
        let is_deaf = happenings.iter().any(|one| matches!(one, Happening::Disturbed(BenchFault::Deaf, _)));
        let mut motor = Some(bench.motor());
        let mut happenings = happenings.into_iter();
        for _ in 0..4 {
            let Some(disarmed) = motor.take() else { break };
            match disarmed.arm(ArmingConsent::given(), &bench.protocol.limits) {
                Ok(armed) => motor = Some(live_through(&bench, armed, &mut happenings)?),
                Err((disarmed, _)) => {
                    assert_no_power(&bench)?;
                    motor = Some(disarmed);
                }
            }
            bench.bus.world().wire.faults.clear();
        }
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
            prop_assert!(targets.largest_step_rad <= limits.speed_rad_s * period_s + count_rad, "{targets:?}");
            let most_change_rad = limits.acceleration_rad_s2 * period_s * period_s + 2.0 * count_rad;
            prop_assert!(targets.largest_step_change_rad <= most_change_rad, "{targets:?}");
        }
    }
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
