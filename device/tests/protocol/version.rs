//! `VERSION`.

use rustix::io::Errno;

use crate::common::*;

#[test]
fn nothing_is_served_before_the_version() {
    let rig = Rig::new();
    let mut client = rig.connect();
    for command in (2..20).chain([0, 0xffff]) {
        let reply = client.ask(command, &words(&[32, 0, 0, 0, 0, 0, 0, 0]));
        assert_eq!((reply.flags, reply.payload.len()), (ERROR_REPLY, 0));
        assert_ne!(reply.error, 0);
    }
    client.version();
    client.works();
}

#[test]
fn malformed_versions_are_refused_and_may_be_repeated() {
    let rig = Rig::new();
    let mut client = rig.connect();
    for payload in [
        &b""[..],
        &[0; 3],
        b"\0\0\0\0{}",
        b"\0\0\0\0[]\0",
        b"\0\0\0\0{\"capabilities\":7}\0",
        b"\0\0\0\0\xff\0",
    ] {
        let reply = client.ask(VERSION, payload);
        assert_eq!(
            (reply.flags, reply.error),
            (ERROR_REPLY, Errno::INVAL.raw_os_error() as u32),
            "{payload:?}"
        );
    }
    client.version();
    client.works();
}

#[test]
fn the_version_is_negotiated_once() {
    let rig = Rig::new();
    let mut client = rig.client();
    assert_eq!(client.fail(VERSION, &[0; 4]), Errno::INVAL);
}

#[test]
fn another_major_version_ends_the_connection() {
    let rig = Rig::new();
    let mut client = rig.connect();
    let reply = client.ask(VERSION, &[1, 0, 0, 0]);
    assert_eq!((reply.flags, reply.error), (ERROR_REPLY, Errno::PROTONOSUPPORT.raw_os_error() as u32));
    assert!(client.is_closed());
    rig.client().works();
}

#[test]
fn data_and_capabilities_may_be_missing() {
    let rig = Rig::new();
    for data in [&b""[..], b"{}\0", b"{\"capabilities\":{}}\0", b"{\"capabilities\":{\"unheard_of\":[]}}\0"] {
        let mut client = rig.connect();
        let reply = client.succeed(VERSION, &[&[0, 0, 1, 0], data].concat());
        assert_eq!(reply[..4], [0; 4]);
        let (end, text) = reply[4..].split_last().unwrap();
        assert_eq!(*end, 0);
        let told: serde_json::Value = serde_json::from_slice(text).unwrap();
        let expected = serde_json::json!({"capabilities": {
            "max_msg_fds": 16, "max_data_xfer_size": 1 << 20, "max_dma_maps": 65535, "pgsizes": 4096,
        }});
        assert_eq!(told, expected);
        client.works();
        assert_eq!(client.fail(WRITE_MULTI, &longs(&[0])), Errno::OPNOTSUPP, "it was not agreed on");
    }
}

#[test]
fn a_client_that_cannot_take_descriptors_gets_none() {
    let rig = Rig::new();
    let mut client = rig.connect();
    client.succeed(VERSION, b"\0\0\0\0{\"capabilities\":{\"max_msg_fds\":0}}\0");
    let reply = client.ask(GET_REGION_INFO, &words(&[64, 0, BAR2, 0, 0, 0, 0, 0]));
    assert_eq!(
        (reply.payload, reply.descriptors.len()),
        (words(&[32, 3, BAR2, 0, MEMORY as u32, 0, 0, 0]), 0)
    );
}
