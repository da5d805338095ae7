//! The constants of a rig, and the coordinates in which they are fitted.

use crate::dataset::{LARGEST_NONLINEARITY, RigQuantity, time_constant_s};
use crate::protocol::RigLoad;
use crate::wrist::Lever;

/// Number of quantities that a calibration reports; their coordinates come first, in the order of [`RigQuantity::ALL`].
pub const REPORTED: usize = RigQuantity::ALL.len();

/// Coordinates that are fitted and not reported: damping ratio, delay, gain, compliance and its delay, hold and speed
/// command of the servo, the speed of the friction, the growth of the lever's damping, and part and travel of a friction that gives
/// before it slides.
pub const NOT_REPORTED: usize = 11;

/// Place of the first coordinate with a prior that is knowledge, not a guard: it stays where nothing else is assumed.
pub const FIRST_KNOWN: usize = REPORTED + 5;

/// Places of inertia, damping and stiffness of the lever among the coordinates.
pub const LEVER_PLACES: std::ops::Range<usize> = 0..3;

/// Places among the coordinates: the torque's cubic part, delay and low-pass, the servo's bandwidth, and the friction.
pub const CUBIC_PLACE: usize = 5;
pub const DELAY_PLACE: usize = 7;
pub const LAG_PLACE: usize = 8;
pub const SERVO_PLACE: usize = 9;
pub const FRICTION_PLACE: usize = 10;

/// Place of the friction's speed among the coordinates.
pub const FRICTION_SPEED_PLACE: usize = REPORTED + 7;

/// Place among the coordinates of the growth of the lever's damping.
pub const DAMPING_GROWTH_PLACE: usize = REPORTED + 8;

/// Places among the coordinates of the part of the friction that gives before it slides, and of its travel.
pub const PRESLIDING_PLACE: usize = REPORTED + 9;
pub const PRESLIDING_TRAVEL_PLACE: usize = REPORTED + 10;

/// The constants that the model of the rig needs.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedConstants {
    /// I_l, b_l and k_l.
    pub lever: Lever,
    /// Recorded over true torque.
    pub torque_gain: f64,
    /// Recorded torque without a load, N m.
    pub torque_offset_nm: f64,
    /// Cubic part c of the recorded torque, gain (T + c T^3), 1/(N m)^2.
    pub torque_nonlinearity_per_nm2: f64,
    /// Recorded over true angle.
    pub angle_gain: f64,
    /// How late the torque record is, s.
    pub torque_delay_s: f64,
    /// Time constant of the torque channel's low-pass, s: 1 / (2 pi cut-off).
    pub torque_lag_s: f64,
    /// Inverse of the servo's natural angular frequency, s.
    pub servo_period_s: f64,
    /// Damping ratio of the servo; 1 is critical.
    pub servo_damping: f64,
    /// Delay of the servo, s.
    pub servo_delay_s: f64,
    /// Recorded angle over target at rest.
    pub servo_gain: f64,
    /// How far a torque in the lever turns the recorded angle at rest, rad/(N m).
    pub servo_compliance_rad_per_nm: f64,
    /// How late the motor yields to that torque, s.
    pub servo_compliance_delay_s: f64,
    /// Power of the response of a hold between two targets: 0 to 2.
    pub servo_hold: f64,
    /// Part of the target's speed that the servo's damping acts against: 0 if it brakes the motor, 1 if it brakes the error.
    pub servo_speed_command: f64,
    /// Speed at which the friction is at 76 % of its full value, beside a hundredth of the largest speed.
    pub friction_speed_factor: f64,
    /// Coulomb friction of the bearing, N m.
    pub bearing_friction_nm: f64,
    /// By which part the lever's damping grows with the speed of its deflection, s/rad.
    pub damping_growth_s_per_rad: f64,
    /// Part of the friction that gives before it slides: 0 if it follows from the speed, 1 if it follows from the travel (Dahl 1976).
    pub presliding_part: f64,
    /// Travel in which that part builds up to 63 % of its full value, rad.
    pub presliding_rad: f64,
    /// True over stated value of each load with a stated value.
    pub load_factors: Vec<f64>,
}

/// How a constant follows from its coordinate, which is 0 at the start and 1 at the end of what engineering allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CoordinateScale {
    /// start + range * coordinate.
    Linear {
        /// Value at coordinate 0.
        start: f64,
        /// Half the range that engineering allows, in the unit of the constant.
        range: f64,
    },
    /// start * exp(range * coordinate).
    Factor {
        /// Value at coordinate 0.
        start: f64,
        /// Logarithm of the factor that engineering allows, up or down.
        range: f64,
    },
}

