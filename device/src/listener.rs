//! The socket at which clients connect.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use rustix::fs::{CWD, FileType, Mode, OFlags, StatxFlags, fchmod, fcntl_getfl, fcntl_setfl, statx};
use rustix::io::Errno;
use rustix::net::sockopt::{socket_acceptconn, socket_domain, socket_type};
use rustix::net::{
    AddressFamily, SocketAddrUnix, SocketFlags, SocketType, bind, connect, listen, socket_with,
};

/// Clients that may wait to be accepted.
const BACKLOG: i32 = 8;

/// Why there is no listening socket.
#[derive(Debug, thiserror::Error)]
pub enum ListenError {
    /// Another process listens there.
    #[error("{}: another process is listening on this socket", path.display())]
    InUse {
        /// The path asked for.
        path: PathBuf,
    },
    /// Something is there that is not a socket.
    #[error("{}: exists and is not a socket", path.display())]
    NotASocket {
        /// The path asked for.
        path: PathBuf,
    },
    /// A descriptor that was handed over is not a listening Unix stream socket.
    #[error("the inherited descriptor is not a listening Unix stream socket")]
    NotListening,
    /// The system refused.
    #[error("{}: {source}", path.display())]
    System {
        /// The path asked for.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
}

/// A listening Unix stream socket. If it has made its path, it removes that when dropped.
#[derive(Debug)]
pub struct Listener {
    socket: OwnedFd,
    path: Option<(PathBuf, FileId)>,
}

/// Device and inode.
type FileId = (u32, u32, u64);

impl Listener {
    /// Listens at `path`, which only the owner may connect to.
    ///
    /// A socket that a dead process left there is replaced; one that a living process listens on is not.
    ///
    /// # Errors
    ///
    /// [`ListenError`], which names the path.
    pub fn bind(path: &Path) -> Result<Self, ListenError> {
        let system = |errno: Errno| ListenError::System { path: path.into(), source: errno.into() };
        let address = SocketAddrUnix::new(path).map_err(system)?;
        let socket = stream_socket().map_err(system)?;
        // The path takes the mode of the socket, so that at no time more than the owner can connect.
        fchmod(&socket, Mode::RUSR | Mode::WUSR).map_err(system)?;
        match bind(&socket, &address) {
            Err(Errno::ADDRINUSE) => {
                remove_stale(path, &address)?;
                bind(&socket, &address).map_err(system)?;
            }
            result => result.map_err(system)?,
        }
        let (id, _) = identify(path).map_err(system)?;
        let listener = Self { socket, path: Some((path.into(), id)) };
        listen(&listener.socket, BACKLOG).map_err(system)?;
        Ok(listener)
    }

    /// Takes a listening socket that was handed over, by a service manager for example.
    ///
    /// # Errors
    ///
    /// [`ListenError::NotListening`] if it is something else.
    pub fn inherit(socket: OwnedFd) -> Result<Self, ListenError> {
        let fits = socket_acceptconn(&socket) == Ok(true)
            && socket_domain(&socket) == Ok(AddressFamily::UNIX)
            && socket_type(&socket) == Ok(SocketType::STREAM);
        if !fits {
            return Err(ListenError::NotListening);
        }
        fcntl_getfl(&socket)
            .and_then(|flags| fcntl_setfl(&socket, flags | OFlags::NONBLOCK))
            .map_err(|_| ListenError::NotListening)?;
        Ok(Self { socket, path: None })
    }
}

impl AsFd for Listener {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        // Another process may have put its own socket there since.
        if let Some((path, id)) = &self.path
            && identify(path).is_ok_and(|(found, _)| found == *id)
        {
            _ = std::fs::remove_file(path);
        }
    }
}

