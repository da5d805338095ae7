//! The torque response of the wrist to the motor's motion: the paper's model, with the mechanisms of subject and rig.

use super::bearing::{Bearing, InBearing};
use super::emg::burst;
use super::mechanism_list::MechanismList;
use super::person::{Person, Reflex, Surface};
use super::setup::Setup;
use super::voluntary::TrialSpread;
use crate::rig::Upcoming;
use crate::wrist::mechanisms::{ActiveMechanisms, ChannelErrors, Covariates};
use crate::wrist::{
    AddedDynamics, FurtherValues, HermiteSegment, History, Integrator, Kinematics, Lever, Mechanics,
    NoAddedDynamics, Plant, State, Torques, substeps,
};

/// Time constant with which the muscle's resistance decays when the subject relaxes after a ramp, s. Assumed.
const RELAXATION_S: f64 = 0.08;

/// Part of the resistance below which the wrist counts as relaxed.
const RELAXED: f64 = 1e-4;

/// The torque that the movement causes at one sample.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ResponseSample {
    /// In the lever, as a change from the hold, N m.
    pub lever_nm: f64,
    /// The same torque as the torque sensor shows it, N m.
    pub measured_nm: f64,
    /// Time since the onset, s; `None` without a movement.
    pub since_onset_s: Option<f64>,
    /// Absolute velocity of the present ramp, rad/s.
    pub speed_rad_s: f64,
    /// Difference of the handle's angle from the recorded motor angle that the movement causes, rad.
    handle_rad: f64,
    /// The same difference of the joint's angle, rad.
    joint_rad: f64,
    /// Torque of the reflex, N m. It is slow: it bends lever and interface by their stiffness.
    reflex_nm: f64,
    /// Torque between handle and hand that the movement causes, N m.
    hand_nm: f64,
    /// Angular acceleration of the handle, rad/s2; `None` without a movement.
    handle_rad_s2: Option<f64>,
}

/// The wrist, the hand and the lever during a movement.
pub struct WristResponse {
    lever: Option<Lever>,
    bearing: Bearing,
    reflex: Reflex,
    reaction_s: f64,
    mechanisms: MechanismList,
    channels: ChannelErrors<f64>,
    gauge_offset_nm: f64,
    period_s: f64,
    /// Stiffness of the interface in the present trial, N m/rad.
    interface_nm_per_rad: f64,
    trial: Option<TrialBeforeRamp>,
    moving: Option<Moving>,
}

/// What is known of the trial before its ramp.
#[derive(Debug, Clone, Copy)]
struct TrialBeforeRamp {
    parameters: [f64; 6],
    covariates: Covariates,
    velocity_rad_s: f64,
}

/// A movement under way. Angles and torques have the sign of a positive ramp: the model of a negative ramp is its mirror image.
struct Moving {
    mechanics: Mechanics<f64>,
    bearing: Bearing,
    covariates: Covariates,
    history: History<f64>,
    substeps: usize,
    integrator: Integrator<f64>,
    sign: f64,
    origin_rad: f64,
    from: Kinematics<f64>,
    follower: Follower,
    sample: u64,
    reflex_nm: f64,
    speed_rad_s: f64,
    resistance: f64,
    relaxed_samples: u64,
}

/// The six base parameters in a trial: those of `person` at this velocity, rad/s, and torque, N m, with the trial's deviations.
pub fn trial_parameters(
    person: &Person,
    velocity_rad_s: f64,
    target_nm: f64,
    spread: &TrialSpread,
) -> [f64; 6] {
    let value = |surface: Surface, spread: f64| surface.at(velocity_rad_s, target_nm) * (1.0 + spread);
    let deviations = person.spread;
    let k_srs = value(
        person.short_range_stiffness_nm_per_rad,
        deviations.short_range_stiffness * spread.short_range_stiffness,
    )
    .max(1.0);
    let k_dec = value(
        person.stiffness_decrement_nm_per_rad,
        deviations.stiffness_decrement * spread.stiffness_decrement,
    );
    let x_e = value(person.elastic_limit_rad, deviations.elastic_limit * spread.elastic_limit);
    [
        person.joint_inertia_kg_m2,
        person.interface_damping_nm_s_per_rad,
        value(person.interface_stiffness_nm_per_rad, 0.0).max(1.0),
        k_srs,
        // The torque of a muscle does not fall when it is stretched further.
        k_dec.clamp(0.0, k_srs),
        x_e.max(0.001),
    ]
}

