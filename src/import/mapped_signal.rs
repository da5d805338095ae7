//! A signal of a mapping: its column, unit and sign, and in which units it can be given.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::protocol::Problem;

/// A column with its unit and sign: the value is `sign` (column - `zero`) in SI units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MappedSignal {
    /// Name of the column, or of the variable in a .mat file.
    pub column: String,
    /// Unit of its values.
    pub unit: SignalUnit,
    /// 1, or -1 to turn the sign.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    #[schemars(range(min = -1, max = 1))]
    pub sign: i8,
    /// Value of the column at zero, in its unit.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub zero: f64,
    /// Value of EMG at maximal effort, in its unit; needed if EMG is not a fraction already.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_mvc: Option<f64>,
}

fn one() -> i8 {
    1
}

fn is_one(sign: &i8) -> bool {
    *sign == 1
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Unit of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum SignalUnit {
    /// Seconds.
    #[serde(rename = "s")]
    Second,
    /// Milliseconds.
    #[serde(rename = "ms")]
    Millisecond,
    /// Microseconds.
    #[serde(rename = "us")]
    Microsecond,
    /// Radians.
    #[serde(rename = "rad")]
    Radian,
    /// Milliradians.
    #[serde(rename = "mrad")]
    Milliradian,
    /// Degrees.
    #[serde(rename = "deg")]
    Degree,
    /// Revolutions.
    #[serde(rename = "rev")]
    Revolution,
    /// Radians a second, squared.
    #[serde(rename = "rad/s2")]
    RadianPerSecondSquared,
    /// Degrees a second, squared.
    #[serde(rename = "deg/s2")]
    DegreePerSecondSquared,
    /// Newton metres.
    #[serde(rename = "N m")]
    NewtonMetre,
    /// Newton centimetres.
    #[serde(rename = "N cm")]
    NewtonCentimetre,
    /// Newton millimetres.
    #[serde(rename = "N mm")]
    NewtonMillimetre,
    /// Kilopond centimetres.
    #[serde(rename = "kgf cm")]
    KilopondCentimetre,
    /// Pound-force inches.
    #[serde(rename = "lbf in")]
    PoundInch,
    /// A fraction of maximal voluntary contraction.
    #[serde(rename = "mvc")]
    Mvc,
    /// Percent of maximal voluntary contraction.
    #[serde(rename = "%")]
    Percent,
    /// Volts.
    #[serde(rename = "V")]
    Volt,
    /// Millivolts.
    #[serde(rename = "mV")]
    Millivolt,
    /// Microvolts.
    #[serde(rename = "uV")]
    Microvolt,
}

impl SignalUnit {
    /// Name in a mapping.
    pub fn name(self) -> String {
        serde_json::to_value(self).ok().and_then(|name| name.as_str().map(str::to_owned)).unwrap_or_default()
    }

    /// The unit that a file spells so: `Nm`, `N.m`, `mNm`, `deg`, `°`, `µV`. `None` for any other text.
    pub fn spelt(text: &str) -> Option<Self> {
        let plain: String =
            text.chars().filter(|own| own.is_alphanumeric() || "%/°".contains(*own)).collect();
        Some(match plain.as_str() {
            "s" | "sec" => Self::Second,
            "ms" | "msec" => Self::Millisecond,
            "us" | "µs" | "μs" => Self::Microsecond,
            "rad" => Self::Radian,
            "mrad" => Self::Milliradian,
            "deg" | "°" | "degree" | "degrees" => Self::Degree,
            "rev" => Self::Revolution,
            "rad/s2" => Self::RadianPerSecondSquared,
            "deg/s2" | "°/s2" => Self::DegreePerSecondSquared,
            "Nm" => Self::NewtonMetre,
            "Ncm" => Self::NewtonCentimetre,
            "Nmm" | "mNm" => Self::NewtonMillimetre,
            "kgfcm" | "kgcm" => Self::KilopondCentimetre,
            "lbfin" | "lbin" => Self::PoundInch,
            "V" => Self::Volt,
            "mV" => Self::Millivolt,
            "uV" | "µV" | "μV" => Self::Microvolt,
            _ => return None,
        })
    }

    /// Whether both units are of the same kind of signal.
    pub fn is_of_kind(self, other: Self) -> bool {
        use SignalKind::{Acceleration, Angle, Emg, Time, Torque};
        let kinds = [Time, Angle, Acceleration, Torque, Emg];
        kinds.into_iter().any(|kind| [self, other].iter().all(|unit| kind.units().contains(unit)))
    }

    /// Factor to the SI unit of its kind; EMG in volts has none, and is divided by its value at maximal effort.
    pub fn factor(self) -> f64 {
        match self {
            Self::Second | Self::Radian | Self::RadianPerSecondSquared | Self::NewtonMetre | Self::Mvc => 1.0,
            Self::Volt | Self::Millivolt | Self::Microvolt => 1.0,
            Self::Millisecond | Self::Milliradian | Self::NewtonMillimetre => 1e-3,
            Self::Microsecond => 1e-6,
            Self::Degree | Self::DegreePerSecondSquared => std::f64::consts::PI / 180.0,
            Self::Revolution => std::f64::consts::TAU,
            Self::NewtonCentimetre | Self::Percent => 1e-2,
            Self::KilopondCentimetre => 0.098_066_5,
            Self::PoundInch => 0.112_984_829,
        }
    }
}

impl MappedSignal {
    /// The column called `column`, as it is.
    pub fn plain(column: &str, unit: SignalUnit) -> Self {
        Self { column: column.to_owned(), unit, sign: 1, zero: 0.0, at_mvc: None }
    }

    /// A value of the column in SI units, or as a fraction of maximal effort.
    pub fn convert(&self, value: f64) -> f64 {
        f64::from(self.sign) * (value - self.zero) * self.unit.factor() / self.at_mvc.unwrap_or(1.0)
    }
}

/// What a signal measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SignalKind {
    Time,
    Angle,
    Acceleration,
    Torque,
    Emg,
}

