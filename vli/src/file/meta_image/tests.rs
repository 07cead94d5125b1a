//! Whole files: what is refused and why, and what is read.

use super::super::{Samples, ScalarVolume, open};
use flate2::write::ZlibEncoder;
use glam::{DMat3, DVec3};
use proptest::prelude::*;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Header of 2 x 3 x 4 bytes that follow.
const HEADER: &str = "ObjectType = Image\nNDims = 3\nDimSize = 2 3 4\nElementType = MET_UCHAR\n";
const LOCAL: &str = "ElementDataFile = LOCAL\n";

struct Files(TempDir);

impl Files {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

fn read(path: &Path) -> Result<ScalarVolume, String> {
    open(path, &mut |_, _| {}).map_err(|error| error.to_string())
}

fn read_file(header: &str, data: &[u8]) -> Result<ScalarVolume, String> {
    read(&Files::new().write("volume.mha", &[header.as_bytes(), data].concat()))
}

/// The header with one field changed, added, or (with nothing behind the sign) removed.
fn with(field: &str) -> String {
    let name = field.split_once(" =").unwrap().0;
    let others = HEADER.lines().filter(|line| !line.starts_with(&format!("{name} =")));
    let mut lines: Vec<&str> = others.collect();
    if !field.ends_with('=') {
        lines.push(field);
    }
    lines.join("\n") + "\n" + if name == "ElementDataFile" { "" } else { LOCAL }
}

fn bytes() -> Vec<u8> {
    (0..24).collect()
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn wrong_fields_are_refused_by_name() {
    for (field, message) in [
        ("ObjectType = Tube", "ObjectType: 'Tube' is not Image"),
        ("NDims =", "NDims: is missing"),
        ("NDims = 2", "NDims: '2' axes, a volume has 3"),
        ("NDims = 4", "DimSize: 3 numbers instead of 4"),
        ("DimSize =", "DimSize: is missing"),
        ("DimSize = 2 3", "DimSize: 2 numbers instead of 3"),
        ("DimSize = 2 -3 4", "DimSize: '-3' is not such a number"),
        ("DimSize = 2 0 4", "DimSize: 2 x 0 x 4 holds no samples"),
        ("DimSize = 2 3 5", "holds 24 bytes where sizes, type and encoding want at least 30"),
        ("DimSize = 2048 2048 2049", "more than 8 GiB"),
        ("DimSize = 18446744073709551615 2 2", "more than 8 GiB"),
        ("ElementType =", "ElementType: is missing"),
        ("ElementType = MET_UCHAR_ARRAY", "ElementType: 'MET_UCHAR_ARRAY' is not a scalar type"),
        ("ElementType = MET_USHORT", "holds 24 bytes where sizes, type and encoding want at least 48"),
        ("ElementNumberOfChannels = 3", "ElementNumberOfChannels: 3 values per voxel"),
        ("BinaryData = maybe", "BinaryData: 'maybe' is neither True nor False"),
        ("BinaryData = False", "holds 24 bytes where sizes, type and encoding want at least 47"),
        ("CompressedData = True", "zlib data: "),
        ("HeaderSize = 1", "holds 24 bytes where sizes, type and encoding want at least 25"),
        ("HeaderSize = -2", "HeaderSize: '-2' is neither"),
        ("HeaderSize = 18446744073709551615", "want at least 18446744073709551615"),
        ("ElementSpacing = 1 nan 1", "TransformMatrix x ElementSpacing: "),
        ("ElementSpacing = 1 0 1", "TransformMatrix x ElementSpacing: "),
        ("ElementSpacing = 1 1", "ElementSpacing: 2 numbers instead of 3"),
        ("TransformMatrix = 1 0 0 0 1 0 1 1 0", "TransformMatrix x ElementSpacing: an axis"),
        ("TransformMatrix = 1 0 0 0 1 0 1 1", "TransformMatrix: 8 numbers instead of 9"),
        ("Position = 0 0 inf", "Offset: a coordinate"),
        ("Offset = 0 0 x", "Offset: 'x' is not such a number"),
        ("ElementDataFile = ", "ElementDataFile: is empty"),
        ("ElementDataFile = none.raw", "none.raw: No such file"),
        ("ElementDataFile = LIST", "files do not make up all samples"),
        ("ElementDataFile = LIST -1\na\nb", "files do not make up all samples"),
        ("ElementDataFile = %d 0 9223372036854775807 1", "do not make up all samples"),
        ("ElementDataFile = %d 1 4 0", "ElementDataFile: 1 to 4 in steps of 0"),
        ("ElementDataFile = .", "is a folder, not a file"),
        ("Modality", "line 5: 'Modality' is no field"),
        ("NDims = 3\nNDims = 3", "line 5: field 'NDims' is given twice"),
    ] {
        let header = if field.contains(" =") { with(field) } else { format!("{HEADER}{field}\n") };
        let error = read_file(&header, &bytes()).expect_err(field);
        assert!(error.contains(message), "{field}: {error}");
        assert!(!error.contains('\n'));
    }
    let error = read_file(HEADER, b"").unwrap_err();
    assert!(error.ends_with("ElementDataFile: is missing"), "{error}");
    let endless = [HEADER.as_bytes(), &vec![b' '; 5 << 20]].concat();
    let error = read(&Files::new().write("volume.mhd", &endless)).unwrap_err();
    assert!(error.contains("the header is longer than"), "{error}");
}

#[test]
fn damaged_compressed_data_is_refused() {
    let header = with("CompressedData = True");
    let whole = zlib(&bytes());
    for length in 0..whole.len() {
        assert!(read_file(&header, &whole[..length]).is_err(), "{length}");
    }
    let error = read_file(&header.replace("2 3 4", "2048 2048 2048"), &whole).unwrap_err();
    assert!(error.contains(&format!("at least {}", (1_u64 << 33).div_ceil(1032))), "{error}");
    assert_eq!(*read_file(&header, &whole).unwrap().samples(), Samples::Uint8(bytes()));
}

#[test]
fn samples_and_geometry_are_read() {
    let header =
        with("ElementType = MET_SHORT").replace("2 3 4", "2 3 2 1").replace("NDims = 3", "NDims = 4") + LOCAL;
    let geometry = "ElementByteOrderMSB = True\nElementSpacing = 0.5 2 3 1\nPosition = 10 20 -30 0\n\
                    Rotation = 0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1\nAnatomicalOrientation = RAI\n";
    let volume = read_file(&format!("{geometry}{header}").replacen(LOCAL, "", 1), &bytes()).unwrap();
    assert_eq!(volume.dimensions(), [2, 3, 2]);
    assert_eq!(volume.value([1, 2, 1]), Some(f64::from(0x1617)));
    assert_eq!(volume.geometry().origin, DVec3::new(10.0, 20.0, -30.0));
    // The first axis of the volume runs along y, the second along -x.
    assert_eq!(
        volume.geometry().directions,
        DMat3::from_cols(DVec3::Y * 0.5, DVec3::X * -2.0, DVec3::Z * 3.0)
    );
    assert_eq!(volume.space.as_deref(), Some("left-posterior-superior"));
}

#[test]
fn text_is_read() {
    let text: Vec<u8> = bytes().iter().flat_map(|byte| format!("{byte} ").into_bytes()).collect();
    assert_eq!(*read_file(&with("BinaryData = False"), &text).unwrap().samples(), Samples::Uint8(bytes()));
}

#[test]
fn data_files_are_found_beside_the_header() {
    let files = Files::new();
    for slice in 0..4 {
        files.write(&format!("slice{slice}.raw"), &bytes()[6 * slice..6 * slice + 6]);
    }
    files.write("my data.raw", &bytes());
    files.write("headed.raw", &[vec![9; 100], bytes()].concat());
    let list = "LIST\nslice0.raw\n slice1.raw\n\nslice2.raw\nslice3.raw";
    for (file, skip) in [
        ("my data.raw", "0"),
        ("headed.raw", "-1"),
        ("headed.raw", "100"),
        ("slice%d.raw 0 3 1", "0"),
        ("slice%d.raw 0 3", "0"),
        (list, "0"),
        (&list.replace("LIST", "LIST 2"), "0"),
    ] {
        let header = format!("{HEADER}HeaderSize = {skip}\nElementDataFile = {file}\n");
        let volume = read(&files.write("volume.mhd", header.as_bytes())).unwrap();
        assert_eq!(*volume.samples(), Samples::Uint8(bytes()), "{file}");
        assert!(volume.remarks.is_empty());
    }
}

/// Fields with values that are rare, wrong, or at the limits of numbers.
const STRANGE: [(&str, &[&str]); 9] = [
    ("NDims", &["3", "4", "2", ""]),
    ("ElementType", &["MET_CHAR", "MET_DOUBLE", "MET_ULONG_LONG", "MET_NONE"]),
    ("DimSize", &["2 3 4", "1 1 1 1", "4294967296 4294967296 4294967296", "0 1 1", "-1 1 1"]),
    ("BinaryData", &["True", "False", "2"]),
    ("CompressedData", &["True", "False"]),
    ("HeaderSize", &["-1", "0", "18446744073709551615", "18446744073709551616"]),
    ("ElementSpacing", &["1 1 1", "1 1 1 1", "-1 1e-320 1", "1e308 1e308 1e308"]),
    ("TransformMatrix", &["1 0 0 0 1 0 0 0 1", "nan 0 0 0 1 0 0 0 1", ""]),
    ("ElementDataFile", &["LOCAL", "LIST", "volume.mha", "%064d 0 9223372036854775807 1", "%d 9 1 -3", "/"]),
];

proptest! {
    #[test]
    fn strange_headers_never_panic(choices in prop::array::uniform9(0_usize..8), length in 0_usize..100) {
        let mut header = String::new();
        for ((field, values), choice) in STRANGE.iter().zip(choices) {
            if let Some(value) = values.get(choice) {
                header += &format!("{field} = {value}\n");
            }
        }
        if let Ok(volume) = read_file(&header, &vec![b'1'; length]) {
            prop_assert_eq!(volume.dimensions().iter().product::<usize>(), volume.samples().len());
        }
    }

    #[test]
    fn mutated_files_never_panic(place in 0_usize..200, byte in any::<u8>(), cut in 0_usize..300) {
        let header = with("ElementSpacing = 1 2 3") + "Offset = 1 2 3\n";
        let mut file = [header.replacen(LOCAL, "", 1).as_bytes(), LOCAL.as_bytes(), &bytes()].concat();
        let place = place % file.len();
        file[place] = byte;
        file.truncate(cut);
        let _ = read(&Files::new().write("volume.mha", &file));
    }
}
