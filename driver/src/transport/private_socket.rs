//! A socket that no other user can reach.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::TempDir;

use super::vfio_user::VfioUser;
use crate::Error;

/// A place for the socket of a card that runs for this process alone: in a directory that only this user may
/// enter, and that is removed with the socket as soon as the connection stands.
#[derive(Debug)]
pub struct PrivateSocket {
    path: PathBuf,
    /// Removed with everything in it when dropped.
    _directory: TempDir,
}

impl PrivateSocket {
    /// A new directory. The socket itself is the server's to create.
    ///
    /// # Errors
    ///
    /// [`Error::System`] if the system has no room for it.
    pub fn new() -> Result<Self, Error> {
        let directory = tempfile::Builder::new()
            .prefix("volumepro-")
            .permissions(Permissions::from_mode(0o700))
            .tempdir()
            .map_err(|cause| Error::System { what: "making a directory for the card's socket", cause })?;
        Ok(Self { path: directory.path().join("card.sock"), _directory: directory })
    }

    /// Where the server listens.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Connects to the server, which listens already, and removes socket and directory. No call lasts longer
    /// than `timeout`.
    ///
    /// # Errors
    ///
    /// As [`VfioUser::connect`].
    pub fn connect(self, timeout: Duration) -> Result<VfioUser, Error> {
        VfioUser::connect(&self.path, timeout)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_else_may_enter_and_nothing_is_left() {
        let socket = PrivateSocket::new().unwrap();
        let directory = socket.path().parent().unwrap().to_owned();
        assert_eq!(directory.metadata().unwrap().permissions().mode() & 0o777, 0o700);
        let error = socket.connect(Duration::from_secs(1)).err().unwrap();
        assert!(error.to_string().contains("card.sock"), "{error}");
        assert!(!directory.exists());
    }
}
