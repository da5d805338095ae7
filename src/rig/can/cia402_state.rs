//! The power drive state machine of CiA 402: states, statusword, controlword and modes of operation.

use std::fmt;

use serde::Serialize;

/// States of the power drive state machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveState {
    /// NOT READY TO SWITCH ON.
    NotReady,
    /// SWITCH ON DISABLED.
    SwitchOnDisabled,
    /// READY TO SWITCH ON.
    ReadyToSwitchOn,
    /// SWITCHED ON.
    SwitchedOn,
    /// OPERATION ENABLED.
    OperationEnabled,
    /// QUICK STOP ACTIVE.
    QuickStopActive,
    /// FAULT REACTION ACTIVE.
    FaultReactionActive,
    /// FAULT.
    Fault,
}

/// The statusword, 6041h.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Statusword(pub u16);

impl Statusword {
    /// The state in bits 0 to 3, 5 and 6. A pattern that the standard does not know is not ready.
    pub fn state(self) -> DriveState {
        match self.0 & 0x6F {
            0x40 | 0x60 => DriveState::SwitchOnDisabled,
            0x21 => DriveState::ReadyToSwitchOn,
            0x23 => DriveState::SwitchedOn,
            0x27 => DriveState::OperationEnabled,
            0x07 => DriveState::QuickStopActive,
            0x0F | 0x2F => DriveState::FaultReactionActive,
            0x08 | 0x28 => DriveState::Fault,
            _ => DriveState::NotReady,
        }
    }

    /// Bit 9, remote: the drive does what the controlword says. Some drives never set it.
    pub fn is_remote(self) -> bool {
        self.0 & 0x0200 != 0
    }

    /// Bit 10: target reached, or homing over.
    pub fn target_reached(self) -> bool {
        self.0 & 0x0400 != 0
    }

    /// Bit 11: a limit of the drive's holds the motion back.
    pub fn internal_limit(self) -> bool {
        self.0 & 0x0800 != 0
    }

    /// Bit 12: home found; the drive follows the command.
    pub fn mode_bit_12(self) -> bool {
        self.0 & 0x1000 != 0
    }

    /// Bit 13: homing error; following error.
    pub fn mode_bit_13(self) -> bool {
        self.0 & 0x2000 != 0
    }
}

/// The controlword, 6040h.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Controlword(pub u16);

impl Controlword {
    /// No power.
    pub const DISABLE_VOLTAGE: Self = Self(0x00);
    /// Stop on the quick-stop ramp.
    pub const QUICK_STOP: Self = Self(0x02);
    /// To READY TO SWITCH ON.
    pub const SHUTDOWN: Self = Self(0x06);
    /// To SWITCHED ON.
    pub const SWITCH_ON: Self = Self(0x07);
    /// To OPERATION ENABLED.
    pub const ENABLE: Self = Self(0x0F);
    /// Enabled, with bit 4: start homing.
    pub const ENABLE_AND_GO: Self = Self(0x1F);
    /// Fault reset, on its rising edge.
    pub const FAULT_RESET: Self = Self(0x80);
}

/// Modes of operation, 6060h.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Homing.
    Homing = 6,
    /// Cyclic synchronous position.
    CyclicSynchronousPosition = 8,
}

/// What to write to come one state nearer to OPERATION ENABLED; `None` where only waiting or a fault reset helps.
pub fn next_controlword(state: DriveState) -> Option<Controlword> {
    match state {
        DriveState::SwitchOnDisabled => Some(Controlword::SHUTDOWN),
        DriveState::ReadyToSwitchOn => Some(Controlword::SWITCH_ON),
        DriveState::SwitchedOn | DriveState::OperationEnabled => Some(Controlword::ENABLE),
        // Left through SWITCH ON DISABLED, never back into motion.
        DriveState::QuickStopActive => Some(Controlword::DISABLE_VOLTAGE),
        DriveState::NotReady | DriveState::FaultReactionActive | DriveState::Fault => None,
    }
}

impl DriveState {
    /// Whether the motor has torque in a state in which the drive must do what the controlword says.
    pub fn must_obey(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::QuickStopActive)
    }

    /// Whether the motor may have torque.
    pub fn has_power(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive)
    }
}

impl fmt::Display for DriveState {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::NotReady => "NOT READY TO SWITCH ON",
            Self::SwitchOnDisabled => "SWITCH ON DISABLED",
            Self::ReadyToSwitchOn => "READY TO SWITCH ON",
            Self::SwitchedOn => "SWITCHED ON",
            Self::OperationEnabled => "OPERATION ENABLED",
            Self::QuickStopActive => "QUICK STOP ACTIVE",
            Self::FaultReactionActive => "FAULT REACTION ACTIVE",
            Self::Fault => "FAULT",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table of CiA 402, with bits that do not matter set and cleared.
    #[test]
    fn every_state_is_read_from_its_bits_whatever_the_others_are() {
        let table = [
            (0x00, DriveState::NotReady),
            (0x40, DriveState::SwitchOnDisabled),
            (0x21, DriveState::ReadyToSwitchOn),
            (0x23, DriveState::SwitchedOn),
            (0x27, DriveState::OperationEnabled),
            (0x07, DriveState::QuickStopActive),
            (0x0F, DriveState::FaultReactionActive),
            (0x08, DriveState::Fault),
        ];
        for (bits, state) in table {
            for others in [0x0000, 0xFF90, 0x0010, 0x0200] {
                assert_eq!(Statusword(bits | others).state(), state);
            }
        }
    }

    #[test]
    fn the_way_to_power_never_skips_a_state_and_ends_at_a_fault() {
        assert_eq!(next_controlword(DriveState::SwitchOnDisabled), Some(Controlword(6)));
        assert_eq!(next_controlword(DriveState::ReadyToSwitchOn), Some(Controlword(7)));
        assert_eq!(next_controlword(DriveState::SwitchedOn), Some(Controlword(15)));
        assert_eq!(next_controlword(DriveState::Fault), None);
        assert_eq!(next_controlword(DriveState::FaultReactionActive), None);
        assert!(DriveState::QuickStopActive.has_power() && !DriveState::Fault.has_power());
    }
}
