//! The rig that a new session is asked to run on: read, and held against the protocol, before a bus is opened.

use std::path::Path;

use crate::protocol::ValidProtocol;
use crate::rig::can::DryRun;
use crate::rig::can::file::ValidRigFile;
use crate::rig::virtual_wrist::{RigFile, Setup};
use crate::rig::{StreamSettings, unmeasured_channels};
use crate::wrist::Lever;

use super::failure::Failure;
use super::session_rig::is_can_rig_file;

/// A rig file that goes with a protocol.
pub enum RequestedRig {
    /// The virtual wrist.
    Virtual(Box<Setup>),
    /// A motor on a CAN bus, and the movements of the protocol inside its limits.
    Can(Box<(ValidRigFile, DryRun)>),
}

impl RequestedRig {
    /// The rig in `file`, without one the virtual wrist, for sessions of `protocol`. Nothing is sent on a bus.
    ///
    /// # Errors
    /// If the file cannot be used, or the rig cannot run the protocol.
    pub fn read(file: Option<&Path>, protocol: &ValidProtocol) -> Result<Self, Failure> {
        if let Some(file) = file.filter(|file| is_can_rig_file(file)) {
            let rig = ValidRigFile::read(file)?;
            let dry_run = DryRun::of(protocol, &rig)?;
            return Ok(Self::Can(Box::new((rig, dry_run))));
        }
        let RigFile::Virtual(setup) = file.map(RigFile::read).transpose()?.unwrap_or_default();
        let missing = unmeasured_channels(protocol, [setup.emg; 2]);
        if !missing.is_empty() {
            return Err(Failure::Usage(format!(
                "the virtual rig measures no EMG (field emg): {}; measure it, or change the protocol",
                missing.join("; ")
            )));
        }
        Ok(Self::Virtual(Box::new(setup)))
    }

    /// Streams that its rig file has recorded with a session.
    pub fn streams(&self) -> &[StreamSettings] {
        match self {
            Self::Virtual(setup) => &setup.streams,
            Self::Can(motor) => &motor.0.streams,
        }
    }

    /// Lever between motor and handle; `None` for a rigid one.
    pub fn lever(&self) -> Option<Lever> {
        match self {
            Self::Virtual(setup) => setup.lever,
            Self::Can(motor) => motor.0.lever,
        }
    }
}
