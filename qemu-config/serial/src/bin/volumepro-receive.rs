//! Receives the results of a guest's command from standard input: `volumepro-receive [RESULT]`. Prints what the command
//! prints, writes the file that it has made to RESULT, exits as it has exited; 125, without a word, if the line ends
//! before.

use std::path::PathBuf;
use std::process::ExitCode;
use volumepro_serial::frame;
use volumepro_serial::receive::{ReceiveError, receive};

fn main() -> ExitCode {
    let result = std::env::args_os().nth(1).map(PathBuf::from);
    match receive(std::io::stdin().lock(), std::io::stdout(), std::io::stderr(), result.as_deref()) {
        Ok(code) => ExitCode::from(code),
        Err(ReceiveError::Line(frame::Error::Ended)) => ExitCode::from(125),
        Err(error) => {
            eprintln!("volumepro-receive: {error}");
            ExitCode::FAILURE
        }
    }
}
