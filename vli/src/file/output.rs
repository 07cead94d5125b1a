//! Files that are written whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes a file. What `write` writes goes to a temporary file beside it first, which then takes its place: a failure
/// leaves what was there before. A device, a pipe, or what a symbolic link points to is written in place, and so is a
/// file in a folder that takes no new ones.
///
/// # Errors
/// The file cannot be written, or those of `write`.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), io::Error> {
    let (file, temporary) = match place(path)? {
        Place::Here => (File::create(path)?, None),
        Place::Beside(file, temporary) => (file, Some(temporary)),
    };
    let mut writer = BufWriter::new(file);
    write(&mut writer)?;
    writer.flush()?;
    temporary.map_or(Ok(()), |temporary| temporary.rename(path))
}

/// Refuses a path where no file can be written. Nothing is left there.
///
/// # Errors
/// The same as [`write_whole`] would give, as far as can be told beforehand.
pub fn check(path: &Path) -> Result<(), io::Error> {
    place(path).map(drop)
}

/// Where a file is written.
enum Place {
    /// Where it is to be.
    Here,
    /// In a temporary file beside it.
    Beside(File, Temporary),
}

fn place(path: &Path) -> Result<Place, io::Error> {
    let before = match fs::symlink_metadata(path) {
        Ok(metadata) => Some(metadata),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    if path.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let Some(before) = before else {
        return Temporary::beside(path).map(|(file, temporary)| Place::Beside(file, temporary));
    };
    if !before.is_file() {
        return Ok(Place::Here);
    }
    // What its owner has protected is not replaced.
    OpenOptions::new().write(true).open(path)?;
    match Temporary::beside(path) {
        Ok((file, temporary)) => {
            file.set_permissions(before.permissions())?;
            Ok(Place::Beside(file, temporary))
        }
        Err(_) => Ok(Place::Here),
    }
}

/// A temporary file, removed when dropped.
struct Temporary(PathBuf);

impl Temporary {
    /// A new file in the folder of `path`.
    fn beside(path: &Path) -> Result<(File, Self), io::Error> {
        let process = std::process::id();
        let mut attempts = (0..100).map(|attempt| {
            let temporary = path.with_file_name(format!(".volumepro-{process}-{attempt}"));
            let file = OpenOptions::new().write(true).create_new(true).open(&temporary)?;
            Ok((file, Self(temporary)))
        });
        let exists = |attempt: &Result<_, io::Error>| {
            attempt.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::AlreadyExists)
        };
        attempts.find(|attempt| !exists(attempt)).unwrap_or_else(|| Err(io::ErrorKind::AlreadyExists.into()))
    }

    /// Gives the file its name, in the place of what had that before.
    fn rename(self, path: &Path) -> Result<(), io::Error> {
        fs::rename(&self.0, path)
        // What is dropped then has no file any more.
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        _ = fs::remove_file(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::{PermissionsExt, symlink};

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    fn write(path: &Path, text: &str) -> Result<(), io::Error> {
        write_whole(path, |writer| writer.write_all(text.as_bytes()))
    }

    #[test]
    fn a_failure_leaves_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, "before").unwrap();
        let failure = write_whole(&path, |writer| {
            writer.write_all(&[b'x'; 1 << 20])?;
            Err(io::Error::other("halfway"))
        });
        assert_eq!(failure.unwrap_err().to_string(), "halfway");
        assert_eq!(fs::read_to_string(&path).unwrap(), "before");
        assert_eq!(names(folder.path()), ["file"]);
    }

    #[test]
    fn places_that_take_no_file_are_refused_and_left_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let nowhere = folder.path().join("none/file");
        for refused in [check(folder.path()), write(folder.path(), "")] {
            assert_eq!(refused.unwrap_err().kind(), io::ErrorKind::IsADirectory);
        }
        for refused in [check(&nowhere), write(&nowhere, "")] {
            assert_eq!(refused.unwrap_err().kind(), io::ErrorKind::NotFound);
        }
        check(&folder.path().join("file")).unwrap();
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn files_are_written_and_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f".repeat(255));
        write(&path, "first").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        write(&path, "second").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "second");
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(names(folder.path()).len(), 1);
    }

    #[test]
    fn what_is_no_plain_file_is_written_in_place() {
        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("target"), folder.path().join("link"));
        symlink(&target, &link).unwrap();
        for text in ["long before", "later"] {
            write(&link, text).unwrap();
            assert_eq!(fs::read_to_string(&target).unwrap(), text);
        }
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        write(Path::new("/dev/null"), "anything").unwrap();
        assert!(write(Path::new("/dev/full"), "anything").is_err());
    }
}