/// Removes a socket that nobody listens on.
fn remove_stale(path: &Path, address: &SocketAddrUnix) -> Result<(), ListenError> {
    let system = |errno: Errno| ListenError::System { path: path.into(), source: errno.into() };
    match identify(path) {
        Ok((_, FileType::Socket)) => {}
        Ok(_) => return Err(ListenError::NotASocket { path: path.into() }),
        // It has gone meanwhile.
        Err(Errno::NOENT) => return Ok(()),
        Err(errno) => return Err(system(errno)),
    }
    match connect(&stream_socket().map_err(system)?, address) {
        Err(Errno::CONNREFUSED) => rustix::fs::unlink(path).map_err(system),
        Err(Errno::NOENT) => Ok(()),
        // A listener whose backlog is full does not take the connection at once.
        Ok(()) | Err(Errno::AGAIN) => Err(ListenError::InUse { path: path.into() }),
        Err(errno) => Err(system(errno)),
    }
}

fn stream_socket() -> Result<OwnedFd, Errno> {
    socket_with(AddressFamily::UNIX, SocketType::STREAM, SocketFlags::CLOEXEC | SocketFlags::NONBLOCK, None)
}

/// What lies at a path itself, a link not followed.
fn identify(path: &Path) -> Result<(FileId, FileType), Errno> {
    let status = statx(CWD, path, rustix::fs::AtFlags::SYMLINK_NOFOLLOW, StatxFlags::BASIC_STATS)?;
    let kind = FileType::from_raw_mode(u32::from(status.stx_mode));
    Ok(((status.stx_dev_major, status.stx_dev_minor, status.stx_ino), kind))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;
    use std::os::unix::net::{UnixListener, UnixStream};

    use super::*;

    #[test]
    fn a_living_listener_keeps_its_path() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("card.sock");
        let first = Listener::bind(&path).unwrap();
        for _ in 0..20 {
            // The backlog fills up and the answer stays.
            assert!(matches!(Listener::bind(&path), Err(ListenError::InUse { .. })));
        }
        drop(first);
        assert!(!path.exists());
    }

    #[test]
    fn what_is_not_a_socket_stays() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "precious").unwrap();
        assert!(matches!(Listener::bind(&file), Err(ListenError::NotASocket { .. })));
        assert!(matches!(Listener::bind(folder.path()), Err(ListenError::NotASocket { .. })));
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&file, &link).unwrap();
        assert!(matches!(Listener::bind(&link), Err(ListenError::NotASocket { .. })));
        assert_eq!(std::fs::read(&file).unwrap(), b"precious");
    }

    #[test]
    fn bad_paths_are_named() {
        let missing = Listener::bind(Path::new("/nowhere/card.sock")).unwrap_err().to_string();
        assert_eq!(missing, "/nowhere/card.sock: No such file or directory (os error 2)");
        let long = "x".repeat(200);
        assert!(Listener::bind(Path::new(&long)).unwrap_err().to_string().starts_with(&long));
    }

    #[test]
    fn a_stale_path_is_replaced_and_only_the_owner_connects() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("card.sock");
        drop(UnixListener::bind(&path).unwrap());
        assert!(path.exists());
        let listener = Listener::bind(&path).unwrap();
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        UnixStream::connect(&path).unwrap();
        // Another process replaces the path: it is not ours to remove any more.
        std::fs::remove_file(&path).unwrap();
        let _other = UnixListener::bind(&path).unwrap();
        drop(listener);
        assert!(path.exists());
    }

    #[test]
    fn only_listening_unix_sockets_are_inherited() {
        let folder = tempfile::tempdir().unwrap();
        let (connected, _peer) = UnixStream::pair().unwrap();
        let network = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let file = std::fs::File::open("/dev/null").unwrap();
        for descriptor in [connected.into(), network.into(), OwnedFd::from(file)] {
            assert!(matches!(Listener::inherit(descriptor), Err(ListenError::NotListening)));
        }
        let path = folder.path().join("inherited.sock");
        drop(Listener::inherit(UnixListener::bind(&path).unwrap().into()).unwrap());
        assert!(path.exists());
    }
}
