//! The free laws: their identifiers, places, arguments and parameters.

use super::parameter::MechanismParameter;
use super::place::{Argument, Place};
use super::prior::Prior;

macro_rules! free_laws {
    ($($name:ident, $id:literal, $title:literal, $equation:literal, $place:ident, $argument:ident, $parameters:expr;)*) => {
        /// A free law: an unknown smooth function at a place of the model.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum FreeLawKind {
            $(#[doc = concat!("`", $id, "`")] $name,)*
        }

        impl FreeLawKind {
            /// Identifier in results and model files.
            pub fn id(self) -> &'static str {
                match self { $(Self::$name => $id,)* }
            }

            /// Description in a few words.
            pub fn title(self) -> &'static str {
                match self { $(Self::$name => $title,)* }
            }

            /// Equation in plain text, h being the free function.
            pub fn equation(self) -> &'static str {
                match self { $(Self::$name => $equation,)* }
            }

            /// Where the law acts.
            #[inline(always)]
            pub fn place(self) -> Place {
                match self { $(Self::$name => Place::$place,)* }
            }

            /// What the law is a function of.
            #[inline(always)]
            pub fn argument(self) -> Argument {
                match self { $(Self::$name => Argument::$argument,)* }
            }

            /// Its parameters: the range of the argument, or the memory, then the coefficients.
            #[inline(always)]
            pub const fn parameters(self) -> &'static [MechanismParameter] {
                match self { $(Self::$name => const { &$parameters },)* }
            }
        }
    };
}

free_laws! {
    JointAngle, "free_joint_angle", "an unknown function of the joint angle in the joint torque",
        "T_j += h(theta_j) - h(0)", Joint, Angle, spline(["from_rad", "to_rad"], (0.0, 0.1), NM);
    JointSpeed, "free_joint_speed", "an unknown function of the joint's speed in the joint torque",
        "T_j += h(theta_j') - h(0)", Joint, Speed, spline(["from_rad_s", "to_rad_s"], (0.0, 4.0), NM);
    JointAngleBeyondYield, "free_joint_angle_beyond_yield",
        "an unknown function of the angle beyond the elastic limit in the joint torque",
        "T_j += h(theta_j - x_e) - h(-x_e)", Joint, AngleBeyondYield, spline(["from_rad", "to_rad"], (-0.05, 0.03), NM);
    JointTime, "free_joint_time", "an unknown function of time in the joint torque",
        "T_j += h(max(0, t)) - h(0)", Joint, Time, spline(["from_s", "to_s"], (0.0, 0.04), NM);
    JointPastSpeed, "free_joint_past_speed", "an unknown response to the joint's past speed in the joint torque",
        "T_j += sum_k c_k (theta_j(t - (k - 1) w) - theta_j(t - k w)) / w, w = to / 8", Joint, PastSpeed, past_speed();
    InterfaceDeflection, "free_interface_deflection",
        "an unknown function of the deflection between hand and handle in the interface torque",
        "T_h += h(d) - h(0), d = theta_l - theta_j", Interface, Deflection, spline(["from_rad", "to_rad"], (-0.005, 0.02), NM);
    InterfaceSpeed, "free_interface_speed",
        "an unknown function of the speed between hand and handle in the interface torque",
        "T_h += h(d') - h(0), d = theta_l - theta_j", Interface, Speed, spline(["from_rad_s", "to_rad_s"], (-1.0, 2.0), NM);
    HandleAngle, "free_handle_angle", "an unknown function of the handle's angle in the lever torque",
        "T_l += h(theta_l) - h(0)", Handle, Angle, spline(["from_rad", "to_rad"], (0.0, 0.1), NM);
    HandleSpeed, "free_handle_speed", "an unknown function of the handle's speed in the lever torque",
        "T_l += h(theta_l') - h(0)", Handle, Speed, spline(["from_rad_s", "to_rad_s"], (0.0, 4.0), NM);
    TorqueChannelTorque, "free_torque_channel_torque", "an unknown function of the torque in the torque channel",
        "T_recorded = T + h(T) - h(T_0), T = T_0 + T_l", TorqueChannel, Torque, spline(["from_nm", "to_nm"], (0.0, 6.0), NM);
    TorqueChannelTime, "free_torque_channel_time", "an unknown function of time in the torque channel",
        "T_recorded = T_l + h(max(0, t)) - h(0)", TorqueChannel, Time, spline(["from_s", "to_s"], (0.0, 0.04), NM);
    TorqueChannelPastTorque, "free_torque_channel_past_torque", "an unknown response to past torque in the torque channel",
        "T_recorded = T_l + sum_k c_k (z_k - T_l), dz_k/dt = (T_l - z_k) / tau_k, tau_k = to / 3^(4 - k)",
        TorqueChannel, PastTorque, past_torque();
    AngleChannelAngle, "free_angle_channel_angle", "an unknown function of the angle in the angle channel",
        "theta_m = theta_recorded + h(theta_recorded) - h(0)", AngleChannel, Angle, spline(["from_rad", "to_rad"], (0.0, 0.1), RAD);
}

