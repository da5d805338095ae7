//! What mechanisms of the torque channel record of the torque in the lever.

use super::channel_states::ChannelStates;
use super::history::History;
use super::mechanisms::{Covariates, MAX_CHANNEL_STATES, MechanismKind, OwnStates};
use crate::number::Number;

/// The torque channel: the mechanisms in order, of which those with states have them here.
pub(super) struct TorqueChannel<'a, T: Number> {
    kinds: &'a [MechanismKind],
    parameters: &'a [T],
    trial: &'a Covariates<T::Plain>,
    states: Vec<ChannelStates<T>>,
    /// Mechanisms of the channel ask for no past but their states.
    no_history: History<T>,
    /// The states have their rates in their coefficients.
    unused_rates: [T; MAX_CHANNEL_STATES],
}

impl<'a, T: Number> TorqueChannel<'a, T> {
    /// The channel over steps of `step_s`, with all mechanisms of the model and their `parameters`, one after the other.
    #[inline(always)]
    pub fn new(
        kinds: &'a [MechanismKind],
        parameters: &'a [T],
        trial: &'a Covariates<T::Plain>,
        step_s: f64,
    ) -> Self {
        let zero = T::constant(0.0);
        let no_history = History::new(0.0, step_s, 0);
        let mut states_of_all = Vec::new();
        let mut first = 0;
        for kind in kinds {
            let (own, count) = (first..first + kind.parameter_count(), kind.channel_state_count());
            first = own.end;
            if count == 0 {
                continue;
            }
            let mut causes = [[zero; MAX_CHANNEL_STATES]; MAX_CHANNEL_STATES + 1];
            let mut cause = 0;
            while cause <= count {
                let mut state = [zero; MAX_CHANNEL_STATES];
                let mut torque = zero;
                if cause < count {
                    state[cause] = T::constant(1.0);
                } else {
                    torque = T::constant(1.0);
                }
                let states = OwnStates::new(&state, &no_history, 0);
                kind.alter_measurement(
                    &parameters[own.clone()],
                    &states,
                    trial,
                    0.0,
                    torque,
                    &mut causes[cause],
                );
                cause += 1;
            }
            states_of_all.push(ChannelStates::new(count, step_s, causes));
        }
        Self {
            kinds,
            parameters,
            trial,
            states: states_of_all,
            no_history,
            unused_rates: [zero; MAX_CHANNEL_STATES],
        }
    }

    /// Whether any mechanism of the channel has states.
    #[inline(always)]
    pub fn has_states(&self) -> bool {
        !self.states.is_empty()
    }

    /// What is recorded `time_s` after the onset, N m, where the torque in the lever is `torque`. Where mechanisms have states, every call
    /// is a step later than the one before.
    #[inline(always)]
    pub fn recorded(&mut self, torque: T, time_s: f64) -> T {
        let mut torque = torque;
        let (mut first, mut next) = (0, 0);
        for kind in self.kinds {
            let own = first..first + kind.parameter_count();
            first = own.end;
            if kind.adds_torque() {
                continue;
            }
            let mut state: &[T] = &[];
            if kind.channel_state_count() > 0 {
                self.states[next].advance(torque);
                state = self.states[next].state();
                next += 1;
            }
            let states = OwnStates::new(state, &self.no_history, 0);
            let (parameters, rates) = (&self.parameters[own], &mut self.unused_rates);
            torque = kind.alter_measurement(parameters, &states, self.trial, time_s, torque, rates);
        }
        torque
    }
}
