//! What the process gives up before it serves clients.
//!
//! A defect that a client finds must not become an attack on the machine. So before the first client is served,
//! and before there is a second thread, the process
//!
//! 1. gives up privileges that programs can gain when they are started (`no_new_privs`),
//! 2. loses files, networks and other processes by Landlock,
//! 3. keeps only the system calls of one table, [`GROUPS`], by a seccomp filter.
//!
//! Threads inherit all of it. Whatever has to be opened is open by then: socket, trace, and the service manager's
//! socket. A card inside another program does not enter a sandbox: [`serve`](crate::serve()) knows nothing of it.

mod calls;
mod files;
mod filter;

mod refusal;
#[cfg(test)]
mod tests;

use std::io;
use std::path::Path;

pub use calls::{GROUPS, Group, Treatment};
use filter::FilterError;

/// What `--sandbox` selects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Other system calls end the process, with a line that names the call.
    #[default]
    On,
    /// Other system calls are carried out, and written to the kernel's log. Files are not restricted.
    Log,
    /// No sandbox.
    Off,
}

/// Something of the sandbox that the system does not offer.
#[derive(Debug, thiserror::Error)]
pub enum Gap {
    /// Programs that are started can gain privileges. This process starts none.
    #[error("no_new_privs is not to be had here: {0}")]
    Privileges(io::Error),
    /// There is no Landlock.
    #[error("Landlock is not to be had here ({0}): only the system call filter keeps files away")]
    Landlock(String),
    /// Landlock restricts less than a newer kernel's.
    #[error("the Landlock of this kernel is version {0} of {latest}: the system call filter does the rest", latest = files::LATEST)]
    OldLandlock(u32),
    /// There is no seccomp filter.
    #[error("seccomp filters are not to be had here ({0}): system calls are not restricted")]
    Filter(String),
}

impl Gap {
    /// Whether the sandbox is weaker for it.
    #[must_use]
    pub const fn matters(&self) -> bool {
        !matches!(self, Self::OldLandlock(_))
    }
}

/// The sandbox could not be made; a defect of this program.
#[derive(Debug, thiserror::Error)]
#[error("the sandbox cannot be entered: {0}")]
pub struct SandboxError(String);

/// Enters the sandbox with the calling thread and all that it will start; there is no way back. `socket` is the
/// path that the process removes at its end, if any: in its folder files can still be deleted.
///
/// Returns what the system does not offer. A container may have neither Landlock nor seccomp, and a card without
/// them is better than none.
///
/// # Errors
///
/// If the filter is not one that the kernel could take.
pub fn enter(mode: Mode, socket: Option<&Path>) -> Result<Vec<Gap>, SandboxError> {
    if mode == Mode::Off {
        return Ok(Vec::new());
    }
    let mut gaps = Vec::new();
    gaps.extend(no_new_privileges().err().map(Gap::Privileges));
    if mode == Mode::On {
        gaps.extend(files::restrict(socket.and_then(Path::parent)));
        refusal::name_refused_calls();
    }
    match filter::install(mode, socket.is_some()) {
        Ok(()) => {}
        Err(FilterError::System(reason)) => gaps.push(Gap::Filter(reason)),
        Err(FilterError::Table(reason)) => return Err(SandboxError(reason)),
    }
    Ok(gaps)
}

fn no_new_privileges() -> io::Result<()> {
    // SAFETY: this call takes numbers only.
    match unsafe { libc::prctl(libc::PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}
