//! The `volumepro` command.

mod arguments;
mod card;
mod error;
mod explain;
mod input;
mod lists;
mod look;
mod progress;
mod render;
mod statistics;
mod view;

use arguments::{Arguments, Command};
use clap::Parser;

use std::process::ExitCode;
use tracing_subscriber::filter::LevelFilter;

/// Runs the command with the process's arguments. Exit code 0; 2 for bad arguments or input, with one line on
/// standard error; 1 for a failure after valid input.
#[must_use]
pub fn run() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return reject(&error),
    };
    let log = tracing_subscriber::fmt().with_max_level(LevelFilter::WARN).with_writer(std::io::stderr);
    log.with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr())).init();
    let result = match arguments.command {
        Command::Render(render) => render::run(&render),
        Command::Info { volume, input } => input::info(&volume, &input),
        Command::Phantom { name, size, output } => input::write_phantom(name, size, &output),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("volumepro: {error}");
            error.exit_code()
        }
    }
}

/// Prints what is wrong with the arguments in one line; help and version as they are.
fn reject(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        let printed = error.print();
        return if printed.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    }
    let text = error.to_string();
    let paragraph = text.lines().take_while(|line| !line.trim().is_empty() && !line.starts_with("Usage"));
    let line = paragraph.map(str::trim).collect::<Vec<_>>().join(" ");
    eprintln!("volumepro: {}", line.trim_start_matches("error: "));
    ExitCode::from(2)
}