impl SignalKind {
    /// The units in which it is given.
    fn units(self) -> &'static [SignalUnit] {
        use SignalUnit::*;
        match self {
            Self::Time => &[Second, Millisecond, Microsecond],
            Self::Angle => &[Radian, Milliradian, Degree, Revolution],
            Self::Acceleration => &[RadianPerSecondSquared, DegreePerSecondSquared],
            Self::Torque => &[NewtonMetre, NewtonCentimetre, NewtonMillimetre, KilopondCentimetre, PoundInch],
            Self::Emg => &[Mvc, Percent, Volt, Millivolt, Microvolt],
        }
    }
}

/// What is wrong with the unit, sign and maximal effort of the signal `name` of a mapping whose text is `text`.
pub fn problems_of(name: &str, kind: SignalKind, signal: &MappedSignal, text: &str) -> Vec<Problem> {
    let line = 1 + text.lines().position(|line| line.contains(&format!("\"{name}\""))).unwrap_or(0);
    let problem = |field: &str, value: Option<String>, expected: String, advice: &str| Problem {
        path: format!("columns.{name}.{field}"),
        line,
        value,
        expected,
        advice: advice.into(),
    };
    let mut problems = Vec::new();
    let unit = format!("{:?}", signal.unit.name());
    if !kind.units().contains(&signal.unit) {
        let names: Vec<String> = kind.units().iter().map(|own| format!("{:?}", own.name())).collect();
        let advice = if kind == SignalKind::Torque {
            "convert volts by the calibration of the gauge first"
        } else {
            "correct the unit, or name another column"
        };
        problems.push(problem("unit", Some(unit), format!("one of {}", names.join(", ")), advice));
    } else if kind == SignalKind::Emg
        && !matches!(signal.unit, SignalUnit::Mvc | SignalUnit::Percent)
        && signal.at_mvc.is_none()
    {
        let expected = format!("the value at maximal effort, in {}", signal.unit.name());
        problems.push(problem("at_mvc", None, expected, "EMG is kept as a fraction of maximal effort"));
    }
    if let Some(at_mvc) = signal.at_mvc.filter(|own| kind != SignalKind::Emg || *own == 0.0) {
        let expected = if kind == SignalKind::Emg { "a value that is not 0" } else { "no such field" };
        problems.push(problem("at_mvc", Some(at_mvc.to_string()), expected.into(), "it is for EMG alone"));
    }
    if signal.sign == 0 {
        problems.push(problem(
            "sign",
            Some("0".into()),
            "1 or -1".into(),
            "with 0 nothing is left of the signal",
        ));
    }
    problems
}