impl FreeLawKind {
    /// Number of the law's parameters.
    #[inline(always)]
    pub const fn parameter_count(self) -> usize {
        self.parameters().len()
    }
}

/// Unit, bound and typical size of a coefficient.
struct Coefficients {
    names: [&'static str; 8],
    bound: f64,
    typical: f64,
}

const NM: Coefficients = Coefficients {
    names: ["c1_nm", "c2_nm", "c3_nm", "c4_nm", "c5_nm", "c6_nm", "c7_nm", "c8_nm"],
    bound: 100.0,
    typical: 0.02,
};

const RAD: Coefficients = Coefficients {
    names: ["c1_rad", "c2_rad", "c3_rad", "c4_rad", "c5_rad", "c6_rad", "c7_rad", "c8_rad"],
    bound: 1.0,
    typical: 5e-4,
};

/// A constant of the law, which a fit does not estimate.
const fn constant(
    name: &'static str,
    meaning: &'static str,
    range: (f64, f64),
    value: f64,
) -> MechanismParameter {
    let prior = Prior::Normal { mean: 0.0, sd: 1.0 };
    MechanismParameter { fitted: false, ..MechanismParameter::new(name, meaning, range, None, value, prior) }
}

/// A coefficient. The prior is a placeholder: how large a free law may be depends on the session.
const fn coefficient(
    name: &'static str,
    meaning: &'static str,
    bound: f64,
    typical: f64,
) -> MechanismParameter {
    let prior = Prior::Normal { mean: 0.0, sd: 1.0 };
    MechanismParameter::new(name, meaning, (-bound, bound), Some(0.0), typical, prior)
}

/// The parameters of a spline: the ends of its range, then the coefficients, which typically rise.
const fn spline(ends: [&'static str; 2], range: (f64, f64), of: Coefficients) -> [MechanismParameter; 10] {
    let meaning = "coefficient of a B-spline, in order";
    let mut parameters = [coefficient("", meaning, of.bound, of.typical); 10];
    parameters[0] = constant(ends[0], "lower end of the argument's range", (-100.0, 100.0), range.0);
    parameters[1] = constant(ends[1], "upper end of the argument's range", (-100.0, 100.0), range.1);
    let mut k = 0;
    while k < 8 {
        parameters[2 + k].typical = of.typical * (k as f64 + 1.0);
        k += 1;
    }
    named(parameters, &of.names)
}

/// `parameters`, of which the last have the names `names`.
const fn named<const N: usize>(
    mut parameters: [MechanismParameter; N],
    names: &[&'static str],
) -> [MechanismParameter; N] {
    let mut k = 0;
    while k < names.len() {
        parameters[N - names.len() + k].name = names[k];
        k += 1;
    }
    parameters
}

/// The parameters of a law of past speed: the memory, then the weights of the speeds.
const fn past_speed() -> [MechanismParameter; 9] {
    let names = [
        "c1_nm_s_per_rad",
        "c2_nm_s_per_rad",
        "c3_nm_s_per_rad",
        "c4_nm_s_per_rad",
        "c5_nm_s_per_rad",
        "c6_nm_s_per_rad",
        "c7_nm_s_per_rad",
        "c8_nm_s_per_rad",
    ];
    let mut parameters =
        [coefficient("", "weight of the mean speed in an interval of the memory", 100.0, 0.02); 9];
    parameters[0] = constant("to_s", "length of the memory", (0.001, 1.0), 0.04);
    named(parameters, &names)
}

/// The parameters of a law of past torque: the memory, then the weights of the lags.
const fn past_torque() -> [MechanismParameter; 5] {
    let mut parameters = [coefficient("", "weight of a lag, the shortest first", 100.0, 0.05); 5];
    parameters[0] = constant("to_s", "longest time constant", (0.01, 1.0), 0.04);
    named(parameters, &["c1", "c2", "c3", "c4"])
}
