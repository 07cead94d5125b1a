//! Whole folders: what is refused and why, and what is read.

use super::super::{Samples, ScalarVolume, open};
use super::*;
use proptest::prelude::*;
use std::collections::BTreeMap;
use tempfile::TempDir;

const EXPLICIT: &str = "1.2.840.10008.1.2.1";
const IMPLICIT: &str = "1.2.840.10008.1.2";
const BIG: &str = "1.2.840.10008.1.2.2";

/// An image of 3 columns and 2 rows, as attributes of tag, representation and value.
#[derive(Clone)]
struct File {
    syntax: &'static str,
    attributes: BTreeMap<(u16, u16), (&'static str, Vec<u8>)>,
}

impl File {
    /// The slice at height `z`, whose first number is `first`.
    fn new(syntax: &'static str, z: f64, first: u16) -> Self {
        let mut file = Self { syntax, attributes: BTreeMap::new() };
        file.text(0x0008, 0x103e, "LO", "a test");
        file.text(0x0020, 0x000e, "UI", "1.2.3");
        file.text(0x0020, 0x0032, "DS", &format!("-10\\20.5\\{z}"));
        file.text(0x0020, 0x0037, "DS", "1\\0\\0\\0\\1\\0");
        file.text(0x0028, 0x0030, "DS", "0.5\\0.25");
        for (element, number) in
            [(0x0002, 1), (0x0010, 2), (0x0011, 3), (0x0100, 16), (0x0101, 12), (0x0102, 11), (0x0103, 0)]
        {
            file.short(element, number);
        }
        file.numbers(&(first..first + 6).collect::<Vec<_>>());
        file
    }

    fn text(&mut self, group: u16, element: u16, representation: &'static str, text: &str) {
        let mut value = text.as_bytes().to_vec();
        if value.len() % 2 == 1 {
            value.push(if representation == "UI" { 0 } else { b' ' });
        }
        self.attributes.insert((group, element), (representation, value));
    }

    fn short(&mut self, element: u16, number: u16) {
        let value = self.bytes(number).to_vec();
        self.attributes.insert((0x0028, element), ("US", value));
    }

    fn numbers(&mut self, numbers: &[u16]) {
        let value = numbers.iter().flat_map(|number| self.bytes(*number)).collect();
        self.attributes.insert((0x7fe0, 0x0010), ("OW", value));
    }

    fn bytes(&self, number: u16) -> [u8; 2] {
        if self.syntax == BIG { number.to_be_bytes() } else { number.to_le_bytes() }
    }

    fn length(&self, length: u32) -> [u8; 4] {
        if self.syntax == BIG { length.to_be_bytes() } else { length.to_le_bytes() }
    }

    fn element(
        &self,
        (group, element): (u16, u16),
        representation: &str,
        value: &[u8],
        length: u32,
    ) -> Vec<u8> {
        let mut bytes = [self.bytes(group), self.bytes(element)].concat();
        match (self.syntax == IMPLICIT, representation) {
            (true, _) => bytes.extend(self.length(length)),
            (_, "OW" | "OB" | "SQ" | "UN") => {
                bytes.extend(representation.as_bytes());
                bytes.extend([0, 0]);
                bytes.extend(self.length(length));
            }
            _ => {
                bytes.extend(representation.as_bytes());
                bytes.extend(self.bytes(length as u16));
            }
        }
        bytes.extend(value);
        bytes
    }

    /// What stands in front of the attributes.
    fn head(&self) -> Vec<u8> {
        let meta = Self { syntax: EXPLICIT, attributes: BTreeMap::new() };
        let mut uid = self.syntax.as_bytes().to_vec();
        uid.resize(uid.len().next_multiple_of(2), 0);
        let syntax = meta.element((0x0002, 0x0010), "UI", &uid, uid.len() as u32);
        let length = meta.element((0x0002, 0x0000), "UL", &(syntax.len() as u32).to_le_bytes(), 4);
        [vec![0; 128], b"DICM".to_vec(), length, syntax].concat()
    }

    fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = self.head();
        for (tag, (representation, value)) in &self.attributes {
            bytes.extend(self.element(*tag, representation, value, value.len() as u32));
        }
        bytes
    }
}

fn folder(files: &[Vec<u8>]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (index, bytes) in files.iter().enumerate() {
        std::fs::write(folder.path().join(format!("image{index}")), bytes).unwrap();
    }
    folder
}

