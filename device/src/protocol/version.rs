//! Negotiation of version and limits.

use rustix::io::Errno;
use serde_json::{Value, json};

use super::MAX_TRANSFER;
use super::socket::MAX_DESCRIPTORS;
use super::wire::{Append, Fields};
use crate::dma;

const MAJOR: u16 = 0;
const MINOR: u16 = 0;
/// Bytes of version data that are looked at; clients send a few hundred.
const MAX_VERSION_DATA: usize = 16 << 10;

/// What was agreed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Limits {
    /// Whether the client can take a descriptor with a reply.
    pub(super) descriptors: bool,
    /// Bytes that one message to the client may carry.
    pub(super) transfer: usize,
    /// Whether the client may send several writes in one message.
    pub(super) write_multiple: bool,
}

/// Reads the client's proposal.
///
/// # Errors
///
/// `EPROTONOSUPPORT` for another major version, after which the connection is of no use; `EINVAL` for a
/// proposal that is not well-formed. Its data, its list of capabilities, and each of those may be missing.
pub(super) fn negotiate(payload: &[u8]) -> Result<Limits, Errno> {
    let mut fields = Fields(payload);
    let (major, _minor) = (fields.u16()?, fields.u16()?);
    if major != MAJOR {
        return Err(Errno::PROTONOSUPPORT);
    }
    let data = parse(fields.0)?;
    let capabilities = data.get("capabilities").unwrap_or(&Value::Null);
    if !(data.is_object() && (capabilities.is_object() || capabilities.is_null())) {
        return Err(Errno::INVAL);
    }
    let number = |name, default| match capabilities.get(name) {
        None => Ok(default),
        Some(value) => value.as_u64().ok_or(Errno::INVAL),
    };
    let write_multiple = match capabilities.get("write_multiple") {
        None => false,
        Some(value) => value.as_bool().ok_or(Errno::INVAL)?,
    };
    let transfer =
        usize::try_from(number("max_data_xfer_size", MAX_TRANSFER as u64)?).unwrap_or(MAX_TRANSFER);
    Ok(Limits {
        descriptors: number("max_msg_fds", 1)? > 0,
        transfer: transfer.min(MAX_TRANSFER),
        write_multiple,
    })
}

/// Appends what the server agrees to. Its limits are always told; an ability only if the client proposed it.
pub(super) fn answer(limits: Limits, reply: &mut Vec<u8>) {
    let mut capabilities = json!({
        "max_msg_fds": MAX_DESCRIPTORS,
        "max_data_xfer_size": MAX_TRANSFER,
        "max_dma_maps": dma::MAX_REGIONS,
        "pgsizes": dma::PAGE,
    });
    if limits.write_multiple
        && let Some(capabilities) = capabilities.as_object_mut()
    {
        capabilities.insert("write_multiple".into(), Value::Bool(true));
    }
    reply.u16(MAJOR);
    reply.u16(MINOR);
    reply.extend(json!({ "capabilities": capabilities }).to_string().bytes());
    reply.push(0);
}

fn parse(data: &[u8]) -> Result<Value, Errno> {
    match data {
        [] => Ok(json!({})),
        [text @ .., 0] if text.len() < MAX_VERSION_DATA => {
            serde_json::from_slice(text).map_err(|_| Errno::INVAL)
        }
        _ => Err(Errno::INVAL),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn propose(data: &str) -> Result<Limits, Errno> {
        negotiate(&[&[0, 0, 1, 0], data.as_bytes()].concat())
    }

    const DEFAULT: Limits = Limits { descriptors: true, transfer: MAX_TRANSFER, write_multiple: false };

    #[test]
    fn malformed_proposals_are_refused() {
        assert_eq!(negotiate(&[]), Err(Errno::INVAL));
        assert_eq!(negotiate(&[0, 0, 0]), Err(Errno::INVAL));
        assert_eq!(negotiate(&[1, 0, 0, 0]), Err(Errno::PROTONOSUPPORT));
        for data in [
            "{}",
            "\0",
            "[]\0",
            "{}\0\0",
            "{\0}\0",
            "nonsense\0",
            "{\"capabilities\":7}\0",
            "{\"capabilities\":{\"max_msg_fds\":-1}}\0",
            "{\"capabilities\":{\"max_msg_fds\":1.5}}\0",
            "{\"capabilities\":{\"max_msg_fds\":\"1\"}}\0",
            "{\"capabilities\":{\"max_data_xfer_size\":null}}\0",
            "{\"capabilities\":{\"write_multiple\":1}}\0",
        ] {
            assert_eq!(propose(data), Err(Errno::INVAL), "{data:?}");
        }
        assert_eq!(propose(&("[".repeat(100_000) + "\0")), Err(Errno::INVAL));
        assert_eq!(propose(&("[".repeat(10_000) + "\0")), Err(Errno::INVAL));
        assert_eq!(negotiate(&[0, 0, 0, 0, 0xff, 0xfe, 0]), Err(Errno::INVAL));
    }

    #[test]
    fn everything_may_be_missing_and_more_may_be_there() {
        for data in [
            "",
            "{}\0",
            "{\"capabilities\":{}}\0",
            "{\"capabilities\":null,\"more\":[1]}\0",
            "{\"capabilities\":{\"twin_socket\":{\"supported\":true},\"migration\":{\"pgsize\":4096}}}\0",
            "{\"capabilities\":{\"max_data_xfer_size\":18446744073709551615,\"max_msg_fds\":16}}\0",
        ] {
            assert_eq!(propose(data), Ok(DEFAULT), "{data:?}");
        }
        let limits =
            "{\"capabilities\":{\"max_data_xfer_size\":4096,\"max_msg_fds\":0,\"write_multiple\":true}}\0";
        assert_eq!(propose(limits), Ok(Limits { descriptors: false, transfer: 4096, write_multiple: true }));
    }

    #[test]
    fn abilities_are_agreed_to_only_if_proposed() {
        for write_multiple in [false, true] {
            let mut reply = Vec::new();
            answer(Limits { write_multiple, ..DEFAULT }, &mut reply);
            assert_eq!((reply.pop(), &reply[..4]), (Some(0), &[0; 4][..]));
            let told: Value = serde_json::from_slice(&reply[4..]).unwrap();
            assert_eq!(told["capabilities"].get("write_multiple").is_some(), write_multiple);
            assert_eq!(told["capabilities"]["max_data_xfer_size"], 1 << 20);
            assert_eq!(told["capabilities"]["pgsizes"], 4096);
            // QEMU takes no reply that is longer than what it sent, some 240 bytes.
            assert!(reply.len() < 160, "{}", reply.len());
        }
    }
}
