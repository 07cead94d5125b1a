//! `tests/contact-sheet` on phantoms, with tiny pictures.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use std::path::Path;
use std::process::{Command, Output};

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/contact-sheet");
const TILE: u32 = 40;

fn run(arguments: &[&str], data: &Path) -> Output {
    Command::new(SCRIPT)
        .args(arguments)
        .env("VOLUMEPRO", env!("CARGO_BIN_EXE_test-volumepro"))
        .env("SHEET", env!("CARGO_BIN_EXE_test-contact-sheet"))
        .env("VOLUMEPRO_DATA", data)
        .output()
        .unwrap()
}

#[test]
fn unknown_arguments_and_failing_pictures_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("sheet.png");
    let output = output.to_str().unwrap();
    for (arguments, expected) in [
        (vec!["--nonsense", "1"], "--nonsense"),
        (vec!["-o"], "-o wants a value"),
        (vec!["-o", output, "--tile", "0"], "0 x 0 pixels"),
        (vec!["-o", output, "--tile", "16", "--phantom-size", "0"], "--phantom-size"),
    ] {
        let result = run(&arguments, folder.path());
        let message = String::from_utf8_lossy(&result.stderr);
        assert!(!result.status.success() && message.contains(expected), "{arguments:?}: {message}");
    }
    assert!(!Path::new(output).exists());
}

/// Every picture shows something, no two are the same, and missing data is said.
#[test]
fn a_sheet_of_phantoms_has_twenty_different_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("sheet.png");
    let arguments = ["-o", output.to_str().unwrap(), "--tile", &TILE.to_string(), "--phantom-size", "40"];
    let result = run(&arguments, &folder.path().join("no data"));
    let message = String::from_utf8_lossy(&result.stderr);
    assert!(result.status.success(), "{message}");
    for name in ["engine", "ct_head", "mri_head", "iron_protein"] {
        assert!(message.contains(&format!("{name}.nrrd is not there; phantom")), "{name}: {message}");
    }
    let sheet = image::open(output).unwrap().to_rgb8();
    assert_eq!(sheet.width(), 4 * (TILE + 8) + 8);
    let rows = 5;
    let height = (sheet.height() - 8) / rows;
    // A heading of 24 pixels stands above the pictures of a row.
    let tiles =
        (0..rows).flat_map(|row| (0..4).map(move |column| [8 + column * (TILE + 8), 32 + row * height]));
    let pictures: Vec<Vec<u8>> = tiles
        .map(|[x, y]| image::imageops::crop_imm(&sheet, x, y, TILE, TILE).to_image().into_raw())
        .collect();
    assert_eq!(pictures.len(), 20);
    for (place, picture) in pictures.iter().enumerate() {
        let seen = picture.chunks(3).filter(|pixel| pixel.iter().any(|channel| *channel > 20)).count();
        assert!(seen > picture.len() / 3 / 20, "picture {place} shows nothing");
        assert!(!pictures[..place].contains(picture), "picture {place} is there twice");
    }
}
