//! Telling whoever has started the process that clients can connect.

use std::io::{self, Write};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::path::PathBuf;

/// Who is to be told. The service manager's socket is open already, because the sandbox opens none.
#[derive(Debug)]
pub struct Readiness {
    place: String,
    manager: Option<UnixDatagram>,
}

impl Readiness {
    /// Readiness to serve at `place`, which is told to standard output and to the socket that `NOTIFY_SOCKET` names,
    /// if that can be connected to.
    pub fn new(place: String) -> Self {
        let manager =
            std::env::var_os("NOTIFY_SOCKET").and_then(|name| connect(name.as_encoded_bytes()).ok());
        Self { place, manager }
    }

    /// Tells it.
    pub fn tell(&self) {
        let mut output = io::stdout();
        _ = writeln!(output, "listening on {}", self.place).and_then(|()| output.flush());
        if let Some(manager) = &self.manager {
            _ = manager.send(b"READY=1");
        }
    }
}

/// The socket of `sd_notify`: a name that begins with `@` is an abstract one.
fn connect(name: &[u8]) -> io::Result<UnixDatagram> {
    let address = match name.strip_prefix(b"@") {
        Some(name) => SocketAddr::from_abstract_name(name)?,
        None => SocketAddr::from_pathname(PathBuf::from(String::from_utf8_lossy(name).as_ref()))?,
    };
    let socket = UnixDatagram::unbound()?;
    socket.connect_addr(&address)?;
    Ok(socket)
}
