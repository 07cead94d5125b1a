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
fn files_that_claim_gigabytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let nifti = |sizes: [u16; 3]| {
        let mut header = vec![0_u8; 352];
        header[..4].copy_from_slice(&348_u32.to_le_bytes());
        for (index, size) in [3, sizes[0], sizes[1], sizes[2]].into_iter().enumerate() {
            header[40 + 2 * index..42 + 2 * index].copy_from_slice(&size.to_le_bytes());
        }
        header[70] = 2;
        (80..92).step_by(4).for_each(|place| header[place..place + 4].copy_from_slice(&1_f32.to_le_bytes()));
        header[344..348].copy_from_slice(b"n+1\0");
        header
    };
    let meta = "NDims = 3\nDimSize = 256 256 256\nElementType = MET_DOUBLE\nCompressedData = True\nElementDataFile = LOCAL\n";
    let vox = "Vox1999a\n##\x0c\nVolumeSize 250 250 250\nVoxelSize 8\n##\x0c\n";
    for (name, bytes, words) in [
        ("a.nii", nifti([250; 3]), "a.nii: holds 352 bytes where"),
        (
            "b.nii",
            nifti([30_000; 3]),
            "b.nii: dim: 30000 x 30000 x 30000 samples of uint8 are more than 8 GiB",
        ),
        ("c.mha", meta.into(), "c.mha: holds 0 bytes where"),
        ("d.vox", vox.into(), "d.vox: holds 0 bytes where"),
    ] {
        fs::write(path.join(name), bytes).unwrap();
        refused(path, &["info", name], words);
    }
    // An attribute of four gigabytes in a DICOM image: text where none is that long, and anything.
    fs::create_dir(path.join("series")).unwrap();
    let head = [&[0; 128], &b"DICM\x02\0\x10\0UI\x14\x001.2.840.10008.1.2.1\0"[..]].concat();
    for attribute in [b"\x20\0\x32\0UN\0\0\xf0\xff\xff\xff", b"\x09\0\x10\x10OB\0\0\xf0\xff\xff\xff"] {
        fs::write(path.join("series/image"), [&head[..], attribute].concat()).unwrap();
        refused(path, &["info", "series"], "series/image: ");
    }
    fs::remove_file(path.join("series/image")).unwrap();
    refused(path, &["info", "series"], "series: is a folder without DICOM images");
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
        (vec!["--device", "pci:nonsense"], "'nonsense'"),
        (vec!["--renderer", "reference", "--simd", "avx2"], "--simd"),
        (vec!["--architecture", "cube4"], "--architecture cube4 is not served yet"),
        (vec!["--simd", "mmx"], "--simd"),
        (vec!["--renderer", "reference", "--threads", "7"], "--threads"),
        (vec!["--renderer", "ideal", "--sections"], "--sections"),
        (vec!["--keep", "nonsense"], "'nonsense' is not all, gradient"),
        (vec!["--keep", "all,crop"], "'all'"),
        (vec!["--renderer", "ideal", "--keep", "all"], "--keep"),
        (vec!["--renderer", "ideal", "--explain"], "--explain"),
        (vec!["--explain=foo"], "[possible values: time]"),
        (vec!["--device", "socket:"], "path"),
        (vec!["--device", "socket:missing"], "missing: No such file"),
        (vec!["--device", "socket:."], "is not a socket"),
        (vec!["--azimuth", "nan"], "'nan' is not finite"),
        (vec!["--parallel-scale", "1e300"], "parallel scale 1e300 is"),
        (vec!["--frames", "0"], "--frames"),
        (vec!["--frames", "-1"], "-1 is not in 1"),
        (vec!["--threads", "-1"], "-1 is not in 1"),
        (vec!["--size", "-5x5"], "-5x5"),
        (vec!["--supersample", "-1,1,1"], "supersampl"),
        (vec!["--background", "-1,0,0"], "0..255"),
        (vec!["--material", "-1,0,0,0"], "--material"),
        (vec!["--raw-shape", "2,2,2", "--raw-type", "uint8"], "--raw-shape"),
        (vec!["--renderer", "ideal", "--device", "socket:card.sock"], "ideal"),
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

