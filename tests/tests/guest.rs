//! The card in a guest of QEMU, with the guest's own kernel, VFIO and programs.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use std::fs;
use std::path::Path;
use volumepro_tests::guest::{Guest, Machine, available};
use volumepro_tests::programs::{self, Device, volumepro};

const VOLUMEPRO: &str = env!("CARGO_BIN_EXE_test-volumepro");
const DEVICE: &str = env!("CARGO_BIN_EXE_test-volumepro-device");

/// Small enough for a guest without hardware virtualisation.
const PHANTOM: [&str; 6] = ["--phantom", "engine-block", "--phantom-size", "48", "--size", "200x150"];

/// The picture of the embedded card.
fn embedded(arguments: &[&str]) -> Vec<u8> {
    programs::embedded(VOLUMEPRO, arguments).unwrap()
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
    for (text, checks) in [(selftest, 19), (smoke, 3)] {
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
fn what_is_missing_in_the_guest_is_said() {
    if !available("what_is_missing_in_the_guest_is_said").unwrap() {
        return;
    }
    // No IOMMU: the kernel gives the card to no driver. It is polled then, and reaches memory by physical addresses.
    let machine = Machine::changed(|line| (!line.contains("intel-iommu,")).then(|| line.into())).unwrap();
    let script = format!(
        "exec 3>&1 >&2
        mkdir -p /etc; echo user:x:1000:1000::/:/bin/sh >/etc/passwd
        volumepro-selftest
        su user -c volumepro-smoke
        volumepro render --device pci:00:1f.0 --phantom engine-block -o /tmp/out.png
        volumepro render --device pci:00:09.0 --phantom engine-block -o /tmp/out.png
        volumepro render --device pci:auto -o /tmp/out.png {} || exit
        cat /tmp/out.png >&3
        echo 1 >/sys/bus/pci/devices/$CARDS/remove
        volumepro-smoke",
        PHANTOM.join(" ")
    );
    let ended = Guest::run(&["--machine", machine.path(), "--exec", &script]).unwrap();
    for message in [
        "FAIL open: 0000:00:01.0 has no driver; bind it to vfio-pci, or use volumepro-smoke",
        "FAIL find: writing /sys/bus/pci/devices/0000:00:01.0/enable: Permission denied (os error 13)",
        "volumepro: PCI device 8086:2918 is no VolumePro 500 (1067:1002 or 10ba:1002)",
        "volumepro: no PCI device at 0000:00:09.0 in /sys/bus/pci/devices",
        "FAIL find: no VolumePro 500 (1067:1002 or 10ba:1002) among the PCI devices in /sys/bus/pci/devices",
    ] {
        assert!(ended.errors.contains(message), "{}\n{message}", ended.errors);
    }
    assert!(ended.output == embedded(&PHANTOM), "the pictures differ");

    let machine = Machine::changed(|line| Some(line.replace("share=on", "share=off"))).unwrap();
    let script = "mkdir -p /etc; echo user:x:1000:1000::/:/bin/sh >/etc/passwd; exec >&2; volumepro-selftest; su user -c volumepro-selftest";
    let ended = Guest::run(&["--machine", machine.path(), "--exec", script]).unwrap();
    for message in [
        "FAIL open: the card does not reach host memory within 3s: in a virtual machine, guest memory must be shared",
        "FAIL open: opening /dev/vfio/",
    ] {
        assert!(ended.errors.contains(message), "{}\n{message}", ended.errors);
    }
}
