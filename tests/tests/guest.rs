//! The card in a guest of QEMU, with the guest's own kernel, VFIO and programs.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use rustix::process::Signal;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};
use volumepro_tests::guest::{Guest, available, program};
use volumepro_tests::programs::{Device, volumepro};

const VOLUMEPRO: &str = env!("CARGO_BIN_EXE_test-volumepro");
const DEVICE: &str = env!("CARGO_BIN_EXE_test-volumepro-device");

/// Small enough for a guest without hardware virtualisation.
const PHANTOM: [&str; 6] = ["--phantom", "engine-block", "--phantom-size", "48", "--size", "200x150"];

/// Frames that take a second each by the reference renderer, to do something in the midst of one.
const LONG: &str = "volumepro render --device pci:$CARDS --phantom engine-block --phantom-size 128 \
    --supersample 1,1,8 --frames 100000 -o /tmp/out.png";

/// The picture of the embedded card.
fn embedded(arguments: &[&str]) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("embedded.png");
    let mut all = vec!["render", "-o", output.to_str().unwrap()];
    all.extend(arguments);
    let result = volumepro(VOLUMEPRO, &all).unwrap();
    assert!(result.status.success(), "{}", String::from_utf8_lossy(&result.stderr));
    fs::read(output).unwrap()
}

/// Compares a text with the one kept in `tests/golden`; UPDATE_GOLDEN=1 keeps this one instead.
fn assert_golden(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden").join(name);
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        fs::write(&path, text).unwrap();
    }
    let kept = fs::read_to_string(&path).unwrap();
    assert_eq!(text, kept, "differs from {}; UPDATE_GOLDEN=1 accepts it", path.display());
}

/// What firmware and kernel choose, which may differ between their versions: addresses of BARs, and the IOMMU group.
fn mask(line: &str) -> String {
    let word = |text: &str, after: &str| -> String {
        let Some((before, rest)) = text.split_once(after) else { return text.to_owned() };
        let end = rest.find(' ').unwrap_or(rest.len());
        format!("{before}{after}*{}", &rest[end..])
    };
    word(&word(line, "Memory at "), "IOMMU group: ")
}

#[test]
fn lspci_and_the_guest_programs_know_the_card() {
    if !available("lspci_and_the_guest_programs_know_the_card").unwrap() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let trace = folder.path().join("trace file");
    let trace_option = format!("--trace={}", trace.display());
    let script = "
        lspci -nn
        echo ==
        lspci -vv -s $CARDS 2>/dev/null
        echo ==
        volumepro-selftest --strict || exit 3
        echo ==
        echo $CARDS >/sys/bus/pci/drivers/vfio-pci/unbind
        volumepro-smoke || exit 4";
    let arguments = ["--device-option", "--strict", "--device-option", &trace_option, "--exec", script];
    let output = String::from_utf8(Guest::run(&arguments).unwrap().success().unwrap()).unwrap();
    let [list, card, selftest, smoke] = output.split("==\n").collect::<Vec<_>>().try_into().unwrap();

    let name = "Multimedia controller [0480]: Mitsubishi Electric \
        VG500 [VolumePro Volume Rendering Accelerator] [1067:1002] (rev 01)";
    assert_eq!(list.lines().filter(|line| line.ends_with(name)).count(), 1, "{list}");
    assert_golden("lspci", &card.lines().map(|line| mask(line) + "\n").collect::<String>());
    for (text, checks) in [(selftest, 15), (smoke, 3)] {
        assert!(text.lines().all(|line| line.starts_with("PASS ")), "{text}");
        assert!(text.lines().count() >= checks, "{text}");
    }
    let trace = fs::read_to_string(trace).unwrap();
    let ends = trace.lines().filter(|line| line.starts_with("connection") && line.contains("ends:"));
    for end in ends {
        for bar in ["BAR1", "BAR2", "BAR4", "BAR5"] {
            assert!(end.contains(&format!("{bar} reads=0 writes=0")), "memory is mapped: {end}");
        }
    }
}

