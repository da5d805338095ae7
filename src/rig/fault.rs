//! Faults: why a motor was made safe. Every fault has a code, a class and a message.

use std::fmt;
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value};

/// Why the motor was made safe, or was not armed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(tag = "fault", rename_all = "snake_case")]
pub enum Fault {
    /// A channel gave a value that is not a number.
    #[error("the {channel} channel gave a value that is not a number; check its cable and amplifier")]
    NotANumber {
        /// Which channel.
        channel: Channel,
    },
    /// A measured quantity is beyond its limit.
    #[error(
        "the measured {quantity} of {measured} is beyond the limit of {limit}; see limits in the protocol"
    )]
    Limit {
        /// Which quantity.
        quantity: Quantity,
        /// The measured value, in the unit of the quantity.
        #[serde(deserialize_with = "number_or_nan")]
        measured: f64,
        /// The limit, in the unit of the quantity.
        #[serde(deserialize_with = "number_or_nan")]
        limit: f64,
    },
    /// The period ended without a sample.
    #[error("no sample arrived in its period; check the connection to the rig")]
    NoSample,
    /// The rig does not measure a channel that the protocol depends on.
    #[error(
        "the rig does not measure the {channel} channel, which the protocol depends on; add it to the rig file, or take \
         gate.antagonist_limit_mvc out of the protocol"
    )]
    NotMeasured {
        /// Which channel.
        channel: Channel,
    },
    /// The EMG of a muscle stayed silent in a maximal effort, so that nothing can be given as a fraction of it.
    #[error("the {channel} channel stayed silent in the maximal effort; check its electrodes")]
    SilentEffort {
        /// Which channel.
        channel: Channel,
    },
    /// The motor, its bus or its sensors failed. In journals it is called `can`, after the only bus there is.
    #[error(transparent)]
    #[serde(rename = "can")]
    Device(DeviceFault),
}

impl Fault {
    /// The name of the fault for programs, in snake case.
    pub fn code(&self) -> &str {
        match self {
            Self::NotANumber { .. } => "not_a_number",
            Self::Limit { .. } => "limit",
            Self::NoSample => "no_sample",
            Self::NotMeasured { .. } => "not_measured",
            Self::SilentEffort { .. } => "silent_effort",
            Self::Device(fault) => fault.code(),
        }
    }

    /// Whether it could not be confirmed, after the fault, that the motor has no power.
    pub fn power_may_be_on(&self) -> bool {
        matches!(self, Self::Device(fault) if fault.values().contains_key(POWER_NOT_CONFIRMED))
    }

    /// The same fault, after which it could not be confirmed that the motor has no power.
    pub fn with_power_not_confirmed(self) -> Self {
        match self {
            Self::Device(fault) => Self::Device(fault.with_value(POWER_NOT_CONFIRMED, Value::Bool(true))),
            other => other,
        }
    }

    /// What the operator is told when the fault ends an armed session.
    pub fn told_when_armed(&self) -> String {
        match self {
            _ if self.power_may_be_on() => {
                format!("fault, {MOTOR_MAY_HAVE_POWER}. {self}")
            }
            Self::Device(_) => format!("fault, the motor was made safe: {self}"),
            // Found by the session, which has stopped the motor since, and knows by itself whether the power is off.
            _ => format!("fault: {self}"),
        }
    }

    /// What the operator is told when the fault prevents arming.
    pub fn told_when_not_armed(&self) -> String {
        if self.power_may_be_on() {
            return format!("the motor was not armed, and MAY STILL HAVE POWER: {EMERGENCY_STOP}. {self}");
        }
        format!("the motor was not armed: {self}")
    }

    /// The class of the fault; `None` for a fault of a device in a journal that does not give the class.
    pub fn class(&self) -> Option<FaultClass> {
        match self {
            Self::NotANumber { .. } | Self::NotMeasured { .. } | Self::SilentEffort { .. } => {
                Some(FaultClass::Sensor)
            }
            Self::Limit { .. } => Some(FaultClass::Limit),
            Self::NoSample => Some(FaultClass::Cycle),
            Self::Device(fault) => fault.class(),
        }
    }
}

