//! A torque at the wrist that opposes motion and hardly depends on its speed.

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::mechanics::{Context, Torques};

/// Longest step of an integration, in the times in which the motor goes through the travel over which the friction builds up: Runge-Kutta steps diverge from 2.8 on, where
/// the joint may turn 1.8 times as fast as the motor. The torque is small, so that stability asks for more steps than accuracy.
const LONGEST_STEP_OF_BRISTLES: f64 = 1.5;

/// Friction of the wrist joint, as a Dahl model.
pub struct JointFriction;

impl Mechanism for JointFriction {
    const ID: &'static str = "joint_friction";
    const TITLE: &'static str = "Coulomb-like friction at the wrist";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new(
            "level_nm",
            "friction torque in motion",
            (0.0, 1.0),
            Some(0.0),
            0.05,
            Prior::HalfNormal { sd: 0.1 },
        ),
        MechanismParameter::new(
            "presliding_rad",
            "travel over which it builds up",
            (0.0002, 0.005),
            None,
            0.0005,
            Prior::LogNormal { median: 0.0005, log_sd: 0.7 },
        ),
    ];
    const EQUATION: &'static str = "T_j += z, dz/dt = (level theta_j' - z |theta_j'|) / presliding";
    const SOURCE: &'static str = "Dahl 1968: dz/dt = (level w - z |w|) / presliding; the bristles' torque z tends to the level in motion";
    const PRIOR_SOURCE: &'static str = "\
        Cartilage and tendon sheaths hold a few per cent of a torque of 1 to 2 N m (assumed); breakaway \
        travel of dry contacts, some 0.1 mm at a radius of a few cm, within a factor of two (assumed)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Joint, argument: Some(Argument::Speed), sd: 0.4 };
    const ADDS_TORQUE: bool = true;
    const STATES: usize = 1;

    fn longest_step_s(p: &[f64], speed_rad_s: f64) -> f64 {
        LONGEST_STEP_OF_BRISTLES * p[1] / speed_rad_s
    }

    #[inline(always)]
    fn add_torques<T: Number>(
        p: &[T],
        context: &Context<'_, T>,
        states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        rates: &mut [T],
    ) {
        let (speed, bristles) = (context.state.omega_j, states.now(0));
        let (forward, backward) = (speed.positive_part(), (-speed).positive_part());
        rates[0] = (forward * (p[0] - bristles) - backward * (p[0] + bristles)) / p[1];
        torques.joint = torques.joint + bristles;
    }
}
