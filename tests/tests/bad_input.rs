//! Bad input gives one clear line and exit code 2, in little memory.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

const VOLUMEPRO: &str = env!("CARGO_BIN_EXE_test-volumepro");
/// Address space in KiB in which everything that is refused must be refused: about what the memories of the embedded
/// card take, mapped by device and driver.
const MEMORY: u32 = 800_000;

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new("sh")
        .arg("-c")
        .arg(format!("ulimit -v {MEMORY}; exec \"$0\" \"$@\""))
        .arg(VOLUMEPRO)
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn refused(folder: &Path, arguments: &[&str], words: &str) {
    let result = run(folder, arguments);
    let message = String::from_utf8(result.stderr).unwrap();
    assert_eq!(result.status.code(), Some(2), "{arguments:?}: {message}");
    assert_eq!(message.lines().count(), 1, "{arguments:?}: {message}");
    assert!(message.contains(words), "{arguments:?} does not say '{words}': {message}");
    assert!(result.stdout.is_empty());
}

fn header(lines: &str) -> Vec<u8> {
    format!("NRRD0004\n{lines}\n\n").into_bytes()
}

#[test]
fn files_that_are_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let uint8 = "type: uint8\ndimension: 3\nencoding: raw\n";
    let floats = [header("type: float\ndimension: 3\nencoding: raw\nendian: little\nsizes: 2 1 1"), {
        [1.0_f32, f32::NAN].map(f32::to_le_bytes).concat()
    }]
    .concat();
    let files: [(&str, Vec<u8>, &str); 10] = [
        (
            "truncated.nrrd",
            [header(&format!("{uint8}sizes: 9 9 9")), vec![0; 700]].concat(),
            "truncated.nrrd",
        ),
        ("lying.nrrd", header(&format!("{uint8}sizes: 2000 2000 2000")), "lying.nrrd"),
        (
            "gzip.nrrd",
            header("type: double\ndimension: 3\nencoding: gzip\nendian: little\nsizes: 900 900 900"),
            "gzip.nrrd",
        ),
        ("zero.nrrd", header(&format!("{uint8}sizes: 0 9 9")), "sizes"),
        ("absurd.nrrd", header(&format!("{uint8}sizes: 99999999999 99999999999 9")), "sizes"),
        ("negative.nrrd", header(&format!("{uint8}sizes: -1 9 9")), "sizes"),
        (
            "spacing.nrrd",
            [header(&format!("{uint8}sizes: 1 1 1\nspacings: 1 nan 1")), vec![0]].concat(),
            "spacings",
        ),
        ("nan.nrrd", floats, "(1, 0, 0)"),
        ("empty.nrrd", vec![], "empty.nrrd"),
        ("text.txt", b"hello".to_vec(), "text.txt"),
    ];
    for (name, bytes, words) in files {
        fs::write(path.join(name), bytes).unwrap();
        refused(path, &["render", name, "-o", "out.png"], words);
        refused(path, &["info", name], words);
    }
    refused(path, &["render", "missing.nrrd", "-o", "out.png"], "missing.nrrd");
    refused(path, &["render", ".", "-o", "out.png"], ".");
    assert!(!path.join("out.png").exists());
}

#[test]
fn transfer_functions_that_are_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    for (content, words) in [
        ("", "transfer.csv"),
        ("value,red,green,blue\n1,0,0,0\n", "transfer.csv"),
        ("value,red,green,blue,opacity\n1,0,0,0\n", "2"),
        ("value,red,green,blue,opacity\n1,0,0,0,0\n0,0,0,0,0\n", "3"),
        ("value,red,green,blue,opacity\n1,0,0,0,1.5\n", "2"),
        ("value,red,green,blue,opacity\n1,0,x,0,1\n", "2"),
    ] {
        fs::write(path.join("transfer.csv"), content).unwrap();
        let arguments = [
            "render",
            "--phantom",
            "sphere",
            "--phantom-size",
            "8",
            "-o",
            "out.png",
            "--transfer",
            "transfer.csv",
        ];
        refused(path, &arguments, words);
    }
}

#[test]
fn arguments_that_are_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let phantom = ["render", "--phantom", "sphere", "--phantom-size", "8", "-o", "out.png"];
    for (arguments, words) in [
        (vec!["--no-such-flag"], "--no-such-flag"),
        (vec!["--size", "0x5"], "0"),
        (vec!["--size", "99999x99999"], "99999"),
        (vec!["--supersample", "1,9,1"], "9"),
        (vec!["--supersample", "1,1.5,1"], "whole"),
        (vec!["--position", "1,2,3"], "--focal"),
        (vec!["--position", "1,2,3", "--focal", "1,2,3"], "focal"),
        (vec!["--parallel-scale", "-3"], "scale"),
        (vec!["--range", "5,1"], "range"),
        (vec!["--preset", "nonsense"], "nonsense"),
        (vec!["--blend", "nonsense"], "nonsense"),
        (vec!["--crop", "1,2,3"], "--crop"),
        (vec!["--cut-plane", "0,0,0,1,1,1"], "--cut-plane"),
        (vec!["--light", "0,0,0"], "--light"),
        (vec!["--background", "1,2"], "--background"),
        (vec!["--device", "nonsense"], "nonsense"),
        (vec!["--device", "pci:0000:00:05.0"], "pci"),
        (vec!["--renderer", "optimised"], "--renderer"),
        (vec!["--simd", "avx512"], "--simd"),
        (vec!["--threads", "7"], "--threads"),
        (vec!["--sections"], "--sections"),
        (vec!["--explain=time"], "--explain=time"),
        (vec!["--frames", "0"], "--frames"),
        (vec!["--supersample", "-1,1,1"], "supersampl"),
        (vec!["--background", "-1,0,0"], "0..255"),
        (vec!["--material", "-1,0,0,0"], "--material"),
        (vec!["--raw-shape", "2,2,2", "--raw-type", "uint8"], "--raw-shape"),
        (vec!["--renderer", "ideal", "--device", "nonsense"], "ideal"),
        (vec!["--renderer", "ideal", "--threads", "3"], "ideal"),
    ] {
        let all: Vec<&str> = phantom.iter().copied().chain(arguments).collect();
        refused(folder.path(), &all, words);
    }
    refused(folder.path(), &["render", "--phantom", "nonsense", "-o", "out.png"], "nonsense");
    refused(folder.path(), &["render", "--phantom", "sphere", "--phantom-size", "0", "-o", "out.png"], "0");
    refused(
        folder.path(),
        &["render", "--phantom", "sphere", "--phantom-size", "99999", "-o", "out.png"],
        "99999",
    );
    refused(
        folder.path(),
        &["render", "--phantom", "sphere", "-o", "no/such/folder/out.png"],
        "no/such/folder",
    );
    assert!(!folder.path().join("out.png").exists());
}
