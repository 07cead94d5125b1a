//! The process in its sandbox: it serves as ever, and every thread of it is restricted.

use std::fs::{File, read_to_string};
use std::os::fd::AsRawFd;
use std::os::unix::fs::{FileExt, chown};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

use rustix::fs::{MemfdFlags, memfd_create};
use rustix::process::{Signal, geteuid};
use vg500_regs::PixelFormat;
use vg500_regs::pci::{PIXEL_MEMORY, Vector};
use vg500_regs::table::*;

use crate::frames::start_transfer;
use crate::peer::{Peer, await_that, frame};
use crate::process::{command, end, ready};

/// A line of the status of each thread of a process.
fn of_each_thread(process: u32, line: &str) -> Vec<String> {
    let threads = std::fs::read_dir(format!("/proc/{process}/task")).unwrap();
    let status = threads.map(|thread| read_to_string(thread.unwrap().path().join("status")).unwrap());
    status
        .map(|status| {
            let found = status.lines().find_map(|it| it.strip_prefix(line)).unwrap();
            found.trim_start_matches(':').trim().to_owned()
        })
        .collect()
}

fn render(socket: &Path, tag: u32) {
    let mut peer = Peer::new(socket);
    peer.fill(32);
    peer.write(interrupt_enable::REGISTER, interrupt_enable::FRAME.mask());
    peer.start(&frame(32, tag, 0));
    peer.await_interrupt(Vector::Frame as usize);
    assert_eq!(peer.plane_state(0), (tag, result::DONE));
}

/// Has the card write a picture into a plain file and into an unsealed memfd, which it reaches by system calls.
fn transfer_to_files(socket: &Path) {
    const AT: u64 = 1 << 32;
    const SIZE: u64 = 1 << 20;
    let mut peer = Peer::new(socket);
    peer.fill(32);
    peer.start(&frame(32, 1, 0));
    let files =
        [tempfile::tempfile().unwrap(), File::from(memfd_create("unsealed", MemfdFlags::empty()).unwrap())];
    for (tag, file) in (1..).zip(files) {
        file.set_len(SIZE).unwrap();
        peer.client.dma_map(0, AT, SIZE, file.as_raw_fd()).unwrap();
        start_transfer(&mut peer, tag, AT, PixelFormat::Rgba8);
        await_that(|| peer.read(transfer_state::REGISTER) == tag | result::DONE << 16);
        let mut row = [0; 128];
        file.read_exact_at(&mut row, 0).unwrap();
        assert_eq!(peer.memory(PIXEL_MEMORY).bytes(0, 128), row);
        assert!(row.iter().any(|&byte| byte != 0));
        peer.client.dma_unmap(AT, SIZE).unwrap();
    }
}

/// Serves frames to several clients, one of which breaks the protocol; returns the log.
fn serves(mut command: Command, folder: &Path, seccomp: &str) -> String {
    let (socket, trace) = (folder.join("card.sock"), folder.join("trace"));
    command.arg("--socket").arg(&socket).arg("--trace").arg(&trace).arg("--strict");
    let (child, line) = ready(command);
    assert!(line.starts_with("listening on"), "{line}");
    render(&socket, 1);
    std::io::Write::write_all(&mut std::os::unix::net::UnixStream::connect(&socket).unwrap(), &[0; 16])
        .unwrap();
    transfer_to_files(&socket);
    render(&socket, 2);
    let restricted = of_each_thread(child.id(), "Seccomp");
    assert!(restricted.len() >= 4 && restricted.iter().all(|it| it == seccomp), "{restricted:?}");
    let privileges = of_each_thread(child.id(), "NoNewPrivs");
    assert!(privileges.iter().all(|it| it == if seccomp == "0" { "0" } else { "1" }), "{privileges:?}");
    let (code, log) = end(child, Signal::INT);
    assert_eq!(code, Some(0), "{log}");
    assert!(!socket.exists());
    assert!(read_to_string(trace).unwrap().contains("frame 2 done"));
    log
}

#[test]
fn every_thread_is_restricted_and_frames_are_served() {
    for (words, seccomp) in [
        (&[][..], "2"),
        (&["--sandbox", "on"], "2"),
        (&["--sandbox", "log"], "2"),
        (&["--sandbox", "off"], "0"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let log = serves(command(words), folder.path(), seccomp);
        assert!(!log.contains("not to be had"), "{log}");
    }
}

#[test]
fn an_ordinary_user_is_restricted_as_well() {
    if !geteuid().is_root() {
        // Then the other tests have shown it.
        return;
    }
    const NOBODY: u32 = 65534;
    let folder = tempfile::tempdir().unwrap();
    chown(folder.path(), Some(NOBODY), Some(NOBODY)).unwrap();
    let mut command = command(&[]);
    command.uid(NOBODY).gid(NOBODY);
    serves(command, folder.path(), "2");
}
