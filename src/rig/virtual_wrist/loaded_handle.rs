//! The handle in a rig trial: no hand, and a known load.

use super::bearing::Bearing;
use super::mechanism_list::MechanismList;
use super::person::Person;
use super::setup::Setup;
use super::wrist_response::{Follower, channels};
use crate::protocol::RigLoad;
use crate::wrist::mechanisms::{ActiveMechanisms, Covariates, MechanismClass};
use crate::wrist::{
    AddedDynamics, Context, FurtherValues, HermiteSegment, History, Integrator, Kinematics, Lever, Mechanics,
    Plant, Torques,
};

/// Time for which a new load has been on the handle when its rig trial begins, s.
const MOUNTED_S: f64 = 1.0;

/// A wrist that is not there: inertia, damping and stiffness of a free body that nothing turns.
const NO_WRIST: [f64; 6] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// Torques and handle at one sample.
#[derive(Debug, Clone, Copy)]
pub struct LoadedSample {
    /// Torque in the lever, N m.
    pub lever_nm: f64,
    /// Torque as its sensor shows it, without its offset, N m.
    pub measured_nm: f64,
    /// What the further channels would show without an error. A load cell at the hand measures what is mounted there; there is no
    /// joint.
    pub further: FurtherValues<f64>,
}

/// Lever and handle with a load. Eq. 3 and 5 of the paper, with the torque of load and bearing in the place of the hand's.
///
/// Angles are changes from those at the start position, torques are whole.
pub struct LoadedHandle {
    load: RigLoad,
    lever: Option<Lever>,
    bearing: Bearing,
    servo_stiffness_nm_per_rad: f64,
    mechanics: Mechanics<f64>,
    mechanisms: MechanismList,
    covariates: Covariates,
    following_hz: Option<f64>,
    follower: Follower,
    history: History<f64>,
    integrator: Integrator<f64>,
    from: Kinematics<f64>,
    /// Samples since the motion began; `None` before.
    sample: Option<u64>,
    period_s: f64,
    substeps: usize,
}

/// What turns the handle beside the lever, and the mechanisms of the rig.
struct LoadTorque<'a> {
    handle: &'a LoadedHandle,
    mechanisms: ActiveMechanisms<'a, f64>,
    /// Torque that does not follow from the handle's angle and speed, N m.
    further_nm: f64,
}

impl LoadedHandle {
    /// The handle of a rig of `setup` with `load` on it, at rest at the start position. Of the mechanisms of `person` and rig,
    /// those of sensors and rig are at work.
    pub fn new(person: &Person, setup: &Setup, load: RigLoad, sample_rate_hz: f64) -> Self {
        let mechanisms = person.mechanisms.and(&setup.mechanisms).starting_at_onset();
        let following_hz = channels(&mechanisms).following_hz;
        let mechanisms = mechanisms.of_classes(&[MechanismClass::Sensor, MechanismClass::Rig]);
        let covariates = Covariates { torque_before_nm: setup.gauge_offset_nm, ..Covariates::default() };
        let states = mechanisms.kinds.iter().map(|kind| kind.state_count()).sum();
        let period_s = 1.0 / sample_rate_hz;
        let history = History::new(0.0, period_s, states);
        let mut plant = Plant::base(setup.lever, &NO_WRIST);
        let active = ActiveMechanisms {
            kinds: &mechanisms.kinds,
            parameters: &mechanisms.parameters,
            trial: &covariates,
            history: &history,
        };
        active.alter_plant(&mut plant);
        let of_mechanisms = libm::ceil(period_s / active.longest_step_s(0.0)) as usize;
        if let (Some(lever), RigLoad::KnownInertia { inertia_kg_m2, .. }) = (&mut plant.lever, load) {
            lever.inertia += inertia_kg_m2;
        }
        let spring = match load {
            RigLoad::KnownSpring { stiffness_nm_per_rad, .. } => stiffness_nm_per_rad,
            _ => 0.0,
        };
        let bearing = Bearing::new(setup);
        let substeps = bearing.substeps(plant.lever, spring, period_s).max(of_mechanisms);
        Self {
            load,
            lever: setup.lever,
            bearing,
            servo_stiffness_nm_per_rad: setup.servo_stiffness_nm_per_rad,
            mechanics: Mechanics::new(plant),
            mechanisms,
            covariates,
            following_hz,
            follower: Follower::default(),
            history,
            integrator: Integrator::at_rest(),
            from: Kinematics::default(),
            sample: None,
            period_s,
            substeps,
        }
    }

    /// The servo's setup with this load: at a rigid lever, a bar turns with the motor itself.
    pub fn servo_setup(&self, setup: &Setup) -> Setup {
        let RigLoad::KnownInertia { inertia_kg_m2, .. } = self.load else { return setup.clone() };
        if self.lever.is_some() {
            return setup.clone();
        }
        let natural = std::f64::consts::TAU * setup.servo_bandwidth_hz;
        let motor_kg_m2 = setup.servo_stiffness_nm_per_rad / (natural * natural);
        let slower = libm::sqrt(motor_kg_m2 / (motor_kg_m2 + inertia_kg_m2));
        Setup {
            servo_bandwidth_hz: setup.servo_bandwidth_hz * slower,
            servo_damping_ratio: setup.servo_damping_ratio * slower,
            ..setup.clone()
        }
    }

