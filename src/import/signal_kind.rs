//! What each signal of a mapping is, and in which units it can be given.

use super::mapping::{MappedSignal, Mapping, SignalUnit};
use crate::protocol::Problem;

/// What a signal measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SignalKind {
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

/// What is wrong with the units, signs and maximal efforts of `mapping`, whose text is `text`.
pub fn signal_problems(mapping: &Mapping, text: &str) -> Vec<Problem> {
    let columns = &mapping.columns;
    let signals = [
        ("time", SignalKind::Time, columns.time.as_ref()),
        ("angle", SignalKind::Angle, Some(&columns.angle)),
        ("torque", SignalKind::Torque, Some(&columns.torque)),
        ("emg_fcr", SignalKind::Emg, columns.emg_fcr.as_ref()),
        ("emg_ecr", SignalKind::Emg, columns.emg_ecr.as_ref()),
        ("handle_angle", SignalKind::Angle, columns.handle_angle.as_ref()),
        ("handle_acceleration", SignalKind::Acceleration, columns.handle_acceleration.as_ref()),
        ("hand_torque", SignalKind::Torque, columns.hand_torque.as_ref()),
        ("joint_angle", SignalKind::Angle, columns.joint_angle.as_ref()),
    ];
    let found = signals.into_iter().filter_map(|(name, kind, signal)| Some((name, kind, signal?)));
    found.flat_map(|(name, kind, signal)| problems_of(name, kind, signal, text)).collect()
}

fn problems_of(name: &str, kind: SignalKind, signal: &MappedSignal, text: &str) -> Vec<Problem> {
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
