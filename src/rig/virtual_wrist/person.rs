//! The virtual person: what the muscle is like, how it is held steady, how it reacts.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mechanism_list::MechanismList;
use crate::files::is_single_name;
use crate::json_file::{self, JsonFileError};
use crate::random::Stream;

/// Format and version of the files of virtual persons.
pub const PERSON_FORMAT: &str = "ramphold-person/1";

/// A virtual person. Unless a field says where its default is from, it is assumed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Person {
    /// Format and version: `ramphold-person/1`.
    pub format: String,
    /// Identifier, such as `S01`.
    pub id: String,
    /// I_j, kg m2. Assumed: 0.005.
    #[serde(default = "defaults::joint_inertia")]
    pub joint_inertia_kg_m2: f64,
    /// b_h, N m s/rad. Assumed: 1.2.
    #[serde(default = "defaults::interface_damping")]
    pub interface_damping_nm_s_per_rad: f64,
    /// k_h, N m/rad. Falls slightly with velocity (Fig. 5 of the paper); the numbers are assumed: 300, -10 per rad/s.
    #[serde(default = "defaults::interface_stiffness")]
    pub interface_stiffness_nm_per_rad: Surface,
    /// k_srs, N m/rad: 15 at 0.9 N m to 23 at 2.1 N m at any velocity (sections 3.2 and 3.3 of the paper).
    #[serde(default = "defaults::short_range_stiffness")]
    pub short_range_stiffness_nm_per_rad: Surface,
    /// k_dec, N m/rad: rises with velocity and torque (sections 3.2 and 3.3); the numbers are assumed: 9, +1.6 per rad/s,
    /// +3 per N m.
    #[serde(default = "defaults::stiffness_decrement")]
    pub stiffness_decrement_nm_per_rad: Surface,
    /// x_e, rad: 0.025 at 1.3 rad/s to 0.065 at 3.25 rad/s, lower at higher torque (sections 3.2 and 3.3); the fall with
    /// torque is assumed: -0.001 per N m about 1.5 N m.
    #[serde(default = "defaults::elastic_limit")]
    pub elastic_limit_rad: Surface,
    /// How k_srs, k_dec and x_e vary from trial to trial.
    #[serde(default)]
    pub spread: Spread,
    /// How the torque is held.
    #[serde(default)]
    pub voluntary: VoluntaryParameters,
    /// The stretch reflex, which everybody has.
    #[serde(default)]
    pub reflex: Reflex,
    /// What the muscles do and show.
    #[serde(default)]
    pub muscles: Muscles,
    /// What this wrist does beyond Eq. 1-7, from the catalogue of mechanisms.
    #[serde(default)]
    pub mechanisms: MechanismList,
}

/// A parameter as a plane over velocity and torque, each without its sign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Surface {
    /// Its value at 1.3 rad/s and 0.9 N m.
    pub at_lowest: f64,
    /// Its rise with velocity, per rad/s.
    pub per_rad_s: f64,
    /// Its rise with torque, per N m.
    pub per_nm: f64,
}

impl Surface {
    /// The value at a velocity and a torque of either sign.
    pub fn at(&self, velocity_rad_s: f64, torque_nm: f64) -> f64 {
        self.at_lowest + self.per_rad_s * (velocity_rad_s.abs() - 1.3) + self.per_nm * (torque_nm.abs() - 0.9)
    }
}

/// Variation from trial to trial: standard deviations as fractions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Spread {
    /// Of k_srs. Assumed: 0.025.
    pub short_range_stiffness: f64,
    /// Of k_dec. Assumed: 0.025.
    pub stiffness_decrement: f64,
    /// Of x_e. Assumed: 0.025.
    pub elastic_limit: f64,
    /// Of the flexor's EMG at the same torque. Assumed: 0.05.
    pub flexor_emg: f64,
    /// Of the antagonist's activity. Assumed: 0.2.
    pub cocontraction: f64,
}

/// How the subject holds a torque.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(rename = "Voluntary")]
pub struct VoluntaryParameters {
    /// From seeing to acting, s. Assumed: 0.2.
    pub reaction_s: f64,
    /// Time constant of the rise and fall of the torque, s. Assumed: 0.08.
    pub rise_s: f64,
    /// Spread of the first attempt at a target, as a fraction of it. Assumed: 0.05.
    pub first_error: f64,
    /// How fast an error that is seen is corrected, 1/s. Assumed: 1.5.
    pub correction_per_s: f64,
    /// Wander below 2.5 Hz, fraction of the torque. Assumed: 0.006.
    pub wander: f64,
    /// Tremor at 8.5-10.5 Hz, fraction of the torque. Assumed: 0.003.
    pub tremor: f64,
}

