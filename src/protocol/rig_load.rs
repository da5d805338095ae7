//! What is mounted on the handle in a rig trial.

/// Standard acceleration of gravity, m/s2.
pub const GRAVITY_M_S2: f64 = 9.80665;

/// A load on the handle, with the error of its stated value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RigLoad {
    /// Nothing but the handle itself.
    EmptyHandle,
    /// A mass on a thread over a disc at the handle's axis: a constant torque.
    KnownWeight {
        /// The mass, kg.
        mass_kg: f64,
        /// Radius of the disc over which its thread runs, m.
        arm_m: f64,
        /// 1 if the torque resists extension, -1 if it pulls into it.
        sign: i8,
        /// One standard deviation of the torque, as a fraction.
        relative_error: f64,
    },
    /// A bar bolted on the handle: a further inertia.
    KnownInertia {
        /// Inertia about the handle's axis, kg m2.
        inertia_kg_m2: f64,
        /// One standard deviation of the inertia, as a fraction.
        relative_error: f64,
    },
    /// A stop: the handle cannot turn.
    ClampedHandle,
    /// A linear spring to the ground, without torque at the start position.
    KnownSpring {
        /// Stiffness about the handle's axis, N m/rad.
        stiffness_nm_per_rad: f64,
        /// One standard deviation of the stiffness, as a fraction.
        relative_error: f64,
    },
}

impl RigLoad {
    /// Name in tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::EmptyHandle => "empty_handle",
            Self::KnownWeight { .. } => "known_weight",
            Self::KnownInertia { .. } => "known_inertia",
            Self::ClampedHandle => "clamped_handle",
            Self::KnownSpring { .. } => "known_spring",
        }
    }

    /// One standard deviation of the stated value, as a fraction; `None` for a load without one.
    pub fn relative_error(&self) -> Option<f64> {
        match *self {
            Self::EmptyHandle | Self::ClampedHandle => None,
            Self::KnownWeight { relative_error, .. }
            | Self::KnownInertia { relative_error, .. }
            | Self::KnownSpring { relative_error, .. } => Some(relative_error),
        }
    }

    /// Torque of a weight, N m, positive if it resists extension; `None` for other loads.
    pub fn weight_nm(&self) -> Option<f64> {
        match *self {
            Self::KnownWeight { mass_kg, arm_m, sign, .. } => {
                Some(f64::from(sign) * mass_kg * GRAVITY_M_S2 * arm_m)
            }
            _ => None,
        }
    }

    /// Direction of a weight: 1 or -1; `None` for other loads.
    pub fn sign(&self) -> Option<i8> {
        match *self {
            Self::KnownWeight { sign, .. } => Some(sign),
            _ => None,
        }
    }

    /// The load without its direction: a weight on either side is one weight.
    pub fn without_sign(self) -> Self {
        match self {
            Self::KnownWeight { mass_kg, arm_m, relative_error, .. } => {
                Self::KnownWeight { mass_kg, arm_m, sign: 1, relative_error }
            }
            other => other,
        }
    }

    /// What the operator does to mount it.
    pub fn instruction(&self) -> String {
        match self {
            Self::EmptyHandle => "Take everything off the handle, and keep hands off it.".to_owned(),
            Self::KnownWeight { mass_kg, arm_m, sign, .. } => {
                let way = if *sign > 0 { "resists the extension" } else { "pulls into the extension" };
                format!("Hang {mass_kg:.3} kg at {arm_m:.3} m so that it {way}, and let it come to rest.")
            }
            Self::KnownInertia { inertia_kg_m2, .. } => {
                format!("Bolt the bar of {inertia_kg_m2:.5} kg m² on the handle, balanced about its axis.")
            }
            Self::ClampedHandle => {
                "Clamp the handle at the start position so that it cannot turn.".to_owned()
            }
            Self::KnownSpring { stiffness_nm_per_rad, .. } => format!(
                "Fix the spring of {stiffness_nm_per_rad:.2} N m/rad between handle and ground, without torque at the \
                 start position."
            ),
        }
    }
}
