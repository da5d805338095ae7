//! Virtual subjects drawn around an average subject.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::Stream;
use crate::rig::virtual_wrist::{Person, Surface};

/// Spread of the parameters between subjects, or between sessions of a subject. All values are assumptions unless the study file
/// gives their source.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SubjectSpread {
    /// Standard deviation of the logarithm of the joint inertia I_j.
    pub joint_inertia: f64,
    /// Standard deviation of the logarithm of the interface damping b_h.
    pub interface_damping: f64,
    /// Spread of the interface stiffness k_h.
    pub interface_stiffness: SurfaceSpread,
    /// Spread of the short-range stiffness k_srs; k_dec shares the factor of its level.
    pub short_range_stiffness: SurfaceSpread,
    /// Spread of the stiffness decrement k_dec, beyond the factor shared with k_srs.
    pub stiffness_decrement: SurfaceSpread,
    /// Spread of the elastic limit x_e.
    pub elastic_limit: SurfaceSpread,
}

/// Spread of a parameter's plane over velocity and torque.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceSpread {
    /// Standard deviation of the logarithm of a factor on the whole plane.
    pub level: f64,
    /// Standard deviation of the slope over velocity, in the parameter's unit per rad/s.
    pub per_rad_s: f64,
    /// Standard deviation of the slope over torque, in the parameter's unit per N m.
    pub per_nm: f64,
}

/// Middle of the paper's velocities, rad/s, and torques, N m. A plane tilts about this point, so that its slopes do not change its
/// level.
const TILT_CENTRE: (f64, f64) = (2.275, 1.5);

/// A population of virtual subjects.
#[derive(Debug, Clone, PartialEq)]
pub struct Population {
    /// The average subject.
    pub average: Person,
    /// Spread between subjects.
    pub spread: SubjectSpread,
    /// Spread between sessions of a subject.
    pub between_sessions: SubjectSpread,
}

impl Population {
    /// Subject `number` (from 1) of the population drawn with `seed`, in session `session` (from 1).
    pub fn subject(&self, seed: u64, number: u32, session: u32) -> Person {
        let mut subject_stream = Stream::new(seed, &format!("study/person/{number}"));
        let person = vary(&self.average, &self.spread, &mut subject_stream);
        let mut session_stream = Stream::new(seed, &format!("study/person/{number}/session/{session}"));
        Person { id: subject_id(number), ..vary(&person, &self.between_sessions, &mut session_stream) }
    }
}

/// Identifier of the virtual subject `number`.
pub fn subject_id(number: u32) -> String {
    format!("P{number:04}")
}

fn vary(person: &Person, spread: &SubjectSpread, stream: &mut Stream) -> Person {
    // Every number is drawn even where the spread is zero: a change of one spread does not shift the draws of the others.
    let mut draw = || stream.normal();
    let inertia = libm::exp(spread.joint_inertia * draw());
    let damping = libm::exp(spread.interface_damping * draw());
    let mut surface = |surface: Surface, spread: SurfaceSpread, shared: f64| {
        let factor = libm::exp(spread.level * draw());
        let turned = [spread.per_rad_s * draw(), spread.per_nm * draw()];
        let scaled = |value: f64| value * factor * shared;
        let own = Surface {
            at_lowest: scaled(surface.at_lowest)
                - turned[0] * (TILT_CENTRE.0 - 1.3)
                - turned[1] * (TILT_CENTRE.1 - 0.9),
            per_rad_s: scaled(surface.per_rad_s) + turned[0],
            per_nm: scaled(surface.per_nm) + turned[1],
        };
        (own, factor)
    };
    let (interface, _) = surface(person.interface_stiffness_nm_per_rad, spread.interface_stiffness, 1.0);
    let (stiffness, shared) =
        surface(person.short_range_stiffness_nm_per_rad, spread.short_range_stiffness, 1.0);
    let (decrement, _) = surface(person.stiffness_decrement_nm_per_rad, spread.stiffness_decrement, shared);
    let (limit, _) = surface(person.elastic_limit_rad, spread.elastic_limit, 1.0);
    Person {
        joint_inertia_kg_m2: person.joint_inertia_kg_m2 * inertia,
        interface_damping_nm_s_per_rad: person.interface_damping_nm_s_per_rad * damping,
        interface_stiffness_nm_per_rad: interface,
        short_range_stiffness_nm_per_rad: stiffness,
        stiffness_decrement_nm_per_rad: decrement,
        elastic_limit_rad: limit,
        ..person.clone()
    }
}

impl SubjectSpread {
    /// The first field with an invalid value (negative, not a number, or a level above 1), and the value.
    pub(super) fn first_invalid(&self) -> Option<(String, f64)> {
        let levels = [
            ("joint_inertia".to_owned(), self.joint_inertia),
            ("interface_damping".to_owned(), self.interface_damping),
        ];
        let surfaces = [
            ("interface_stiffness", self.interface_stiffness),
            ("short_range_stiffness", self.short_range_stiffness),
            ("stiffness_decrement", self.stiffness_decrement),
            ("elastic_limit", self.elastic_limit),
        ];
        let level = |(name, value): (String, f64)| (name, value, 1.0);
        let all = levels.into_iter().map(level).chain(surfaces.into_iter().flat_map(|(name, surface)| {
            [
                (format!("{name}.level"), surface.level, 1.0),
                (format!("{name}.per_rad_s"), surface.per_rad_s, f64::MAX),
                (format!("{name}.per_nm"), surface.per_nm, f64::MAX),
            ]
        }));
        all.into_iter()
            .find(|(_, value, most)| !(0.0..=*most).contains(value))
            .map(|(name, value, _)| (name, value))
    }
}
