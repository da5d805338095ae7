//! The whole trajectory of every condition, walked through on paper before the motor may move.

use super::file::{CanRigFileError, MotorSettings, RigLimits, ValidRigFile, unholdable};
use super::limits::HandleLimits;
use super::mit::check_gains;
use crate::protocol::{RigMotion, ValidProtocol};
use crate::rig::unmeasured_channels;

/// Periods from a fault to the motor braking: it is read at the end of one, and the command acts at the end of the next.
const PERIODS_UNTIL_TOLD: f64 = 2.0;

/// Proof that a protocol's every movement stays inside the limits of a rig, and that its bus can carry it.
#[derive(Debug, Clone, PartialEq)]
pub struct DryRun {
    limits: HandleLimits,
}

impl DryRun {
    /// The limits that were kept.
    pub fn limits(&self) -> &HandleLimits {
        &self.limits
    }

    /// Walks through every movement of the protocol at the rig's period.
    ///
    /// # Errors
    /// Everything in which protocol and rig do not go together.
    pub fn of(protocol: &ValidProtocol, rig: &ValidRigFile) -> Result<Self, CanRigFileError> {
        let limits = HandleLimits::tighter(&rig.limits, &protocol.limits);
        let mut reasons = Vec::new();
        sampling(protocol, rig, &mut reasons);
        channels(protocol, rig, &mut reasons);
        torques(protocol, &limits, &mut reasons);
        resolution(protocol, rig, &mut reasons);
        drive_numbers(rig, &limits, &mut reasons);
        if let MotorSettings::Mit(motor) = &rig.motor {
            let refused = check_gains(motor, &limits, rig.period().duration()).err();
            reasons.extend(refused.map(|fault| fault.to_string()));
        }
        if limits.check_target(0.0).is_err() {
            reasons.push(format!("the start position is outside the angles {:?} rad", limits.angle_rad));
        }
        for velocity_rad_s in &protocol.velocities_rad_s {
            let walked = protocol
                .ramp_and_hold(*velocity_rad_s)
                .map_err(|error| error.to_string())
                .map(|movement| RigMotion::Ramp { velocity_rad_s: *velocity_rad_s, movement })
                .and_then(|ramp| walk(rig, &format!("at {velocity_rad_s} rad/s"), &ramp, &limits));
            reasons.extend(walked.err());
        }
        rig_trials(protocol, rig, &limits, &mut reasons);
        if reasons.is_empty() {
            return Ok(Self { limits });
        }
        Err(CanRigFileError::Unsuitable { file: rig.file_name().to_owned(), reasons })
    }
}

fn sampling(protocol: &ValidProtocol, rig: &ValidRigFile, reasons: &mut Vec<String>) {
    let (wanted, given) = (protocol.signal.sample_rate_hz, rig.sample_period().rate_hz());
    if rig.sample_period().is_of(wanted) {
        return;
    }
    let samples = rig.signals.torque.samples;
    let needed_us = samples as f64 * 1e6 / wanted;
    let load = rig.budget().bits_per_period() as f64 * wanted
        / (samples as f64 * f64::from(rig.bit_rate.bits_per_s()));
    reasons.push(format!(
        "the protocol samples at {wanted} Hz, the rig gives {given:.3} Hz ({samples} each {} us); with period_us \
         {needed_us:.1} the bus would be loaded to {:.0} %: change period_us, put several samples in a frame, or \
         change signal.sample_rate_hz",
        rig.period_us,
        load * 100.0
    ));
}

fn channels(protocol: &ValidProtocol, rig: &ValidRigFile, reasons: &mut Vec<String>) {
    let emg = [rig.signals.emg_fcr, rig.signals.emg_ecr].map(|signal| signal.is_some());
    reasons.extend(unmeasured_channels(protocol, emg));
    if protocol.gate.antagonist_limit_mvc.is_some() && emg[1] && rig.tolerate.unchanged_emg_periods.is_none()
    {
        reasons.push(
            "the protocol's gate has antagonist_limit_mvc, and an EMG that has frozen would pass for a silent muscle; add \
             tolerate.unchanged_emg_periods, 50 for an amplifier whose noise is at least one count"
                .to_owned(),
        );
    }
}

fn torques(protocol: &ValidProtocol, limits: &HandleLimits, reasons: &mut Vec<String>) {
    for torque in protocol.torques_nm.iter().filter(|torque| torque.abs() >= limits.torque_nm) {
        reasons
            .push(format!("target torque {torque} N m is not below the limit of {} N m", limits.torque_nm));
    }
}

/// Whether the drive can hold the limits that protocol and rig give together.
fn drive_numbers(rig: &ValidRigFile, limits: &HandleLimits, reasons: &mut Vec<String>) {
    let MotorSettings::Cia402(motor) = &rig.motor else { return };
    let (angle_rad, speed_rad_s) = (limits.angle_rad, limits.speed_rad_s);
    for (field, expected, advice) in unholdable(motor, &RigLimits { angle_rad, speed_rad_s, ..rig.limits }) {
        reasons.push(format!("with the protocol's limits, {field} must be {expected}; {advice}"));
    }
}

