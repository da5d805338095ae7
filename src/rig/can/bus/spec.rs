//! Names of buses, as written in rig files and on the command line.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Where a bus is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BusSpec {
    /// A network interface of Linux, `socketcan:can0`. Its bit rate is set with `ip link`.
    Socketcan {
        /// Name of the interface.
        interface: String,
    },
    /// A serial adapter that speaks Lawicel's ASCII, `slcan:/dev/ttyACM0` or `slcan:COM3`.
    Slcan {
        /// The serial device.
        device: String,
    },
    /// A socketcand server, `socketcand:127.0.0.1:29536:can0`.
    Socketcand {
        /// Its host.
        host: String,
        /// Its TCP port.
        port: u16,
        /// The bus it is asked for.
        channel: String,
    },
}

/// A text that names no bus.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0:?} names no bus; write socketcan:INTERFACE, slcan:DEVICE or socketcand:HOST:PORT:NAME, \
     such as socketcan:can0, slcan:/dev/ttyACM0 or socketcand:127.0.0.1:29536:can0"
)]
pub struct BusSpecError(String);

impl FromStr for BusSpec {
    type Err = BusSpecError;

    fn from_str(text: &str) -> Result<Self, BusSpecError> {
        let error = || BusSpecError(text.to_owned());
        let (kind, place) = text.split_once(':').filter(|(_, place)| !place.is_empty()).ok_or_else(error)?;
        match kind {
            "socketcan" => Ok(Self::Socketcan { interface: place.to_owned() }),
            "slcan" => Ok(Self::Slcan { device: place.to_owned() }),
            "socketcand" => {
                let mut parts = place.split(':');
                match (parts.next(), parts.next(), parts.next(), parts.next()) {
                    (Some(host), Some(port), Some(channel), None)
                        if !host.is_empty() && !channel.is_empty() =>
                    {
                        let port = port.parse().map_err(|_| error())?;
                        Ok(Self::Socketcand { host: host.to_owned(), port, channel: channel.to_owned() })
                    }
                    _ => Err(error()),
                }
            }
            _ => Err(error()),
        }
    }
}

impl fmt::Display for BusSpec {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Socketcan { interface } => write!(formatter, "socketcan:{interface}"),
            Self::Slcan { device } => write!(formatter, "slcan:{device}"),
            Self::Socketcand { host, port, channel } => {
                write!(formatter, "socketcand:{host}:{port}:{channel}")
            }
        }
    }
}

impl<'de> Deserialize<'de> for BusSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

impl Serialize for BusSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl JsonSchema for BusSpec {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "BusSpec".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "format": "bus",
            "pattern": "^(socketcan:.+|slcan:.+|socketcand:[^:]+:[0-9]+:[^:]+)$"
        })
    }
}

/// Bit rate of a bus, bit/s: one of those that CiA 301 and Lawicel's adapters share.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct BitRate(u32);

impl BitRate {
    /// The rates there are, in the order of Lawicel's S0 to S8.
    const RATES: [u32; 9] = [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

    /// 1 Mbit/s, the fastest of classic CAN.
    pub const MAX: Self = Self(1_000_000);

    /// One of the rates there are.
    pub fn new(bits_per_s: u32) -> Option<Self> {
        Self::RATES.contains(&bits_per_s).then_some(Self(bits_per_s))
    }

    /// In bit/s.
    pub fn bits_per_s(self) -> u32 {
        self.0
    }

    /// Lawicel's digit for it.
    pub(super) fn lawicel(self) -> u8 {
        let at = Self::RATES.iter().position(|rate| *rate == self.0).unwrap_or(Self::RATES.len() - 1);
        b'0' + at as u8
    }
}

impl<'de> Deserialize<'de> for BitRate {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let bits_per_s = u32::deserialize(deserializer)?;
        Self::new(bits_per_s).ok_or_else(|| {
            serde::de::Error::custom(format!("a bit rate of {bits_per_s}; expected one of {:?}", Self::RATES))
        })
    }
}

impl JsonSchema for BitRate {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "BitRate".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "enum": Self::RATES })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_is_named_as_it_is_printed() {
        for text in ["socketcan:can0", "slcan:/dev/ttyACM0", "slcan:COM3", "socketcand:127.0.0.1:29536:can0"]
        {
            assert_eq!(text.parse::<BusSpec>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn what_names_no_bus_is_refused() {
        for text in [
            "",
            "can0",
            "socketcan:",
            "usb:1",
            "socketcand:host:can0",
            "socketcand:h:1:c:x",
            "socketcand:h:99999:c",
        ] {
            assert!(text.parse::<BusSpec>().is_err(), "{text}");
        }
    }

    #[test]
    fn only_the_usual_bit_rates_exist() {
        assert_eq!(BitRate::new(1_000_000).map(BitRate::lawicel), Some(b'8'));
        assert_eq!(BitRate::new(125_000).map(BitRate::lawicel), Some(b'4'));
        assert_eq!(BitRate::new(123_456), None);
    }
}
