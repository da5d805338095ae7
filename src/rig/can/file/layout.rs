//! Sizes and identifiers of the frames of a rig file.

use super::motors::{MitMotor, MotorSettings};
use super::rig_file::CanRigFile;
use super::signals::{Carried, FrameLayout};
use crate::rig::{RecordedChannel, RecordedSignals};

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
            Carried::EmgFcr => signals.emg_fcr.map_or(0, |emg| emg.kind.bytes() * emg.samples),
            Carried::EmgEcr => signals.emg_ecr.map_or(0, |emg| emg.kind.bytes() * emg.samples),
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

impl CanRigFile {
    /// What is known of the recorded channels. EMG that comes once a period has the rate of the periods.
    pub fn recorded_signals(&self) -> RecordedSignals {
        let (signals, known) = (&self.signals, &self.channels);
        let rate_hz = |samples: usize| samples as f64 * 1e6 / f64::from(self.period_us);
        let sampled_hz = rate_hz(signals.torque.samples);
        let moved = [
            ("theta_m_rad", sampled_hz, "rad", &known.position),
            ("torque_l_nm", sampled_hz, "N m", &known.torque),
        ];
        let muscles = [
            ("emg_fcr_mvc", signals.emg_fcr, &known.emg_fcr),
            ("emg_ecr_mvc", signals.emg_ecr, &known.emg_ecr),
        ];
        let measured = muscles
            .into_iter()
            .filter_map(|(column, emg, details)| Some((column, rate_hz(emg?.samples), "MVC", details)));
        let channels = moved.into_iter().chain(measured).map(|(column, rate_hz, unit, details)| {
            (column.to_owned(), RecordedChannel::new(rate_hz, unit, details.clone()))
        });
        RecordedSignals { recorded_filter: self.recorded_filter, channels: channels.collect() }
    }
}

impl MitMotor {
    /// P_MAX: positions of the output go from minus this to this, rad. All models of the table have the same.
    pub fn position_max_rad(&self) -> f64 {
        self.ranges.and_then(|ranges| ranges.position_max_rad).unwrap_or(12.5)
    }

    /// The smallest difference of two angles of the handle that its 16 bits can tell, rad.
    pub fn angle_step_rad(&self) -> f64 {
        2.0 * self.position_max_rad() / 65_535.0 / self.gear_ratio.abs()
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
