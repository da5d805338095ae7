//! The wrist in the rig while the motor moves: the paper's model, with what the person and the rig add to it.

use super::emg::burst;
use super::mechanism_list::MechanismList;
use super::person::{Person, Reflex, Surface};
use super::setup::Setup;
use super::voluntary::TrialSpread;
use crate::rig::Upcoming;
use crate::wrist::mechanisms::{ActiveMechanisms, ChannelErrors, Covariates};
use crate::wrist::{
    Extension, HermiteSegment, History, Integrator, Kinematics, Lever, Mechanics, NoExtension, Plant,
    RecordedInput, Torques, substeps,
};

/// Time constant with which the muscle's resistance fades when the person lets go after a ramp, s. Assumed.
const LETTING_GO_S: f64 = 0.08;

/// What is left of the resistance when the limb counts as relaxed.
const RELAXED: f64 = 1e-4;

/// The part of the torque that the movement causes, and when.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Response {
    /// In the lever, as a change from the hold, N m.
    pub lever_nm: f64,
    /// What the torque sensor makes of it, N m.
    pub measured_nm: f64,
    /// Since the onset, while a movement is under way, s.
    pub since_onset_s: Option<f64>,
    /// Speed of the ramp under way, without its sign, rad/s.
    pub speed_rad_s: f64,
}

/// The wrist, the hand and the lever.
pub struct Limb {
    lever: Option<Lever>,
    reflex: Reflex,
    reaction_s: f64,
    switched: MechanismList,
    channels: ChannelErrors<f64>,
    gauge_offset_nm: f64,
    period_s: f64,
    trial: Option<Trial>,
    moving: Option<Moving>,
}

/// What is known of the trial before its ramp.
#[derive(Debug, Clone, Copy)]
struct Trial {
    parameters: [f64; 6],
    covariates: Covariates,
    velocity_rad_s: f64,
}

/// A movement under way. Angles and torques are turned so that the ramp is positive: the model of a negative ramp is the
/// mirrored one.
struct Moving {
    mechanics: Mechanics<f64>,
    covariates: Covariates,
    history: History<f64>,
    substeps: usize,
    integrator: Integrator<f64>,
    sign: f64,
    origin_rad: f64,
    from: Kinematics<f64>,
    follower_rad: [f64; 2],
    sample: u64,
    reflex_nm: f64,
    speed_rad_s: f64,
    resistance: f64,
    let_go: u64,
}

impl Limb {
    /// The limb of `person` in a rig of `setup`.
    pub fn new(person: &Person, setup: &Setup, sample_rate_hz: f64) -> Self {
        let switched = person.mechanisms.and(&setup.mechanisms).starting_at_onset();
        Self {
            lever: setup.lever,
            reflex: person.reflex,
            reaction_s: person.voluntary.reaction_s,
            channels: channels(&switched),
            switched,
            gauge_offset_nm: setup.gauge_offset_nm,
            period_s: 1.0 / sample_rate_hz,
            trial: None,
            moving: None,
        }
    }

