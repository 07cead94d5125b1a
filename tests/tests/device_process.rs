//! The device as a process of its own: the same pictures, no mistake, and nothing left of clients that die.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use std::fs;
use std::path::Path;
use volumepro_tests::programs::{Device, volumepro};

const VOLUMEPRO: &str = env!("CARGO_BIN_EXE_test-volumepro");
const DEVICE: &str = env!("CARGO_BIN_EXE_test-volumepro-device");
const DOOMED_CLIENT: &str = env!("CARGO_BIN_EXE_test-doomed-client");

/// Scenes that between them use every kind of frame there is.
const SCENES: [&[&str]; 6] = [
    &["--azimuth", "30", "--elevation", "20"],
    &["--blend", "mip", "--azimuth", "-120"],
    &["--blend", "sum", "--supersample", "2,1,1"],
    &["--blend", "minip", "--supersample", "1,1,3"],
    &["--modulate", "opacity,diffuse,specular", "--crop", "5,30,0,40,0,40", "--cursor", "20,20,20"],
    &["--cut-plane", "0,1,0.2,-20,9,2", "--background", "transparent", "--shading", "off"],
];

fn render(scene: &[&str], device: &str, output: &Path) -> Vec<u8> {
    let fixed = ["--phantom", "engine-block", "--phantom-size", "48", "--size", "200x150"];
    let mut arguments = vec!["render", "-o", output.to_str().unwrap(), "--device", device];
    arguments.extend(fixed);
    arguments.extend(scene);
    let result = volumepro(VOLUMEPRO, &arguments).unwrap();
    assert!(result.status.success(), "{scene:?}: {}", String::from_utf8_lossy(&result.stderr));
    fs::read(output).unwrap()
}

#[test]
fn a_strict_process_gives_the_embedded_pictures_without_a_mistake() {
    let folder = tempfile::tempdir().unwrap();
    let device = Device::start(DEVICE, &["--strict"]).unwrap();
    for round in 0..2 {
        for scene in SCENES {
            let embedded = render(scene, "embedded", &folder.path().join("embedded.png"));
            let separate = render(scene, &device.selection(), &folder.path().join("separate.png"));
            assert!(embedded == separate, "{scene:?} differs in round {round}");
        }
    }
    device.wait_for_end().unwrap();
    let trace = device.trace().unwrap();
    assert!(!trace.contains("mistake:"), "{trace}");
    let ends: Vec<&str> =
        trace.lines().filter(|line| line.starts_with("connection") && line.contains("ends:")).collect();
    assert_eq!(ends.len(), 2 * SCENES.len());
    for end in ends {
        // Tables, voxels and pixels went through mapped memory: not a single message touched them.
        for bar in ["BAR1", "BAR2", "BAR4"] {
            assert!(end.contains(&format!("{bar} reads=0 writes=0")), "{end}");
        }
        assert!(end.contains("mistakes=0"), "{end}");
    }
}

#[test]
fn clients_killed_at_every_message_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut device = Device::start(DEVICE, &["--strict"]).unwrap();
    let picture = || render(SCENES[0], &device.selection(), &folder.path().join("out.png"));
    let expected = picture();
    device.wait_for_end().unwrap();
    let before = device.holdings_at_rest().unwrap();
    let mut messages = 0;
    loop {
        messages += 1;
        let socket = device.socket();
        let arguments = [socket.to_str().unwrap(), &messages.to_string()];
        let ended = volumepro(DOOMED_CLIENT, &arguments).unwrap().status;
        device.wait_for_end().unwrap();
        assert_eq!(
            device.settled_holdings(before).unwrap(),
            before,
            "after a client killed at message {messages}"
        );
        if ended.success() {
            break;
        }
        assert_eq!(ended.code(), None, "the client was killed at message {messages}, it did not fail");
    }
    assert!(messages > 30, "a session has more than {messages} messages");
    assert!(picture() == expected, "the next client finds power-on state");
    assert!(device.is_alive().unwrap());
}
