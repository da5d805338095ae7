//! CANopen devices that measure beside a motor: identity, heartbeat, TPDOs, and the way to OPERATIONAL.

use std::time::Duration;

use super::canopen::{CanopenError, Link, MonitoredNode, NmtCommand, NmtState, Object};
use super::device_setup::{identify, write_tpdos};
use super::file::{CanRigFile, Sensor};

/// How long nodes may take for NMT commands.
const NMT_TIMEOUT: Duration = Duration::from_secs(2);

/// The measuring devices of a rig.
#[derive(Debug, Clone)]
pub struct Sensors(Vec<Sensor>);

impl Sensors {
    /// Those of a rig file.
    pub fn new(file: &CanRigFile) -> Self {
        Self(file.sensors.clone())
    }

    /// Whose heartbeats are minded.
    pub fn monitored_nodes(&self) -> Vec<MonitoredNode> {
        let timeout = |ms: u16| Duration::from_millis(u64::from(ms));
        self.0
            .iter()
            .map(|one| MonitoredNode { node: one.node, timeout: timeout(one.heartbeat_wait_ms) })
            .collect()
    }

    /// Identity, heartbeat and TPDOs, in PRE-OPERATIONAL.
    pub fn prepare(&self, link: &mut Link, file: &CanRigFile) -> Result<(), CanopenError> {
        for sensor in &self.0 {
            link.nmt(NmtCommand::EnterPreOperational, sensor.node)?;
            identify(link, sensor.node, &sensor.identity)?;
            link.write_and_confirm(sensor.node, Object::plain(0x1017), sensor.heartbeat_ms)?;
            write_tpdos(link, sensor.node, file)?;
        }
        Ok(())
    }

    /// To OPERATIONAL.
    pub fn start(&self, link: &mut Link) -> Result<(), CanopenError> {
        start_nodes(link, &self.monitored_nodes())
    }

    /// Back to PRE-OPERATIONAL: no frames but heartbeats.
    pub fn release(&self, link: &mut Link) -> Result<(), CanopenError> {
        self.0.iter().try_for_each(|sensor| link.nmt(NmtCommand::EnterPreOperational, sensor.node))
    }
}

/// Nodes to OPERATIONAL; their heartbeats must say so.
pub fn start_nodes(link: &mut Link, nodes: &[MonitoredNode]) -> Result<(), CanopenError> {
    for node in nodes {
        link.nmt(NmtCommand::Start, node.node)?;
    }
    let deadline = link.now() + NMT_TIMEOUT;
    for MonitoredNode { node, .. } in nodes {
        while link.state(*node) != Some(NmtState::Operational) {
            let now = link.now();
            if now > deadline {
                return Err(match link.state(*node) {
                    Some(state) => CanopenError::NotOperational { node: *node, state },
                    None => {
                        CanopenError::HeartbeatLost { node: *node, after_ms: NMT_TIMEOUT.as_millis() as u64 }
                    }
                });
            }
            link.receive(now + Duration::from_millis(5))?;
        }
    }
    Ok(())
}
