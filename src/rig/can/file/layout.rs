//! Sizes and identifiers of the frames of a rig file.

use super::rig_file::{CanRigFile, Carried, FrameLayout, MotorSettings};

impl CanRigFile {
    /// Bytes of something carried.
    pub fn bytes(&self, carried: Carried) -> usize {
        let signals = &self.signals;
        match carried {
            Carried::Statusword => 2,
            Carried::Position => 4,
            Carried::Torque => signals.torque.kind.bytes() * signals.torque.samples,
            Carried::PositionSteps => {
                signals.position_steps.map_or(0, |steps| steps.kind.bytes() * steps.samples)
            }
            Carried::Counter => signals.counter.map_or(0, |counter| counter.kind.bytes()),
            Carried::EmgFcr => signals.emg_fcr.map_or(0, |emg| emg.kind.bytes()),
            Carried::EmgEcr => signals.emg_ecr.map_or(0, |emg| emg.kind.bytes()),
        }
    }

    /// Bytes of a frame.
    pub fn frame_bytes(&self, frame: &FrameLayout) -> usize {
        frame.carries.iter().map(|carried| self.bytes(*carried)).sum()
    }

    /// Bytes of the frame with the target.
    pub fn target_bytes(&self) -> usize {
        match self.motor {
            MotorSettings::Cia402(_) => 6 + self.display.map_or(0, |display| display.kind.bytes()),
            MotorSettings::Cansimple(_) | MotorSettings::Mit(_) => 8,
        }
    }
}

impl FrameLayout {
    /// Its identifier: the one given, or that of the pre-defined connection set.
    pub fn identifier(&self) -> Option<u16> {
        self.id.or_else(|| {
            let (node, number) = (u16::from(self.node?), u16::from(self.tpdo?));
            (1..=4).contains(&number).then(|| 0x180 + 0x100 * (number - 1) + node)
        })
    }
}
