//! The archive format.

use crate::contents::{Contents, Error, Node};
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

const DIRECTORY: u32 = 0o040_755;
const PROGRAM: u32 = 0o100_755;
const FILE: u32 = 0o100_644;
const LINK: u32 = 0o120_777;

/// Archives end on multiples of this, so that the next can follow.
const BLOCK: u64 = 512;

/// Writes the archive.
///
/// # Errors
/// A file cannot be read, has 4 GiB or more, or changes meanwhile; the archive cannot be written.
pub fn write(contents: &Contents, output: impl Write) -> Result<(), Error> {
    let mut archive = Archive { output, written: 0, entries: 0 };
    for (path, node) in contents.nodes() {
        let name = path.as_os_str().as_bytes();
        match node {
            Node::Directory => archive.header(name, DIRECTORY, 0)?,
            Node::Link { target } => {
                let target = target.as_os_str().as_bytes();
                archive.header(name, LINK, size_of(path, target.len() as u64)?)?;
                archive.bytes(target)?;
                archive.pad(4)?;
            }
            Node::File { host, executable } => {
                archive.file(name, if *executable { PROGRAM } else { FILE }, host)?;
            }
        }
    }
    archive.entries = 0;
    archive.header(b"TRAILER!!!", 0, 0)?;
    archive.pad(BLOCK)?;
    archive.output.flush().map_err(Error::Write)
}

struct Archive<W> {
    output: W,
    written: u64,
    entries: u32,
}

impl<W: Write> Archive<W> {
    /// A header, as the format has it: a magic number and 13 numbers of 8 hexadecimal digits, and the name.
    fn header(&mut self, name: &[u8], mode: u32, size: u32) -> Result<(), Error> {
        let inode = self.entries;
        self.entries += 1;
        let links = if mode == DIRECTORY { 2 } else { 1 };
        let name_size = size_of(Path::new("name"), name.len() as u64 + 1)?;
        let numbers = [inode, mode, 0, 0, links, 0, size, 0, 0, 0, 0, name_size, 0];
        self.bytes(b"070701")?;
        for number in numbers {
            self.bytes(format!("{number:08x}").as_bytes())?;
        }
        self.bytes(name)?;
        self.bytes(&[0])?;
        self.pad(4)
    }

    fn file(&mut self, name: &[u8], mode: u32, host: &Path) -> Result<(), Error> {
        let mut file = File::open(host).map_err(Error::at(host))?;
        let size = file.metadata().map_err(Error::at(host))?.len();
        self.header(name, mode, size_of(host, size)?)?;
        let mut left = size;
        let mut buffer = vec![0; 1 << 16];
        loop {
            let read = file.read(&mut buffer).map_err(Error::at(host))?;
            let bytes = buffer.get(..read).unwrap_or_default();
            left = left.checked_sub(read as u64).ok_or_else(|| Error::Changed { path: host.into() })?;
            if read == 0 {
                break;
            }
            self.bytes(bytes)?;
        }
        if left != 0 {
            return Err(Error::Changed { path: host.into() });
        }
        self.pad(4)
    }

    fn bytes(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.written += bytes.len() as u64;
        self.output.write_all(bytes).map_err(Error::Write)
    }

    fn pad(&mut self, multiple: u64) -> Result<(), Error> {
        while !self.written.is_multiple_of(multiple) {
            self.bytes(&[0])?;
        }
        Ok(())
    }
}

