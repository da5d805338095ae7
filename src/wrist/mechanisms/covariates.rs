//! What is known of a trial besides its signals, and what a mechanism requires of a session.
//!
//! A new covariate is one line of the list below, and a new requirement one variant of [`DataRequirement`] with its test. The compiler
//! then points to the two places that know the values: the preprocessing of recorded trials and the virtual wrist.

use crate::number::Plain;
use crate::wrist::plant::Lever;

macro_rules! covariates {
    ($($(#[$doc:meta])* $field:ident,)*) => {
        /// What is known of a trial besides its signals.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Covariates<P = f64> {
            $($(#[$doc])* pub $field: P,)*
        }

        impl<P: Plain> Covariates<P> {
            /// The covariates of up to `P::LANES` trials, one trial per lane; the last trial fills the lanes that remain.
            pub fn gather(trials: &[Covariates]) -> Self {
                let field = |read: fn(&Covariates) -> f64| {
                    let mut values = [0.0; 16];
                    for (lane, value) in values.iter_mut().enumerate().take(P::LANES) {
                        *value = read(&trials[lane.min(trials.len() - 1)]);
                    }
                    P::load(&values)
                };
                Self { $($field: field(|c| c.$field),)* }
            }
        }

        impl Default for Covariates {
            fn default() -> Self {
                Self { $($field: 0.0,)* }
            }
        }
    };
}

covariates! {
    /// Ramp velocity, rad/s.
    velocity_rad_s,
    /// Torque before the ramp, N m.
    torque_before_nm,
    /// Place in the session, from 0 (first trial) to 1 (last).
    progress,
    /// Rest before the trial, s.
    rest_s,
    /// Flexor EMG in the hold, less what is usual at this target torque, fraction of MVC.
    flexor_emg_excess_mvc,
    /// Extensor EMG in the hold, fraction of MVC.
    extensor_emg_mvc,
}

/// What a session must hold before a mechanism can be considered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DataRequirement {
    /// A compliant lever.
    Lever,
    /// Flexor EMG that varies between trials.
    FlexorEmg,
    /// Extensor EMG that varies between trials.
    ExtensorEmg,
    /// A rest before the trials that varies between them.
    Rest,
    /// Trials at more than one velocity.
    Velocities,
}

/// Smallest difference between two trials' covariates that counts as a variation, in the covariate's unit.
const SMALLEST_VARIATION: f64 = 1e-12;

impl DataRequirement {
    /// Why a session with this lever and these trials does not meet the requirement; `None` if it does.
    pub fn unmet(self, lever: Option<Lever>, trials: &[Covariates]) -> Option<&'static str> {
        let constant = |read: fn(&Covariates) -> f64| {
            !trials.iter().skip(1).any(|trial| (read(trial) - read(&trials[0])).abs() > SMALLEST_VARIATION)
        };
        let (unmet, reason) = match self {
            Self::Lever => (lever.is_none(), "the lever is rigid"),
            Self::FlexorEmg => (constant(|c| c.flexor_emg_excess_mvc), "there is no flexor EMG"),
            Self::ExtensorEmg => (constant(|c| c.extensor_emg_mvc), "there is no extensor EMG"),
            Self::Rest => {
                (constant(|c| c.rest_s), "the rest before the trials is not given, or always the same")
            }
            Self::Velocities => (constant(|c| c.velocity_rad_s), "there is only one velocity"),
        };
        unmet.then_some(reason)
    }
}
