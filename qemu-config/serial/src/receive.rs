//! The host's side.

use crate::frame::{Error, Frames, Kind};
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Why there is no result.
#[derive(Debug, thiserror::Error)]
pub enum ReceiveError {
    /// The line.
    #[error(transparent)]
    Line(#[from] Error),
    /// The result cannot be written.
    #[error("{}: {source}", path.display())]
    Result {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The command has succeeded but has not made the file.
    #[error("the command has not made {}", path.display())]
    NoFile {
        /// The file.
        path: PathBuf,
    },
    /// What the command prints cannot be printed.
    #[error("cannot print: {0}")]
    Print(#[source] io::Error),
}

/// Prints what the guest's command prints, writes the file that it has made to `result`, and gives its exit code.
///
/// # Errors
/// [`ReceiveError`].
pub fn receive(
    line: impl Read,
    mut output: impl Write,
    mut errors: impl Write,
    result: Option<&Path>,
) -> Result<u8, ReceiveError> {
    let mut frames = Frames::new(line);
    let mut missing = result;
    loop {
        let (kind, data) = frames.read()?;
        match kind {
            Kind::Output => print(&mut output, &data)?,
            Kind::Errors => print(&mut errors, &data)?,
            Kind::File => {
                let Some(path) = missing.take() else { continue };
                fs::write(path, data).map_err(|source| ReceiveError::Result { path: path.into(), source })?;
            }
            Kind::Exit => {
                let code = data.first().copied().unwrap_or(255);
                return match missing {
                    Some(path) if code == 0 => Err(ReceiveError::NoFile { path: path.into() }),
                    _ => Ok(code),
                };
            }
        }
    }
}

fn print(mut stream: impl Write, data: &[u8]) -> Result<(), ReceiveError> {
    stream.write_all(data).and_then(|()| stream.flush()).map_err(ReceiveError::Print)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame;
    use crate::send::send;
    use std::process::Command;

    fn shell(script: &str, made: Option<&Path>) -> Vec<u8> {
        let mut line = Vec::new();
        send(&mut line, Command::new("sh").args(["-c", script]), made).unwrap();
        line
    }

    #[test]
    fn an_unwritable_result_is_named() {
        let mut line = Vec::new();
        frame::write(&mut line, Kind::File, b"picture").unwrap();
        let path = Path::new("/no/such/folder");
        let error = receive(line.as_slice(), io::sink(), io::sink(), Some(path)).unwrap_err();
        assert_eq!(error.to_string(), "/no/such/folder: No such file or directory (os error 2)");
    }

    #[test]
    fn a_command_that_makes_nothing_is_an_error_if_it_succeeds() {
        let path = Path::new("/no/such/file");
        let error = receive(shell("true", Some(path)).as_slice(), io::sink(), io::sink(), Some(path));
        assert_eq!(error.unwrap_err().to_string(), "the command has not made /no/such/file");
        let code = receive(shell("exit 2", Some(path)).as_slice(), io::sink(), io::sink(), Some(path));
        assert_eq!(code.unwrap(), 2);
    }

    #[test]
    fn a_program_that_is_not_there_is_named() {
        let mut line = Vec::new();
        send(&mut line, &mut Command::new("/no/such/program"), None).unwrap();
        let mut errors = Vec::new();
        assert_eq!(receive(line.as_slice(), io::sink(), &mut errors, None).unwrap(), 127);
        assert_eq!(errors, b"/no/such/program: No such file or directory (os error 2)\n");
    }

    #[test]
    fn streams_file_and_exit_code_arrive() {
        let folder = tempfile::tempdir().unwrap();
        let [made, kept] = ["made", "kept"].map(|name| folder.path().join(name));
        let script = format!("echo out; echo err >&2; printf '\\000\\377' > {}", made.display());
        let line = shell(&script, Some(&made));
        let (mut output, mut errors) = (Vec::new(), Vec::new());
        assert_eq!(receive(line.as_slice(), &mut output, &mut errors, Some(&kept)).unwrap(), 0);
        assert_eq!((output.as_slice(), errors.as_slice()), (b"out\n".as_slice(), b"err\n".as_slice()));
        assert_eq!(fs::read(kept).unwrap(), [0, 255]);
        assert_eq!(receive(shell("kill -9 $$", None).as_slice(), io::sink(), io::sink(), None).unwrap(), 137);
    }
}