fn size_of(path: &Path, size: u64) -> Result<u32, Error> {
    u32::try_from(size).map_err(|_| Error::TooLarge { path: path.into(), size })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    use std::process::{Command, Stdio};

    /// Name, mode and data of every entry, by the letter of the format.
    fn read(archive: &[u8]) -> Vec<(String, u32, Vec<u8>)> {
        let mut entries = Vec::new();
        let mut at = 0;
        loop {
            assert_eq!(archive[at..at + 6], *b"070701");
            let number = |index: usize| {
                let digits = &archive[at + 6 + 8 * index..at + 14 + 8 * index];
                u32::from_str_radix(std::str::from_utf8(digits).unwrap(), 16).unwrap()
            };
            let name = &archive[at + 110..at + 110 + number(11) as usize];
            let name = std::ffi::CStr::from_bytes_with_nul(name).unwrap().to_str().unwrap().to_owned();
            if name == "TRAILER!!!" {
                return entries;
            }
            let data = (at + 110 + number(11) as usize).next_multiple_of(4);
            let end = data + number(6) as usize;
            entries.push((name, number(1), archive[data..end].to_vec()));
            at = end.next_multiple_of(4);
        }
    }

    fn example(folder: &Path) -> Contents {
        fs::write(folder.join("init"), "#!/bin/sh\n").unwrap();
        fs::set_permissions(folder.join("init"), fs::Permissions::from_mode(0o700)).unwrap();
        fs::write(folder.join("data file"), [7; 100_001]).unwrap();
        let mut contents = Contents::default();
        contents.add_file(Path::new("/init"), &folder.join("init")).unwrap();
        contents.add_file(Path::new("/data/a file"), &folder.join("data file")).unwrap();
        contents.add_link(Path::new("/bin/sh"), Path::new("busybox")).unwrap();
        contents
    }

    fn written(contents: &Contents) -> Vec<u8> {
        let mut bytes = Vec::new();
        write(contents, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn a_file_that_vanishes_or_shrinks_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let contents = example(folder.path());
        fs::remove_file(folder.path().join("init")).unwrap();
        let error = write(&contents, Vec::new()).unwrap_err().to_string();
        assert!(error.ends_with("/init: No such file or directory (os error 2)"), "{error}");
        // Files of the kernel have size zero and content all the same.
        let mut contents = Contents::default();
        contents.add_file(Path::new("/version"), Path::new("/proc/version")).unwrap();
        let error = write(&contents, Vec::new()).unwrap_err().to_string();
        assert_eq!(error, "/proc/version: its size has changed while it was read");
    }

    #[test]
    fn files_of_4_gib_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large");
        File::create(&path).unwrap().set_len(1 << 32).unwrap();
        let mut contents = Contents::default();
        contents.add_file(Path::new("/large"), &path).unwrap();
        let error = write(&contents, Vec::new()).unwrap_err().to_string();
        assert!(error.ends_with("4294967296 bytes; an initramfs holds files of less than 4 GiB"), "{error}");
    }

    #[test]
    fn a_full_disk_is_an_error() {
        let error = write(&Contents::default(), File::options().write(true).open("/dev/full").unwrap());
        assert_eq!(error.unwrap_err().to_string(), "cannot write: No space left on device (os error 28)");
    }

    #[test]
    fn what_was_put_in_comes_out() {
        let folder = tempfile::tempdir().unwrap();
        let entries = read(&written(&example(folder.path())));
        let expected = [
            ("bin", DIRECTORY, vec![]),
            ("bin/sh", LINK, b"busybox".to_vec()),
            ("data", DIRECTORY, vec![]),
            ("data/a file", FILE, vec![7; 100_001]),
            ("init", PROGRAM, b"#!/bin/sh\n".to_vec()),
        ];
        assert_eq!(entries, expected.map(|(name, mode, data)| (name.to_owned(), mode, data)));
    }

    #[test]
    fn equal_contents_give_equal_bytes() {
        let [first, second] = [(); 2].map(|()| {
            let folder = tempfile::tempdir().unwrap();
            written(&example(folder.path()))
        });
        assert_eq!(first, second);
        assert!(first.len().is_multiple_of(512));
    }

    /// An independent reader, where this machine has one.
    #[test]
    fn other_readers_agree() {
        let folder = tempfile::tempdir().unwrap();
        let archive = folder.path().join("archive");
        fs::write(&archive, written(&example(folder.path()))).unwrap();
        for (program, arguments) in [("busybox", ["cpio", "-t"]), ("cpio", ["--quiet", "-t"])] {
            let input = Stdio::from(File::open(&archive).unwrap());
            match Command::new(program).args(arguments).stdin(input).output() {
                Ok(output) => {
                    let list = String::from_utf8(output.stdout).unwrap();
                    assert_eq!(list, "bin\nbin/sh\ndata\ndata/a file\ninit\n", "{program}");
                }
                Err(_) => println!("SKIPPED: no {program} to read an archive with"),
            }
        }
    }
}