/// Torque and EMG that a stretch brings about after its latency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Reflex {
    /// From the onset to the torque, s; after the window of 40 ms. Assumed: 0.048.
    pub torque_latency_s: f64,
    /// From the onset to the EMG, s. Assumed: 0.035.
    pub emg_latency_s: f64,
    /// From the latency to the peak, s. Assumed: 0.03.
    pub rise_s: f64,
    /// Peak torque, N m per rad/s and per N m of voluntary torque. Assumed: 0.25.
    pub gain_s_per_rad: f64,
    /// Peak EMG, fraction of MVC per rad/s. Assumed: 0.1.
    pub emg_mvc_s_per_rad: f64,
}

/// Strength and EMG.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Muscles {
    /// Greatest torque in flexion, N m. Assumed: 12.
    pub flexion_nm: f64,
    /// Greatest torque in extension, N m. Assumed: 8.
    pub extension_nm: f64,
    /// Activity of the antagonist as a fraction of that of the agonist. Assumed: 0.15.
    pub cocontraction: f64,
    /// EMG at rest, fraction of MVC. Assumed: 0.004.
    pub emg_at_rest_mvc: f64,
}

mod defaults {
    use super::Surface;

    pub fn joint_inertia() -> f64 {
        0.005
    }
    pub fn interface_damping() -> f64 {
        1.2
    }
    pub fn interface_stiffness() -> Surface {
        Surface { at_lowest: 300.0, per_rad_s: -10.0, per_nm: 0.0 }
    }
    pub fn short_range_stiffness() -> Surface {
        Surface { at_lowest: 15.0, per_rad_s: 0.0, per_nm: 8.0 / 1.2 }
    }
    pub fn stiffness_decrement() -> Surface {
        Surface { at_lowest: 9.0, per_rad_s: 1.6, per_nm: 3.0 }
    }
    pub fn elastic_limit() -> Surface {
        Surface { at_lowest: 0.0256, per_rad_s: 0.04 / 1.95, per_nm: -0.001 }
    }
}

impl Default for Spread {
    fn default() -> Self {
        Self {
            short_range_stiffness: 0.025,
            stiffness_decrement: 0.025,
            elastic_limit: 0.025,
            flexor_emg: 0.05,
            cocontraction: 0.2,
        }
    }
}

impl Default for VoluntaryParameters {
    fn default() -> Self {
        Self {
            reaction_s: 0.2,
            rise_s: 0.08,
            first_error: 0.05,
            correction_per_s: 1.5,
            wander: 0.006,
            tremor: 0.003,
        }
    }
}

impl Default for Reflex {
    fn default() -> Self {
        Self {
            torque_latency_s: 0.048,
            emg_latency_s: 0.035,
            rise_s: 0.03,
            gain_s_per_rad: 0.25,
            emg_mvc_s_per_rad: 0.1,
        }
    }
}

impl Default for Muscles {
    fn default() -> Self {
        Self { flexion_nm: 12.0, extension_nm: 8.0, cocontraction: 0.15, emg_at_rest_mvc: 0.004 }
    }
}

impl Default for Person {
    fn default() -> Self {
        Self {
            format: PERSON_FORMAT.to_owned(),
            id: "V00".to_owned(),
            joint_inertia_kg_m2: defaults::joint_inertia(),
            interface_damping_nm_s_per_rad: defaults::interface_damping(),
            interface_stiffness_nm_per_rad: defaults::interface_stiffness(),
            short_range_stiffness_nm_per_rad: defaults::short_range_stiffness(),
            stiffness_decrement_nm_per_rad: defaults::stiffness_decrement(),
            elastic_limit_rad: defaults::elastic_limit(),
            spread: Spread::default(),
            voluntary: VoluntaryParameters::default(),
            reflex: Reflex::default(),
            muscles: Muscles::default(),
            mechanisms: MechanismList::default(),
        }
    }
}

/// What the file should be, for messages.
const VIRTUAL_SUBJECT: &str = "the file of a virtual subject (see ramphold schema person)";

/// Why a file does not describe a virtual person.
#[derive(Debug, thiserror::Error)]
pub enum PersonError {
    /// The file cannot be read, is not JSON, or has a field that is unknown, missing or of the wrong type.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// A value that no person has.
    #[error("{}, field {field}: {found}; expected {expected}", .file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// Path of the field.
        field: &'static str,
        /// The value.
        found: String,
        /// What it can be.
        expected: &'static str,
    },
}

impl Person {
    /// Reads the file of a virtual person.
    pub fn read(file: &Path) -> Result<Self, PersonError> {
        Self::parse(&json_file::read_text(file, VIRTUAL_SUBJECT)?, file)
    }

