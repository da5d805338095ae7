//! The bit rate of a CAN interface, asked of the kernel by route netlink (RTM_GETLINK, as `ip -details link` does).

use std::ffi::CString;
use std::io;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::time::Duration;

/// How long the kernel may take for its answer.
const KERNEL_TIMEOUT: Duration = Duration::from_secs(1);
const MESSAGE_HEADER_BYTES: usize = 16;
const LINK_HEADER_BYTES: usize = 16;
/// The two upper bits of an attribute's type are flags.
const TYPE_MASK: u16 = 0x3FFF;

// linux/rtnetlink.h, linux/if_link.h, linux/can/netlink.h
const RTM_NEWLINK: u16 = 16;
const RTM_GETLINK: u16 = 18;
const NLMSG_ERROR: u16 = 2;
const NLM_F_REQUEST: u16 = 1;
const IFLA_LINKINFO: u16 = 18;
const IFLA_INFO_DATA: u16 = 2;
const IFLA_CAN_BITTIMING: u16 = 1;

/// The bit rate of an interface, bit/s; `None` for one that has none, such as vcan.
///
/// # Errors
/// There is no such interface, or the kernel does not say.
pub fn bit_rate(interface: &str) -> io::Result<Option<u32>> {
    let name = CString::new(interface).map_err(|_| io::ErrorKind::InvalidInput)?;
    // SAFETY: `name` ends with a zero and lives during the call.
    let index = unsafe { libc::if_nametoindex(name.as_ptr()) };
    if index == 0 {
        return Err(io::Error::last_os_error());
    }
    bit_rate_in(&ask(index)?)
}

fn ask(index: u32) -> io::Result<Vec<u8>> {
    // SAFETY: no memory is passed; the descriptor is owned by nobody else.
    let socket = unsafe {
        match libc::socket(libc::AF_NETLINK, libc::SOCK_RAW | libc::SOCK_CLOEXEC, libc::NETLINK_ROUTE) {
            -1 => return Err(io::Error::last_os_error()),
            descriptor => OwnedFd::from_raw_fd(descriptor),
        }
    };
    rustix::net::sockopt::set_socket_timeout(
        &socket,
        rustix::net::sockopt::Timeout::Recv,
        Some(KERNEL_TIMEOUT),
    )?;
    let request = request(index);
    let mut answer = vec![0u8; 32_768];
    // SAFETY: pointers and lengths are those of `request` and `answer`, which live during the calls.
    let received = unsafe {
        if libc::send(socket.as_raw_fd(), request.as_ptr().cast(), request.len(), 0) < 0 {
            return Err(io::Error::last_os_error());
        }
        libc::recv(socket.as_raw_fd(), answer.as_mut_ptr().cast(), answer.len(), 0)
    };
    answer.truncate(usize::try_from(received).map_err(|_| io::Error::last_os_error())?);
    Ok(answer)
}

fn request(index: u32) -> Vec<u8> {
    let mut request = Vec::with_capacity(MESSAGE_HEADER_BYTES + LINK_HEADER_BYTES);
    request.extend(((MESSAGE_HEADER_BYTES + LINK_HEADER_BYTES) as u32).to_ne_bytes());
    request.extend(RTM_GETLINK.to_ne_bytes());
    request.extend(NLM_F_REQUEST.to_ne_bytes());
    // Sequence number and sender; then family, padding and type of the link.
    request.extend([0; 12]);
    request.extend(index.to_ne_bytes());
    request.extend([0; 8]);
    request
}

/// The bit rate in the kernel's answer.
fn bit_rate_in(message: &[u8]) -> io::Result<Option<u32>> {
    let unknown = || io::Error::other("the kernel does not describe the interface");
    let word = |at: usize| message.get(at..at + 4).and_then(|bytes| <[u8; 4]>::try_from(bytes).ok());
    let kind = message.get(4..6).and_then(|bytes| <[u8; 2]>::try_from(bytes).ok()).ok_or_else(unknown)?;
    match u16::from_ne_bytes(kind) {
        RTM_NEWLINK => {}
        NLMSG_ERROR => {
            let code = i32::from_ne_bytes(word(MESSAGE_HEADER_BYTES).ok_or_else(unknown)?);
            return Err(io::Error::from_raw_os_error(-code));
        }
        _ => return Err(unknown()),
    }
    let attributes = message.get(MESSAGE_HEADER_BYTES + LINK_HEADER_BYTES..).ok_or_else(unknown)?;
    let timing = attribute(attributes, IFLA_LINKINFO)
        .and_then(|info| attribute(info, IFLA_INFO_DATA))
        .and_then(|data| attribute(data, IFLA_CAN_BITTIMING));
    let rate = timing.and_then(|timing| timing.get(..4)).and_then(|rate| <[u8; 4]>::try_from(rate).ok());
    // 0 is said by interfaces that do not know their rate, such as one over a serial line.
    Ok(rate.map(u32::from_ne_bytes).filter(|rate| *rate > 0))
}

/// The payload of the first attribute of a type.
fn attribute(mut list: &[u8], wanted: u16) -> Option<&[u8]> {
    loop {
        let length = usize::from(u16::from_ne_bytes(list.get(..2)?.try_into().ok()?));
        let kind = u16::from_ne_bytes(list.get(2..4)?.try_into().ok()?) & TYPE_MASK;
        let payload = list.get(4..length)?;
        if kind == wanted {
            return Some(payload);
        }
        list = list.get(length.next_multiple_of(4)..)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute_of(kind: u16, payload: &[u8]) -> Vec<u8> {
        let mut bytes = ((payload.len() + 4) as u16).to_ne_bytes().to_vec();
        bytes.extend(kind.to_ne_bytes());
        bytes.extend(payload);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }

    fn link(attributes: &[u8]) -> Vec<u8> {
        let mut message = ((32 + attributes.len()) as u32).to_ne_bytes().to_vec();
        message.extend(RTM_NEWLINK.to_ne_bytes());
        message.resize(32, 0);
        message.extend(attributes);
        message
    }

    #[test]
    fn the_bit_rate_is_found_among_nested_attributes() {
        let mut timing = 500_000u32.to_ne_bytes().to_vec();
        timing.resize(32, 0);
        // The order and the flag bits are the kernel's.
        let data = [attribute_of(2, &[0; 48]), attribute_of(IFLA_CAN_BITTIMING, &timing)].concat();
        let info = [attribute_of(1, b"can\0"), attribute_of(0x8000 | IFLA_INFO_DATA, &data)].concat();
        let message = link(&[attribute_of(3, b"can0\0"), attribute_of(IFLA_LINKINFO, &info)].concat());
        assert_eq!(bit_rate_in(&message).unwrap(), Some(500_000));
    }

    #[test]
    fn an_interface_without_bit_timing_has_no_bit_rate_and_an_error_is_told() {
        let vcan = link(&attribute_of(IFLA_LINKINFO, &attribute_of(1, b"vcan\0")));
        assert_eq!(bit_rate_in(&vcan).unwrap(), None);
        let mut error = link(&[]);
        error[4..6].copy_from_slice(&NLMSG_ERROR.to_ne_bytes());
        error[16..20].copy_from_slice(&(-libc::ENODEV).to_ne_bytes());
        assert_eq!(bit_rate_in(&error).unwrap_err().raw_os_error(), Some(libc::ENODEV));
        assert!(bit_rate_in(&[]).is_err());
    }

    #[test]
    fn the_kernel_of_this_machine_describes_an_interface_that_is_no_can_bus() {
        assert_eq!(bit_rate("lo").unwrap(), None);
        assert!(bit_rate("no-such-can").is_err());
    }
}
