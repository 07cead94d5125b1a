//! The guest's side.

use crate::frame::{self, Kind};
use std::fs;
use std::io::{self, Read, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::thread;

/// Runs a command and sends what it prints, then the file `result` if the command has succeeded and made it, then the
/// exit code: that of a shell, 128 and the signal's number, for a command killed by a signal, 127 for one that cannot
/// be run.
///
/// # Errors
/// The line cannot be written, or the result cannot be read.
pub fn send(line: impl Write + Send, command: &mut Command, result: Option<&Path>) -> io::Result<()> {
    let line = Mutex::new(line);
    let code = match command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn() {
        Ok(mut child) => {
            let (output, errors) = (child.stdout.take(), child.stderr.take());
            thread::scope(|scope| {
                let errors = scope.spawn(|| forward(&line, Kind::Errors, errors));
                forward(&line, Kind::Output, output)?;
                errors.join().map_err(|_| io::Error::other("a thread has ended early"))?
            })?;
            code(child.wait()?)
        }
        Err(error) => {
            let program = command.get_program().to_string_lossy().into_owned();
            write(&line, Kind::Errors, format!("{program}: {error}\n").as_bytes())?;
            127
        }
    };
    match result {
        Some(path) if code == 0 && path.exists() => write(&line, Kind::File, &fs::read(path)?)?,
        _ => (),
    }
    write(&line, Kind::Exit, &[code])
}

fn code(status: ExitStatus) -> u8 {
    let signal = status.signal().map(|signal| 128 + signal);
    status.code().or(signal).and_then(|code| u8::try_from(code).ok()).unwrap_or(255)
}

fn forward(line: &Mutex<impl Write>, kind: Kind, stream: Option<impl Read>) -> io::Result<()> {
    let Some(mut stream) = stream else { return Ok(()) };
    let mut buffer = [0; 4096];
    loop {
        match stream.read(&mut buffer)? {
            0 => return Ok(()),
            length => write(line, kind, buffer.get(..length).unwrap_or_default())?,
        }
    }
}

fn write(line: &Mutex<impl Write>, kind: Kind, data: &[u8]) -> io::Result<()> {
    let mut line = line.lock().map_err(|_| io::Error::other("a thread has ended early"))?;
    frame::write(&mut *line, kind, data)
}
