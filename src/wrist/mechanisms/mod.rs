//! The catalogue of mechanisms: what the base model may lack.
//!
//! A mechanism is one file that declares its name, parameters, equation, source and evidence, and what it adds to the
//! mechanics, to the sensors or to the dependence on the trial. The same value switches it on in the virtual wrist, in the
//! fit and in the diagnosis. To add a mechanism, write its file and add one line to the list below;
//! `docs/how-to/add-a-mechanism.md` has a worked example.
//!
//! A free law is an unknown function at a place of the model. It is a [`MechanismKind`] too, but it is not in the catalogue.

#[macro_use]
mod catalogue;
mod active;
mod channel_errors;
mod covariates;
mod free_law;
mod free_law_kind;
mod mechanism;
mod parameter;
mod place;
mod prior;
mod spline;
mod states;

pub use active::ActiveMechanisms;
pub use channel_errors::ChannelErrors;
pub use covariates::{Covariates, DataRequirement};
pub use free_law::FreeLaw;
pub use free_law_kind::FreeLawKind;
pub use mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext, SIZE_DRIFT_SD};
pub use parameter::MechanismParameter;
pub use place::{Argument, LawSpace, Place};
pub use prior::Prior;
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

/// Every free law.
pub const FREE_LAWS: &[MechanismKind] = &[
    MechanismKind::Free(FreeLawKind::JointAngle),
    MechanismKind::Free(FreeLawKind::JointSpeed),
    MechanismKind::Free(FreeLawKind::JointAngleBeyondYield),
    MechanismKind::Free(FreeLawKind::JointTime),
    MechanismKind::Free(FreeLawKind::JointPastSpeed),
    MechanismKind::Free(FreeLawKind::InterfaceDeflection),
    MechanismKind::Free(FreeLawKind::InterfaceSpeed),
    MechanismKind::Free(FreeLawKind::HandleAngle),
    MechanismKind::Free(FreeLawKind::HandleSpeed),
    MechanismKind::Free(FreeLawKind::TorqueChannelTorque),
    MechanismKind::Free(FreeLawKind::TorqueChannelTime),
    MechanismKind::Free(FreeLawKind::TorqueChannelPastTorque),
    MechanismKind::Free(FreeLawKind::AngleChannelAngle),
];

impl MechanismKind {
    /// The mechanism or free law with this identifier.
    pub fn from_id(id: &str) -> Option<Self> {
        CATALOGUE.iter().chain(FREE_LAWS).copied().find(|kind| kind.id() == id)
    }

    /// The first mechanism of the catalogue that shows in `evidence`.
    pub fn shown_in(evidence: EvidenceSource) -> Option<Self> {
        CATALOGUE.iter().copied().find(|kind| kind.evidence() == evidence)
    }

    /// Whether it is a free law, which is not in the catalogue.
    pub fn is_free_law(self) -> bool {
        matches!(self, Self::Free(_))
    }

    /// Place, argument and coefficients of a free law; `None` for a mechanism of the catalogue.
    pub fn free_law(self) -> Option<FreeLaw> {
        match self {
            Self::Free(kind) => Some(kind.law()),
            _ => None,
        }
    }
}
