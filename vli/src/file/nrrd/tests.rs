//! Whole files: what is refused and why, and what is read.

use super::super::{Geometry, Samples, ScalarType, ScalarVolume, open};
use super::{Compression, write};
use flate2::write::GzEncoder;
use glam::{DMat3, DVec3};
use proptest::prelude::*;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Header of 2 x 3 x 4 bytes.
const HEADER: &str = "NRRD0004\n# comment\ntype: uint8\ndimension: 3\nsizes: 2 3 4\nencoding: raw\n";

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
    open(path, &mut |_, _| {}).map_err(|error| {
        let text = error.to_string();
        assert!(!text.contains('\n'), "one line: {text}");
        text
    })
}

/// Reads a file of header lines, an empty line and data.
fn read_file(header: &str, data: &[u8]) -> Result<ScalarVolume, String> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.push(b'\n');
    bytes.extend_from_slice(data);
    read(&Files::new().write("volume.nrrd", &bytes))
}

/// The header with one field changed, added, or (with nothing behind the colon) removed.
fn with(field: &str) -> String {
    let name = field.split_once(':').unwrap().0;
    let others = HEADER.lines().filter(|line| !line.starts_with(&format!("{name}:")));
    let mut lines: Vec<&str> = others.collect();
    if !field.ends_with(':') {
        lines.push(field);
    }
    lines.join("\n") + "\n"
}

