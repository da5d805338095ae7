//! The friction of the handle's bearing, taken out of a trial.
//!
//! With friction T_f(t) on the handle, Eq. 3 of the paper becomes I_l theta_l'' = T_l - T_h - T_f. Let x answer k_l x + b_l x' = T_f. A motor
//! at theta_m - x without friction then moves the handle alike, and its lever has the torque T_l - T_f. So the friction leaves the model as
//! it is: T_f goes out of the recorded torque, and x out of the motion of the motor. Exact for a friction that is known at each time.

use super::rig_constants::RigConstants;
use crate::signal::{Section, filter};
use crate::wrist::{Kinematics, Lever, built_up_friction};

/// Speed at which the friction is at 76 % of its full value, as a part of the ramp's: what rig trials are searched from.
const FULL_AT: f64 = 0.01;

/// Part of the ramp's speed at which its motion has risen.
const RISEN: f64 = 0.5;

/// Least time constant with which the lever bends, samples: a shorter one cannot be seen.
const LEAST_LAG: f64 = 0.01;

/// By which law the friction of a bearing goes with its motion. The usual one is constant, against the motion.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrictionLaw {
    /// Part of it that builds up over a travel, as where the balls give before they roll; see [`built_up_friction`].
    pub presliding_part: f64,
    /// That travel, rad.
    pub presliding_rad: f64,
    /// By which part of itself it is larger at the speed of the ramp than at rest.
    pub growth: f64,
}

impl FrictionLaw {
    /// Friction as a part of its full value at each knot of a motion that begins at rest, where a constant friction has the parts `constant`.
    fn parts(&self, motion: &[Kinematics<f64>], velocity_rad_s: f64, constant: &[f64]) -> Vec<f64> {
        let mut built_up = 0.0;
        let mut before_rad = motion.first().map_or(0.0, |knot| knot.theta);
        let part = |(knot, constant): (&Kinematics<f64>, &f64)| {
            let way_rad = knot.theta - before_rad;
            before_rad = knot.theta;
            let mut part = *constant;
            if self.presliding_part != 0.0 {
                built_up = built_up_friction(built_up, way_rad, self.presliding_rad);
                part += self.presliding_part * (built_up - constant);
            }
            part * (1.0 + self.growth * (knot.omega / velocity_rad_s).abs())
        };
        motion.iter().zip(constant).map(part).collect()
    }
}

/// What the friction does along a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionEffect {
    /// Its part of the torque in the window, filtered as a prediction is, N m.
    recorded_nm: Vec<f64>,
    /// What it takes from the motion of the motor.
    motion: Vec<Kinematics<f64>>,
}

impl FrictionEffect {
    /// Along `motion` of a ramp of `velocity_rad_s`, whose onset is at the sample `onset`, in a window of `samples`; `None` without friction.
    /// The recorded torque has passed `sections`. Before the onset the handle rests, and its friction is in the torque from which changes are
    /// counted.
    pub fn along(
        (constants, law): (&RigConstants, &FrictionLaw),
        (sections, period_s, samples): (&[Section], f64, usize),
        motion: &[Kinematics<f64>],
        onset: usize,
        velocity_rad_s: f64,
    ) -> Option<Self> {
        let friction_nm = constants.bearing_friction_nm;
        if friction_nm == 0.0 {
            return None;
        }
        let full_at_rad_s = FULL_AT * velocity_rad_s.abs();
        let rises = &motion[onset..];
        let risen = rises.iter().take_while(|knot| knot.omega < RISEN * velocity_rad_s.abs()).count();
        let constant = |(sample, knot): (usize, &Kinematics<f64>)| {
            // A smoothed motion seems to turn back before it rises.
            let least = if sample < risen { 0.0 } else { f64::NEG_INFINITY };
            if sample == 0 { 0.0 } else { libm::tanh(knot.omega.max(least) / full_at_rad_s) }
        };
        let constant: Vec<f64> = rises.iter().enumerate().map(constant).collect();
        let mut torque_nm = vec![0.0; onset];
        torque_nm.extend(law.parts(rises, velocity_rad_s, &constant).iter().map(|part| friction_nm * part));
        let recorded_nm = filter(sections, &torque_nm);
        Some(Self {
            recorded_nm: recorded_nm[onset..onset + samples].to_vec(),
            motion: bent(constants.lever, &torque_nm, period_s),
        })
    }

    /// Takes the friction out of the recorded torque and of the motion that drives the model.
    pub fn take_out(&self, measured_nm: &mut [f64], motion: &mut [Kinematics<f64>]) {
        self.add_to_torque(-1.0, measured_nm);
        self.add_to_motion(-1.0, motion);
    }

    /// Puts the friction back into both.
    pub fn put_back(&self, measured_nm: &mut [f64], motion: &mut [Kinematics<f64>]) {
        self.put_into_torque(measured_nm);
        self.add_to_motion(1.0, motion);
    }

    /// Puts the friction back into the recorded torque alone.
    pub fn put_into_torque(&self, measured_nm: &mut [f64]) {
        self.add_to_torque(1.0, measured_nm);
    }

    fn add_to_torque(&self, sign: f64, measured_nm: &mut [f64]) {
        measured_nm.iter_mut().zip(&self.recorded_nm).for_each(|(all, own)| *all += sign * own);
    }

    fn add_to_motion(&self, sign: f64, motion: &mut [Kinematics<f64>]) {
        for (knot, own) in motion.iter_mut().zip(&self.motion) {
            *knot = Kinematics { theta: knot.theta + sign * own.theta, omega: knot.omega + sign * own.omega };
        }
    }
}

/// What `torque_nm` bends a lever, x in k_l x + b_l x' = T; nothing without a lever.
fn bent(lever: Option<Lever>, torque_nm: &[f64], period_s: f64) -> Vec<Kinematics<f64>> {
    let Some(lever) = lever else { return vec![Kinematics::default(); torque_nm.len()] };
    let (stiffness, damping) = (lever.stiffness_nm_per_rad, lever.damping_nm_s_per_rad);
    let decay_per_s = stiffness / damping.max(LEAST_LAG * stiffness * period_s);
    let keep = libm::exp(-decay_per_s * period_s);
    let mut theta = 0.0;
    let mut before_nm = 0.0;
    let at = |nm: &f64| {
        // The torque is straight between two samples.
        let slope = (nm - before_nm) / period_s;
        let behind = slope / decay_per_s;
        theta = (nm - behind) / stiffness + keep * (theta - (before_nm - behind) / stiffness);
        before_nm = *nm;
        Kinematics { theta, omega: decay_per_s * (nm / stiffness - theta) }
    };
    torque_nm.iter().map(at).collect()
}
