//! The sandbox bites: what an attacker would do next is refused.
//!
//! Each attempt runs in a process of its own, which is this program again: [`attempt`] with the name of the attempt
//! in the environment.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::ffi::c_long;
use std::fs::File;
use std::io;
use std::net::{TcpListener, UdpSocket};
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Command, Output};

use memmap2::MmapOptions;
use volumepro_device::sandbox::{self, Mode};

const ATTEMPT: &str = "SANDBOX_ATTEMPT";
const MODE: &str = "SANDBOX_MODE";

/// A process that does not exist.
const NOBODY: i64 = i32::MAX as i64;

type Attempt = fn() -> io::Result<()>;

/// Calls that fail, as they would if the system did not have them.
const MISSING: [(&str, Attempt); 4] = [
    ("read a file", || File::open("/etc/passwd").map(drop)),
    ("write a file", || File::create("/tmp/volumepro-sandbox-attempt").map(drop)),
    ("read a link", || std::fs::read_link("/proc/self/exe").map(drop)),
    ("list a folder", || std::fs::read_dir("/").map(drop)),
];

/// Calls that end the process, and their names.
const FATAL: [(&str, c_long, Attempt); 13] = [
    ("become another program", libc::SYS_execve, || Err(Command::new("/bin/true").exec())),
    ("start a program", libc::SYS_clone, || Command::new("/bin/true").status().map(drop)),
    ("listen on the network", libc::SYS_socket, || TcpListener::bind("127.0.0.1:0").map(drop)),
    ("send to the network", libc::SYS_socket, || UdpSocket::bind("127.0.0.1:0").map(drop)),
    ("connect to another server", libc::SYS_socket, || ignore(UnixStream::connect("/run/other.sock"))),
    ("trace a process", libc::SYS_ptrace, || call(libc::SYS_ptrace, [libc::PTRACE_ATTACH.into(), NOBODY])),
    ("end another process", libc::SYS_kill, || call(libc::SYS_kill, [NOBODY, 0])),
    ("end another thread", libc::SYS_tgkill, || call(libc::SYS_tgkill, [NOBODY, NOBODY])),
    ("map code", libc::SYS_mmap, || {
        let file = File::from(rustix::fs::memfd_create("code", rustix::fs::MemfdFlags::empty())?);
        file.set_len(4096)?;
        // SAFETY: nobody else has the file.
        unsafe { MmapOptions::new().map_exec(&file) }.map(drop)
    }),
    ("make memory code", libc::SYS_mprotect, || {
        let memory = MmapOptions::new().len(4096).map_anon()?;
        memory.make_exec().map(drop)
    }),
    ("delete a file", libc::SYS_unlink, || ignore(std::fs::remove_file("/nowhere/file"))),
    ("change a file's mode", libc::SYS_chmod, || ignore(call(libc::SYS_chmod, [0, 0]))),
    ("enter a name space", libc::SYS_unshare, || call(libc::SYS_unshare, [0, 0])),
];

/// What the card still does.
const ALLOWED: [(&str, Attempt); 5] = [
    ("a thread", || {
        std::thread::spawn(|| File::open("/etc/passwd").unwrap_err())
            .join()
            .map(drop)
            .map_err(|_| io::Error::other("thread"))
    }),
    ("memory", || volumepro_device::backing::Backing::new("memory", 1 << 20).and_then(|it| it.clear())),
    ("a hash table", || ignore(Ok(std::collections::HashMap::from([(1, 2)])))),
    ("a panic", || {
        std::panic::catch_unwind(|| panic!("as ordered")).map_or(Ok(()), |()| Err(io::Error::other("none")))
    }),
    ("much memory", || ignore(Ok(vec![1u8; 64 << 20]))),
];

/// An attempt that the system refuses for a reason of its own once the sandbox has let it pass.
fn ignore<T>(result: io::Result<T>) -> io::Result<()> {
    drop(result);
    Ok(())
}

fn call(number: c_long, [first, second]: [i64; 2]) -> io::Result<()> {
    // SAFETY: none of the calls above takes the address of memory, but for chmod, which refuses a null pointer.
    match unsafe { libc::syscall(number, first, second, 0) } {
        -1 if io::Error::last_os_error().raw_os_error() == Some(libc::ESRCH) => Ok(()),
        -1 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}

fn in_the_sandbox(mode: &str, attempt: &str) -> Output {
    let mut program = Command::new(std::env::current_exe().unwrap());
    program.args(["--exact", "attempt", "--nocapture", "--test-threads=1"]);
    program.env(MODE, mode).env(ATTEMPT, attempt).env("RUST_BACKTRACE", "1").output().unwrap()
}

#[test]
fn attempt() {
    let Ok(name) = std::env::var(ATTEMPT) else { return };
    let mode = if std::env::var(MODE).unwrap() == "log" { Mode::Log } else { Mode::On };
    let fatal = FATAL.iter().map(|(name, _, attempt)| (name, attempt));
    let others = MISSING.iter().chain(&ALLOWED).map(|(name, attempt)| (name, attempt));
    let (_, attempt) = fatal.chain(others).find(|(known, _)| **known == name).unwrap();
    for gap in sandbox::enter(mode, None).unwrap() {
        assert!(!gap.matters(), "{gap}");
    }
    match attempt() {
        Ok(()) => println!("done"),
        Err(error) => println!("refused: {error}"),
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn files_are_as_good_as_missing() {
    for (name, _) in MISSING {
        let output = in_the_sandbox("on", name);
        assert!(text(&output.stdout).contains("refused: Function not implemented"), "{name}: {output:?}");
    }
    assert!(!Path::new("/tmp/volumepro-sandbox-attempt").exists());
}

#[test]
fn other_calls_end_the_process_and_are_named() {
    for (name, number, _) in FATAL {
        let output = in_the_sandbox("on", name);
        let log = text(&output.stderr);
        assert_eq!(output.status.signal(), Some(libc::SIGSYS), "{name}: {output:?}");
        // The C library holds all signals back while it starts a program, and so the line about this one.
        let named = number == libc::SYS_clone || log.contains(&format!("at system call {number};"));
        assert!(named, "{name}: {log}");
        assert!(!text(&output.stdout).contains("done"), "{name}");
    }
}

#[test]
fn what_the_card_needs_passes() {
    for (name, _) in ALLOWED {
        let output = in_the_sandbox("on", name);
        assert!(output.status.success() && text(&output.stdout).contains("done"), "{name}: {output:?}");
    }
}

#[test]
fn the_log_mode_lets_everything_pass() {
    let passing = FATAL.iter().map(|(name, ..)| *name).filter(|name| *name != "become another program");
    for name in passing.chain(["read a file", "list a folder"]) {
        let output = in_the_sandbox("log", name);
        assert!(output.status.success() && text(&output.stdout).contains("done"), "{name}: {output:?}");
    }
    let output = in_the_sandbox("log", "become another program");
    assert!(output.status.success() && !text(&output.stdout).contains("refused"), "{output:?}");
}