#[test]
fn a_card_with_msi_interrupts_and_one_with_intx_is_polled() {
    if !available("a_card_with_msi_interrupts_and_one_with_intx_is_polled").unwrap() {
        return;
    }
    let [msi, intx] = ["msi", "intx"].map(|kind| Device::start(DEVICE, &["--interrupt", kind]).unwrap());
    let [msi, intx] = [&msi, &intx].map(Device::socket);
    let script = format!(
        "set -- $CARDS; volumepro-selftest --device $1 --interrupts 100 >&2 || exit
        volumepro render --device pci:$2 -o /tmp/out.png {} || exit; cat /tmp/out.png",
        PHANTOM.join(" ")
    );
    let [msi, intx] = [&msi, &intx].map(|path| path.to_str().unwrap());
    let ended = Guest::run(&["--socket", msi, "--socket", intx, "--exec", &script]).unwrap();
    assert!(ended.status.success(), "{}", ended.errors);
    assert!(ended.errors.contains("PASS interrupts: 100 frames, 100 interrupts"), "{}", ended.errors);
    assert!(ended.output == embedded(&PHANTOM), "the pictures differ");
}

#[test]
fn pictures_of_files_are_those_of_the_embedded_card() {
    if !available("pictures_of_files_are_those_of_the_embedded_card").unwrap() {
        return;
    }
    // A detached header, spaces in every name, a transfer function, a name relative to the current folder's parent.
    let folder = tempfile::tempdir().unwrap();
    let scans = folder.path().join("my scans");
    fs::create_dir(&scans).unwrap();
    let header = scans.join("a scan.nhdr");
    fs::write(
        &header,
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 40 30 20\nencoding: raw\ndata file: the voxels.raw\n\n",
    )
    .unwrap();
    let voxels: Vec<u8> = (0..40 * 30 * 20_u32).map(|index| (index % 251) as u8).collect();
    fs::write(scans.join("the voxels.raw"), voxels).unwrap();
    let table = scans.join("the table.csv");
    fs::write(&table, "value,red,green,blue,opacity\n20,1,0.5,0,0\n250,0,0.5,1,0.2\n").unwrap();
    let picture = folder.path().join("the picture.png");
    let scene = ["--size", "160x120", "--azimuth", "-40", "--elevation", "15", "--transfer"];
    let mut arguments = vec!["--device-option", "--strict", "--render", header.to_str().unwrap(), "-o"];
    arguments.push(picture.to_str().unwrap());
    arguments.extend(scene);
    arguments.extend([table.to_str().unwrap(), "--stats", "json"]);
    let ended = Guest::run(&arguments).unwrap();
    assert!(ended.status.success(), "{}", ended.errors);
    assert!(ended.errors.contains("vfio-pci"), "the guest's diagnostics: {}", ended.errors);
    let statistics: serde_json::Value = serde_json::from_slice(&ended.output).unwrap();
    assert_eq!(statistics["dimensions"], serde_json::json!([40, 30, 20]));
    let mut scene = vec![header.to_str().unwrap()];
    scene.extend(["--size", "160x120", "--azimuth", "-40", "--elevation", "15"]);
    scene.extend(["--transfer", table.to_str().unwrap()]);
    assert!(fs::read(&picture).unwrap() == embedded(&scene), "the pictures differ");
}

#[test]
fn a_bad_volume_is_named_as_on_the_host() {
    if !available("a_bad_volume_is_named_as_on_the_host").unwrap() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scan = folder.path().join("scan.nrrd");
    let samples = "samples ".repeat(1 << 17);
    fs::write(&scan, format!("NRRD0004\ntype: uint9\n\n{samples}")).unwrap();
    let picture = folder.path().join("out.png");
    let arguments = ["render", scan.to_str().unwrap(), "-o", picture.to_str().unwrap()];
    let host = volumepro(VOLUMEPRO, &arguments).unwrap();
    let mut guest_arguments = vec!["--render"];
    guest_arguments.extend(&arguments[1..]);
    let guest = Guest::run(&guest_arguments).unwrap();
    assert_eq!(guest.status.code(), host.status.code());
    let message = String::from_utf8(host.stderr).unwrap();
    let message = message.lines().last().unwrap();
    let message = message.split_once(": ").unwrap().1; // without the name of the program, which differs
    assert!(guest.errors.contains(message), "{}\n{message}", guest.errors);
    assert!(!picture.exists());
}