    /// Draws the muscle as it is in this trial; `emg` is the flexor's excess and the extensor's level.
    pub fn prepare(
        &mut self,
        person: &Person,
        upcoming: &Upcoming,
        target_nm: f64,
        spread: &TrialSpread,
        emg: [f64; 2],
    ) {
        let velocity_rad_s = upcoming.velocity_rad_s;
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
        self.trial = Some(Trial {
            parameters: [
                person.joint_inertia_kg_m2,
                person.interface_damping_nm_s_per_rad,
                value(person.interface_stiffness_nm_per_rad, 0.0).max(1.0),
                k_srs,
                // A muscle does not push back less the further it is stretched.
                k_dec.clamp(0.0, k_srs),
                x_e.max(0.001),
            ],
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

    /// The ramp begins: from here on, angle and torque are changes from what they are now.
    pub fn start(&mut self, motor: Kinematics<f64>, torque_nm: f64) {
        let Some(trial) = self.trial else { return };
        let sign = trial.velocity_rad_s.signum();
        let covariates =
            Covariates { torque_before_nm: sign * (torque_nm + self.gauge_offset_nm), ..trial.covariates };
        let states = self.switched.kinds.iter().map(|kind| kind.state_count()).sum();
        let history = History::new(0.0, self.period_s, states);
        let mut plant = Plant::base(self.lever, &trial.parameters);
        ActiveMechanisms {
            kinds: &self.switched.kinds,
            parameters: &self.switched.parameters,
            trial: &covariates,
            history: &history,
        }
        .alter_plant(&mut plant);
        let speed_rad_s = trial.velocity_rad_s.abs();
        self.moving = Some(Moving {
            mechanics: Mechanics::new(plant),
            covariates,
            history,
            substeps: substeps(self.lever, &trial.parameters, self.period_s),
            integrator: Integrator::at_rest(),
            sign,
            origin_rad: motor.theta,
            from: Kinematics::default(),
            follower_rad: [0.0; 2],
            sample: 0,
            reflex_nm: self.reflex.gain_s_per_rad * speed_rad_s * torque_nm.abs(),
            speed_rad_s,
            resistance: 1.0,
            let_go: 0,
        });
    }

    /// At rest again.
    pub fn stop(&mut self) {
        self.moving = None;
    }

    /// What the limb answers when the motor has come to `motor`; `let_go` says that the person is not asked for torque.
    pub fn step(&mut self, motor: Kinematics<f64>, let_go: bool) -> Response {
        let Some(moving) = &mut self.moving else { return Response::default() };
        let to = moving.turned(motor, self.channels.following_hz, self.period_s);
        let response = moving.advance(&self.switched, &self.reflex, to, self.period_s);
        if let_go {
            moving.let_go += 1;
            if moving.let_go as f64 * self.period_s > self.reaction_s {
                moving.resistance *= libm::exp(-self.period_s / LETTING_GO_S);
            }
        }
        if moving.resistance < RELAXED {
            self.moving = None;
        }
        response
    }
}

impl Moving {
    /// The motor as seen from the onset. Where the recorded angle is only a command, the motor follows it with two equal
    /// lags, as the mechanism `servo_following` has it.
    fn turned(
        &mut self,
        motor: Kinematics<f64>,
        following_hz: Option<f64>,
        period_s: f64,
    ) -> Kinematics<f64> {
        let recorded =
            Kinematics { theta: self.sign * (motor.theta - self.origin_rad), omega: self.sign * motor.omega };
        let Some(bandwidth_hz) = following_hz else { return recorded };
        let rate = std::f64::consts::TAU * bandwidth_hz;
        let keep = libm::exp(-rate * period_s);
        let [first, second] = &mut self.follower_rad;
        *first = recorded.theta + keep * (*first - recorded.theta);
        *second = *first + keep * (*second - *first);
        Kinematics { theta: *second, omega: rate * (*first - *second) }
    }

    fn advance(
        &mut self,
        switched: &MechanismList,
        reflex: &Reflex,
        to: Kinematics<f64>,
        period_s: f64,
    ) -> Response {
        let start_s = self.sample as f64 * period_s;
        let end_s = (self.sample + 1) as f64 * period_s;
        let input = RecordedInput(HermiteSegment::new(self.from, to, period_s));
        let torques = if switched.kinds.is_empty() {
            self.run(&NoExtension, &input, to, start_s, end_s)
        } else {
            let history = std::mem::replace(&mut self.history, History::new(0.0, period_s, 0));
            let covariates = self.covariates;
            let extension = ActiveMechanisms {
                kinds: &switched.kinds,
                parameters: &switched.parameters,
                trial: &covariates,
                history: &history,
            };
            let torques = self.run(&extension, &input, to, start_s, end_s);
            self.history = history;
            let (added, rates) = self.integrator.sampled();
            self.history.push(added, rates);
            torques
        };
        self.from = to;
        self.sample += 1;
        let reflex_nm = self.reflex_nm * burst(end_s - reflex.torque_latency_s, reflex.rise_s);
        let turned = self.sign * self.resistance;
        Response {
            lever_nm: turned * (torques.lever + reflex_nm),
            measured_nm: turned * (torques.measured + reflex_nm),
            since_onset_s: Some(end_s),
            speed_rad_s: self.speed_rad_s,
        }
    }

    fn run<X: Extension<f64>>(
        &mut self,
        extension: &X,
        input: &RecordedInput<f64>,
        to: Kinematics<f64>,
        start_s: f64,
        end_s: f64,
    ) -> Torques<f64> {
        self.integrator.advance(&self.mechanics, extension, input, start_s, end_s - start_s, self.substeps);
        self.integrator.torques(&self.mechanics, extension, to, end_s).0
    }
}

/// What the mechanisms switched on do to the way from the motor's angle to the recorded one.
pub fn channels(switched: &MechanismList) -> ChannelErrors<f64> {
    let (trial, history) = (Covariates::default(), History::new(0.0, 1.0, 0));
    ActiveMechanisms {
        kinds: &switched.kinds,
        parameters: &switched.parameters,
        trial: &trial,
        history: &history,
    }
    .channels()
}
