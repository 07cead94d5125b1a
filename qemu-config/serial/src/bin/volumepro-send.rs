//! Runs a command in a guest and sends its results over a line: `volumepro-send LINE RESULT COMMAND...`, where RESULT
//! is the file that the command writes, empty for none.

use rustix::termios::{OptionalActions, tcdrain, tcgetattr, tcsetattr};
use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io;
use std::path::Path;
use std::process::{Command, ExitCode};
use volumepro_serial::send::send;

/// Opens a line so that all bytes pass as they are.
fn open(path: &Path) -> io::Result<File> {
    let line = OpenOptions::new().write(true).open(path)?;
    if let Ok(mut settings) = tcgetattr(&line) {
        settings.make_raw();
        tcsetattr(&line, OptionalActions::Now, &settings)?;
    }
    Ok(line)
}

fn run(
    path: &Path,
    result: &Path,
    program: OsString,
    arguments: impl Iterator<Item = OsString>,
) -> io::Result<()> {
    let line = open(path)?;
    let result = (!result.as_os_str().is_empty()).then_some(result);
    send(&line, Command::new(program).args(arguments), result)?;
    tcdrain(&line).or_else(|error| if error == rustix::io::Errno::NOTTY { Ok(()) } else { Err(error) })?;
    Ok(())
}

fn main() -> ExitCode {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(line), Some(result), Some(program)) = (arguments.next(), arguments.next(), arguments.next())
    else {
        eprintln!("usage: volumepro-send LINE RESULT COMMAND...");
        return ExitCode::from(2);
    };
    match run(Path::new(&line), Path::new(&result), program, arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("volumepro-send: {}: {error}", Path::new(&line).display());
            ExitCode::FAILURE
        }
    }
}
