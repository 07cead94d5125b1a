//! Writes an initramfs archive: `volumepro-initramfs OUTPUT [--directory GUEST | --file GUEST HOST | --link GUEST
//! TARGET]...`, where GUEST is a path of the guest and HOST a file, or a directory with all in it, of this machine.

use std::ffi::OsString;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::process::ExitCode;
use volumepro_initramfs::{Contents, write};

const USAGE: &str =
    "usage: volumepro-initramfs OUTPUT [--directory GUEST | --file GUEST HOST | --link GUEST TARGET]...";

fn run(mut arguments: impl Iterator<Item = OsString>) -> Result<(), String> {
    let output = arguments.next().ok_or(USAGE)?;
    let mut contents = Contents::default();
    while let Some(option) = arguments.next() {
        let mut path = || arguments.next().ok_or(USAGE);
        match option.to_str() {
            Some("--directory") => contents.add_directory(Path::new(&path()?)),
            Some("--file") => contents.add_file(Path::new(&path()?), Path::new(&path()?)),
            Some("--link") => contents.add_link(Path::new(&path()?), Path::new(&path()?)),
            _ => return Err(USAGE.into()),
        }
        .map_err(|error| error.to_string())?;
    }
    let named = |error: String| format!("{}: {error}", Path::new(&output).display());
    let file = File::create(&output).map_err(|error| named(error.to_string()))?;
    write(&contents, BufWriter::new(file)).map_err(|error| error.to_string())
}

fn main() -> ExitCode {
    match run(std::env::args_os().skip(1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("volumepro-initramfs: {error}");
            ExitCode::FAILURE
        }
    }
}
