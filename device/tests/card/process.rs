//! The process: readiness, signals, exit codes, inherited sockets.

use std::io::{BufRead, BufReader, Read};
use std::os::fd::OwnedFd;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixDatagram, UnixListener};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use vg500_regs::table::voxel_memory_size;

use crate::peer::Peer;

const PROGRAM: &str = env!("CARGO_BIN_EXE_volumepro-device");

pub fn command(words: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.args(words).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Starts a process and waits until it is ready; returns the line that says so.
pub fn ready(mut command: Command) -> (Child, String) {
    let mut child = command.spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    (child, line)
}

pub fn end(mut child: Child, signal: Signal) -> (Option<i32>, String) {
    kill_process(Pid::from_child(&child), signal).unwrap();
    let mut log = String::new();
    child.stderr.take().unwrap().read_to_string(&mut log).unwrap();
    (child.wait().unwrap().code(), log)
}

#[test]
fn unusable_command_lines_end_with_code_2_and_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let socket = folder.path().join("card.sock");
    let [file, socket] = [file, socket].map(|path| path.display().to_string());
    let cases: [&[&str]; 9] = [
        &[],
        &["--socket"],
        &["--bogus"],
        &["--socket", &file],
        &["--socket", "/nowhere/card.sock"],
        &["--socket", &socket, "--trace", "/nowhere/trace"],
        &["--socket", &socket, "--renderer", "fastest"],
        &["--socket", &socket, "--threads", "0"],
        &["--socket", &socket, "--simd", "mmx"],
    ];
    for words in cases {
        let Output { status, stdout, stderr } = command(words).output().unwrap();
        let text = String::from_utf8(stderr).unwrap();
        assert_eq!((status.code(), stdout.len()), (Some(2), 0), "{words:?}: {text}");
        assert_eq!(text.lines().count(), 1, "{words:?}: {text}");
        assert!(!Path::new(&socket).exists(), "{words:?}");
    }
}

#[test]
fn a_socket_in_use_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("card.sock");
    let (first, _) = ready(command(&["--socket", socket.to_str().unwrap()]));
    let second = command(&["--socket", socket.to_str().unwrap()]).output().unwrap();
    assert_eq!(second.status.code(), Some(1));
    assert!(String::from_utf8(second.stderr).unwrap().contains("another process"));
    Peer::new(&socket);
    assert_eq!(end(first, Signal::TERM).0, Some(0));
}

#[test]
fn signals_end_it_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("card.sock");
    let words = ["--socket", socket.to_str().unwrap(), "--strict", "--voxel-memory", "256"];
    for signal in [Signal::INT, Signal::TERM] {
        let (child, line) = ready(command(&words));
        assert_eq!(line, format!("listening on {}\n", socket.display()));
        assert_eq!(socket.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        let mut peer = Peer::new(&socket);
        assert_eq!(peer.read(voxel_memory_size::REGISTER), 256 << 20);
        assert_eq!(end(child, signal).0, Some(0));
        assert!(!socket.exists());
    }
}

#[test]
fn what_a_client_can_cause_does_not_flood_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("card.sock");
    let (child, _) = ready(command(&["--socket", socket.to_str().unwrap(), "--strict"]));
    let mut peer = Peer::new(&socket);
    (0..500).for_each(|_| _ = peer.read_at(0x18));
    drop(peer);
    let (code, log) = end(child, Signal::TERM);
    assert_eq!(code, Some(0));
    let named = log.matches("undocumented offset 0x0018").count();
    assert!((1..100).contains(&named), "{named} lines");
}

#[test]
fn a_listening_socket_can_be_inherited() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("card.sock");
    let listener = OwnedFd::from(UnixListener::bind(&socket).unwrap());
    let notify = folder.path().join("notify.sock");
    let manager = UnixDatagram::bind(&notify).unwrap();
    manager.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    // The shell puts the socket, its standard input, where the protocol wants it, and becomes the process that it names.
    let script = format!("export LISTEN_PID=$$; exec {PROGRAM} 3<&0 </dev/null");
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(script);
    shell.env("LISTEN_FDS", "1").env("NOTIFY_SOCKET", &notify);
    shell.stdin(Stdio::from(listener)).stdout(Stdio::piped()).stderr(Stdio::piped());
    let (child, line) = ready(shell);
    assert_eq!(line, "listening on an inherited socket\n");
    let mut message = [0; 64];
    let length = manager.recv(&mut message).unwrap();
    assert_eq!(&message[..length], b"READY=1");
    Peer::new(&socket);
    assert_eq!(end(child, Signal::TERM).0, Some(0));
    assert!(socket.exists(), "it belongs to who made it");
}
