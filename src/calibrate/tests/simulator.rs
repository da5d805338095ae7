//! A rig that does not share the model of the fit: fine Runge-Kutta steps of the non-linear equations in time, with noise and an
//! encoder of its own.

use crate::dataset::{RigTrial, RigTrialMotion, RigTrialSignals, RigTrials, Status};
use crate::protocol::RigLoad;
use crate::random::Stream;
use crate::wrist::Lever;

/// The true rig.
#[derive(Debug, Clone)]
pub struct TrueRig {
    pub lever: Lever,
    pub torque_gain: f64,
    pub torque_offset_nm: f64,
    pub torque_nonlinearity_per_nm2: f64,
    pub angle_gain: f64,
    pub torque_delay_s: f64,
    pub torque_cutoff_hz: f64,
    pub servo_hz: f64,
    pub servo_damping: f64,
    pub servo_delay_s: f64,
    /// How far a torque in the lever turns the motor at rest, rad/(N m).
    pub servo_compliance_rad_per_nm: f64,
    /// Part of the target's speed that the servo's damping acts against.
    pub servo_speed_command: f64,
    pub bearing_friction_nm: f64,
    pub sample_rate_hz: f64,
    pub encoder_bits: i32,
    /// White noise of the torque, N m.
    pub noise_nm: f64,
    /// Noise of the torque with a time constant of 20 ms, N m.
    pub slow_noise_nm: f64,
    /// Change of the offset from trial to trial, N m.
    pub drift_nm: f64,
    /// Jitter of the motor, rad.
    pub jitter_rad: f64,
    /// Hum of the mains in the torque, N m: a law that the fit does not know.
    pub hum_nm: f64,
    /// Friction at rest over friction in motion: a law that the fit does not know.
    pub breakaway: f64,
    /// Travel in which the friction builds up, rad; 0 for one that follows from the speed.
    pub presliding_rad: f64,
    /// Hardening of the lever, cubic part of its torque at 2 mrad: a law that the fit does not know.
    pub hardening: f64,
    /// Growth of the lever's damping at 1 rad/s of its deflection, with the square of that speed: another law than that of the fit.
    pub damping_growth: f64,
    pub seed: u64,
}

impl TrueRig {
    /// A usual rig, a little different from what is stated.
    pub fn usual(seed: u64) -> Self {
        Self {
            lever: Lever { inertia_kg_m2: 0.0018, damping_nm_s_per_rad: 0.35, stiffness_nm_per_rad: 820.0 },
            torque_gain: 1.04,
            torque_offset_nm: 0.06,
            torque_nonlinearity_per_nm2: 0.002,
            angle_gain: 0.98,
            torque_delay_s: 0.0006,
            torque_cutoff_hz: 140.0,
            servo_hz: 110.0,
            servo_damping: 1.0,
            servo_delay_s: 0.001,
            servo_compliance_rad_per_nm: 0.0,
            servo_speed_command: 0.0,
            bearing_friction_nm: 0.015,
            sample_rate_hz: 2000.0,
            encoder_bits: 17,
            noise_nm: 0.02,
            slow_noise_nm: 0.004,
            drift_nm: 0.003,
            jitter_rad: 1e-5,
            hum_nm: 0.0,
            breakaway: 1.0,
            presliding_rad: 0.0,
            hardening: 0.0,
            damping_growth: 0.0,
            seed,
        }
    }