/// The value of a fault that says that the power may still be on.
const POWER_NOT_CONFIRMED: &str = "power_not_confirmed";
const EMERGENCY_STOP: &str = "press the emergency stop";

/// What the operator is told when the motor was stopped and does not confirm that its power is off.
pub const MOTOR_MAY_HAVE_POWER: &str = "THE MOTOR MAY STILL HAVE POWER: press the emergency stop";

/// Faults that call for the same reaction of the motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultClass {
    /// A measured angle, speed or torque is beyond its limit.
    Limit,
    /// A sensor gives no number, or repeats an old one.
    Sensor,
    /// The drive reports a fault or does not follow its command.
    Drive,
    /// The bus fails.
    Bus,
    /// Frames or wake-ups came too late.
    Cycle,
}

/// A fault of a motor, its bus or its sensors: a code, a class, a message, and the values that belong to the code.
///
/// A journal keeps all four, so that a reader needs to know neither the device nor the codes of the program that wrote
/// it. Each distinct fault is kept in memory until the program ends; a `DeviceFault` refers to it and is copied freely.
#[derive(Clone, Copy)]
pub struct DeviceFault(&'static FaultDescription);

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct FaultDescription {
    #[serde(rename = "kind")]
    code: String,
    #[serde(flatten)]
    values: Map<String, Value>,
    /// Journals of version 0.1.0 give neither class nor message.
    #[serde(rename = "class", default, skip_serializing_if = "Option::is_none")]
    class: Option<FaultClass>,
    #[serde(rename = "message", default, skip_serializing_if = "Option::is_none")]
    message: Option<String>,
}

/// What a journal says instead of a number that is not finite.
const NOT_FINITE: &str = "not a finite number";

/// A number of a journal; one that was not finite when it was written is no number.
fn number_or_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// The distinct faults of this process.
static DESCRIPTIONS: Mutex<Vec<&'static FaultDescription>> = Mutex::new(Vec::new());

impl DeviceFault {
    /// A fault with its values by name. Allocates memory when the fault is a new one, so it belongs behind the control
    /// cycle, after the motor was made safe.
    ///
    /// JSON has no number for what is not finite and would keep `null`, which says nothing: such a value is kept as text.
    pub fn new(code: &str, class: FaultClass, message: String, mut values: Map<String, Value>) -> Self {
        for value in values.values_mut().filter(|value| value.is_null()) {
            *value = Value::from(NOT_FINITE);
        }
        Self::kept(FaultDescription {
            code: code.to_owned(),
            values,
            class: Some(class),
            message: Some(message),
        })
    }

    fn kept(description: FaultDescription) -> Self {
        let mut all = DESCRIPTIONS.lock().unwrap_or_else(PoisonError::into_inner);
        let known = all.iter().copied().find(|known| **known == description);
        Self(known.unwrap_or_else(|| {
            let kept: &'static FaultDescription = Box::leak(Box::new(description));
            all.push(kept);
            kept
        }))
    }

    /// The same fault with one more value.
    fn with_value(self, name: &str, value: Value) -> Self {
        let FaultDescription { code, values, class, message } = self.0;
        let mut values = values.clone();
        values.insert(name.to_owned(), value);
        Self::kept(FaultDescription { code: code.clone(), values, class: *class, message: message.clone() })
    }

    /// The name of the fault for programs, in snake case.
    pub fn code(&self) -> &'static str {
        &self.0.code
    }

    /// The class of the fault; `None` if it was read from a journal that does not give it.
    pub fn class(&self) -> Option<FaultClass> {
        self.0.class
    }

    /// The values that belong to the code, by name.
    pub fn values(&self) -> &'static Map<String, Value> {
        &self.0.values
    }
}

impl PartialEq for DeviceFault {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.0, other.0)
    }
}

impl fmt::Debug for DeviceFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(formatter)
    }
}