#[test]
fn two_cards_in_a_guest_render_at_the_same_time() {
    if !available("two_cards_in_a_guest_render_at_the_same_time").unwrap() {
        return;
    }
    let scenes: [&[&str]; 3] = [
        &["--azimuth", "30", "--elevation", "20"],
        &["--blend", "mip", "--supersample", "2,1,1"],
        &["--modulate", "opacity,diffuse", "--crop", "5,30,0,40,0,40", "--cut-plane", "0,1,0.2,-20,9,2"],
    ];
    let mut script = String::from("for card in $CARDS; do (\n");
    for (index, scene) in scenes.iter().enumerate() {
        let scene = [&PHANTOM[..], scene].concat().join(" ");
        script += &format!("volumepro render --device pci:$card -o /tmp/$card-{index}.png {scene} || exit\n");
    }
    // Every picture after its size.
    script += ") & done; wait; for file in /tmp/*.png; do stat -c %s $file; cat $file; done";
    let arguments = ["--cards", "2", "--device-option", "--strict", "--exec", &script];
    let mut output = &*Guest::run(&arguments).unwrap().success().unwrap();
    for card in 0..2 {
        for scene in scenes {
            let line = output.iter().position(|&byte| byte == b'\n').unwrap();
            let size: usize = std::str::from_utf8(&output[..line]).unwrap().parse().unwrap();
            let (picture, rest) = output[line + 1..].split_at(size);
            assert!(picture == embedded(&[&PHANTOM[..], scene].concat()), "card {card}: {scene:?}");
            output = rest;
        }
    }
    assert!(output.is_empty());
}

#[test]
fn reboots_cost_the_device_nothing() {
    if !available("reboots_cost_the_device_nothing").unwrap() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let machine = folder.path().join("machine.args");
    let arguments = fs::read_to_string(program("machine.args")).unwrap();
    assert!(arguments.contains("\n-no-reboot\n"));
    fs::write(&machine, arguments.replace("\n-no-reboot\n", "\n")).unwrap();
    let mut device = Device::start(DEVICE, &["--strict"]).unwrap();
    let script = "volumepro-selftest --interrupts 10 && echo booted && sleep 3 && reboot -f";
    let socket = device.socket();
    let arguments =
        ["--machine", machine.to_str().unwrap(), "--socket", socket.to_str().unwrap(), "--exec", script];
    let mut guest = Guest::start(&arguments).unwrap();
    let mut holdings = Vec::new();
    for boot in 1..=4 {
        guest.wait_for("booted", boot).unwrap();
        holdings.push(device.holdings_at_rest().unwrap());
    }
    guest.signal(Signal::TERM).unwrap();
    assert_eq!(guest.end().unwrap().status.code(), Some(143));
    assert!(holdings.windows(2).all(|pair| pair[0] == pair[1]), "{holdings:?}");
    device.wait_for_end().unwrap();
    assert!(device.is_alive().unwrap());
    // QEMU resets the card when it starts, and at every reboot.
    assert!(device.trace().unwrap().matches("reset of the device").count() > 3);
}