fn bytes() -> Vec<u8> {
    (0..24).collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn wrong_fields_are_refused_by_name() {
    for (field, message) in [
        ("type:", "type: is missing"),
        ("dimension:", "dimension: is missing"),
        ("sizes:", "sizes: is missing"),
        ("encoding:", "encoding: is missing"),
        ("type: block", "type: 'block' is not a scalar type"),
        ("type: complex", "type: 'complex'"),
        ("type: uint16", "endian: is missing"),
        ("dimension: 2", "sizes: 3 entries for 2 axes"),
        ("dimension: 0", "dimension: '0' is not 1 to 16"),
        ("dimension: 17", "dimension: '17'"),
        ("dimension: x", "dimension: 'x'"),
        ("sizes: 2 3", "sizes: 2 entries for 3 axes"),
        ("sizes: 2 0 12", "sizes: '0' is not a number of samples"),
        ("sizes: 2 -3 4", "sizes: '-3'"),
        ("sizes: 2 3.0 4", "sizes: '3.0'"),
        ("sizes: 2 3 99999999999999999999", "sizes: '99999999999999999999'"),
        ("sizes: 4294967296 4294967296 4294967296", "sizes: 4294967296 x 4294967296 x 4294967296 samples"),
        ("sizes: 2048 2048 2049", "more than 8 GiB"),
        ("sizes: 2 3 5", "holds 24 bytes where sizes, type and encoding want at least 30"),
        ("encoding: bzip2", "encoding: bzip2 is not supported"),
        ("encoding: zrl", "encoding: 'zrl' is not one of"),
        ("spacings: 1 nan 1", "spacings: 'nan' is not a spacing"),
        ("spacings: 1 inf 1", "spacings: 'inf'"),
        ("spacings: 1 0 1", "spacings: '0'"),
        ("spacings: 1 x 1", "spacings: 'x'"),
        ("spacings: 1 1", "spacings: 2 entries for 3 axes"),
        ("spacings: 1 1e300 1", "spacings: a coordinate is not a number between"),
        ("space directions: (1,0,0) (0,1,0) (1,1,0)", "space directions: an axis is shorter"),
        ("space directions: (1,0,0) (0,1,0) (0,0,nan)", "space directions: a coordinate"),
        ("space directions: (1,0,0) (0,1,0)", "space directions: 2 entries for 3 axes"),
        ("space directions: (1,0,0) (0,1,0) (0,1)", "space directions: '(0,1)' is not three numbers"),
        ("space directions: (1,0,0) (0,1,0) (0,0,1", "space directions: '(0,0,1' is neither"),
        ("space directions: none (1,0,0) (0,1,0)", "axis 1 is 'none' and has 2 values per voxel"),
        ("space origin: (0,0,inf)", "space origin: a coordinate"),
        ("space origin: none", "space origin: 'none' is not one vector"),
        ("space origin: 0 0 0", "space origin: '0 0 0' is neither"),
        ("kinds: RGB-color domain domain", "kinds: axis 1 is 'RGB-color' and has 2 values per voxel"),
        ("kinds: domain domain vector", "kinds: axis 3 is 'vector' and has 4 values per voxel"),
        ("kinds: domain", "kinds: 1 entries for 3 axes"),
        ("line skip: -1", "line skip: '-1'"),
        ("line skip: 99", "line skip: 99, but there are"),
        ("byte skip: -2", "byte skip: '-2'"),
        ("byte skip: 1", "holds 24 bytes where sizes, type and encoding want at least 25"),
        ("byte skip: 18446744073709551615", "want at least 18446744073709551615"),
        ("data file: none.raw", "none.raw: No such file"),
        ("data file: .", "is a folder, not a file"),
        ("data file: LIST", "data file: LIST wants"),
        ("data file: slice%d.raw 0 9 1", "data file: 10 files do not make up all samples"),
        ("data file: slice%d.raw 0 3 1", "slice0.raw: No such file"),
        ("data file: slice%d.raw 0 9223372036854775807 1", "do not make up all samples"),
    ] {
        let error = read_file(&with(field), &bytes()).expect_err(field);
        assert!(error.contains(message), "{field}: {error}");
    }
}

#[test]
fn headers_that_are_none_are_refused() {
    for (text, message) in [
        ("", "is in no known format"),
        ("NRRD", "is in no known format"),
        ("NRRD0006\n\n", "line 1: 'NRRD0006' is not NRRD0001 to NRRD0005"),
        ("NRRD0004\n\n", "dimension: is missing"),
        ("NRRD0004\nsomething\n", "line 2: 'something' is neither a field"),
        ("NRRD0004\nsizes: 2 3 4\nsizes: 2 3 4\n", "line 3: field 'sizes' is given twice"),
    ] {
        let error = read(&Files::new().write("volume", text.as_bytes())).expect_err(text);
        assert!(error.contains(message), "{text}: {error}");
    }
    let error = read(&Files::new().write("volume.nhdr", HEADER.as_bytes())).unwrap_err();
    assert!(error.contains("data file: is missing"), "{error}");
    let endless = [b"NRRD0004\n#".to_vec(), vec![b' '; 5 << 20]].concat();
    let error = read(&Files::new().write("volume", &endless)).unwrap_err();
    assert!(error.contains("the header is longer than"), "{error}");
    let error = read(Path::new("/dev/null")).unwrap_err();
    assert_eq!(error, "/dev/null: is not a regular file");
}

#[test]
fn binary_rubbish_is_refused() {
    let mut state = 1_u32;
    for length in [0, 1, 100, 10_000] {
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let bytes: Vec<u8> = b"NRRD0004\n".iter().copied().chain((0..length).map(|_| noise())).collect();
        assert!(read(&Files::new().write("volume.nrrd", &bytes)).is_err());
    }
}

#[test]
fn axes_must_be_three_and_scalar() {
    let three = |dimension: usize, sizes: &str| {
        let header =
            format!("NRRD0004\ntype: uint8\nencoding: raw\ndimension: {dimension}\nsizes: {sizes}\n");
        read_file(&header, &bytes())
    };
    for (dimension, sizes, message) in [
        (1, "24", "dimension: 1 axes of space"),
        (2, "4 6", "dimension: 2 axes of space"),
        (4, "2 3 2 2", "dimension: 4 axes of space"),
        (4, "2 1 3 4", "dimension: 4 axes of space"),
    ] {
        let error = three(dimension, sizes).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
    for (dimension, sizes) in [(4, "1 2 3 4"), (4, "2 3 4 1"), (6, "1 1 2 3 4 1")] {
        assert_eq!(three(dimension, sizes).unwrap().dimensions(), [2, 3, 4]);
    }
    assert_eq!(three(5, "1 1 1 24 1").unwrap().dimensions(), [1, 24, 1]);
}

#[test]
fn axes_of_one_value_are_dropped_wherever_they_are() {
    let header = "NRRD0005\ntype: uchar\nencoding: raw\ndimension: 4\nsizes: 2 3 1 4\nspace: RAS\n\
                  space directions: (0,0,2) (1,0,0) none (0,3,0)\nkinds: space space list space\n";
    let volume = read_file(header, &bytes()).unwrap();
    assert_eq!(volume.dimensions(), [2, 3, 4]);
    assert_eq!(volume.geometry().directions, DMat3::from_cols(DVec3::Z * 2.0, DVec3::X, DVec3::Y * 3.0));
    assert_eq!(volume.space.as_deref(), Some("right-anterior-superior"));
}

#[test]
fn lying_gzip_headers_do_not_allocate() {
    // 8 GiB can be claimed by a file of 8 MiB, but not by a short one.
    let data = gzip(&bytes());
    let header = with("encoding: gzip").replace("sizes: 2 3 4", "sizes: 2048 2048 2048");
    let error = read_file(&header, &data).unwrap_err();
    assert!(error.contains(&format!("holds {} bytes", data.len())), "{error}");
    assert!(error.contains(&format!("at least {}", (1_u64 << 33).div_ceil(1032))), "{error}");
}

#[test]
fn damaged_gzip_data_is_refused() {
    let header = with("encoding: gzip");
    let whole = gzip(&bytes());
    for length in 1..whole.len() {
        let error = read_file(&header, &whole[..length]).unwrap_err();
        assert!(error.contains("volume.nrrd: gzip data: "), "{length}: {error}");
    }
    let mut damaged = whole.clone();
    damaged[whole.len() - 8] ^= 1;
    assert!(read_file(&header, &damaged).unwrap_err().contains("gzip data: "));
    let error = read_file(&header, &gzip(&bytes()[..23])).unwrap_err();
    assert!(error.contains("gzip data: it ends 1 bytes before the last sample"), "{error}");
    assert!(read_file(&header, &bytes()).unwrap_err().contains("gzip data: "));
}

#[test]
fn gzip_data_may_have_members_and_be_skipped() {
    let members = [gzip(&[7; 5]), gzip(&bytes()[..10]), gzip(&bytes()[10..])].concat();
    let volume = read_file(&(with("encoding: gzip") + "byte skip: 5\n"), &members).unwrap();
    assert_eq!(*volume.samples(), Samples::Uint8(bytes()));
}

#[test]
fn damaged_text_is_refused() {
    for (encoding, data, message) in [
        ("text", "0 1 2", "holds 5 bytes where"),
        ("text", "0 1 2                                                ", "text data: it ends after 3 of 24"),
        (
            "text",
            "0 1 2 3 256 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23",
            "number 5, '256', is not",
        ),
        ("text", "0 1 2 3 \u{1b}[ 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23", "'\\u{1b}['"),
        ("hex", "0001", "holds 4 bytes where"),
        ("hex", "000102030405060708090a0b0c0d0e0f101112131415160g", "'g' is not a hexadecimal digit"),
        ("hex", "000102030405060708090a0b0c0d0e0f10111213141516 1", "it ends 1 bytes before"),
    ] {
        let error = read_file(&with(&format!("encoding: {encoding}")), data.as_bytes()).expect_err(data);
        assert!(error.contains(message), "{data}: {error}");
    }
}

#[test]
fn text_and_hex_are_read() {
    let hex = "00 0102030405060708090A0b\n0c0d0e0f1011121314151617\n";
    let volume = read_file(&with("encoding: hex"), hex.as_bytes()).unwrap();
    assert_eq!(*volume.samples(), Samples::Uint8(bytes()));
    assert!(volume.remarks.is_empty());
    let header = with("encoding: ascii").replace("uint8", "float").replace("2 3 4", "1 1 4");
    let volume = read_file(&header, b" -1.5e3\t+2\n NaN -inf ").unwrap();
    let Samples::Float32(values) = volume.samples() else { panic!("{volume:?}") };
    assert_eq!(values[..2], [-1500.0, 2.0]);
    assert!(values[2].is_nan() && values[3] == f32::NEG_INFINITY);
}

#[test]
fn bytes_may_be_skipped_and_left_over() {
    let data = [b"one\ntwo\n....".to_vec(), bytes()].concat();
    let skipped = read_file(&(HEADER.to_owned() + "line skip: 2\nbyteskip: 4\n"), &data).unwrap();
    assert_eq!(*skipped.samples(), Samples::Uint8(bytes()));
    assert!(skipped.remarks.is_empty());
    let at_end = read_file(&(HEADER.to_owned() + "byte skip: -1\n"), &data).unwrap();
    assert_eq!(*at_end.samples(), Samples::Uint8(bytes()));
    let surplus = read_file(HEADER, &data).unwrap();
    assert!(surplus.remarks[0].contains("data goes on behind the last sample"), "{:?}", surplus.remarks);
}

#[test]
fn unusual_headers_are_understood() {
    let header = "NRRD0001\r\ncontent: a test\r\nType: unsigned char\r\ndimension: 3\r\nkey:=value\r\n\
                  axismins: 0 0 0\r\nthicknesses: nan 1 1\r\nlabels: \"x\" \"y\" \"z\"\r\nmode: fast\r\n\
                  sizes: 2 3 4\r\nspacings: 0.5 -1 2\r\nENCODING: RAW\r\n\r";
    let volume = read_file(header, &bytes()).unwrap();
    assert_eq!(volume.content.as_deref(), Some("a test"));
    assert_eq!(*volume.geometry(), Geometry::from_spacing([0.5, -1.0, 2.0]));
    assert_eq!(volume.remarks, ["field 'mode' is unknown and ignored"]);
    assert_eq!(volume.value([1, 2, 3]), Some(23.0));
}

#[test]
fn data_files_are_found_beside_the_header() {
    let files = Files::new();
    for slice in 0..4 {
        files.write(&format!("slice{:02}.raw", 10 - slice), &bytes()[6 * slice..6 * slice + 6]);
    }
    files.write("all.raw", &bytes());
    let absolute = files.0.path().join("all.raw").display().to_string();
    let list = "LIST\nslice10.raw\nslice09.raw\nslice08.raw\nslice07.raw";
    for data in ["all.raw", "slice%02d.raw 10 7 -1", "slice%02d.raw 10 7 -1 2", list, &absolute] {
        let header = format!("{HEADER}data file: {data}\n");
        let volume = read(&files.write("volume.nhdr", header.as_bytes())).unwrap();
        assert_eq!(*volume.samples(), Samples::Uint8(bytes()), "{data}");
    }
    files.write("slice08.raw", &[1, 2, 3]);
    let error =
        read(&files.write("volume.nhdr", format!("{HEADER}datafile: {list}\n").as_bytes())).unwrap_err();
    assert!(error.contains("slice08.raw: holds 3 bytes where"), "{error}");
}

#[test]
fn compressed_data_files_may_hold_slabs() {
    let files = Files::new();
    files.write("1.gz", &gzip(&bytes()[..12]));
    files.write("2.gz", &gzip(&bytes()[12..]));
    let header = with("encoding: gz") + "data file: %d.gz 1 2 1 3\n";
    let volume = read(&files.write("volume.nhdr", header.as_bytes())).unwrap();
    assert_eq!(*volume.samples(), Samples::Uint8(bytes()));
}

#[test]
fn progress_goes_from_nothing_to_everything() {
    let samples: Vec<u8> = (0..3 << 20).map(|index| (index % 251) as u8).collect();
    let volume =
        ScalarVolume::new([1 << 10, 1 << 10, 3], samples.into(), Geometry::from_spacing([1.0; 3])).unwrap();
    let files = Files::new();
    let path = files.0.path().join("volume.nrrd");
    for compression in [Compression::None, Compression::Gzip] {
        write(&path, &volume, compression).unwrap();
        let mut seen = Vec::new();
        open(&path, &mut |done, total| seen.push((done, total))).unwrap();
        let total = 3 << 20;
        assert_eq!(seen, [(0, total), (1 << 20, total), (2 << 20, total), (total, total)]);
    }
}

#[test]
fn files_that_cannot_be_written_are_named() {
    let volume = ScalarVolume::new([1; 3], vec![0_u8].into(), Geometry::from_spacing([1.0; 3])).unwrap();
    let files = Files::new();
    let folder = files.0.path();
    assert!(write(folder, &volume, Compression::None).unwrap_err().to_string().contains("is a directory"));
    let error = write(&folder.join("none/volume.nrrd"), &volume, Compression::Gzip).unwrap_err();
    assert!(error.to_string().contains("none/volume.nrrd: No such file"), "{error}");
}

/// Samples of a type from bytes, with NaN among them.
fn samples(scalar: ScalarType, bytes: &[u8]) -> Samples {
    let mut samples = Samples::with_capacity(scalar, bytes.len() / scalar.bytes()).unwrap();
    samples.append(bytes, super::super::ByteOrder::Little);
    samples
}

/// The samples' bits, which tell one NaN from another.
fn bits(samples: &Samples) -> Vec<u8> {
    let mut bytes = Vec::new();
    samples.write_to(&mut bytes).unwrap();
    bytes
}

/// Fields with values that are rare, wrong, or at the limits of numbers.
const STRANGE: [(&str, &[&str]); 10] = [
    ("type", &["int8", "double", "long long", "block", ""]),
    ("encoding", &["raw", "gzip", "hex", "text", "bz2"]),
    ("endian", &["little", "big", "middle"]),
    ("byte skip", &["-1", "0", "1", "18446744073709551615", "18446744073709551616"]),
    ("line skip", &["0", "1", "18446744073709551615", "x"]),
    (
        "data file",
        &["volume.nrrd", "LIST", "%d 1 2 1", "%064d.raw 0 9223372036854775807 1 3", "%d 1 9 3 0", "/"],
    ),
    ("kinds", &["domain domain domain", "list domain domain domain", "vector space", ""]),
    ("spacings", &["1 1 1", "nan 1 1 1", "1e300 1 1", "-0.0 1 1", "1e-320 1 1"]),
    (
        "space directions",
        &["(1,0,0) (0,1,0) (0,0,1)", "none (1,0,0) (0,1,0) (0,0,1)", "(1e308,1e308,1e308)", "((", ""],
    ),
    ("space origin", &["(0,0,0)", "(1e308,0,0)", "none", ")("]),
];

proptest! {
    #[test]
    fn what_is_written_is_read(
        scalar in prop::sample::select(ScalarType::ALL.to_vec()),
        dimensions in prop::array::uniform3(1_usize..6),
        pool in prop::collection::vec(any::<u8>(), 125 * 8),
        spacing in prop::array::uniform3(prop_oneof![1e-3..1e3, Just(1.0), -5.0..-0.1]),
        shear in prop::option::of(-0.2..0.2_f64),
        space in prop::option::of(Just("left-posterior-superior".to_owned())),
        compression in prop::sample::select(vec![Compression::None, Compression::Gzip]),
    ) {
        let count: usize = dimensions.iter().product();
        let mut geometry = Geometry::from_spacing(spacing);
        if let Some(shear) = shear {
            geometry.directions.x_axis.y = shear * spacing[1];
            geometry.origin = DVec3::new(1.0 / 3.0, shear, -1e6);
        }
        let mut volume =
            ScalarVolume::new(dimensions, samples(scalar, &pool[..count * scalar.bytes()]), geometry).unwrap();
        volume.space = space;
        let files = Files::new();
        let path = files.0.path().join("volume.nrrd");
        write(&path, &volume, compression).unwrap();
        let read = read(&path).unwrap();
        prop_assert_eq!(read.dimensions(), dimensions);
        prop_assert_eq!(read.samples().scalar_type(), scalar);
        prop_assert_eq!(bits(read.samples()), bits(volume.samples()));
        prop_assert_eq!(read.geometry(), volume.geometry());
        prop_assert_eq!(&read.space, &volume.space);
        prop_assert!(read.remarks.is_empty());
    }

    #[test]
    fn every_encoding_and_byte_order_means_the_same(
        scalar in prop::sample::select(ScalarType::ALL.to_vec()),
        pool in prop::collection::vec(0_u8..0x40, 24 * 8),
        big in any::<bool>(),
        encoding in prop::sample::select(vec!["raw", "gzip", "hex", "text"]),
    ) {
        // Bytes below 0x40 make no NaN, which has no text that tells its bits.
        let wanted = samples(scalar, &pool[..24 * scalar.bytes()]);
        let mut data = bits(&wanted);
        if big {
            data.chunks_mut(scalar.bytes()).for_each(<[u8]>::reverse);
        }
        let data = match encoding {
            "gzip" => gzip(&data),
            "hex" => data.iter().map(|byte| format!("{byte:02x}")).collect::<String>().into_bytes(),
            "text" => super::super::with_samples!(&wanted, values =>
                values.iter().map(|value| format!("{value:?} ")).collect::<String>().into_bytes()),
            _ => data,
        };
        let header = format!(
            "NRRD0005\ntype: {scalar}\ndimension: 3\nsizes: 2 3 4\nencoding: {encoding}\nendian: {}\n",
            if big { "big" } else { "little" }
        );
        let read = read_file(&header, &data).unwrap();
        prop_assert_eq!(read.samples(), &wanted);
    }

    #[test]
    fn strange_headers_never_panic(
        values in prop::collection::vec((prop::sample::select(STRANGE.to_vec()), 0_usize..8), 0..6),
        sizes in prop::collection::vec(prop::sample::select(vec!["0", "1", "2", "4", "12", "4294967296", "-1"]), 0..6),
        length in 0_usize..100,
    ) {
        let mut lines = vec![format!("dimension: {}", sizes.len()), format!("sizes: {}", sizes.join(" "))];
        for ((field, choices), choice) in values {
            lines.push(format!("{field}: {}", choices[choice % choices.len()]));
        }
        for default in ["type: uint16", "encoding: raw", "endian: big"] {
            let field = default.split_once(':').unwrap().0;
            if !lines.iter().any(|line| line.starts_with(field)) {
                lines.push(default.into());
            }
        }
        let header = format!("NRRD0005\n{}\n", lines.join("\n"));
        if let Ok(volume) = read_file(&header, &vec![b'1'; length]) {
            prop_assert_eq!(volume.dimensions().iter().product::<usize>(), volume.samples().len());
        }
    }

    #[test]
    fn mutated_files_never_panic(place in 0_usize..200, byte in any::<u8>(), cut in 0_usize..300) {
        let mut file = (HEADER.to_owned() + "data file: %02d.raw 1 4 1\nspacings: 1 2 3\n\n").into_bytes();
        file.extend_from_slice(&bytes());
        let place = place % file.len();
        file[place] = byte;
        file.truncate(cut);
        let _ = read(&Files::new().write("volume.nrrd", &file));
    }
}
