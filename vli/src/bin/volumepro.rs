//! The `volumepro` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    vli::command::run()
}
