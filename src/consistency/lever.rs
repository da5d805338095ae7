//! Whether the lever can pass on a ramp.

use super::contradiction::Contradiction;
use super::ramp::rounded;
use super::signal_check::SignalCheck;
use crate::wrist::Lever;

/// Below this natural frequency, Hz, a lever is slower than the window of 40 ms is long: no torque of the ramp would get through.
const LOWEST_HZ: f64 = 25.0;

/// Above this, Hz, no steel handle of a hand's size oscillates.
const HIGHEST_HZ: f64 = 5000.0;

/// Above this damping ratio, a lever is no handle but a damper: steel has below 0.01, rubber some 0.1, and from 1 on a lever does not ring at
/// all. Ten times that is far from any of them, and far below the thousandfold that a damping in N mm s/rad makes.
const MOST_DAMPED: f64 = 10.0;

/// What is wrong with the lever of a session.
pub fn check_lever(lever: &Lever) -> Option<Contradiction> {
    let hz = libm::sqrt(lever.stiffness_nm_per_rad / lever.inertia_kg_m2) / std::f64::consts::TAU;
    if (LOWEST_HZ..=HIGHEST_HZ).contains(&hz) {
        return check_damping(lever);
    }
    let mistake = if hz < LOWEST_HZ {
        "Is the inertia in kg cm2 or g m2, or the stiffness in N m a degree?"
    } else {
        "Is the stiffness in N cm/rad or N mm/rad, or the inertia in t m2?"
    };
    Some(Contradiction {
        check: SignalCheck::Lever,
        place: "session.json, field rig.lever".into(),
        trials: Vec::new(),
        measured: format!("its stiffness and inertia give a natural frequency of {} Hz", rounded(hz)),
        stated: format!("{LOWEST_HZ} to {HIGHEST_HZ} Hz"),
        likely_mistake: Some(mistake.into()),
        remedy:
            "Give inertia_kg_m2 in kg m2 and stiffness_nm_per_rad in N m/rad, or null for a rigid handle."
                .into(),
    })
}

/// What is wrong with the damping of a lever.
fn check_damping(lever: &Lever) -> Option<Contradiction> {
    let critical = 2.0 * libm::sqrt(lever.stiffness_nm_per_rad * lever.inertia_kg_m2);
    let ratio = lever.damping_nm_s_per_rad / critical;
    if ratio <= MOST_DAMPED {
        return None;
    }
    Some(Contradiction {
        check: SignalCheck::Lever,
        place: "session.json, field rig.lever.damping_nm_s_per_rad".into(),
        trials: Vec::new(),
        measured: format!("with its stiffness and inertia it gives a damping ratio of {}", rounded(ratio)),
        stated: format!("at most {MOST_DAMPED}"),
        likely_mistake: Some("Is the damping in N mm s/rad or N cm s/rad?".into()),
        remedy: "Give damping_nm_s_per_rad in N m s/rad, or null for a rigid handle.".into(),
    })
}