/// The weights and the multisines of the rig trials; their ramps are those of the conditions.
fn rig_trials(
    protocol: &ValidProtocol,
    rig: &ValidRigFile,
    limits: &HandleLimits,
    reasons: &mut Vec<String>,
) {
    for trial in protocol.rig_plan().iter().filter(|trial| trial.repetition == 1) {
        let what = format!("in rig trial {} ({})", trial.position, trial.load.name());
        if trial.load.weight_nm().is_some_and(|weight_nm| weight_nm.abs() >= limits.torque_nm) {
            reasons.push(format!("{what}, the weight is not below the limit of {} N m", limits.torque_nm));
        }
        if let RigMotion::Multisine(_) = trial.motion {
            reasons.extend(walk(rig, &what, &trial.motion, limits).err());
        }
    }
}

/// Steps of the angle in the amplitude of the ramp. With this many the angle, and with it a fitted stiffness, is off by a
/// quarter of a percent at most.
const STEPS_IN_RAMP: f64 = 200.0;

/// Whether a motor that tells its angle in few bits can tell a ramp.
fn resolution(protocol: &ValidProtocol, rig: &ValidRigFile, reasons: &mut Vec<String>) {
    let MotorSettings::Mit(motor) = &rig.motor else { return };
    let (step_rad, amplitude_rad) = (motor.angle_step_rad(), protocol.ramp.amplitude_rad.abs());
    if step_rad * STEPS_IN_RAMP > amplitude_rad {
        reasons.push(format!(
            "the motor tells its angle in steps of {:.3} mrad at the handle, and the ramp of {amplitude_rad} rad needs steps of \
             {:.3} mrad or less; use a larger ramp, a firmware with a smaller P_MAX, or a gear between motor and handle",
            step_rad * 1e3,
            amplitude_rad / STEPS_IN_RAMP * 1e3
        ));
    }
}

/// One motion, from the onset until the motor is back; `what` is its name for messages.
fn walk(rig: &ValidRigFile, what: &str, movement: &RigMotion, limits: &HandleLimits) -> Result<(), String> {
    let (period_s, mut before_rad) = (rig.period().seconds(), 0.0);
    let periods = (movement.duration_s() / period_s).ceil() as u64 + 1;
    for period in 0..=periods {
        let t_s = period as f64 * period_s;
        let motion = movement.at(t_s);
        let asked_rad_s = ((motion.angle_rad - before_rad) / period_s).abs().max(motion.velocity_rad_s.abs());
        let beyond = |quantity: &str, value: f64, limit: &dyn std::fmt::Debug| {
            Err(format!(
                "{what}, {t_s:.3} s after the onset, {quantity} is {value:.4}, the limit is {limit:?}"
            ))
        };
        if limits.check_target(motion.angle_rad).is_err() {
            return beyond("the angle (rad)", motion.angle_rad, &limits.angle_rad);
        }
        // The steps of the drive's interpolation may be faster than the curve by rounding alone.
        if asked_rad_s > limits.speed_rad_s * (1.0 + 1e-9) {
            return beyond("the speed (rad/s)", asked_rad_s, &limits.speed_rad_s);
        }
        if motion.acceleration_rad_s2.abs() > limits.acceleration_rad_s2 {
            return beyond(
                "the acceleration (rad/s2)",
                motion.acceleration_rad_s2,
                &limits.acceleration_rad_s2,
            );
        }
        before_rad = motion.angle_rad;
    }
    stops(rig, what, movement, limits)
}

/// Whether the motor can be stopped within the rig's angles from everywhere on the way.
fn stops(rig: &ValidRigFile, what: &str, movement: &RigMotion, limits: &HandleLimits) -> Result<(), String> {
    let period_s = rig.period().seconds();
    let periods = (movement.duration_s() / period_s).ceil() as u64 + 1;
    for period in 0..=periods {
        let t_s = period as f64 * period_s;
        let motion = movement.at(t_s);
        let end_rad = stopped_rad(rig, limits, motion.angle_rad, motion.velocity_rad_s);
        let [low_rad, high_rad] = rig.limits.angle_rad;
        if !(low_rad..=high_rad).contains(&end_rad) {
            let fields = match &rig.motor {
                MotorSettings::Cia402(_) => "motor.quick_stop_rad_s2",
                MotorSettings::Cansimple(_) | MotorSettings::Mit(_) => {
                    "limits.acceleration_rad_s2 of rig and protocol"
                }
            };
            return Err(format!(
                "{what}, {t_s:.3} s after the onset, a quick stop ends at {end_rad:.4} rad, beyond limits.angle_rad \
                 {:?} of the rig; raise {fields}, or run slower ramps",
                rig.limits.angle_rad
            ));
        }
    }
    Ok(())
}

/// Where the handle comes to rest when a quick stop is asked for at `angle_rad`: it goes on at its velocity until the motor
/// is told, then brakes.
fn stopped_rad(rig: &ValidRigFile, limits: &HandleLimits, angle_rad: f64, velocity_rad_s: f64) -> f64 {
    let deceleration_rad_s2 = match &rig.motor {
        MotorSettings::Cia402(motor) => motor.quick_stop_rad_s2,
        MotorSettings::Cansimple(_) | MotorSettings::Mit(_) => limits.acceleration_rad_s2,
    };
    let until_told_s = PERIODS_UNTIL_TOLD * rig.period().seconds();
    let braking_rad = velocity_rad_s * velocity_rad_s.abs() / (2.0 * deceleration_rad_s2);
    angle_rad + velocity_rad_s * until_told_s + braking_rad
}