/// The message; of a fault that was kept without one, its code and values.
impl fmt::Display for DeviceFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(message) = &self.0.message {
            return formatter.write_str(message);
        }
        write!(formatter, "the motor reported the fault {}", self.0.code)?;
        for (at, (name, value)) in self.0.values.iter().enumerate() {
            write!(formatter, "{}{name} {value}", if at == 0 { " (" } else { ", " })?;
        }
        formatter.write_str(if self.0.values.is_empty() { "" } else { ")" })
    }
}

impl std::error::Error for DeviceFault {}

impl Serialize for DeviceFault {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for DeviceFault {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        FaultDescription::deserialize(deserializer).map(Self::kept)
    }
}

/// A measured signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Motor angle.
    Angle,
    /// Lever torque.
    Torque,
    /// EMG of the flexor carpi radialis.
    EmgFcr,
    /// EMG of the extensor carpi radialis.
    EmgEcr,
}

/// A measured quantity that has a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Motor angle, rad.
    Angle,
    /// Motor speed, rad/s.
    Speed,
    /// Lever torque, N m.
    Torque,
}

impl Quantity {
    /// The channel that it is measured on.
    pub fn channel(self) -> Channel {
        match self {
            Self::Angle | Self::Speed => Channel::Angle,
            Self::Torque => Channel::Torque,
        }
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Angle => "angle",
            Self::Torque => "torque",
            Self::EmgFcr => "FCR EMG",
            Self::EmgEcr => "ECR EMG",
        })
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Angle => "angle (rad)",
            Self::Speed => "speed (rad/s)",
            Self::Torque => "torque (N m)",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fault_of_a_journal_keeps_its_text_whatever_its_code() {
        for text in [
            r#"{"fault":"can","kind":"missed_cycle","in_a_row":401,"tolerated":400,"id":389}"#,
            r#"{"fault":"can","kind":"name_of_a_later_version","speed_rad_s":-7.125}"#,
            r#"{"fault":"can","kind":"bus_off","class":"bus","message":"the CAN controller went bus-off"}"#,
            r#"{"fault":"limit","quantity":"angle","measured":0.3,"limit":0.2}"#,
        ] {
            let fault: Fault = serde_json::from_str(text).unwrap();
            assert_eq!(serde_json::to_string(&fault).unwrap(), text);
        }
    }

    #[test]
    fn fault_without_a_message_is_described_by_its_code_and_values() {
        let text = r#"{"fault":"can","kind":"missed_cycle","in_a_row":2,"id":389}"#;
        let fault: Fault = serde_json::from_str(text).unwrap();
        assert_eq!(fault.to_string(), "the motor reported the fault missed_cycle (in_a_row 2, id 389)");
        assert_eq!((fault.code(), fault.class()), ("missed_cycle", None));
    }

    #[test]
    fn fault_with_a_number_that_is_not_finite_is_readable() {
        let values = Map::from_iter([("angle_rad".to_owned(), Value::from(f64::NAN))]);
        let fault =
            Fault::Device(DeviceFault::new("angle", FaultClass::Limit, "far away".to_owned(), values));
        let text = serde_json::to_string(&fault).unwrap();
        assert!(!text.contains("null"), "{text}");
        assert_eq!(serde_json::from_str::<Fault>(&text).unwrap(), fault);
        // As an earlier build wrote it.
        let kept = r#"{"fault":"limit","quantity":"angle","measured":null,"limit":0.2}"#;
        let fault: Fault = serde_json::from_str(kept).unwrap();
        assert!(matches!(fault, Fault::Limit { measured, limit: 0.2, .. } if measured.is_nan()), "{fault}");
    }

    #[test]
    fn equal_descriptions_are_one_fault() {
        let fault = |count: u64| {
            let values = Map::from_iter([("count".to_owned(), count.into())]);
            DeviceFault::new("flood", FaultClass::Bus, "too many frames".to_owned(), values)
        };
        assert_eq!(fault(3), fault(3));
        assert_ne!(fault(3), fault(4));
    }
}