fn read_files(files: &[Vec<u8>]) -> Result<ScalarVolume, String> {
    let folder = folder(files);
    open(folder.path(), &mut |_, _| {}).map_err(|error| error.to_string())
}

fn read(files: &[File]) -> Result<ScalarVolume, String> {
    read_files(&files.iter().map(File::to_bytes).collect::<Vec<_>>())
}

/// Three slices in the order 2, 0, 1, two millimetres apart.
fn series(syntax: &'static str) -> Vec<File> {
    [2, 0, 1].map(|slice| File::new(syntax, f64::from(slice) * 2.0 - 1.0, 100 * slice)).to_vec()
}

#[test]
fn folders_without_images_are_refused() {
    let error = read_files(&[]).unwrap_err();
    assert!(error.ends_with("is a folder without DICOM images"), "{error}");
    let mut report = File::new(EXPLICIT, 0.0, 0);
    report.attributes.remove(&(0x7fe0, 0x0010));
    let error = read_files(&[b"text".to_vec(), vec![0; 1000], report.to_bytes()]).unwrap_err();
    assert!(error.ends_with("is a folder without DICOM images"), "{error}");
}

/// What makes a file wrong.
type Change = fn(&mut File);

#[test]
fn wrong_attributes_are_refused_by_name() {
    let cases: [(Change, &str); 29] = [
        (|it| it.text(0x0020, 0x000e, "UI", "1.2.4"), "SeriesInstanceUID: differs from that of"),
        (|it| it.text(0x0020, 0x0032, "DS", "1\\2"), "ImagePositionPatient: '1\\2' is not 3 numbers"),
        (|it| it.text(0x0020, 0x0032, "DS", "1\\2\\nan"), "ImagePositionPatient: '1\\2\\nan'"),
        (|it| drop(it.attributes.remove(&(0x0020, 0x0032))), "ImagePositionPatient: is missing"),
        (|it| it.text(0x0020, 0x0032, "DS", "-10\\20.5\\0"), "ImagePositionPatient: slice 2 of 3 lies 1 mm"),
        (|it| it.text(0x0020, 0x0032, "DS", "-10\\20.5\\-1"), "ImagePositionPatient: slice 2 of 3"),
        (|it| it.text(0x0020, 0x0032, "DS", "-9\\20.5\\1"), "ImagePositionPatient: slice 2 of 3 lies 1 mm"),
        (|it| it.text(0x0020, 0x0037, "DS", "1\\0\\0\\0\\0\\1"), "ImageOrientationPatient: differs"),
        (|it| it.text(0x0020, 0x0037, "DS", "1\\0\\0"), "ImageOrientationPatient: '1\\0\\0' is not 6"),
        (|it| drop(it.attributes.remove(&(0x0020, 0x0037))), "ImageOrientationPatient: is missing"),
        (|it| it.text(0x0020, 0x0037, "DS", &"1".repeat(2000)), "ImageOrientationPatient: 2000 bytes long"),
        (|it| it.short(0x0002, 3), "SamplesPerPixel: 3, but slices of scalars are read"),
        (|it| it.text(0x0028, 0x0008, "IS", "9"), "NumberOfFrames: 9, but"),
        (|it| it.short(0x0010, 3), "holds 12 bytes where sizes, type and encoding want at least 18"),
        (|it| it.short(0x0010, 1), "Rows or Columns: differs"),
        (|it| it.short(0x0010, 0), "Rows or Columns: differs"),
        (|it| drop(it.attributes.remove(&(0x0028, 0x0011))), "Columns: is missing"),
        (|it| it.text(0x0028, 0x0011, "LO", "abc"), "Columns: 4 bytes instead of 2"),
        (|it| it.text(0x0028, 0x0030, "DS", "0.5\\0.5"), "PixelSpacing: differs"),
        (|it| it.text(0x0028, 0x0030, "DS", "x"), "PixelSpacing: 'x' is not 2 numbers"),
        (|it| it.short(0x0100, 12), "BitsAllocated: 12 bits are not read"),
        (|it| it.short(0x0100, 8), "BitsStored: 12 of 8 bits"),
        (|it| it.short(0x0101, 0), "BitsStored: 0 of 16 bits"),
        (|it| it.short(0x0102, 15), "BitsStored: 12 of 16 bits, the highest of them 15"),
        (|it| it.short(0x0103, 1), "BitsAllocated, BitsStored or sign: differs"),
        (|it| it.short(0x0103, 2), "BitsAllocated: 16 bits are not read"),
        (|it| it.text(0x0028, 0x1053, "DS", "1\\2"), "RescaleSlope: '1\\2' is not a number"),
        (|it| it.text(0x0028, 0x1053, "DS", "inf"), "RescaleSlope: 'inf' is not a number"),
        (|it| it.numbers(&[1]), "holds 2 bytes where"),
    ];
    for (change, message) in cases {
        for syntax in [EXPLICIT, IMPLICIT, BIG] {
            let mut files = series(syntax);
            change(&mut files[2]);
            let error = read(&files).expect_err(message);
            assert!(error.contains(message), "{message}: {error}");
        }
    }
    let mixed = [series(EXPLICIT), vec![File::new(BIG, 5.0, 0)]].concat();
    assert!(read(&mixed).unwrap_err().contains("image3: TransferSyntaxUID: differs"));
    let error = read(&[File::new(EXPLICIT, 0.0, 0), File::new(EXPLICIT, 0.0, 0)]).unwrap_err();
    assert!(error.contains("ImagePositionPatient: is that of") && error.ends_with("image0 too"), "{error}");
}

