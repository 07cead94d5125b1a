//! Each half of the sandbox on a thread of its own, which takes the restrictions with it.

use std::fs::File;
use std::io::ErrorKind;
use std::net::TcpListener;
use std::path::PathBuf;

use seccompiler::{BpfProgram, SeccompAction, SeccompFilter, apply_filter};

use super::*;

/// What a thread finds that has done something to itself.
fn on_a_thread<R: Send>(find: impl FnOnce() -> R + Send) -> R {
    std::thread::scope(|scope| scope.spawn(find).join().unwrap())
}

/// A container that answers these system calls with an error.
fn without(calls: &[i64], error: i32) {
    let rules = calls.iter().map(|&call| (call, Vec::new())).collect();
    let refused = SeccompAction::Errno(error as u32);
    let architecture = std::env::consts::ARCH.try_into().unwrap();
    let filter = SeccompFilter::new(rules, SeccompAction::Allow, refused, architecture).unwrap();
    apply_filter(&BpfProgram::try_from(filter).unwrap()).unwrap();
}

fn gaps(mode: Mode) -> Vec<String> {
    let gaps = enter(mode, None).unwrap();
    gaps.into_iter().filter(Gap::matters).map(|gap| gap.to_string()).collect()
}

#[test]
fn no_sandbox_takes_nothing_away() {
    on_a_thread(|| {
        assert!(gaps(Mode::Off).is_empty());
        File::open("/etc/passwd").unwrap();
        let status = std::fs::read_to_string("/proc/thread-self/status").unwrap();
        assert!(status.contains("\nSeccomp:\t0\n") && status.contains("\nNoNewPrivs:\t0\n"), "{status}");
    });
}

#[test]
fn the_log_mode_lets_calls_pass() {
    on_a_thread(|| {
        assert!(gaps(Mode::Log).is_empty());
        let status = std::fs::read_to_string("/proc/thread-self/status").unwrap();
        assert!(status.contains("\nSeccomp:\t2\n") && status.contains("\nNoNewPrivs:\t1\n"), "{status}");
        TcpListener::bind("127.0.0.1:0").unwrap();
    });
}

#[test]
fn a_container_without_landlock_and_seccomp_is_told() {
    const NEITHER: [i64; 2] = [libc::SYS_landlock_create_ruleset, libc::SYS_seccomp];
    for error in [libc::ENOSYS, libc::EPERM] {
        let gaps = on_a_thread(|| {
            without(&NEITHER, error);
            gaps(Mode::On)
        });
        assert_eq!(gaps.len(), 2, "{gaps:?}");
        assert!(gaps[0].starts_with("Landlock is not to be had here ("), "{gaps:?}");
        assert!(gaps[1].starts_with("seccomp filters are not to be had here ("), "{gaps:?}");
        assert!(gaps.iter().all(|gap| gap.lines().count() == 1));
    }
}

#[test]
fn a_container_without_landlock_keeps_the_filter() {
    let found = on_a_thread(|| {
        without(&[libc::SYS_landlock_create_ruleset], libc::ENOSYS);
        let gaps = gaps(Mode::On);
        (gaps, File::open("/etc/passwd").map(drop))
    });
    assert_eq!(found.0.len(), 1, "{:?}", found.0);
    assert_eq!(found.1.unwrap_err().raw_os_error(), Some(libc::ENOSYS));
}

#[test]
fn landlock_takes_files_and_networks_and_leaves_the_sockets_folder() {
    let [folder, elsewhere] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let path = |name: &str| -> PathBuf { folder.path().join(name) };
    let (inside, outside) = (path("socket"), elsewhere.path().join("file"));
    std::fs::write(&inside, "").unwrap();
    let open = File::create(&outside).unwrap();
    on_a_thread(|| {
        assert!(files::restrict(Some(folder.path())).is_none_or(|gap| !gap.matters()));
        let denied = |result: std::io::Result<()>| result.unwrap_err().kind() == ErrorKind::PermissionDenied;
        assert!(denied(File::open("/etc/passwd").map(drop)));
        assert!(denied(File::open(&inside).map(drop)));
        assert!(denied(File::create(path("new")).map(drop)));
        assert!(denied(std::fs::remove_file(&outside)));
        assert!(denied(TcpListener::bind("127.0.0.1:0").map(drop)));
        // What is open stays so, and the socket's path can be taken away.
        std::io::Write::write_all(&mut &open, b"trace").unwrap();
        std::fs::remove_file(&inside).unwrap();
    });
    assert!(!inside.exists());
    assert_eq!(std::fs::read(&outside).unwrap(), b"trace");
}

#[test]
fn a_plain_name_lies_in_the_current_folder() {
    on_a_thread(|| {
        let gap = files::restrict(Path::new("card.sock").parent());
        assert!(gap.is_none_or(|gap| !gap.matters()));
    });
}

#[test]
fn no_system_call_stands_in_the_table_twice() {
    let mut names: Vec<_> = GROUPS.iter().flat_map(Group::names).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count);
    for refused in ["execve", "execveat", "socket", "connect", "ptrace", "kill", "fork", "vfork", "ioctl"] {
        assert!(!names.contains(&refused), "{refused}");
    }
}
