//! Cards that go and guests that go: reboots, removal, machines and devices that vanish, all in the midst of frames.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use rustix::process::Signal;
use std::fs;
use std::time::{Duration, Instant};
use volumepro_tests::guest::{Guest, Machine, available};
use volumepro_tests::programs::{self, Device};

const VOLUMEPRO: &str = env!("CARGO_BIN_EXE_test-volumepro");
const DEVICE: &str = env!("CARGO_BIN_EXE_test-volumepro-device");

/// A small picture.
const PHANTOM: [&str; 6] = ["--phantom", "engine-block", "--phantom-size", "48", "--size", "200x150"];

/// Frames that take a second each by the reference renderer, to do something in the midst of one.
const LONG: &str = "volumepro render --device pci:$CARDS --phantom engine-block --phantom-size 128 \
    --supersample 1,1,8 --frames 100000 -o /tmp/out.png";

/// Waits in the guest until a frame and its pixels have interrupted it, and then until the next frame is under way.
const IN_A_FRAME: &str = "while [ $(awk '/vfio-msi/ {n += $2} END {print n + 0}' /proc/interrupts) -lt 2 ]; \
    do sleep 0.1; done; sleep 0.2";

/// The picture of the embedded card.
fn embedded(arguments: &[&str]) -> Vec<u8> {
    programs::embedded(VOLUMEPRO, arguments).unwrap()
}

#[test]
fn reboots_cost_the_device_nothing() {
    if !available("reboots_cost_the_device_nothing").unwrap() {
        return;
    }
    let machine = Machine::changed(|line| (line != "-no-reboot").then(|| line.into())).unwrap();
    let mut device = Device::start(DEVICE, &["--strict", "--renderer", "reference"]).unwrap();
    let script = format!(
        "volumepro-selftest --interrupts 10 && echo booted && sleep 2 || exit
        {LONG} &
        {IN_A_FRAME}; reboot -f"
    );
    let socket = device.socket();
    let arguments = ["--machine", machine.path(), "--socket", socket.to_str().unwrap(), "--exec", &script];
    let mut guest = Guest::start(&arguments).unwrap();
    let mut holdings = Vec::new();
    let mut cancelled = Vec::new();
    for boot in 1..=4 {
        guest.wait_for("booted", boot).unwrap();
        holdings.push(device.holdings_at_rest().unwrap());
        cancelled.push(device.trace().unwrap().matches("failed: cancelled").count());
    }
    guest.signal(Signal::TERM).unwrap();
    assert_eq!(guest.end().unwrap().status.code(), Some(143));
    assert!(holdings.windows(2).all(|pair| pair[0] == pair[1]), "{holdings:?}");
    device.wait_for_end().unwrap();
    assert!(device.is_alive().unwrap());
    // The self test cancels frames of its own, and a reboot the one that it comes upon; it may come between two.
    let upon_a_frame = (1..4).filter(|&boot| cancelled[boot] - cancelled[boot - 1] > cancelled[0]).count();
    assert!(upon_a_frame >= 2, "{cancelled:?}");
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
    // ... and lets go of it at once: the guest's kernel does not wait a minute for the card to come out of a reset.
    guest.wait_for("ended", 1).unwrap();
    assert!(killed.elapsed() < Duration::from_secs(40), "{:?}", killed.elapsed());
    let ended = guest.end().unwrap();
    assert_eq!(ended.status.code(), Some(1), "{}", ended.errors);

    let device = Device::start(DEVICE, &[]).unwrap();
    let socket = device.socket();
    let arguments = ["--socket", socket.to_str().unwrap(), "--no-driver", "--exec", "volumepro-smoke"];
    Guest::run(&arguments).unwrap().success().unwrap();
}

#[test]
fn a_card_loses_its_program_in_the_midst_of_a_frame_is_removed_and_comes_back() {
    if !available("a_card_loses_its_program_in_the_midst_of_a_frame_is_removed_and_comes_back").unwrap() {
        return;
    }
    let device = Device::start(DEVICE, &["--renderer", "reference"]).unwrap();
    // It takes the kernel up to a second to end the program and reset the card, and the frame longer.
    let longer = LONG.replace("128", "160");
    let script = format!(
        "{longer} & program=$!
        {IN_A_FRAME}
        card=/sys/bus/pci/devices/$CARDS
        kill -9 $program; wait $program
        echo 1 >$card/remove
        volumepro render --device pci:auto --phantom engine-block -o /tmp/out.png && exit 3
        echo 1 >/sys/bus/pci/rescan
        echo vfio-pci >$card/driver_override
        echo $CARDS >/sys/bus/pci/drivers_probe
        volumepro render --device pci:$CARDS -o /tmp/out.png {} && cat /tmp/out.png",
        PHANTOM.join(" ")
    );
    let socket = device.socket();
    let ended = Guest::run(&["--socket", socket.to_str().unwrap(), "--exec", &script]).unwrap();
    assert!(ended.status.success(), "{}", ended.errors);
    let nothing = "volumepro: no VolumePro 500 (1067:1002 or 10ba:1002) among";
    assert!(ended.errors.contains(nothing), "{}", ended.errors);
    assert!(ended.output == embedded(&PHANTOM), "the pictures differ");
    device.wait_for_end().unwrap();
    let trace = device.trace().unwrap();
    let course: Vec<_> =
        trace.lines().filter(|line| line.contains("frame ") || line.contains("reset")).collect();
    assert!(course.iter().any(|line| line.ends_with("failed: cancelled")), "{}", course.join("\n"));
}