#[test]
fn compressed_images_are_refused_by_their_syntax() {
    for (syntax, message) in [
        ("1.2.840.10008.1.2.4.70", "TransferSyntaxUID: 1.2.840.10008.1.2.4.70 (JPEG Lossless"),
        ("1.2.840.10008.1.2.1.99", "(Deflated Explicit VR Little Endian): only images that are not"),
        ("1.2.3", "TransferSyntaxUID: 1.2.3: only"),
        ("", "TransferSyntaxUID: : only"),
    ] {
        let error = read(&[File::new(syntax, 0.0, 0)]).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
    // Fragments in spite of the syntax.
    let mut file = File::new(EXPLICIT, 0.0, 0);
    file.attributes.remove(&(0x7fe0, 0x0010));
    let pixels = file.element((0x7fe0, 0x0010), "OB", &[], u32::MAX);
    let error = read_files(&[[file.to_bytes(), pixels].concat()]).unwrap_err();
    assert!(error.contains("PixelData: is compressed"), "{error}");
}

#[test]
fn lengths_that_lie_take_no_memory() {
    for (tag, representation) in [
        ((0x0009, 0x0010), "OB"),
        ((0x0009, 0x0010), "UN"),
        ((0x0028, 0x3006), "OW"),
        ((0x0020, 0x0032), "UN"),
        ((0x7fe0, 0x0010), "OW"),
    ] {
        let mut file = File::new(EXPLICIT, 0.0, 0);
        file.attributes.split_off(&tag);
        let claim = file.element(tag, representation, &[0; 8], u32::MAX - 1);
        let error = read_files(&[[file.to_bytes(), claim].concat()]).expect_err(representation);
        assert!(error.contains("image0: "), "{error}");
    }
}

#[test]
fn cut_off_files_are_refused() {
    let whole = File::new(EXPLICIT, 0.0, 0).to_bytes();
    for length in 0..whole.len() {
        assert!(read_files(&[whole[..length].to_vec()]).is_err(), "{length}");
    }
    // A part of a series that is cut off anywhere behind its beginning is no other file, but damaged.
    for length in 300..whole.len() {
        let files = [File::new(EXPLICIT, 1.0, 0).to_bytes(), whole[..length].to_vec()];
        match read_files(&files) {
            Ok(volume) => assert_eq!(volume.remarks.len(), 1, "{length}"),
            Err(error) => assert!(error.contains("image1: "), "{length}: {error}"),
        }
    }
}

#[test]
fn slices_are_read_in_their_order() {
    for syntax in [EXPLICIT, IMPLICIT, BIG] {
        let volume = read(&series(syntax)).unwrap();
        assert_eq!(volume.dimensions(), [3, 2, 3]);
        let wanted = [0_u16, 100, 200].into_iter().flat_map(|first| first..first + 6).collect();
        assert_eq!(*volume.samples(), Samples::Uint16(wanted));
        assert_eq!(volume.geometry().origin, DVec3::new(-10.0, 20.5, -1.0));
        let wanted = DMat3::from_diagonal(DVec3::new(0.25, 0.5, 2.0));
        assert_eq!(volume.geometry().directions, wanted);
        assert_eq!(volume.space.as_deref(), Some("left-posterior-superior"));
        assert_eq!(volume.content.as_deref(), Some("a test"));
        assert!(volume.remarks.is_empty(), "{:?}", volume.remarks);
    }
}

#[test]
fn sequences_and_private_attributes_are_passed() {
    let mut file = File::new(EXPLICIT, 0.0, 0);
    // A sequence of unknown length, in which there are attributes of the same names as outside.
    let rows = file.element((0x0028, 0x0010), "US", &[99, 0], 2);
    let item =
        [&[0xfe, 0xff, 0x00, 0xe0, 0xff, 0xff, 0xff, 0xff][..], &rows, &[0xfe, 0xff, 0x0d, 0xe0, 0, 0, 0, 0]];
    let sequence = [item.concat(), vec![0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]].concat();
    let whole = file.to_bytes();
    let place = file.head().len();
    let sequence = file.element((0x0008, 0x1140), "SQ", &sequence, u32::MAX);
    let private = file.element((0x0009, 0x1010), "OB", &[1; 5000], 5000);
    let description = file.element((0x0008, 0x103e), "LO", b"a test", 6);
    let rest = &whole[place + description.len()..];
    let bytes = [&whole[..place], &description, &sequence, &private, rest].concat();
    assert_eq!(read_files(&[bytes]).unwrap().dimensions(), [3, 2, 1]);
    file.text(0x0018, 0x0050, "DS", "3.5");
    assert_eq!(read(&[file]).unwrap().geometry().spacing(), [0.25, 0.5, 3.5]);
}

#[test]
fn numbers_have_the_meaning_that_attributes_say() {
    let mut files = series(EXPLICIT);
    for file in &mut files {
        file.text(0x0028, 0x1052, "DS", "-1024");
        file.text(0x0028, 0x1053, "DS", "1");
        // Four bits of an overlay lie over twelve of the image.
        file.numbers(&[0xf000, 0x0001, 0xafff, 0, 0, 0]);
    }
    let volume = read(&files).unwrap();
    let Samples::Int16(values) = volume.samples() else { panic!("{:?}", volume.samples()) };
    assert_eq!(values[..3], [-1024, -1023, 3071]);
    for file in &mut files {
        file.short(0x0103, 1);
    }
    let Samples::Int16(values) = read(&files).unwrap().samples().clone() else { panic!("signed") };
    assert_eq!(values[..3], [-1024, -1023, -1025]);
    files[1].text(0x0028, 0x1053, "DS", "0.5");
    let Samples::Float32(values) = read(&files).unwrap().samples().clone() else { panic!("a half") };
    assert_eq!(values[..3], [-1024.0, -1023.5, -1024.5]);
}

#[test]
fn slices_may_be_sheared_and_turned() {
    let files: Vec<File> = (0..3)
        .map(|slice| {
            let mut file = File::new(EXPLICIT, 0.0, slice);
            // Columns run along y, rows along z; slices follow along x and are sheared along z.
            file.text(0x0020, 0x0037, "DS", "0\\1\\0\\0\\0\\1");
            file.text(0x0020, 0x0032, "DS", &format!("{}\\0\\{}", 3 * slice, slice));
            file
        })
        .collect();
    let directions = read(&files).unwrap().geometry().directions;
    assert_eq!(directions, DMat3::from_cols(DVec3::Y * 0.25, DVec3::Z * 0.5, DVec3::new(3.0, 0.0, 1.0)));
}

#[test]
fn other_files_are_ignored_and_said() {
    let mut files: Vec<Vec<u8>> = series(EXPLICIT).iter().map(File::to_bytes).collect();
    files.push(b"notes".to_vec());
    assert_eq!(read_files(&files).unwrap().remarks, ["1 files are no DICOM images; ignored"]);
}

proptest! {
    #[test]
    fn mutated_files_never_panic(
        syntax in prop::sample::select(vec![EXPLICIT, IMPLICIT, BIG]),
        changes in prop::collection::vec((128_usize..600, any::<u8>()), 1..8),
        cut in 200_usize..700,
    ) {
        let mut bytes = File::new(syntax, 0.0, 0).to_bytes();
        for (place, byte) in changes {
            let place = place % bytes.len();
            bytes[place] = byte;
        }
        bytes.truncate(cut);
        if let Ok(volume) = read_files(&[bytes]) {
            prop_assert_eq!(volume.dimensions().iter().product::<usize>(), volume.samples().len());
        }
    }
}