    /// One trial with a load whose true value is `factor` times the stated one.
    pub fn trial(
        &self,
        number: u32,
        load: RigLoad,
        motion: RigTrialMotion,
        repetition: u32,
        factor: f64,
        targets: &[f64],
    ) -> RigTrial {
        let mut stream = Stream::new(self.seed, &format!("trial/{number}"));
        let fine = (40_000.0 / self.sample_rate_hz).ceil() as usize;
        let step_s = 1.0 / (self.sample_rate_hz * fine as f64);
        let count = targets.len() * fine;
        let target = |time_s: f64| {
            let place = (time_s * self.sample_rate_hz).max(0.0);
            let before = (place as usize).min(targets.len() - 1);
            let after = (before + 1).min(targets.len() - 1);
            let part = place - before as f64;
            targets[before] * (1.0 - part.min(1.0)) + targets[after] * part.min(1.0)
        };
        let weight = match load {
            RigLoad::KnownWeight { mass_kg, arm_m, sign, .. } => {
                f64::from(sign) * factor * mass_kg * crate::protocol::GRAVITY_M_S2 * arm_m
            }
            _ => 0.0,
        };
        let k = self.lever.stiffness_nm_per_rad;
        let start = targets[0];
        // Motor angle and speed, handle angle and speed, torque behind the low-pass, and what the friction has built up.
        let mut state = [start, 0.0, start - weight / k, 0.0, weight, 0.0];
        let phase = std::f64::consts::TAU * stream.uniform();
        let mut torques = Vec::with_capacity(count);
        let mut angles = Vec::with_capacity(targets.len());
        let mut jitter = 0.0;
        for sample in 0..count {
            if sample % fine == 0 {
                angles.push(state[0]);
                let keep = libm::exp(-1.0 / (0.01 * self.sample_rate_hz));
                jitter = keep * jitter + libm::sqrt(1.0 - keep * keep) * self.jitter_rad * stream.normal();
            }
            torques.push(state[4]);
            let time_s = sample as f64 * step_s;
            let rates = |state: &[f64; 6], time_s: f64| {
                let time_s = time_s - self.servo_delay_s;
                let period_s = 1.0 / self.sample_rate_hz;
                let speed = (target(time_s + 0.5 * period_s) - target(time_s - 0.5 * period_s)) / period_s;
                self.rates(state, [target(time_s) + jitter, speed], start, load, factor, weight)
            };
            let first = rates(&state, time_s);
            let second = rates(&plus(&state, &first, 0.5 * step_s), time_s + 0.5 * step_s);
            let third = rates(&plus(&state, &second, 0.5 * step_s), time_s + 0.5 * step_s);
            let fourth = rates(&plus(&state, &third, step_s), time_s + step_s);
            for place in 0..6 {
                state[place] +=
                    step_s / 6.0 * (first[place] + 2.0 * second[place] + 2.0 * third[place] + fourth[place]);
            }
        }
        let step = std::f64::consts::TAU / libm::exp2(f64::from(self.encoder_bits));
        let offset = self.torque_offset_nm + self.drift_nm * stream.normal();
        let (mut slow, keep) = (0.0, libm::exp(-1.0 / (0.02 * self.sample_rate_hz)));
        let torque_l_nm = (0..targets.len())
            .map(|sample| {
                let place = (sample * fine) as f64 - self.torque_delay_s / step_s;
                let before = (place.max(0.0) as usize).min(count - 2);
                let part = (place - before as f64).max(0.0);
                let torque = torques[before] * (1.0 - part) + torques[before + 1] * part;
                slow = keep * slow + libm::sqrt(1.0 - keep * keep) * self.slow_noise_nm * stream.normal();
                let time_s = sample as f64 / self.sample_rate_hz;
                let hum = self.hum_nm * libm::sin(std::f64::consts::TAU * 50.0 * time_s + phase);
                offset + self.torque_gain * torque + slow + hum + self.noise_nm * stream.normal()
            })
            .collect();
        let theta_m_rad =
            angles.iter().map(|angle| libm::round(self.angle_gain * angle / step) * step).collect();
        RigTrial {
            number,
            file: format!("rig-trials/rig-trial-{number:03}.csv"),
            load,
            motion,
            repetition,
            status: Status::Ok,
            record: RigTrialSignals {
                target_rad: targets.to_vec(),
                theta_m_rad,
                torque_l_nm,
                ..RigTrialSignals::default()
            },
        }
    }

