//! The virtual rig: servo, lever and sensors.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::emg::amplifier_band_hz;
use super::mechanism_list::MechanismList;
use crate::json_file::{self, JsonFileError};
use crate::rig::{
    ChannelDetails, ChannelFilter, RecordedChannel, RecordedSignals, StreamSettings, stream_mistakes,
};
use crate::wrist::{FurtherChannel, Lever};

/// The virtual rig. Values that no source gives are marked as assumed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Setup {
    /// The lever between motor and handle; `null` for a rigid one. Assumed: 0.0016 kg m2, 0.4 N m s/rad, 900 N m/rad.
    pub lever: Option<Lever>,
    /// Stiffness of the servo, N m/rad; 1000 in section 2.1 of the paper.
    pub servo_stiffness_nm_per_rad: f64,
    /// Natural frequency of the servo without a load, Hz. Assumed: 80.
    pub servo_bandwidth_hz: f64,
    /// Damping ratio of the servo. Assumed: 1.
    pub servo_damping_ratio: f64,
    /// Coulomb friction of the handle's bearing, N m, in trials and rig trials. Assumed: none.
    #[serde(skip_serializing_if = "is_zero")]
    pub bearing_friction_nm: f64,
    /// Counts of the encoder in a revolution. Assumed: 2^17.
    pub encoder_counts_per_revolution: f64,
    /// Noise of the strain gauges, N m (standard deviation, white). Assumed: 0.01.
    pub gauge_noise_nm: f64,
    /// What the gauges show at no torque, N m. Assumed: 0.03.
    pub gauge_offset_nm: f64,
    /// One step of the torque's converter, N m. Assumed: 0.0005.
    pub gauge_step_nm: f64,
    /// Whether the rig measures the EMG of flexor and extensor; without it, records have no EMG. Assumed: yes.
    #[serde(skip_serializing_if = "is_true")]
    pub emg: bool,
    /// One step of the EMG's converter, fraction of nominal MVC. Assumed: 0.0001.
    pub emg_step_mvc: f64,
    /// Counts of an encoder at the handle in a revolution; without it, the rig has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub handle_encoder_counts_per_revolution: Option<f64>,
    /// Noise of an accelerometer at the handle, rad/s2 (standard deviation, white); without it, the rig has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accelerometer_noise_rad_s2: Option<f64>,
    /// Noise of a load cell at the hand, N m (standard deviation, white); without it, the rig has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hand_load_cell_noise_nm: Option<f64>,
    /// Counts of an encoder at the joint itself in a revolution; without it, the rig has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_encoder_counts_per_revolution: Option<f64>,
    /// Streams of Lab Streaming Layer, such as that of an EMG amplifier, that are recorded with a session in real time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub streams: Vec<StreamSettings>,
    /// What this rig does beyond Eq. 3-7, from the catalogue of mechanisms.
    pub mechanisms: MechanismList,
}

// By reference, as serde asks for it.
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

// By reference, as serde asks for it.
fn is_true(value: &bool) -> bool {
    *value
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            lever: Some(Lever {
                inertia_kg_m2: 0.0016,
                damping_nm_s_per_rad: 0.4,
                stiffness_nm_per_rad: 900.0,
            }),
            servo_stiffness_nm_per_rad: 1000.0,
            servo_bandwidth_hz: 80.0,
            servo_damping_ratio: 1.0,
            bearing_friction_nm: 0.0,
            encoder_counts_per_revolution: 131_072.0,
            gauge_noise_nm: 0.01,
            gauge_offset_nm: 0.03,
            gauge_step_nm: 0.0005,
            emg: true,
            emg_step_mvc: 0.0001,
            handle_encoder_counts_per_revolution: None,
            accelerometer_noise_rad_s2: None,
            hand_load_cell_noise_nm: None,
            joint_encoder_counts_per_revolution: None,
            streams: Vec::new(),
            mechanisms: MechanismList::default(),
        }
    }
}

impl Setup {
    /// What is known of the recorded channels. Delays are left out: a virtual rig may have one that is to be found.
    pub fn recorded_signals(&self, sample_rate_hz: f64) -> RecordedSignals {
        let [high_pass_hz, low_pass_hz] = amplifier_band_hz(sample_rate_hz);
        let emg_filter = vec![
            ChannelFilter::HighPass { cutoff_hz: high_pass_hz, order: Some(2) },
            ChannelFilter::LowPass { cutoff_hz: low_pass_hz, order: Some(2) },
        ];
        let channel = |unit: &str, filter: Vec<ChannelFilter>, origin: &str| {
            let details = ChannelDetails {
                filter: Some(filter),
                origin: Some(origin.to_owned()),
                ..ChannelDetails::default()
            };
            RecordedChannel::new(sample_rate_hz, unit, details)
        };
        let mut channels = BTreeMap::from([
            ("theta_m_rad".to_owned(), channel("rad", Vec::new(), "virtual encoder")),
            ("torque_l_nm".to_owned(), channel("N m", Vec::new(), "virtual strain gauges")),
        ]);
        if self.emg {
            for column in ["emg_fcr_mvc", "emg_ecr_mvc"] {
                channels.insert(column.to_owned(), channel("MVC", emg_filter.clone(), "virtual amplifier"));
            }
        }
        for (further, is_there) in [
            (FurtherChannel::HandleAngle, self.handle_encoder_counts_per_revolution.is_some()),
            (FurtherChannel::HandleAcceleration, self.accelerometer_noise_rad_s2.is_some()),
            (FurtherChannel::HandTorque, self.hand_load_cell_noise_nm.is_some()),
            (FurtherChannel::JointAngle, self.joint_encoder_counts_per_revolution.is_some()),
        ] {
            if is_there {
                let own = channel(further.unit(), Vec::new(), "virtual sensor");
                channels.insert(further.column().to_owned(), own);
            }
        }
        RecordedSignals { recorded_filter: None, channels }
    }
}

