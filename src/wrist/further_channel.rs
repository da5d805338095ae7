//! Channels that a session may have besides motor angle and lever torque.

use crate::number::Number;

/// A channel besides motor angle and torque in the lever.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FurtherChannel {
    /// Handle angle theta_l, from an encoder at the handle.
    HandleAngle,
    /// Angular acceleration of the handle, from an accelerometer on it.
    HandleAcceleration,
    /// Torque T_h between handle and hand (Eq. 6), from a load cell at the hand.
    HandTorque,
    /// Joint angle theta_j.
    JointAngle,
}

impl FurtherChannel {
    /// Number of channels.
    pub const COUNT: usize = 4;

    /// All channels, in the order of their columns.
    pub const ALL: [Self; Self::COUNT] =
        [Self::HandleAngle, Self::HandleAcceleration, Self::HandTorque, Self::JointAngle];

    /// Name of the column in the record of a trial.
    pub fn column(self) -> &'static str {
        match self {
            Self::HandleAngle => "theta_l_rad",
            Self::HandleAcceleration => "alpha_l_rad_s2",
            Self::HandTorque => "torque_h_nm",
            Self::JointAngle => "theta_j_rad",
        }
    }

    /// Symbol of the quantity, without its unit.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::HandleAngle => "theta_l",
            Self::HandleAcceleration => "alpha_l",
            Self::HandTorque => "torque_h",
            Self::JointAngle => "theta_j",
        }
    }

    /// Unit of the column, for readers.
    pub fn unit(self) -> &'static str {
        match self {
            Self::HandleAngle | Self::JointAngle => "rad",
            Self::HandleAcceleration => "rad/s2",
            Self::HandTorque => "N m",
        }
    }

    /// What is measured, for readers.
    pub fn title(self) -> &'static str {
        match self {
            Self::HandleAngle => "angle of the handle",
            Self::HandleAcceleration => "angular acceleration of the handle",
            Self::HandTorque => "torque at the hand",
            Self::JointAngle => "angle of the joint",
        }
    }

    /// Whether the channel is an angle, which an encoder records in steps.
    pub fn is_angle(self) -> bool {
        matches!(self, Self::HandleAngle | Self::JointAngle)
    }
}

/// A further channel with the factor by which its values become torques, so that one trial has one vector of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaledChannel {
    /// The channel.
    pub channel: FurtherChannel,
    /// Factor from the channel's unit to N m.
    pub nm_per_unit: f64,
}

/// What the further channels show at one sample, as changes from the steady state before the ramp.
#[derive(Debug, Clone, Copy)]
pub struct FurtherValues<T> {
    /// theta_l, rad.
    pub theta_l: T,
    /// Angular acceleration of the handle, rad/s2.
    pub alpha_l: T,
    /// T_h, N m.
    pub torque_h: T,
    /// theta_j, rad.
    pub theta_j: T,
}

impl<T: Number> FurtherValues<T> {
    /// No change from the steady state.
    #[inline(always)]
    pub fn at_rest() -> Self {
        let zero = T::constant(0.0);
        Self { theta_l: zero, alpha_l: zero, torque_h: zero, theta_j: zero }
    }

    /// The value of one channel, in its unit.
    #[inline(always)]
    pub fn of(&self, channel: FurtherChannel) -> T {
        match channel {
            FurtherChannel::HandleAngle => self.theta_l,
            FurtherChannel::HandleAcceleration => self.alpha_l,
            FurtherChannel::HandTorque => self.torque_h,
            FurtherChannel::JointAngle => self.theta_j,
        }
    }
}
