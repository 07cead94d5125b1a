//! What goes into an archive.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Component, Path, PathBuf};

/// What stands at a path of the guest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Node {
    /// A directory.
    Directory,
    /// A copy of a file of the host. It can be executed if the host's can.
    File {
        /// Where it is on the host.
        host: PathBuf,
        /// Whether it can be executed.
        executable: bool,
    },
    /// A symbolic link.
    Link {
        /// What it points to.
        target: PathBuf,
    },
}

/// Why there is no archive.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A guest path that cannot be one.
    #[error("{}: a path of the guest begins with '/' and has no '..'", path.display())]
    Path {
        /// The path.
        path: PathBuf,
    },
    /// A guest path is asked to be a directory and something else.
    #[error("{}: both a directory and a file or link", path.display())]
    Conflict {
        /// The path.
        path: PathBuf,
    },
    /// Neither a file nor a directory nor a link.
    #[error("{}: neither a file nor a directory", path.display())]
    Kind {
        /// The host's path.
        path: PathBuf,
    },
    /// The format has 32 bits for sizes.
    #[error("{}: {size} bytes; an initramfs holds files of less than 4 GiB", path.display())]
    TooLarge {
        /// The host's path.
        path: PathBuf,
        /// Its size in bytes.
        size: u64,
    },
    /// A file is longer or shorter than at first.
    #[error("{}: its size has changed while it was read", path.display())]
    Changed {
        /// The host's path.
        path: PathBuf,
    },
    /// The system refused.
    #[error("{}: {source}", path.display())]
    System {
        /// The host's path.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The archive cannot be written.
    #[error("cannot write: {0}")]
    Write(#[source] io::Error),
}

impl Error {
    /// Names the path of an error of the system.
    pub(crate) fn at(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::System { path: path.into(), source }
    }
}

/// The paths of the guest, each after its directory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    nodes: BTreeMap<PathBuf, Node>,
}

impl Contents {
    /// Adds an empty directory and those above it.
    ///
    /// # Errors
    /// [`Error::Path`], [`Error::Conflict`].
    pub fn add_directory(&mut self, guest: &Path) -> Result<(), Error> {
        for directory in relative(guest)?.ancestors().filter(|path| !path.as_os_str().is_empty()) {
            if *self.nodes.entry(directory.into()).or_insert(Node::Directory) != Node::Directory {
                return Err(Error::Conflict { path: Path::new("/").join(directory) });
            }
        }
        Ok(())
    }

    /// Adds a file of the host, or, with all that is in it, a directory.
    ///
    /// # Errors
    /// Any but [`Error::Changed`] and [`Error::Write`].
    pub fn add_file(&mut self, guest: &Path, host: &Path) -> Result<(), Error> {
        let metadata = fs::metadata(host).map_err(Error::at(host))?;
        if metadata.is_dir() {
            return self.add_tree(guest, host);
        }
        if !metadata.is_file() {
            return Err(Error::Kind { path: host.into() });
        }
        let executable = metadata.permissions().mode() & 0o111 != 0;
        self.add(guest, Node::File { host: host.into(), executable })
    }

    /// Adds a symbolic link.
    ///
    /// # Errors
    /// [`Error::Path`], [`Error::Conflict`].
    pub fn add_link(&mut self, guest: &Path, target: &Path) -> Result<(), Error> {
        self.add(guest, Node::Link { target: target.into() })
    }

    /// Adds what a directory of the host holds. Links stay links.
    fn add_tree(&mut self, guest: &Path, host: &Path) -> Result<(), Error> {
        self.add_directory(guest)?;
        for entry in fs::read_dir(host).map_err(Error::at(host))? {
            let path = entry.map_err(Error::at(host))?.path();
            let Some(name) = path.file_name() else { continue };
            let guest = guest.join(name);
            if path.is_symlink() {
                self.add_link(&guest, &fs::read_link(&path).map_err(Error::at(&path))?)?;
            } else {
                self.add_file(&guest, &path)?;
            }
        }
        Ok(())
    }

    fn add(&mut self, guest: &Path, node: Node) -> Result<(), Error> {
        let path = relative(guest)?;
        match path.parent() {
            None => return Err(Error::Path { path: guest.into() }),
            Some(parent) => self.add_directory(&Path::new("/").join(parent))?,
        }
        if self.nodes.get(&path) == Some(&Node::Directory) {
            return Err(Error::Conflict { path: guest.into() });
        }
        self.nodes.insert(path, node);
        Ok(())
    }

    /// The paths, relative to the guest's root, each after its directory, and what is there.
    pub fn nodes(&self) -> impl Iterator<Item = (&Path, &Node)> {
        self.nodes.iter().map(|(path, node)| (path.as_path(), node))
    }
}

/// A path of the guest without its first slash, and without double slashes and single dots.
fn relative(guest: &Path) -> Result<PathBuf, Error> {
    let error = || Error::Path { path: guest.into() };
    let mut components = guest.components();
    if components.next() != Some(Component::RootDir) {
        return Err(error());
    }
    components
        .map(|component| match component {
            Component::Normal(name) => Ok(name),
            _ => Err(error()),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_leave_the_root_are_refused() {
        for path in ["", "bin/sh", "/bin/../sh", ".."] {
            let error = Contents::default().add_directory(Path::new(path)).unwrap_err();
            assert_eq!(
                error.to_string(),
                format!("{path}: a path of the guest begins with '/' and has no '..'")
            );
        }
        assert!(Contents::default().add_link(Path::new("/"), Path::new("x")).is_err());
    }

    #[test]
    fn a_path_is_a_directory_or_something_else() {
        let mut contents = Contents::default();
        contents.add_link(Path::new("/bin/sh"), Path::new("busybox")).unwrap();
        let error = contents.add_directory(Path::new("/bin/sh/deep")).unwrap_err();
        assert_eq!(error.to_string(), "/bin/sh: both a directory and a file or link");
        let error = contents.add_link(Path::new("/bin"), Path::new("usr/bin")).unwrap_err();
        assert_eq!(error.to_string(), "/bin: both a directory and a file or link");
    }

    #[test]
    fn what_is_no_file_is_named() {
        let mut contents = Contents::default();
        let error = contents.add_file(Path::new("/null"), Path::new("/dev/null")).unwrap_err();
        assert_eq!(error.to_string(), "/dev/null: neither a file nor a directory");
        let error = contents.add_file(Path::new("/a"), Path::new("/no such file")).unwrap_err();
        assert_eq!(error.to_string(), "/no such file: No such file or directory (os error 2)");
    }

    #[test]
    fn directories_come_first_and_the_last_of_two_files_counts() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("deep")).unwrap();
        fs::write(folder.path().join("deep/file"), "x").unwrap();
        std::os::unix::fs::symlink("file", folder.path().join("deep/link")).unwrap();
        let mut contents = Contents::default();
        contents.add_link(Path::new("/a//b/./deep/file"), Path::new("first")).unwrap();
        contents.add_file(Path::new("/a/b"), folder.path()).unwrap();
        let found: Vec<_> =
            contents.nodes().map(|(path, node)| (path.to_str().unwrap(), node.clone())).collect();
        let file = Node::File { host: folder.path().join("deep/file"), executable: false };
        let link = Node::Link { target: "file".into() };
        let expected = [
            ("a", Node::Directory),
            ("a/b", Node::Directory),
            ("a/b/deep", Node::Directory),
            ("a/b/deep/file", file),
            ("a/b/deep/link", link),
        ];
        assert_eq!(found, expected);
    }
}
