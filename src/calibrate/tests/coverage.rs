//! How often the 95 % intervals of a calibration contain the truth, over rigs, encoders, sample rates and laws that the fit does not
//! know.

use super::simulator::{ALL_LOADS, TrueRig, rig_trials};
use super::{deviations, of_the_day};
use crate::calibrate::{calibrate, compare};
use crate::dataset::RigQuantity;
use crate::random::Stream;

/// One kind of rig.
struct Setting {
    name: &'static str,
    change: fn(&mut TrueRig),
}

const SETTINGS: [Setting; 6] = [
    Setting { name: "17 bits, 2000 Hz", change: |_| () },
    Setting { name: "13 bits, 1000 Hz", change: |rig| (rig.encoder_bits, rig.sample_rate_hz) = (13, 1000.0) },
    Setting { name: "20 bits, 1000 Hz", change: |rig| (rig.encoder_bits, rig.sample_rate_hz) = (20, 1000.0) },
    Setting { name: "15 bits, 2500 Hz", change: |rig| (rig.encoder_bits, rig.sample_rate_hz) = (15, 2500.0) },
    Setting {
        name: "15 bits, hum of the mains and a friction that breaks away",
        change: |rig| (rig.encoder_bits, rig.hum_nm, rig.breakaway) = (15, 0.01, 1.6),
    },
    Setting { name: "17 bits, a lever that hardens by 2 % at 2 mrad", change: |rig| rig.hardening = 0.02 },
];

/// Prints a line for each setting and quantity; `RIGS` and `SETTING` choose how many rigs, and one setting alone.
#[test]
#[ignore = "takes a quarter of an hour; run with --ignored --nocapture"]
fn intervals_contain_the_truth_in_every_setting() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<usize>().ok());
    let rigs = number("RIGS").unwrap_or(20);
    let only = number("SETTING");
    for (place, setting) in
        SETTINGS.iter().enumerate().filter(|(place, _)| only.is_none_or(|own| own == *place))
    {
        let mut inside = [0; RigQuantity::ALL.len()];
        let mut told = inside;
        let mut squares = [0.0; RigQuantity::ALL.len()];
        let (mut misfits, mut wrong_loads) = (0, 0);
        for seed in 0..rigs as u64 {
            let mut rig = TrueRig::usual(seed);
            (setting.change)(&mut rig);
            let mut stream = Stream::new(seed, "coverage");
            let mut factor = |sd: f64| libm::exp(sd * stream.normal());
            rig.lever.inertia_kg_m2 *= factor(0.1);
            rig.lever.damping_nm_s_per_rad *= factor(0.2);
            rig.lever.stiffness_nm_per_rad *= factor(0.15);
            rig.torque_gain *= factor(0.03);
            rig.angle_gain *= factor(0.02);
            rig.torque_delay_s *= factor(0.5);
            rig.torque_cutoff_hz *= factor(0.2);
            rig.servo_hz *= factor(0.1);
            rig.bearing_friction_nm *= factor(0.3);
            let outcome = calibrate(&rig_trials(&rig, ALL_LOADS, |_| 1.0), "ramphold", "rig").unwrap();
            for (name, z) in deviations(&outcome, &rig) {
                let quantity = RigQuantity::ALL.iter().position(|own| *own == name).unwrap();
                told[quantity] += 1;
                inside[quantity] += u32::from(z.abs() < 1.96);
                squares[quantity] += z * z;
            }
            misfits += u32::from(outcome.misfit.p_value < 0.05);
            wrong_loads += u32::from(outcome.loads.iter().any(super::super::LoadCheck::disagrees));
        }
        println!(
            "{place} {}: misfit {misfits}, a load that disagrees {wrong_loads}, of {rigs}",
            setting.name
        );
        for (quantity, name) in RigQuantity::ALL.iter().enumerate() {
            let of = told[quantity];
            let rms = libm::sqrt(squares[quantity] / f64::from(of.max(1)));
            println!("  {:28} inside {:3} of {of:3}, rms z {rms:.2}", name.name(), inside[quantity]);
        }
        let [all, of]: [u32; 2] = [inside.iter().sum(), told.iter().sum()];
        println!("  together {all} of {of}");
        assert!(f64::from(all) > 0.9 * f64::from(of), "{}: {all} of {of}", setting.name);
    }
}

/// Prints how often a change is named although nothing changed, and which quantity.
#[test]
#[ignore = "takes minutes; run with --ignored --nocapture"]
fn a_day_without_a_change_seldom_differs() {
    let days = 10;
    let calibrations = std::env::var("RIGS").map_or(6, |text| text.parse().unwrap());
    let (mut alarms, mut low, mut squares) = (0, 0, [0.0; RigQuantity::ALL.len()]);
    for seed in 0..calibrations {
        let rig = TrueRig::usual(seed);
        let calibration =
            calibrate(&rig_trials(&rig, ALL_LOADS, |_| 1.0), "ramphold", "rig").unwrap().calibration;
        for day in 0..days {
            let rig = TrueRig { seed: 1000 + 100 * seed + day, ..rig.clone() };
            let found = compare(&of_the_day(&rig), &calibration).unwrap();
            alarms += u32::from(!found.changed.is_empty());
            low += u32::from(found.p_value < 0.05);
            for own in &found.quantities {
                let place = RigQuantity::ALL.iter().position(|name| *name == own.name).unwrap();
                squares[place] += (own.difference / own.se) * (own.difference / own.se);
            }
            if !found.changed.is_empty() {
                println!("rig {seed} day {day}: {:?} {:?}", found.changed, found.quantities[0]);
            }
        }
    }
    let of = calibrations * days;
    for (name, sum) in RigQuantity::ALL.iter().zip(squares) {
        println!("{:28} rms z {:.2}", name.name(), libm::sqrt(sum / of as f64));
    }
    println!("named {alarms}, p of all below 0.05 {low}, of {of}");
    assert!(f64::from(alarms) < 0.15 * of as f64, "{alarms} of {of}");
}