#[test]
fn options_without_effect() {
    let folder = tempfile::tempdir().unwrap();
    let phantom = ["render", "--phantom", "sphere", "--phantom-size", "8", "-o", "out.png"];
    for (arguments, words) in [
        ("--light 0,0,1 --shading off", ["--light ", "--shading off"]),
        ("--light 0,0,1 --blend sum", ["--light ", "--blend sum"]),
        ("--light 0,0,1 --material 1,0,0,1", ["--light ", "--material"]),
        ("--material 1,0,0,1 --blend mip", ["--material ", "--blend mip"]),
        ("--material 1,0,0,1 --shading off", ["--material ", "--shading off"]),
        ("--modulate diffuse --blend minip", ["--modulate diffuse", "--blend minip"]),
        ("--modulate opacity,specular --shading off", ["--modulate specular", "--shading off"]),
        ("--modulate diffuse --material 1,0,1,1", ["--modulate diffuse", "--material"]),
        ("--modulate specular --material 1,1,0,1", ["--modulate specular", "--material"]),
        ("--modulate opacity --blend mip", ["--modulate opacity", "--blend mip"]),
        ("--gradient-table 0,0,0,0,1,1,1,1", ["--gradient-table", "--modulate"]),
        ("--position 1,2,3", ["--position", "--focal"]),
        ("--focal 1,2,3", ["--focal", "--position"]),
        ("--preset smooth --transfer x.csv", ["--preset", "--transfer"]),
        ("--raw-type uint8", ["--raw-type", "--raw-shape"]),
        ("--raw-endian big", ["--raw-endian", "--raw-shape"]),
        ("--raw-spacing 1,1,1", ["--raw-spacing", "--raw-shape"]),
        ("--raw-shape 1,1,1", ["--raw-shape", "--raw-type"]),
        ("--raw-shape 1,1,1 --raw-type uint8", ["--raw-shape", "VOLUME"]),
        ("--nan 0", ["--nan", "VOLUME"]),
        ("--renderer ideal --simd portable", ["--simd", "--renderer ideal"]),
        ("--renderer ideal --threads 1", ["--threads", "--renderer ideal"]),
    ] {
        let all: Vec<&str> = phantom.into_iter().chain(arguments.split(' ')).collect();
        for words in words {
            refused(folder.path(), &all, words);
        }
    }
    assert!(!folder.path().join("out.png").exists());
}

#[test]
fn commands_that_are_missing_or_not_served() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, words) in [
        (vec![], "a command is missing"),
        (vec!["rendre"], "'rendre'"),
        (vec!["report", "a.nrrd", "-o", "folder"], "report: this command is not served yet"),
        (vec!["sdk", "--prefix", "folder"], "sdk: this command is not served yet"),
        (vec!["bench", "--scene", "none,nonsense"], "'nonsense' is no scene; there are none, diffuse"),
        (vec!["bench", "--axis", "+w"], "'+w' is no axis; there are +x, -x"),
        (vec!["bench", "--size", "16,0"], "0 is not in 1..=256"),
        (vec!["bench", "--size", "257"], "257 is not in 1..=256"),
        (vec!["bench", "--bits", "10"], "8 or 12 is wanted"),
        (vec!["bench", "--simd", "mmx"], "'mmx'"),
        (vec!["bench", "--threads", "2,-1"], "-1 is not in 1"),
        (vec!["bench", "--frames", "20"], "20 is not in 21"),
        (vec!["bench", "--skipping", "perhaps"], "'perhaps'"),
        (vec!["bench", "--stages", "--scene", "mip"], "--stages"),
        (vec!["phantom", "sphere", "--size", "-3", "-o", "out.nrrd"], "1..=1024"),
        (vec!["phantom", "engine-block", "--size", "1024", "-o", "no/folder/out.nrrd"], "no/folder"),
        (vec!["phantom", "engine-block", "--size", "1024", "-o", "."], ".: is a directory"),
        (vec!["info", "--raw-type", "uint8", "missing"], "--raw-shape"),
        (vec!["info", "two\nlines"], "two\\nlines: No such file"),
    ] {
        refused(folder.path(), &arguments, words);
    }
}

