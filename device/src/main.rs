//! The `volumepro-device` process.

use std::process::ExitCode;

fn main() -> ExitCode {
    volumepro_device::run()
}
