//! The catalogue of mechanisms: what the base model may lack.
//!
//! A mechanism is one file that declares its name, parameters, equation, source and evidence, and what it adds to the
//! mechanics, to the sensors or to the dependence on the trial. The same value switches it on in the virtual wrist, in the
//! fit and in the diagnosis. To add a mechanism, write its file and add one line to the list below;
//! `docs/how-to/add-a-mechanism.md` has a worked example.

#[macro_use]
mod catalogue;
mod active;
mod channel_errors;
mod covariates;
mod mechanism;
mod parameter;
mod states;

pub use active::ActiveMechanisms;
pub use channel_errors::ChannelErrors;
pub use covariates::{Covariates, DataRequirement};
pub use mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
pub use parameter::MechanismParameter;
pub use states::OwnStates;

use super::mechanics::{Context, Torques};
use super::plant::{Lever, Plant};
use crate::number::Number;

catalogue! {
    joint_damping::JointDamping,
    joint_friction::JointFriction,
    interface_hardening::InterfaceHardening,
    interface_slack::InterfaceSlack,
    stretch_reflex::StretchReflex,
    stress_relaxation::StressRelaxation,
    post_yield_viscosity::PostYieldViscosity,
    gradual_yield::GradualYield,
    stiffening::Stiffening,
    timed_yield::TimedYield,
    lever_inertia::LeverInertia,
    lever_stiffness::LeverStiffness,
    lever_damping::LeverDamping,
    servo_following::ServoFollowing,
    channel_skew::ChannelSkew,
    torque_lag::TorqueLag,
    torque_gain::TorqueGain,
    angle_gain::AngleGain,
    torque_saturation::TorqueSaturation,
    mains_hum::MainsHum,
    torque_drift::TorqueDrift,
    fatigue::Fatigue,
    thixotropy::Thixotropy,
    cocontraction::Cocontraction,
    outlier_trial::OutlierTrial,
    activation_scaling::ActivationScaling,
    #[cfg(test)] // The worked example of the docs.
    end_range_stiffness::EndRangeStiffness,
}

impl MechanismKind {
    /// The mechanism with this identifier.
    pub fn from_id(id: &str) -> Option<Self> {
        CATALOGUE.iter().copied().find(|kind| kind.id() == id)
    }

    /// The first mechanism of the catalogue that shows in `evidence`.
    pub fn shown_in(evidence: EvidenceSource) -> Option<Self> {
        CATALOGUE.iter().copied().find(|kind| kind.evidence() == evidence)
    }
}