#[test]
fn volumes_too_large_are_refused_before_they_are_read_or_computed() {
    let folder = tempfile::tempdir().unwrap();
    // Two gigabytes that take no room on the disk.
    fs::File::create(folder.path().join("large.raw")).unwrap().set_len(1 << 31).unwrap();
    let raw = ["--raw-shape", "2048,1024,1024", "--raw-type", "uint8", "-o", "out.png"];
    let begun = std::time::Instant::now();
    refused(
        folder.path(),
        &[&["render", "large.raw"][..], &raw].concat(),
        "large.raw: 2048 x 1024 x 1024 voxels",
    );
    refused(
        folder.path(),
        &["render", "--phantom-size", "1024", "-o", "out.png"],
        "more than 256 along an axis are not served yet",
    );
    assert!(begun.elapsed().as_secs() < 2, "{:?}", begun.elapsed());
}

#[test]
fn values_that_replace_nothing() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("nan.raw"), f32::NAN.to_le_bytes()).unwrap();
    let info = ["info", "nan.raw", "--raw-shape", "1,1,1", "--raw-type", "float"];
    for (value, words) in [
        ("nan", "'nan' is not finite"),
        ("-inf", "'-inf' is not finite"),
        ("1e39", "--nan 1e39: is infinite as float"),
    ] {
        refused(folder.path(), &[&info[..], &["--nan", value]].concat(), words);
    }
    refused(folder.path(), &info, "--nan VALUE would replace");
    assert!(run(folder.path(), &[&info[..], &["--nan", "-2.5"]].concat()).status.success());
}

#[test]
fn pipes_are_no_input() {
    let folder = tempfile::tempdir().unwrap();
    let made = Command::new("mkfifo").arg(folder.path().join("pipe")).status().unwrap();
    assert!(made.success());
    refused(folder.path(), &["info", "pipe"], "pipe: is not a regular file");
    let render = ["render", "--phantom", "sphere", "--phantom-size", "8", "-o", "out.png"];
    refused(folder.path(), &[&render[..], &["--transfer", "pipe"]].concat(), "pipe: is not a regular file");
}

#[test]
fn a_picture_that_cannot_be_written_leaves_the_one_before() {
    let folder = tempfile::tempdir().unwrap();
    let render = ["render", "--phantom", "sphere", "--phantom-size", "8", "-o", "out.png"];
    // The card's memories are files, too; the ideal renderer has none.
    let render = [&render[..], &["--renderer", "ideal"]].concat();
    fs::write(folder.path().join("out.png"), "before").unwrap();
    let script = "ulimit -f 1; trap '' XFSZ; exec \"$0\" \"$@\"";
    let result = Command::new("sh")
        .args(["-c", script, VOLUMEPRO])
        .args(&render)
        .current_dir(folder.path())
        .output()
        .unwrap();
    let message = String::from_utf8(result.stderr).unwrap();
    assert_eq!(result.status.code(), Some(1), "{message}");
    assert!(message.lines().last().unwrap().contains("out.png: File too large"), "{message}");
    assert_eq!(fs::read_to_string(folder.path().join("out.png")).unwrap(), "before");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    assert!(run(folder.path(), &render).status.success());
    assert!(fs::read(folder.path().join("out.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn pictures_go_to_standard_output_and_readers_may_leave() {
    let folder = tempfile::tempdir().unwrap();
    let render = ["render", "--phantom", "sphere", "--phantom-size", "8", "-o", "/dev/stdout"];
    let result = run(folder.path(), &render);
    assert!(result.status.success());
    assert!(result.stdout.starts_with(b"\x89PNG") && result.stdout.ends_with(b"IEND\xaeB\x60\x82"));
    for arguments in ["info sphere.nrrd", "--help", "render --phantom-size 8 -o out.png --stats json"] {
        let phantom = run(folder.path(), &["phantom", "sphere", "--size", "8", "-o", "sphere.nrrd"]);
        assert!(phantom.status.success());
        let script = format!(
            "({VOLUMEPRO} {arguments}; echo $? >code) | true; while ! [ -s code ]; do sleep 0.01; done"
        );
        let result = Command::new("sh").arg("-c").arg(script).current_dir(folder.path()).output().unwrap();
        let message = String::from_utf8(result.stderr).unwrap();
        assert!(!message.contains("volumepro:"), "{arguments}: {message}");
        assert_eq!(fs::read_to_string(folder.path().join("code")).unwrap(), "0\n", "{arguments}");
        fs::remove_file(folder.path().join("code")).unwrap();
    }
}
