//! The `volumepro` command.

mod arguments;
#[cfg(feature = "embedded")]
mod bench;
mod card;
mod error;
mod explain;
mod input;
mod lists;
mod look;
mod messages;
mod progress;
mod refusals;
mod render;
mod statistics;
mod view;

use arguments::{Arguments, Command};
use clap::Parser;
use error::Error;
use std::process::ExitCode;
use tracing_subscriber::filter::LevelFilter;

/// Runs the command with the process's arguments. Exit code 0; 2 for bad arguments or input, with one line on
/// standard error; 1 for a failure after valid input.
#[must_use]
pub fn run() -> ExitCode {
    let result = match Arguments::try_parse() {
        Ok(arguments) => execute(arguments.command),
        Err(error) => messages::answer(&error),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => messages::end(&error),
    }
}

fn execute(command: Command) -> Result<(), Error> {
    let log = tracing_subscriber::fmt().with_max_level(LevelFilter::WARN).with_writer(std::io::stderr);
    log.with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr())).init();
    match command {
        Command::Render(render) => render::run(&render),
        Command::Info { volume, input } => input::info(&volume, &input),
        Command::Phantom { name, size, output } => input::write_phantom(name, size, &output),
        #[cfg(feature = "embedded")]
        Command::Bench(arguments) => bench::run(&arguments),
        #[cfg(not(feature = "embedded"))]
        Command::Bench(_) => Err(Error::input("bench: this program was built without the embedded card")),
        Command::Report(_) => refusals::command("report"),
        Command::Sdk(_) => refusals::command("sdk"),
    }
}