impl WristResponse {
    /// The wrist of `person` in a rig of `setup`.
    pub fn new(person: &Person, setup: &Setup, sample_rate_hz: f64) -> Self {
        let mechanisms = person.mechanisms.and(&setup.mechanisms).starting_at_onset();
        Self {
            lever: setup.lever,
            bearing: Bearing::new(setup),
            reflex: person.reflex,
            reaction_s: person.voluntary.reaction_s,
            channels: channels(&mechanisms),
            mechanisms,
            gauge_offset_nm: setup.gauge_offset_nm,
            period_s: 1.0 / sample_rate_hz,
            interface_nm_per_rad: person.interface_stiffness_nm_per_rad.at_lowest,
            trial: None,
            moving: None,
        }
    }

    /// Sets the muscle's parameters for this trial; `emg` is the flexor's excess and the extensor's level, fraction of MVC.
    pub fn prepare(
        &mut self,
        person: &Person,
        upcoming: &Upcoming,
        target_nm: f64,
        spread: &TrialSpread,
        emg: [f64; 2],
    ) {
        let velocity_rad_s = upcoming.velocity_rad_s;
        let parameters = trial_parameters(person, velocity_rad_s, target_nm, spread);
        self.interface_nm_per_rad = parameters[2];
        self.trial = Some(TrialBeforeRamp {
            parameters,
            covariates: Covariates {
                velocity_rad_s: velocity_rad_s.abs(),
                torque_before_nm: 0.0,
                progress: upcoming.progress,
                rest_s: upcoming.rest_s,
                flexor_emg_excess_mvc: emg[0],
                extensor_emg_mvc: emg[1],
            },
            velocity_rad_s,
        });
    }

    /// Starts the ramp: from here on, angle and torque are changes from their present values.
    pub fn start(&mut self, motor: Kinematics<f64>, torque_nm: f64) {
        let Some(trial) = self.trial else { return };
        let sign = trial.velocity_rad_s.signum();
        let covariates =
            Covariates { torque_before_nm: sign * (torque_nm + self.gauge_offset_nm), ..trial.covariates };
        let states = self.mechanisms.kinds.iter().map(|kind| kind.state_count()).sum();
        let history = History::new(0.0, self.period_s, states);
        let mut plant = Plant::base(self.lever, &trial.parameters);
        let active = ActiveMechanisms {
            kinds: &self.mechanisms.kinds,
            parameters: &self.mechanisms.parameters,
            trial: &covariates,
            history: &history,
        };
        active.alter_plant(&mut plant);
        let speed_rad_s = trial.velocity_rad_s.abs();
        let of_wrist = substeps(&plant, active.longest_step_s(speed_rad_s), self.period_s);
        let of_bearing = match self.bearing.rubs() {
            true => self.bearing.substeps(plant.lever, trial.parameters[2], self.period_s),
            false => 0,
        };
        self.moving = Some(Moving {
            mechanics: Mechanics::new(plant),
            bearing: self.bearing,
            covariates,
            history,
            substeps: of_wrist.max(of_bearing),
            integrator: Integrator::at_rest(),
            sign,
            origin_rad: motor.theta,
            from: Kinematics::default(),
            follower: Follower::default(),
            sample: 0,
            reflex_nm: self.reflex.gain_s_per_rad * speed_rad_s * torque_nm.abs(),
            speed_rad_s,
            resistance: 1.0,
            relaxed_samples: 0,
        });
    }