    fn rates(
        &self,
        state: &[f64; 6],
        [target, target_speed]: [f64; 2],
        start: f64,
        load: RigLoad,
        factor: f64,
        weight: f64,
    ) -> [f64; 6] {
        let [theta_m, omega_m, theta_l, omega_l, filtered, built_up] = *state;
        let natural = std::f64::consts::TAU * self.servo_hz;
        let is_clamped = load == RigLoad::ClampedHandle;
        let (theta_l, omega_l) = if is_clamped { (start, 0.0) } else { (theta_l, omega_l) };
        let twist = theta_m - theta_l;
        let hard = 1.0 + self.hardening * (twist / 0.002) * (twist / 0.002);
        let speed = omega_m - omega_l;
        let damped = 1.0 + self.damping_growth * speed * speed;
        let torque =
            self.lever.stiffness_nm_per_rad * twist * hard + self.lever.damping_nm_s_per_rad * speed * damped;
        // Against the torque before the trial the motor is at its start already.
        let back = self.servo_compliance_rad_per_nm * (torque - weight);
        let braked = omega_m - self.servo_speed_command * target_speed;
        let acceleration =
            natural * natural * (target - theta_m - back) - 2.0 * self.servo_damping * natural * braked;
        let inertia = self.lever.inertia_kg_m2
            + if let RigLoad::KnownInertia { inertia_kg_m2, .. } = load {
                factor * inertia_kg_m2
            } else {
                0.0
            };
        let spring = if let RigLoad::KnownSpring { stiffness_nm_per_rad, .. } = load {
            factor * stiffness_nm_per_rad * (theta_l - start)
        } else {
            0.0
        };
        let breakaway = 1.0 + (self.breakaway - 1.0) * libm::exp(-(omega_l / 0.02) * (omega_l / 0.02));
        let gives = self.presliding_rad > 0.0;
        let of_motion = if gives { built_up } else { libm::tanh(omega_l / 0.002) };
        let friction = self.bearing_friction_nm * breakaway * of_motion;
        let building = if gives { (omega_l - omega_l.abs() * built_up) / self.presliding_rad } else { 0.0 };
        let handle = if is_clamped { 0.0 } else { (torque - weight - spring - friction) / inertia };
        let sensed = torque + self.torque_nonlinearity_per_nm2 * torque * torque * torque;
        let rate = std::f64::consts::TAU * self.torque_cutoff_hz * (sensed - filtered);
        [omega_m, acceleration, if is_clamped { 0.0 } else { omega_l }, handle, rate, building]
    }

    /// Targets of a ramp, its hold and its return.
    pub fn ramp(&self, velocity_rad_s: f64) -> Vec<f64> {
        let (rise_s, way_rad, hold_s, back_s) = (0.02, 0.14, 0.3, 0.4);
        let ramp_s = way_rad / velocity_rad_s.abs() + rise_s;
        let at = |time_s: f64| {
            let time_s = time_s - 0.25;
            let up = |time_s: f64, whole_s: f64| smooth((time_s / whole_s).clamp(0.0, 1.0), rise_s / whole_s);
            way_rad * velocity_rad_s.signum() * (up(time_s, ramp_s) - up(time_s - ramp_s - hold_s, back_s))
        };
        let samples = ((0.25 + ramp_s + hold_s + back_s + 0.25) * self.sample_rate_hz) as usize;
        (0..samples).map(|sample| at(sample as f64 / self.sample_rate_hz)).collect()
    }

    /// Targets of a multisine.
    pub fn multisine(
        &self,
        amplitude_rad: f64,
        lowest_hz: f64,
        highest_hz: f64,
        duration_s: f64,
    ) -> Vec<f64> {
        let lines = 24;
        let mut frequencies: Vec<f64> = (0..lines)
            .map(|line| lowest_hz * libm::pow(highest_hz / lowest_hz, f64::from(line) / f64::from(lines - 1)))
            .map(|hz| libm::round(hz * duration_s) / duration_s)
            .collect();
        frequencies.dedup();
        let count = frequencies.len() as f64;
        let value = |time_s: f64| -> f64 {
            let fade = (time_s / 0.3).min((duration_s - time_s) / 0.3).clamp(0.0, 1.0);
            let sum: f64 = frequencies
                .iter()
                .enumerate()
                .map(|(line, hz)| {
                    let phase = -std::f64::consts::PI * (line * line) as f64 / count;
                    libm::sin(std::f64::consts::TAU * hz * time_s + phase)
                })
                .sum();
            sum * fade * fade * (3.0 - 2.0 * fade)
        };
        let rate = self.sample_rate_hz;
        let rest = (0.25 * rate) as usize;
        let moving: Vec<f64> =
            (0..(duration_s * rate) as usize).map(|sample| value(sample as f64 / rate)).collect();
        let peak = moving.iter().fold(0.0, |far: f64, value| far.max(value.abs()));
        let moving = moving.iter().map(|value| amplitude_rad * value / peak);
        std::iter::repeat_n(0.0, rest).chain(moving).chain(std::iter::repeat_n(0.0, rest)).collect()
    }
}