    /// Parses and checks the text of the file of a virtual subject; `file` is its name for messages.
    pub fn parse(text: &str, file: &Path) -> Result<Self, PersonError> {
        let person: Self = json_file::parse(text, file, VIRTUAL_SUBJECT)?;
        person.check(file)?;
        Ok(person)
    }

    /// A person drawn around the average one, the same for the same `id`.
    pub fn drawn(id: &str) -> Self {
        let average = Self::default();
        // Spread from person to person: assumed, of the size of the error bars of Fig. 5.
        let mut stream = Stream::new(0, &format!("person/{id}"));
        let mut factor = |spread: f64| libm::exp(spread * stream.normal());
        let scaled = |surface: Surface, factor: f64| Surface {
            at_lowest: surface.at_lowest * factor,
            per_rad_s: surface.per_rad_s * factor,
            per_nm: surface.per_nm * factor,
        };
        let stiffness = factor(0.10);
        Self {
            id: id.to_owned(),
            joint_inertia_kg_m2: average.joint_inertia_kg_m2 * factor(0.10),
            interface_damping_nm_s_per_rad: average.interface_damping_nm_s_per_rad * factor(0.15),
            interface_stiffness_nm_per_rad: scaled(average.interface_stiffness_nm_per_rad, factor(0.15)),
            short_range_stiffness_nm_per_rad: scaled(average.short_range_stiffness_nm_per_rad, stiffness),
            stiffness_decrement_nm_per_rad: scaled(
                average.stiffness_decrement_nm_per_rad,
                stiffness * factor(0.05),
            ),
            elastic_limit_rad: scaled(average.elastic_limit_rad, factor(0.05)),
            ..average
        }
    }

    fn check(&self, file: &Path) -> Result<(), PersonError> {
        let (voluntary, reflex, muscles) = (&self.voluntary, &self.reflex, &self.muscles);
        let positive = [
            ("joint_inertia_kg_m2", self.joint_inertia_kg_m2),
            ("interface_damping_nm_s_per_rad", self.interface_damping_nm_s_per_rad),
            ("interface_stiffness_nm_per_rad.at_lowest", self.interface_stiffness_nm_per_rad.at_lowest),
            ("short_range_stiffness_nm_per_rad.at_lowest", self.short_range_stiffness_nm_per_rad.at_lowest),
            ("elastic_limit_rad.at_lowest", self.elastic_limit_rad.at_lowest),
            ("voluntary.rise_s", voluntary.rise_s),
            ("reflex.rise_s", reflex.rise_s),
            ("muscles.flexion_nm", muscles.flexion_nm),
            ("muscles.extension_nm", muscles.extension_nm),
        ];
        let not_negative = [
            ("stiffness_decrement_nm_per_rad.at_lowest", self.stiffness_decrement_nm_per_rad.at_lowest),
            ("spread.short_range_stiffness", self.spread.short_range_stiffness),
            ("spread.stiffness_decrement", self.spread.stiffness_decrement),
            ("spread.elastic_limit", self.spread.elastic_limit),
            ("spread.flexor_emg", self.spread.flexor_emg),
            ("spread.cocontraction", self.spread.cocontraction),
            ("voluntary.reaction_s", voluntary.reaction_s),
            ("voluntary.first_error", voluntary.first_error),
            ("voluntary.correction_per_s", voluntary.correction_per_s),
            ("voluntary.wander", voluntary.wander),
            ("voluntary.tremor", voluntary.tremor),
            ("reflex.torque_latency_s", reflex.torque_latency_s),
            ("reflex.emg_latency_s", reflex.emg_latency_s),
            ("muscles.cocontraction", muscles.cocontraction),
            ("muscles.emg_at_rest_mvc", muscles.emg_at_rest_mvc),
        ];
        let refuse = |field, found: String, expected| {
            Err(PersonError::Value { file: file.to_owned(), field, found, expected })
        };
        if self.format != PERSON_FORMAT {
            return refuse("format", self.format.clone(), PERSON_FORMAT);
        }
        if !is_single_name(&self.id) {
            let expected = "a name such as S03, without /, \\, : and control characters: files of its sessions are named after it";
            return refuse("id", format!("{:?}", self.id), expected);
        }
        for (field, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(field, value.to_string(), "a number above 0");
            }
        }
        for (field, value) in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return refuse(field, value.to_string(), "a number from 0 up");
            }
        }
        if voluntary.reaction_s > 2.0 {
            return refuse("voluntary.reaction_s", voluntary.reaction_s.to_string(), "at most 2 s");
        }
        Ok(())
    }
}