    /// Ends the movement.
    pub fn stop(&mut self) {
        self.moving = None;
    }

    /// The response when the motor has come to `motor`; `relax` tells that no torque is asked of the subject.
    pub fn step(&mut self, motor: Kinematics<f64>, relax: bool) -> ResponseSample {
        let Some(moving) = &mut self.moving else { return ResponseSample::default() };
        let to = moving.relative_motion(motor, self.channels.following_hz, self.period_s);
        let mut response = moving.advance(&self.mechanisms, &self.reflex, to, self.period_s);
        if relax {
            moving.relaxed_samples += 1;
            if moving.relaxed_samples as f64 * self.period_s > self.reaction_s {
                moving.resistance *= libm::exp(-self.period_s / RELAXATION_S);
            }
        }
        if let Some(lever) = self.lever {
            response.handle_rad -= response.reflex_nm / lever.stiffness_nm_per_rad;
            response.joint_rad -= response.reflex_nm / lever.stiffness_nm_per_rad;
        }
        response.joint_rad -= response.reflex_nm / self.interface_nm_per_rad;
        // If the recorded angle is only a command, handle and joint differ from it by what the motor does.
        let recorded_rad = moving.sign * (motor.theta - moving.origin_rad);
        let motor_rad = moving.sign * (to.theta - recorded_rad);
        response.handle_rad += motor_rad;
        response.joint_rad += motor_rad;
        if moving.resistance < RELAXED {
            self.moving = None;
        }
        response
    }

    /// What the further channels would show without an error, where the motor moves through `motor` in this period and the subject
    /// holds `voluntary_nm`. The voluntary torque is slow: it bends lever and interface by their stiffness.
    pub fn further(
        &self,
        response: &ResponseSample,
        motor: [Kinematics<f64>; 2],
        voluntary_nm: f64,
    ) -> FurtherValues<f64> {
        let bent_rad = self.lever.map_or(0.0, |lever| voluntary_nm / lever.stiffness_nm_per_rad);
        let theta_l = motor[1].theta + response.handle_rad - bent_rad;
        let segment = HermiteSegment::new(motor[0], motor[1], self.period_s);
        FurtherValues {
            theta_l,
            alpha_l: response.handle_rad_s2.unwrap_or_else(|| segment.acceleration_at_end()),
            torque_h: voluntary_nm + response.hand_nm,
            theta_j: motor[1].theta + response.joint_rad
                - bent_rad
                - voluntary_nm / self.interface_nm_per_rad,
        }
    }
}

impl Moving {
    /// The motor's motion relative to the onset, in the direction of the ramp.
    fn relative_motion(
        &mut self,
        motor: Kinematics<f64>,
        following_hz: Option<f64>,
        period_s: f64,
    ) -> Kinematics<f64> {
        let recorded =
            Kinematics { theta: self.sign * (motor.theta - self.origin_rad), omega: self.sign * motor.omega };
        self.follower.follow(recorded, following_hz, period_s)
    }