#[test]
fn guests_that_vanish_leave_the_device_nothing() {
    if !available("guests_that_vanish_leave_the_device_nothing").unwrap() {
        return;
    }
    let mut device = Device::start(DEVICE, &["--renderer", "reference"]).unwrap();
    let socket = device.socket();
    let with_device = ["--socket", socket.to_str().unwrap()];

    // Killed in the midst of a frame.
    let mut guest = Guest::start(&[&with_device[..], &["--exec", LONG]].concat()).unwrap();
    guest.wait_until(|_| frames(&device) > [2, 0] && frames(&device)[0] > frames(&device)[1]).unwrap();
    guest.kill_qemu().unwrap();
    let ended = guest.end().unwrap();
    assert_eq!(ended.status.code(), Some(1));
    assert!(ended.errors.contains("QEMU has ended with code 137 before"), "{}", ended.errors);
    device.wait_for_end().unwrap();
    let rest = device.holdings_at_rest().unwrap();

    // Ten more machines that end somewhere in their firmware or kernel.
    for start in 1..=10 {
        let mut guest = Guest::start(&[&with_device[..], &["--exec", "true"]].concat()).unwrap();
        guest
            .wait_until(|_| {
                let trace = device.trace().unwrap();
                let connection = trace.rfind(&format!("connection {} begins", start + 1));
                connection.is_some_and(|at| trace[at..].lines().count() > 10 * start)
            })
            .unwrap();
        if start % 2 == 0 { guest.kill_qemu() } else { guest.signal(Signal::TERM) }.unwrap();
        guest.end().unwrap();
        device.wait_for_end().unwrap();
        assert_eq!(device.settled_holdings(rest).unwrap(), rest, "after start {start}");
    }

    // The next one finds the card as new.
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("out.png");
    let render = ["--render", "-o", picture.to_str().unwrap()];
    let ended = Guest::run(&[&with_device[..], &render, &PHANTOM].concat()).unwrap();
    assert!(ended.status.success(), "{}", ended.errors);
    assert!(fs::read(&picture).unwrap() == embedded(&PHANTOM));
    device.wait_for_end().unwrap();
    assert_eq!(device.settled_holdings(rest).unwrap(), rest);
    assert!(device.is_alive().unwrap());
}

/// Frames that the device has begun and ended.
fn frames(device: &Device) -> [usize; 2] {
    let trace = device.trace().unwrap();
    ["begins", "done"]
        .map(|word| trace.lines().filter(|line| line.starts_with("frame") && line.contains(word)).count())
}

#[test]
fn a_device_that_dies_is_reported_in_the_guest() {
    if !available("a_device_that_dies_is_reported_in_the_guest").unwrap() {
        return;
    }
    let device = Device::start(DEVICE, &["--renderer", "reference"]).unwrap();
    let script = format!("{LONG}; code=$?; echo ended; exit $code");
    let socket = device.socket();
    let mut guest = Guest::start(&["--socket", socket.to_str().unwrap(), "--exec", &script]).unwrap();
    // QEMU 11.1.3 fails an assertion if a message of its own is unread when the device goes. Soon after the begin of
    // a frame none is: the program waits for an interrupt.
    guest.wait_until(|_| frames(&device)[0] > 2).unwrap();
    let [before, _] = frames(&device);
    guest.wait_until(|_| frames(&device)[0] > before).unwrap();
    std::thread::sleep(Duration::from_millis(50));
    assert_eq!(frames(&device), [before + 1, before], "a frame takes long");
    drop(device);
    let killed = Instant::now();
    // The driver asks the card in vain, and says so...
    guest.wait_until(|guest| guest.errors().contains("volumepro: the card is dead")).unwrap();
    assert!(killed.elapsed() < Duration::from_secs(20), "{:?}", killed.elapsed());
    // ... and when it lets go of it, the guest's kernel waits 66 seconds for the card to come out of its reset.
    guest.wait_for("ended", 1).unwrap();
    assert!(killed.elapsed() < Duration::from_secs(100), "{:?}", killed.elapsed());
    let ended = guest.end().unwrap();
    assert_eq!(ended.status.code(), Some(1), "{}", ended.errors);

    let device = Device::start(DEVICE, &[]).unwrap();
    let socket = device.socket();
    let arguments = ["--socket", socket.to_str().unwrap(), "--no-driver", "--exec", "volumepro-smoke"];
    Guest::run(&arguments).unwrap().success().unwrap();
}
