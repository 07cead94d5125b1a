//! What the command says, on standard error and on standard output.

use super::error::Error;
use crate::text::one_line;
use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

/// Most remarks about a file that are said.
const REMARKS: usize = 5;

/// Says something in one line on standard error, if that still exists.
pub fn say(what: impl Display) {
    _ = writeln!(io::stderr(), "{}", one_line(&what.to_string()));
}

/// Says why the command ends, and ends it.
pub fn end(error: &Error) -> ExitCode {
    say(format_args!("volumepro: {error}"));
    error.exit_code()
}

/// Says what the reader of a file noticed.
pub fn remark(path: &std::path::Path, remarks: &[String]) {
    for remark in remarks.iter().take(REMARKS) {
        say(format_args!("{}: {remark}", path.display()));
    }
    if let Some(more @ 1..) = remarks.len().checked_sub(REMARKS) {
        say(format_args!("{}: and {more} more remarks", path.display()));
    }
}

/// Prints on standard output. Who reads it may have heard enough: a closed pipe is no error.
pub fn print(text: &str) -> Result<(), Error> {
    let mut output = io::stdout();
    match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::failure(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}

/// Help and version as they are; what is wrong with the arguments as an error.
pub fn answer(error: &clap::Error) -> Result<(), Error> {
    let text = error.render().to_string();
    if !error.use_stderr() {
        return print(&text);
    }
    if error.kind() == clap::error::ErrorKind::MissingSubcommand {
        return Err(Error::input("a command is missing; volumepro --help lists them"));
    }
    // The first paragraph tells what is wrong; its lines become one.
    let paragraph: Vec<&str> = text.lines().map(str::trim).take_while(|line| !line.is_empty()).collect();
    Err(Error::input(paragraph.join(" ").trim_start_matches("error: ")))
}