/// A rig as its file describes it: `{ "kind": "virtual", ... }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum RigFile {
    /// The virtual wrist.
    Virtual(Setup),
}

impl Default for RigFile {
    fn default() -> Self {
        Self::Virtual(Setup::default())
    }
}

/// What the file should be, for messages.
const VIRTUAL_RIG: &str = "the file of a virtual rig (see ramphold schema rig)";

/// Why a file does not describe a rig.
#[derive(Debug, thiserror::Error)]
pub enum RigFileError {
    /// The file cannot be read, is not JSON, or has a field that is unknown, missing or of the wrong type.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// A value that no rig has.
    #[error("{}, field {field}: {found}; expected {expected}", .file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// Path of the field.
        field: &'static str,
        /// The value.
        found: f64,
        /// What it can be.
        expected: &'static str,
    },
    /// A stream that cannot be recorded.
    #[error("{}, field {field}: expected {expected}", .file.display())]
    Stream {
        /// The file.
        file: PathBuf,
        /// Path of the field.
        field: String,
        /// What it can be.
        expected: String,
    },
}

impl RigFile {
    /// Reads the file of a rig.
    pub fn read(file: &Path) -> Result<Self, RigFileError> {
        Self::parse(&json_file::read_text(file, VIRTUAL_RIG)?, file)
    }

    /// Parses and checks the text of the file of a virtual rig; `file` is its name for messages.
    pub fn parse(text: &str, file: &Path) -> Result<Self, RigFileError> {
        let rig: Self = json_file::parse(text, file, VIRTUAL_RIG)?;
        let Self::Virtual(setup) = &rig;
        setup.check(file)?;
        Ok(rig)
    }

    /// Whether there is no motor that could hurt anyone.
    pub fn is_virtual(&self) -> bool {
        match self {
            Self::Virtual(_) => true,
        }
    }
}

impl Setup {
    fn check(&self, file: &Path) -> Result<(), RigFileError> {
        let lever = self.lever.map_or([1.0, 0.0, 1.0], |lever| {
            [lever.inertia_kg_m2, lever.damping_nm_s_per_rad, lever.stiffness_nm_per_rad]
        });
        let positive = [
            ("lever.inertia_kg_m2", lever[0]),
            ("lever.stiffness_nm_per_rad", lever[2]),
            ("servo_stiffness_nm_per_rad", self.servo_stiffness_nm_per_rad),
            ("servo_bandwidth_hz", self.servo_bandwidth_hz),
            ("servo_damping_ratio", self.servo_damping_ratio),
            ("encoder_counts_per_revolution", self.encoder_counts_per_revolution),
            (
                "handle_encoder_counts_per_revolution",
                self.handle_encoder_counts_per_revolution.unwrap_or(1.0),
            ),
            ("joint_encoder_counts_per_revolution", self.joint_encoder_counts_per_revolution.unwrap_or(1.0)),
        ];
        let not_negative = [
            ("lever.damping_nm_s_per_rad", lever[1]),
            ("bearing_friction_nm", self.bearing_friction_nm),
            ("gauge_noise_nm", self.gauge_noise_nm),
            ("gauge_step_nm", self.gauge_step_nm),
            ("emg_step_mvc", self.emg_step_mvc),
            ("accelerometer_noise_rad_s2", self.accelerometer_noise_rad_s2.unwrap_or(0.0)),
            ("hand_load_cell_noise_nm", self.hand_load_cell_noise_nm.unwrap_or(0.0)),
        ];
        let refuse = |field, found, expected| {
            Err(RigFileError::Value { file: file.to_owned(), field, found, expected })
        };
        for (field, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(field, value, "a number above 0");
            }
        }
        for (field, value) in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return refuse(field, value, "a number from 0 up");
            }
        }
        if !self.gauge_offset_nm.is_finite() {
            return refuse("gauge_offset_nm", self.gauge_offset_nm, "a number");
        }
        match stream_mistakes(&self.streams).into_iter().next() {
            Some((field, expected)) => Err(RigFileError::Stream { file: file.to_owned(), field, expected }),
            None => Ok(()),
        }
    }
}
