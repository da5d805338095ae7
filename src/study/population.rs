//! Virtual persons drawn around an average one.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::Stream;
use crate::rig::virtual_wrist::{Person, Surface};

/// How persons, or sessions of one person, differ. All of it is assumed unless a study file says where it is from.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PersonSpread {
    /// Of I_j: standard deviation of its logarithm.
    pub joint_inertia: f64,
    /// Of b_h: standard deviation of its logarithm.
    pub interface_damping: f64,
    /// Of k_h.
    pub interface_stiffness: SurfaceSpread,
    /// Of k_srs; k_dec shares the factor of its level.
    pub short_range_stiffness: SurfaceSpread,
    /// Of k_dec, beside what it shares with k_srs.
    pub stiffness_decrement: SurfaceSpread,
    /// Of x_e.
    pub elastic_limit: SurfaceSpread,
}

/// How a parameter's plane over velocity and torque differs.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceSpread {
    /// Of the whole plane: standard deviation of the logarithm of a factor.
    pub level: f64,
    /// Of its rise with velocity: standard deviation, in the parameter's unit per rad/s.
    pub per_rad_s: f64,
    /// Of its rise with torque: standard deviation, in the parameter's unit per N m.
    pub per_nm: f64,
}

/// Planes turn about the middle of the paper's velocities and torques, so that a rise does not change the level.
const MIDDLE: (f64, f64) = (2.275, 1.5);

/// All persons that there could be.
#[derive(Debug, Clone, PartialEq)]
pub struct Population {
    /// The average person.
    pub average: Person,
    /// How persons differ from each other.
    pub spread: PersonSpread,
    /// How a person differs from session to session.
    pub between_sessions: PersonSpread,
}

impl Population {
    /// Person `number`, from 1, of `seed`, as they are in session `session`, from 1.
    pub fn person(&self, seed: u64, number: u32, session: u32) -> Person {
        let mut own = Stream::new(seed, &format!("study/person/{number}"));
        let person = vary(&self.average, &self.spread, &mut own);
        let mut today = Stream::new(seed, &format!("study/person/{number}/session/{session}"));
        Person { id: subject_id(number), ..vary(&person, &self.between_sessions, &mut today) }
    }
}

/// What a virtual person is called.
pub fn subject_id(number: u32) -> String {
    format!("P{number:04}")
}

fn vary(person: &Person, spread: &PersonSpread, stream: &mut Stream) -> Person {
    // Every draw is made, whatever the spread, so that a change of one number changes one thing.
    let mut draw = || stream.normal();
    let inertia = libm::exp(spread.joint_inertia * draw());
    let damping = libm::exp(spread.interface_damping * draw());
    let mut surface = |surface: Surface, spread: SurfaceSpread, shared: f64| {
        let factor = libm::exp(spread.level * draw());
        let turned = [spread.per_rad_s * draw(), spread.per_nm * draw()];
        let scaled = |value: f64| value * factor * shared;
        let own = Surface {
            at_lowest: scaled(surface.at_lowest)
                - turned[0] * (MIDDLE.0 - 1.3)
                - turned[1] * (MIDDLE.1 - 0.9),
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

impl PersonSpread {
    /// The first number that is no spread: below zero, none at all, or a level above 1.
    pub(super) fn first_bad(&self) -> Option<(String, f64)> {
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