    /// Samples for which the load hangs before its rig trial begins.
    pub fn mounted_samples(&self) -> u64 {
        (MOUNTED_S / self.period_s).ceil() as u64
    }

    /// The angle of the motor, whose servo has it at `motor`: a clamp at a rigid lever holds the motor itself.
    pub fn motor(&self, motor: Kinematics<f64>) -> Kinematics<f64> {
        if self.holds_motor() { Kinematics::default() } else { motor }
    }

    /// The torque that turns the motor beside its servo, of a torque in the lever. What turns with the motor is part of the servo.
    pub fn on_motor_nm(&self, lever_nm: f64, motor_before: Kinematics<f64>, motor: Kinematics<f64>) -> f64 {
        if self.holds_motor() { 0.0 } else { lever_nm - self.inertial_nm(motor_before, motor) }
    }

    fn holds_motor(&self) -> bool {
        self.lever.is_none() && self.load == RigLoad::ClampedHandle
    }

    /// The torque that turns a bar together with the motor, N m; 0 if there is a lever between the two.
    fn inertial_nm(&self, before: Kinematics<f64>, after: Kinematics<f64>) -> f64 {
        match self.load {
            RigLoad::KnownInertia { inertia_kg_m2, .. } if self.lever.is_none() => {
                inertia_kg_m2 * (after.omega - before.omega) / self.period_s
            }
            _ => 0.0,
        }
    }

    /// Torque of the bearing's friction, N m; a handle that is clamped has none.
    fn friction_nm(&self, omega_l: f64) -> f64 {
        match self.load {
            RigLoad::ClampedHandle => 0.0,
            _ => self.bearing.friction_nm(omega_l),
        }
    }

    /// One sample: the motor has come to `motor`, and was commanded to `command_rad`; `is_moving` tells that the motion has begun.
    pub fn step(&mut self, motor: Kinematics<f64>, command_rad: f64, is_moving: bool) -> LoadedSample {
        let to = self.follower.follow(self.motor(motor), self.following_hz, self.period_s);
        let further_nm = if self.holds_motor() {
            self.servo_stiffness_nm_per_rad * command_rad
        } else {
            self.inertial_nm(self.from, to)
        };
        if is_moving {
            self.sample.get_or_insert(0);
        }
        // Before the motion, the mechanisms that count from the onset have not begun.
        let start_s = self.sample.map_or(0.0, |sample| sample as f64 * self.period_s);
        let mut integrator = self.integrator.clone();
        let torque = LoadTorque {
            handle: self,
            mechanisms: ActiveMechanisms {
                kinds: &self.mechanisms.kinds,
                parameters: &self.mechanisms.parameters,
                trial: &self.covariates,
                history: &self.history,
            },
            further_nm,
        };
        let input = HermiteSegment::new(self.from, to, self.period_s);
        integrator.advance(&self.mechanics, &torque, &input, start_s, self.period_s, self.substeps);
        let (torques, rates) = integrator.torques(&self.mechanics, &torque, to, start_s + self.period_s);
        let state = integrator.state();
        let (theta_l, omega_l, alpha_l) = match self.lever {
            Some(_) => (state.theta_l, state.omega_l, rates.omega_l),
            None => (to.theta, to.omega, input.acceleration_at_end()),
        };
        // The bar is part of the lever's inertia if there is a lever, and of the further torque if there is none.
        let bar_nm = match (self.load, self.lever) {
            (RigLoad::KnownInertia { inertia_kg_m2, .. }, Some(_)) => inertia_kg_m2 * alpha_l,
            _ => 0.0,
        };
        let torque_h = torques.interface - self.friction_nm(omega_l) + bar_nm;
        if let Some(sample) = &mut self.sample {
            let (added, rates) = integrator.sampled();
            self.history.push(added, rates);
            *sample += 1;
        }
        self.integrator = integrator;
        self.from = to;
        let further = FurtherValues { theta_l, alpha_l, torque_h, theta_j: 0.0 };
        LoadedSample { lever_nm: torques.lever, measured_nm: torques.measured, further }
    }
}

impl AddedDynamics<f64> for LoadTorque<'_> {
    const ACTIVE: bool = true;

    fn state_count(&self) -> usize {
        self.mechanisms.state_count()
    }

    fn add_torques(
        &self,
        context: &Context<'_, f64>,
        added: &[f64],
        torques: &mut Torques<f64>,
        rates: &mut [f64],
    ) {
        self.mechanisms.add_torques(context, added, torques, rates);
        let load_nm = match self.handle.load {
            RigLoad::EmptyHandle | RigLoad::KnownInertia { .. } => 0.0,
            RigLoad::KnownWeight { .. } => self.handle.load.weight_nm().unwrap_or_default(),
            RigLoad::KnownSpring { stiffness_nm_per_rad, .. } => stiffness_nm_per_rad * context.handle.theta,
            // The stop gives back whatever the lever brings.
            RigLoad::ClampedHandle => torques.lever,
        };
        let friction_nm = self.handle.friction_nm(context.handle.omega);
        torques.interface = load_nm + friction_nm + self.further_nm;
        // Nothing turns the wrist that is not there.
        torques.joint = torques.interface;
    }

    fn alter_measurement(&self, added: &[f64], time_s: f64, torque: f64, rates: &mut [f64]) -> f64 {
        self.mechanisms.alter_measurement(added, time_s, torque, rates)
    }
}