/// A way of length 1 in time 1, whose speed rises and falls along half a cosine.
fn smooth(time: f64, rise: f64) -> f64 {
    let speed = 1.0 / (1.0 - rise);
    let risen = |time: f64| {
        0.5 * (time - rise / std::f64::consts::PI * libm::sin(std::f64::consts::PI * time / rise))
    };
    if time < rise {
        speed * risen(time)
    } else if time <= 1.0 - rise {
        speed * (0.5 * rise + time - rise)
    } else {
        1.0 - speed * risen(1.0 - time)
    }
}

fn plus(state: &[f64; 6], rates: &[f64; 6], step_s: f64) -> [f64; 6] {
    std::array::from_fn(|place| state[place] + step_s * rates[place])
}

/// Which loads a laboratory has.
#[derive(Debug, Clone, Copy)]
pub struct Loads {
    pub weight: bool,
    pub inertia: bool,
    pub clamp: bool,
    pub spring: bool,
}

/// All of them.
pub const ALL_LOADS: Loads = Loads { weight: true, inertia: true, clamp: true, spring: true };

/// The weights, bars and springs of a laboratory: stated value, its relative error and the seed's true factor.
pub fn rig_trials(rig: &TrueRig, loads: Loads, wrong: fn(&RigLoad) -> f64) -> RigTrials {
    let mut stream = Stream::new(rig.seed, "loads");
    let mut trials = Vec::new();
    let mut add = |load: RigLoad, motion: RigTrialMotion, factor: f64, targets: &[f64]| {
        for repetition in 1..=2 {
            let number = trials.len() as u32 + 1;
            trials.push(rig.trial(number, load, motion, repetition, factor, targets));
        }
    };
    for velocity_rad_s in [1.3, -1.3, 3.25, -3.25] {
        add(RigLoad::EmptyHandle, RigTrialMotion::Ramp { velocity_rad_s }, 1.0, &rig.ramp(velocity_rad_s));
    }
    add(RigLoad::EmptyHandle, RigTrialMotion::Multisine, 1.0, &rig.multisine(0.01, 1.0, 60.0, 4.0));
    let mut factor =
        |load: &RigLoad| wrong(load) * (1.0 + load.relative_error().unwrap_or(0.0) * stream.normal());
    if loads.weight {
        for mass_kg in [1.0, 2.5] {
            let load = |sign| RigLoad::KnownWeight { mass_kg, arm_m: 0.1, sign, relative_error: 0.002 };
            let factor = factor(&load(1));
            for sign in [1, -1] {
                add(
                    load(sign),
                    RigTrialMotion::Still,
                    factor,
                    &vec![0.0; (2.0 * rig.sample_rate_hz) as usize],
                );
            }
        }
    }
    if loads.inertia {
        let load = RigLoad::KnownInertia { inertia_kg_m2: 0.004, relative_error: 0.01 };
        add(load, RigTrialMotion::Multisine, factor(&load), &rig.multisine(0.01, 1.0, 60.0, 4.0));
    }
    if loads.clamp {
        add(RigLoad::ClampedHandle, RigTrialMotion::Multisine, 1.0, &rig.multisine(0.002, 1.0, 60.0, 4.0));
    }
    if loads.spring {
        let load = RigLoad::KnownSpring { stiffness_nm_per_rad: 20.0, relative_error: 0.01 };
        add(load, RigTrialMotion::Multisine, factor(&load), &rig.multisine(0.02, 1.0, 30.0, 4.0));
    }
    RigTrials {
        sample_rate_hz: rig.sample_rate_hz,
        lever: Some(Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 }),
        measured_utc: None,
        trials,
        sources: Vec::new(),
    }
}

/// The true values, in the order of the reported quantities.
pub fn truth(rig: &TrueRig) -> [f64; 11] {
    [
        rig.lever.inertia_kg_m2,
        rig.lever.damping_nm_s_per_rad,
        rig.lever.stiffness_nm_per_rad,
        rig.torque_gain,
        rig.torque_offset_nm,
        rig.torque_nonlinearity_per_nm2,
        rig.angle_gain,
        rig.torque_delay_s,
        rig.torque_cutoff_hz,
        rig.servo_hz,
        rig.bearing_friction_nm,
    ]
}
