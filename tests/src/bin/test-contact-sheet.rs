//! `test-contact-sheet OUT.png` composes a sheet of what standard input lists: a line `= HEADING` begins a row, a line
//! `PICTURE.png CAPTION` adds a picture to it.

use std::io::{self, BufRead};
use std::process::ExitCode;
use volumepro_tests::contact_sheet::{Row, Tile, compose};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("test-contact-sheet: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn std::error::Error>> {
    let output = std::env::args_os().nth(1).ok_or("a file to write is wanted")?;
    let mut rows: Vec<Row> = Vec::new();
    for line in io::stdin().lock().lines() {
        let line = line?;
        let (first, rest) =
            line.split_once(' ').ok_or_else(|| format!("'{line}' is no picture and caption"))?;
        if first == "=" {
            rows.push(Row { heading: rest.into(), tiles: Vec::new() });
            continue;
        }
        let picture = image::open(first).map_err(|error| format!("{first}: {error}"))?.to_rgb8();
        let row = rows.last_mut().ok_or("a picture stands before the first heading")?;
        row.tiles.push(Tile { picture, caption: rest.into() });
    }
    compose(&rows).save(output)?;
    Ok(())
}