impl CoordinateScale {
    /// The constant at a coordinate.
    pub fn value(self, coordinate: f64) -> f64 {
        match self {
            Self::Linear { start, range } => start + range * coordinate,
            Self::Factor { start, range } => start * libm::exp(range * coordinate),
        }
    }

    /// Derivative of the constant's effect with the coordinate: of a factor, that of its logarithm.
    pub fn range(self) -> f64 {
        match self {
            Self::Linear { range, .. } | Self::Factor { range, .. } => range,
        }
    }

    /// The coordinate of a value.
    pub fn coordinate(self, value: f64) -> f64 {
        match self {
            Self::Linear { start, range } => (value - start) / range,
            Self::Factor { start, range } => libm::log(value / start) / range,
        }
    }
}

/// Largest factor by which a gain or a constant of the lever may be wrong: that of the catalogue of mechanisms.
pub const WIDEST_FACTOR: f64 = 3.0;
/// Largest delay between the channels, s; that of the mechanism channel_skew.
const LARGEST_DELAY_S: f64 = 0.01;
/// Lowest cut-off of a torque channel, Hz; that of the mechanism torque_lag.
const LOWEST_CUTOFF_HZ: f64 = 10.0;
/// Cut-off at which the fit of the torque channel starts, Hz; the median of its mechanism's prior.
const START_CUTOFF_HZ: f64 = 150.0;
/// Lowest natural frequency of a servo, Hz; that of the mechanism servo_following.
pub const LOWEST_SERVO_HZ: f64 = 5.0;
/// Natural frequency at which the fit of the servo starts, Hz; the median of its mechanism's prior.
const START_SERVO_HZ: f64 = 120.0;
/// Offset that no amplifier is left with, as a part of the largest torque recorded.
const LARGEST_OFFSET: f64 = 1.0;
/// Friction of the bearing that makes a rig useless, as a part of the largest torque recorded.
const LARGEST_FRICTION: f64 = 0.1;
/// How far the speed of the friction may be from where it starts, as a factor, one standard deviation.
const FRICTION_SPEED_FACTOR: f64 = 10.0;
/// Growth of the lever's damping with the speed of its deflection, s/rad, one standard deviation: a tenth at 1 rad/s, which a soft lever
/// reaches (assumed). No solid or joint damps in exact proportion to speed, and a nonlinearity of the torque channel would stand in for it.
const DAMPING_GROWTH_S_PER_RAD: f64 = 0.1;
/// Travel in which the friction of a bearing builds up, rad: balls of some micrometres' give, on a race of some millimetres (assumed).
pub const PRESLIDING_RAD: f64 = 1e-3;
/// By how much that travel may differ, as a factor, one standard deviation (assumed).
pub const PRESLIDING_FACTOR: f64 = 10.0;
/// The lever that the fit starts from where the session states none: that of the paper's rig.
const PAPER_LEVER: Lever =
    Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };

/// The coordinates of a fit: those reported, those of the servo, and one for each load with a stated value.
#[derive(Debug, Clone)]
pub struct RigCoordinates {
    /// CoordinateScale of each.
    pub scales: Vec<CoordinateScale>,
    /// The loads with a stated value, without sign.
    pub loads: Vec<RigLoad>,
    /// Standard deviation of each coordinate before the trials are seen: 1, and for a load that of its stated value.
    pub prior_sd: Vec<f64>,
    /// Whether the friction may give before it slides: where no trial shows it, its coordinates are none.
    pub has_presliding: bool,
}

impl RigCoordinates {
    /// Coordinates about the stated lever, for records whose torque is at most `largest_nm` from its offset.
    pub fn new(lever: Option<Lever>, largest_nm: f64, loads: Vec<RigLoad>) -> Self {
        let lever = lever.unwrap_or(PAPER_LEVER);
        let factor = |start| CoordinateScale::Factor { start, range: libm::log(WIDEST_FACTOR) };
        let linear = |start, range| CoordinateScale::Linear { start, range };
        let critical = 2.0 * libm::sqrt(lever.stiffness_nm_per_rad * lever.inertia_kg_m2);
        let mut scales = vec![
            factor(lever.inertia_kg_m2),
            linear(lever.damping_nm_s_per_rad, critical),
            factor(lever.stiffness_nm_per_rad),
            factor(1.0),
            linear(0.0, LARGEST_OFFSET * largest_nm),
            linear(0.0, LARGEST_NONLINEARITY / (largest_nm * largest_nm)),
            factor(1.0),
            linear(0.0, LARGEST_DELAY_S),
            // Lead and lag of one size differ in their phases alone: the start is on the side of the lag.
            linear(time_constant_s(START_CUTOFF_HZ), time_constant_s(LOWEST_CUTOFF_HZ)),
            linear(time_constant_s(START_SERVO_HZ), time_constant_s(LOWEST_SERVO_HZ)),
            linear(0.0, LARGEST_FRICTION * largest_nm),
            factor(1.0),
            linear(0.0, time_constant_s(LOWEST_SERVO_HZ)),
            factor(1.0),
            linear(0.0, 1.0 / lever.stiffness_nm_per_rad),
            linear(0.0, LARGEST_DELAY_S),
            linear(1.0, 1.0),
            linear(0.5, 0.5),
            CoordinateScale::Factor { start: 1.0, range: libm::log(FRICTION_SPEED_FACTOR) },
            linear(0.0, DAMPING_GROWTH_S_PER_RAD),
            linear(0.5, 0.5),
            CoordinateScale::Factor { start: PRESLIDING_RAD, range: libm::log(PRESLIDING_FACTOR) },
        ];
        let mut prior_sd = vec![1.0; scales.len()];
        // Both ends of either range are common: each is one standard deviation from the middle.
        prior_sd[FIRST_KNOWN] = 1.0;
        prior_sd[FIRST_KNOWN + 1] = 1.0;
        for load in &loads {
            scales.push(CoordinateScale::Linear { start: 1.0, range: 1.0 });
            prior_sd.push(load.relative_error().unwrap_or(0.0));
        }
        Self { scales, loads, prior_sd, has_presliding: false }
    }

