//! Free laws of a session: the range of each one's argument, and models that have one.

use crate::fit::{Fit, Model, Observations, ParameterSpec, Scope, X_E, simulated_trajectory};
use crate::wrist::mechanisms::{Argument, FREE_LAWS, MechanismKind, Place};

/// Memory of a law of the past, s: the longest lag of a tissue or an amplifier that a window of 40 ms can tell from a level.
const MEMORY_S: f64 = 0.016;

/// Size of a free torque about which its prior lies, N m: a tenth of the torques of the protocol.
const TYPICAL_NM: f64 = 0.1;

/// The same for a free angle, rad, for a torque per past speed, N m s/rad, and for a part of a past torque.
const TYPICAL_RAD: f64 = 1e-3;
const TYPICAL_NM_S_PER_RAD: f64 = 0.1;
const TYPICAL_PART: f64 = 0.1;

/// The range of each free law's argument in a session.
#[derive(Debug, Clone)]
pub struct FreeLawRanges {
    ranges: Vec<(MechanismKind, [f64; 2])>,
    largest_speed: f64,
    largest_torque: f64,
    window_s: f64,
}

impl FreeLawRanges {
    /// The ranges that `fit` passes through. A law without an effect there has none.
    pub fn of(observations: &Observations, fit: &Fit) -> Self {
        let has_lever = observations.lever.is_some();
        let laws = FREE_LAWS.iter().filter_map(|kind| Some((*kind, kind.free_law()?)));
        let applicable = laws.filter(|(_, law)| has_lever || law.place != Place::Handle);
        let mut ranges: Vec<(MechanismKind, [f64; 2])> =
            applicable.map(|(kind, _)| (kind, [0.0, 0.0])).collect();
        let (mut largest_speed, mut largest_torque) = (1e-6f64, 1e-6f64);
        for trial in 0..observations.trials.len() {
            let own = &observations.trials[trial];
            let trajectory = simulated_trajectory(observations, fit, trial);
            for sample in trajectory.iter().take(observations.samples) {
                let (state, limit) = (&sample.state, fit.parameters[trial][X_E]);
                let (handle, speed) = match observations.lever {
                    Some(_) => (state.theta_l, state.omega_l),
                    None => (sample.motor.theta, sample.motor.omega),
                };
                let torque = own.direction * own.torque_0_nm + sample.torques.measured;
                largest_speed = largest_speed.max(state.omega_j.abs());
                largest_torque = largest_torque.max(sample.torques.measured.abs());
                for (kind, range) in &mut ranges {
                    let Some(law) = kind.free_law() else { continue };
                    let at = match (law.place, law.argument) {
                        (_, Argument::PastSpeed | Argument::PastTorque) => MEMORY_S,
                        (_, Argument::Time) => sample.time_s,
                        (_, Argument::AngleBeyondYield) => state.theta_j - limit,
                        (_, Argument::Deflection) => handle - state.theta_j,
                        (_, Argument::Torque) => torque,
                        (Place::Joint, Argument::Angle) => state.theta_j,
                        (Place::Joint, Argument::Speed) => state.omega_j,
                        (Place::Interface, Argument::Speed) => speed - state.omega_j,
                        (Place::Handle, Argument::Angle) => handle,
                        (Place::Handle, Argument::Speed) => speed,
                        _ => sample.motor.theta,
                    };
                    *range = [range[0].min(at), range[1].max(at)];
                }
            }
        }
        ranges.retain(|(_, range)| range[1] - range[0] > 1e-9);
        let window_s = observations.samples as f64 * observations.period_s;
        Self { ranges, largest_speed, largest_torque, window_s }
    }

    /// The free laws of the session.
    pub fn kinds(&self) -> impl Iterator<Item = MechanismKind> + '_ {
        self.ranges.iter().map(|(kind, _)| *kind)
    }

    /// The range of a free law's argument.
    pub fn range(&self, kind: MechanismKind) -> Option<[f64; 2]> {
        self.ranges.iter().find(|(own, _)| *own == kind).map(|(_, range)| *range)
    }

    /// `model` with the free law `kind` at zero; the model itself where the session has no such law.
    pub fn with_free_law(&self, mut model: Model, kind: MechanismKind) -> Model {
        let (Some([from, to]), Some(law)) = (self.range(kind), kind.free_law()) else { return model };
        model = model.with(kind);
        if let Some(added) = model.mechanisms.last_mut() {
            let ends = match law.coefficients.start {
                1 => vec![to],
                _ => vec![from, to],
            };
            for (place, spec) in added.parameters.iter_mut().enumerate() {
                *spec = match ends.get(place) {
                    Some(end) => ParameterSpec::fixed(*end),
                    None => ParameterSpec { value: Some(0.0), ..ParameterSpec::free(Scope::Session) },
                };
            }
        }
        model
    }

    /// The free law `kind` of a `model`, which has it, acts only at the lags `lags_s` of the past, and not beyond the window.
    pub fn restrict_to_lags(&self, model: &mut Model, kind: MechanismKind, [from_s, to_s]: [f64; 2]) {
        let Some(law) = kind.free_law() else { return };
        let Some(added) = model.mechanisms.iter_mut().find(|own| own.kind == kind) else { return };
        let to_s = to_s.min(self.window_s);
        added.parameters[0] = ParameterSpec::fixed(to_s);
        let width = to_s / law.coefficients.len() as f64;
        for (number, place) in law.coefficients.enumerate() {
            if (number as f64 + 1.0) * width <= from_s {
                added.parameters[place] = ParameterSpec::fixed(0.0);
            }
        }
    }

    /// Size of a free law's coefficients about which their prior lies.
    pub fn typical_size(&self, kind: MechanismKind) -> f64 {
        match kind.free_law().map(|law| (law.place, law.argument)) {
            Some((_, Argument::PastSpeed)) => TYPICAL_NM_S_PER_RAD,
            Some((_, Argument::PastTorque)) => TYPICAL_PART,
            Some((Place::AngleChannel, _)) => TYPICAL_RAD,
            _ => TYPICAL_NM,
        }
    }

    /// What a coefficient of a free law must be multiplied by to give a torque, roughly: 1 for a torque, a speed for a torque per speed.
    pub fn argument_size(&self, kind: MechanismKind) -> f64 {
        match kind.free_law().map(|law| law.argument) {
            Some(Argument::PastSpeed) => self.largest_speed,
            Some(Argument::PastTorque) => self.largest_torque,
            _ => 1.0,
        }
    }
}
