//! The file system that a guest boots from, as an initramfs archive.
//!
//! The format is cpio's "newc" (kernel documentation, `driver-api/early-userspace/buffer-format`). Archives follow one
//! another in one file: later ones add to earlier ones and replace. Equal content gives equal bytes: owners, times and
//! inode numbers of the host do not show.

mod archive;
mod contents;

pub use archive::write;
pub use contents::{Contents, Error, Node};