    /// Number of coordinates.
    pub fn count(&self) -> usize {
        self.scales.len()
    }

    /// Place of the first load's coordinate.
    pub fn first_load() -> usize {
        REPORTED + NOT_REPORTED
    }

    /// The constants at a point.
    pub fn constants(&self, point: &[f64]) -> FittedConstants {
        let value = |place: usize| self.scales[place].value(point[place]);
        FittedConstants {
            lever: Lever {
                inertia_kg_m2: value(0),
                damping_nm_s_per_rad: value(1),
                stiffness_nm_per_rad: value(2),
            },
            torque_gain: value(3),
            torque_offset_nm: value(4),
            torque_nonlinearity_per_nm2: value(5),
            angle_gain: value(6),
            torque_delay_s: value(7),
            torque_lag_s: value(8),
            servo_period_s: value(9),
            bearing_friction_nm: value(10),
            servo_damping: value(11),
            servo_delay_s: value(12),
            servo_gain: value(13),
            servo_compliance_rad_per_nm: value(14),
            servo_compliance_delay_s: value(15),
            servo_hold: value(16),
            servo_speed_command: value(17),
            friction_speed_factor: value(FRICTION_SPEED_PLACE),
            damping_growth_s_per_rad: value(DAMPING_GROWTH_PLACE),
            presliding_part: if self.has_presliding { value(PRESLIDING_PLACE) } else { 0.0 },
            presliding_rad: value(PRESLIDING_TRAVEL_PLACE),
            load_factors: (Self::first_load()..self.count()).map(value).collect(),
        }
    }

    /// The constants at a point, with a motor that follows its target exactly.
    pub fn constants_with_ideal_servo(&self, point: &[f64]) -> FittedConstants {
        FittedConstants {
            servo_period_s: 0.0,
            servo_delay_s: 0.0,
            servo_gain: 1.0,
            servo_compliance_rad_per_nm: 0.0,
            servo_hold: 0.0,
            ..self.constants(point)
        }
    }

    /// What is at the handle at a point.
    pub fn at_handle(&self, constants: &FittedConstants, load: RigLoad) -> AtHandle {
        let factor = self
            .loads
            .iter()
            .position(|known| *known == load.without_sign())
            .map_or(1.0, |place| constants.load_factors[place]);
        match load {
            RigLoad::EmptyHandle => AtHandle::default(),
            RigLoad::ClampedHandle => AtHandle { is_clamped: true, ..AtHandle::default() },
            RigLoad::KnownWeight { .. } => {
                AtHandle { torque_nm: factor * load.weight_nm().unwrap_or_default(), ..AtHandle::default() }
            }
            RigLoad::KnownInertia { inertia_kg_m2, .. } => {
                AtHandle { inertia_kg_m2: factor * inertia_kg_m2, ..AtHandle::default() }
            }
            RigLoad::KnownSpring { stiffness_nm_per_rad, .. } => {
                AtHandle { stiffness_nm_per_rad: factor * stiffness_nm_per_rad, ..AtHandle::default() }
            }
        }
    }
}

/// What is at the handle, in SI units.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AtHandle {
    /// A stop.
    pub is_clamped: bool,
    /// Constant torque, N m.
    pub torque_nm: f64,
    /// Inertia, kg m2.
    pub inertia_kg_m2: f64,
    /// Stiffness of a spring to the ground, N m/rad.
    pub stiffness_nm_per_rad: f64,
}
