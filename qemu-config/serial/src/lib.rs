//! Results of a guest's command, brought to the host over a serial line.
//!
//! `volumepro-send` runs a command in the guest and sends frames: what the command prints, as it comes, then the file
//! that it was to write, then its exit code. `volumepro-receive` on the host prints, writes, and exits alike.

pub mod frame;
pub mod receive;
pub mod send;
