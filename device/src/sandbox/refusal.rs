//! The last words of a process that made a system call which is not in the table.

use std::ffi::{c_int, c_uint, c_void};
use std::fmt::{self, Write};

/// What the kernel tells with `SIGSYS`, as `<asm-generic/siginfo.h>` has it.
#[repr(C)]
struct Information {
    signal: c_int,
    error: c_int,
    code: c_int,
    address: *mut c_void,
    call: c_int,
    architecture: c_uint,
}

/// A line of text without the heap, which a signal handler must not touch. What does not fit is lost.
struct Line {
    text: [u8; 160],
    length: usize,
}

impl Write for Line {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for (place, byte) in self.text.iter_mut().skip(self.length).zip(text.bytes()) {
            *place = byte;
            self.length += 1;
        }
        Ok(())
    }
}

/// From now on a refused system call is named on standard error before it ends the process.
pub(super) fn name_refused_calls() {
    // SAFETY: a zeroed `sigaction` is a valid one; the handler has the form that SA_SIGINFO asks for, and does
    // only what a signal handler may. If the system refuses, the call still ends the process, without a line.
    unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = name as extern "C" fn(c_int, *mut Information, *mut c_void) as usize;
        action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK | libc::SA_RESETHAND;
        libc::sigaction(libc::SIGSYS, &raw const action, std::ptr::null_mut());
    }
}

extern "C" fn name(signal: c_int, information: *mut Information, _: *mut c_void) {
    // SAFETY: the kernel passes a valid structure to handlers that were set with SA_SIGINFO.
    let call = unsafe { (*information).call };
    let mut line = Line { text: [0; 160], length: 0 };
    _ = writeln!(
        line,
        "volumepro-device: the sandbox ends the process at system call {call}; with --sandbox log such calls pass"
    );
    // SAFETY: the buffer has that many bytes. SA_RESETHAND has set back what the signal does: it ends the process
    // as soon as this handler returns.
    unsafe {
        libc::write(libc::STDERR_FILENO, line.text.as_ptr().cast(), line.length);
        libc::raise(signal);
    }
}