    fn advance(
        &mut self,
        mechanisms: &MechanismList,
        reflex: &Reflex,
        to: Kinematics<f64>,
        period_s: f64,
    ) -> ResponseSample {
        let start_s = self.sample as f64 * period_s;
        let end_s = (self.sample + 1) as f64 * period_s;
        let input = HermiteSegment::new(self.from, to, period_s);
        let (torques, rates) = if mechanisms.kinds.is_empty() {
            self.run(&NoAddedDynamics, &input, to, start_s, end_s)
        } else {
            let history = std::mem::replace(&mut self.history, History::new(0.0, period_s, 0));
            let covariates = self.covariates;
            let added_dynamics = ActiveMechanisms {
                kinds: &mechanisms.kinds,
                parameters: &mechanisms.parameters,
                trial: &covariates,
                history: &history,
            };
            let now = self.run(&added_dynamics, &input, to, start_s, end_s);
            self.history = history;
            let (added, rates) = self.integrator.sampled();
            self.history.push(added, rates);
            now
        };
        let motor_rad_s2 = input.acceleration_at_end();
        let state = self.integrator.state();
        let (handle, alpha_l) = match self.mechanics.plant.lever {
            Some(_) => (Kinematics { theta: state.theta_l, omega: state.omega_l }, rates.omega_l),
            None => (to, motor_rad_s2),
        };
        let hand_nm = torques.interface - self.bearing.friction_nm(handle.omega);
        self.from = to;
        self.sample += 1;
        let reflex_nm = self.reflex_nm * burst(end_s - reflex.torque_latency_s, reflex.rise_s);
        let factor = self.sign * self.resistance;
        ResponseSample {
            lever_nm: factor * (torques.lever + reflex_nm),
            measured_nm: factor * (torques.measured + reflex_nm),
            since_onset_s: Some(end_s),
            speed_rad_s: self.speed_rad_s,
            reflex_nm: factor * reflex_nm,
            handle_rad: factor * (handle.theta - to.theta),
            joint_rad: factor * (state.theta_j - to.theta),
            hand_nm: factor * (hand_nm + reflex_nm),
            handle_rad_s2: Some(
                self.sign * (self.resistance * alpha_l + (1.0 - self.resistance) * motor_rad_s2),
            ),
        }
    }

    fn run<X: AddedDynamics<f64>>(
        &mut self,
        wrist: &X,
        input: &HermiteSegment<f64>,
        to: Kinematics<f64>,
        start_s: f64,
        end_s: f64,
    ) -> (Torques<f64>, State<f64>) {
        let bearing = self.bearing;
        match bearing.rubs() {
            true => self.integrate(&InBearing { bearing, wrist }, input, to, start_s, end_s),
            false => self.integrate(wrist, input, to, start_s, end_s),
        }
    }

    fn integrate<X: AddedDynamics<f64>>(
        &mut self,
        added_dynamics: &X,
        input: &HermiteSegment<f64>,
        to: Kinematics<f64>,
        start_s: f64,
        end_s: f64,
    ) -> (Torques<f64>, State<f64>) {
        let (period_s, steps) = (end_s - start_s, self.substeps);
        self.integrator.advance(&self.mechanics, added_dynamics, input, start_s, period_s, steps);
        self.integrator.torques(&self.mechanics, added_dynamics, to, end_s)
    }
}

/// The motor behind a recorded angle that is only a command: it follows with two equal lags (mechanism `servo_following`).
#[derive(Debug, Clone, Copy, Default)]
pub struct Follower {
    lags_rad: [f64; 2],
}

impl Follower {
    /// The motion of the motor when the recorded one is `recorded`; the recorded one itself without a bandwidth.
    pub fn follow(
        &mut self,
        recorded: Kinematics<f64>,
        following_hz: Option<f64>,
        period_s: f64,
    ) -> Kinematics<f64> {
        let Some(bandwidth_hz) = following_hz else { return recorded };
        let rate = std::f64::consts::TAU * bandwidth_hz;
        let keep = libm::exp(-rate * period_s);
        let [first, second] = &mut self.lags_rad;
        *first = recorded.theta + keep * (*first - recorded.theta);
        *second = *first + keep * (*second - *first);
        Kinematics { theta: *second, omega: rate * (*first - *second) }
    }
}

/// How the recorded angle differs from the motor's angle with these mechanisms.
pub fn channels(mechanisms: &MechanismList) -> ChannelErrors<f64> {
    let (trial, history) = (Covariates::default(), History::new(0.0, 1.0, 0));
    ActiveMechanisms {
        kinds: &mechanisms.kinds,
        parameters: &mechanisms.parameters,
        trial: &trial,
        history: &history,
    }
    .channels()
}
