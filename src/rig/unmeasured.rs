//! What a protocol needs of a rig's channels.

use crate::protocol::ValidProtocol;

/// What `protocol` does that needs EMG which the rig does not measure; `emg` says of flexor and extensor whether it does.
pub fn unmeasured_channels(protocol: &ValidProtocol, emg: [bool; 2]) -> Vec<String> {
    let [fcr, ecr] = emg;
    let mut needed = Vec::new();
    if protocol.before.mvc.is_some() && !(fcr && ecr) {
        needed.push(
            "the protocol measures maximal efforts, which needs signals emg_fcr and emg_ecr".to_owned(),
        );
    }
    if protocol.gate.antagonist_limit_mvc.is_some() && !ecr {
        needed.push("the protocol's gate has antagonist_limit_mvc, which needs signal emg_ecr".to_owned());
    }
    needed
}
