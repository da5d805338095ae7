//! The mechanisms that are switched on in a simulation.

use super::MechanismKind;
use super::channel_errors::ChannelErrors;
use super::covariates::Covariates;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::history::History;
use crate::wrist::mechanics::{AddedDynamics, Context, Torques};
use crate::wrist::plant::Plant;

/// Mechanisms that are switched on in a trial, with their parameters.
pub struct ActiveMechanisms<'a, T: Number> {
    /// The mechanisms, in order.
    pub kinds: &'a [MechanismKind],
    /// Their parameters, one mechanism after the other.
    pub parameters: &'a [T],
    /// What is known of the trial.
    pub trial: &'a Covariates<T::Plain>,
    /// The added states at past samples.
    pub history: &'a History<T>,
}

impl<T: Number> ActiveMechanisms<'_, T> {
    /// Alters the coefficients of the plant in the trial.
    #[inline(always)]
    pub fn alter_plant(&self, plant: &mut Plant<T>) {
        let mut first = 0;
        for kind in self.kinds {
            let count = kind.parameter_count();
            kind.alter_plant(&self.parameters[first..first + count], plant, self.trial);
            first += count;
        }
    }

    /// How the recorded angle differs from the motor's.
    #[inline(always)]
    pub fn channels(&self) -> ChannelErrors<T> {
        let mut channels = ChannelErrors::none();
        let mut first = 0;
        for kind in self.kinds {
            let count = kind.parameter_count();
            kind.alter_channels(&self.parameters[first..first + count], &mut channels);
            first += count;
        }
        channels
    }
}

impl ActiveMechanisms<'_, f64> {
    /// The longest step of an integration that the mechanisms allow, s, where the motor turns at up to `speed_rad_s`.
    pub fn longest_step_s(&self, speed_rad_s: f64) -> f64 {
        let mut first = 0;
        let steps = self.kinds.iter().map(|kind| {
            let own = first..first + kind.parameter_count();
            first = own.end;
            kind.longest_step_s(&self.parameters[own], speed_rad_s)
        });
        steps.fold(f64::INFINITY, f64::min)
    }
}

impl<T: Number> AddedDynamics<T> for ActiveMechanisms<'_, T> {
    const ACTIVE: bool = true;

    #[inline(always)]
    fn state_count(&self) -> usize {
        self.kinds.iter().map(|kind| kind.state_count()).sum()
    }

    #[inline(always)]
    fn add_torques(&self, context: &Context<'_, T>, added: &[T], torques: &mut Torques<T>, rates: &mut [T]) {
        let (mut first, mut slot) = (0, 0);
        for kind in self.kinds {
            let (p, own) = (first..first + kind.parameter_count(), slot..slot + kind.state_count());
            (first, slot) = (p.end, own.end);
            let states = OwnStates::new(&added[own.clone()], self.history, own.start);
            kind.add_torques(&self.parameters[p], context, &states, torques, &mut rates[own]);
        }
    }

    #[inline(always)]
    fn alter_measurement(&self, added: &[T], time_s: f64, torque: T, rates: &mut [T]) -> T {
        let (mut first, mut slot, mut torque) = (0, 0, torque);
        for kind in self.kinds {
            let (p, own) = (first..first + kind.parameter_count(), slot..slot + kind.state_count());
            (first, slot) = (p.end, own.end);
            let states = OwnStates::new(&added[own.clone()], self.history, own.start);
            let (p, rates) = (&self.parameters[p], &mut rates[own]);
            torque = kind.alter_measurement(p, &states, self.trial, time_s, torque, rates);
        }
        torque
    }
}
