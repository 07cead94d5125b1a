//! The system calls that the process makes, each with its reason.

use libc::*;

/// How the system calls of a group are treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Treatment {
    /// Carried out.
    Allowed,
    /// Carried out if the process removes its socket's path at its end.
    AllowedWithSocket,
    /// Answered with "no such system call", after which callers do without.
    Missing,
}

/// System calls for one purpose.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// What they are for.
    pub purpose: &'static str,
    /// How they are treated.
    pub treatment: Treatment,
    pub(super) calls: &'static [Call],
}

/// One system call.
#[derive(Clone, Copy, Debug)]
pub(super) struct Call {
    /// Its name behind `SYS_`.
    name: &'static str,
    pub(super) number: c_long,
    /// It is treated so only if one of these holds; without any it always is.
    pub(super) only: &'static [Only],
}

/// A condition on an argument.
#[derive(Clone, Copy, Debug)]
pub(super) enum Only {
    /// Argument `argument` has `value` in the bits of `mask`.
    Bits { argument: u8, mask: u32, value: u32 },
    /// The first argument is this process.
    ThisProcess,
}

impl Group {
    /// Names of the system calls.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.calls.iter().map(Call::name)
    }
}

impl Call {
    fn name(&self) -> &'static str {
        self.name.strip_prefix("SYS_").unwrap_or(self.name)
    }
}

/// `calls![SYS_read, SYS_fcntl if [..]]`
macro_rules! calls {
    ($($name:ident $(if $only:expr)?),+ $(,)?) => {
        &[$(Call { name: stringify!($name), number: $name, only: calls!(@ $($only)?) }),+]
    };
    (@) => { &[] };
    (@ $only:expr) => { &$only };
}

const fn is(argument: u8, value: c_int) -> Only {
    Only::Bits { argument, mask: u32::MAX, value: value as u32 }
}

/// Memory that is not executable.
const NOT_EXECUTABLE: [Only; 1] = [Only::Bits { argument: 2, mask: PROT_EXEC as u32, value: 0 }];
/// A thread of this process, in the name spaces of this process.
const THREAD: [Only; 1] = [Only::Bits {
    argument: 0,
    mask: (CLONE_THREAD
        | CLONE_NEWNS
        | CLONE_NEWCGROUP
        | CLONE_NEWUTS
        | CLONE_NEWIPC
        | CLONE_NEWUSER
        | CLONE_NEWPID
        | CLONE_NEWNET) as u32,
    value: CLONE_THREAD as u32,
}];
/// To duplicate descriptors, and to look at them and at seals.
const FCNTL: [Only; 5] =
    [is(1, F_DUPFD_CLOEXEC), is(1, F_GETFD), is(1, F_GETFL), is(1, F_ADD_SEALS), is(1, F_GET_SEALS)];
/// Names of threads and, from the C library, of memory.
const PRCTL: [Only; 2] = [is(0, PR_SET_NAME), is(0, PR_SET_VMA)];
/// How long a client that is turned away may take.
const SETSOCKOPT: [Only; 2] = [is(2, SO_RCVTIMEO), is(2, SO_SNDTIMEO)];

/// All system calls that do not end the process. Calls that do the same in newer and older systems stand beside each
/// other, because the C library chooses between them.
pub const GROUPS: &[Group] = &[
    Group {
        purpose: "messages from and to clients; trace, log, and the word to the service manager",
        treatment: Treatment::Allowed,
        calls: calls![
            SYS_accept4,
            SYS_recvmsg,
            SYS_sendmsg,
            SYS_recvfrom,
            SYS_sendto,
            SYS_setsockopt if SETSOCKOPT,
            SYS_read,
            SYS_write,
            SYS_writev,
            SYS_close,
        ],
    },
    Group {
        purpose: "interrupts, without waiting for a client that does not take them",
        treatment: Treatment::Allowed,
        calls: calls![SYS_io_setup, SYS_io_submit, SYS_io_getevents, SYS_io_destroy],
    },
    Group {
        purpose: "waiting for clients, signals, other threads and the time",
        treatment: Treatment::Allowed,
        calls: calls![
            SYS_poll,
            SYS_ppoll,
            SYS_epoll_wait,
            SYS_epoll_pwait,
            SYS_epoll_pwait2,
            SYS_epoll_ctl,
            SYS_futex,
            SYS_nanosleep,
            SYS_clock_nanosleep,
            SYS_clock_gettime,
            SYS_gettimeofday,
            SYS_sched_yield,
            SYS_restart_syscall,
        ],
    },
    Group {
        purpose: "the card's memories, new ones for each client, and the client's memory",
        treatment: Treatment::Allowed,
        calls: calls![
            SYS_memfd_create,
            SYS_ftruncate,
            SYS_fallocate,
            SYS_fcntl if FCNTL,
            SYS_fstat,
            SYS_newfstatat,
            SYS_statx,
            SYS_pread64,
            SYS_pwrite64,
            SYS_mmap if NOT_EXECUTABLE,
            SYS_munmap,
        ],
    },
    Group {
        purpose: "the process's own memory, and random numbers for its hash tables",
        treatment: Treatment::Allowed,
        calls: calls![SYS_brk, SYS_mremap, SYS_mprotect if NOT_EXECUTABLE, SYS_madvise, SYS_getrandom],
    },
    Group {
        purpose: "threads",
        treatment: Treatment::Allowed,
        calls: calls![
            SYS_clone if THREAD,
            SYS_set_robust_list,
            SYS_rseq,
            SYS_prctl if PRCTL,
            SYS_sched_getaffinity,
            SYS_sigaltstack,
            SYS_rt_sigprocmask,
            SYS_gettid,
            SYS_getpid,
            SYS_exit,
        ],
    },
    Group {
        purpose: "signals to this process, and its end",
        treatment: Treatment::Allowed,
        calls: calls![SYS_rt_sigaction, SYS_rt_sigreturn, SYS_tgkill if [Only::ThisProcess], SYS_exit_group],
    },
    Group {
        purpose: "taking the socket's path away at the end",
        treatment: Treatment::AllowedWithSocket,
        calls: calls![SYS_unlink, SYS_unlinkat],
    },
    Group {
        purpose: "threads again: their arguments lie in memory, where no filter sees them; callers fall back to clone",
        treatment: Treatment::Missing,
        calls: calls![SYS_clone3],
    },
    Group {
        purpose: "files that the C library asks for the number of processors, and a panic for the names of its callers",
        treatment: Treatment::Missing,
        calls: calls![SYS_open, SYS_openat, SYS_openat2, SYS_readlink, SYS_readlinkat, SYS_getcwd],
    },
];
