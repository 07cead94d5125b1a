//! Whole files: what is refused and why, and what is read.

use super::super::{Samples, ScalarVolume, open};
use super::*;
use flate2::write::GzEncoder;
use proptest::prelude::*;
use std::io::Write;

/// Fields of the header by their places, as the standard lists them.
const SIZE: usize = 0;
const DIM: usize = 40;
const TYPE: usize = 70;
const PIXDIM: usize = 76;
const OFFSET: usize = 108;
const SLOPE: usize = 112;
const UNITS: usize = 123;
const DESCRIPTION: usize = 148;
const QFORM: usize = 252;
const SFORM: usize = 254;
const QUATERNION: usize = 256;
const ROWS: usize = 280;
const MAGIC: usize = 344;

/// A file of 2 x 3 x 4 bytes, in either byte order.
#[derive(Clone)]
struct File {
    bytes: Vec<u8>,
    big: bool,
}

impl File {
    fn new(big: bool) -> Self {
        let mut file = Self { bytes: vec![0; 352], big };
        file.integer(SIZE, 348_i32);
        for (index, size) in [3, 2, 3, 4, 1, 1, 1, 1].into_iter().enumerate() {
            file.short(DIM + 2 * index, size);
        }
        file.short(TYPE, 2);
        file.floats(PIXDIM, &[1.0; 8]);
        file.floats(OFFSET, &[352.0]);
        file.bytes[MAGIC..MAGIC + 4].copy_from_slice(b"n+1\0");
        file.bytes.extend(0..24);
        file
    }

    fn put(&mut self, place: usize, mut little: Vec<u8>) {
        if self.big {
            little.reverse();
        }
        self.bytes[place..place + little.len()].copy_from_slice(&little);
    }

    fn integer(&mut self, place: usize, value: i32) {
        self.put(place, value.to_le_bytes().to_vec());
    }

    fn short(&mut self, place: usize, value: i16) {
        self.put(place, value.to_le_bytes().to_vec());
    }

    fn floats(&mut self, place: usize, values: &[f32]) {
        for (index, value) in values.iter().enumerate() {
            self.put(place + 4 * index, value.to_le_bytes().to_vec());
        }
    }

    fn read(&self) -> Result<ScalarVolume, String> {
        read_as("volume.nii", &self.bytes)
    }
}

fn read_as(name: &str, bytes: &[u8]) -> Result<ScalarVolume, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    open(&path, &mut |_, _| {}).map_err(|error| error.to_string())
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// What makes a file wrong.
type Change = fn(&mut File);

#[test]
fn wrong_fields_are_refused_by_name() {
    let cases: [(Change, &str); 21] = [
        (|it| it.integer(SIZE, 540), "sizeof_hdr: 540 is not 348"),
        (|it| it.bytes[MAGIC..MAGIC + 4].copy_from_slice(b"ni1\0"), "magic: samples in another file"),
        (|it| it.bytes[MAGIC..MAGIC + 4].copy_from_slice(b"n+2\0"), "header: Invalid NIfTI-1 file"),
        (|it| it.short(TYPE, 128), "datatype: 128 is not a scalar type"),
        (|it| it.short(TYPE, 0), "datatype: 0"),
        (|it| it.short(TYPE, 4), "holds 376 bytes where sizes, type and encoding want at least 400"),
        (|it| it.short(DIM, 2), "dim: 2 axes, a volume has 3"),
        (|it| it.short(DIM + 2, 0), "dim: "),
        (|it| it.short(DIM + 2, -1), "dim: -1 samples along an axis"),
        (|it| (0..3).for_each(|axis| it.short(DIM + 2 + 2 * axis, i16::MAX)), "more than 8 GiB"),
        (
            |it| {
                it.short(DIM, 4);
                it.short(DIM + 8, 9);
            },
            "dim: more than three axes have samples",
        ),
        (|it| it.floats(OFFSET, &[348.0]), "vox_offset: 348 is no place"),
        (|it| it.floats(OFFSET, &[352.5]), "vox_offset: 352.5"),
        (|it| it.floats(OFFSET, &[f32::NAN]), "vox_offset: NaN"),
        (|it| it.floats(OFFSET, &[1e30]), "vox_offset: 1.0"),
        (|it| it.floats(OFFSET, &[1e10]), "want at least 10000000024"),
        (|it| it.floats(SLOPE, &[2.0, f32::INFINITY]), "scl_inter: inf is not finite"),
        (|it| it.floats(PIXDIM + 4, &[0.0]), "pixdim: an axis"),
        (|it| it.floats(PIXDIM + 4, &[f32::NAN]), "pixdim: a coordinate"),
        (|it| it.short(SFORM, 1), "srow_x, srow_y, srow_z: an axis"),
        (
            |it| {
                it.short(QFORM, 1);
                it.floats(QUATERNION, &[f32::NAN]);
            },
            "quatern and pixdim: a coordinate",
        ),
    ];
    for (change, message) in cases {
        for big in [false, true] {
            let mut file = File::new(big);
            change(&mut file);
            let error = file.read().expect_err(message);
            assert!(error.contains(message), "{message}: {error}");
        }
    }
    for length in 0..376 {
        assert!(read_as("volume.nii", &File::new(false).bytes[..length]).is_err(), "{length}");
    }
}

#[test]
fn damaged_compressed_files_are_refused() {
    let whole = gzip(&File::new(false).bytes);
    for length in 0..whole.len() {
        assert!(read_as("volume.nii.gz", &whole[..length]).is_err(), "{length}");
    }
    let mut large = File::new(false);
    (0..3).for_each(|axis| large.short(DIM + 2 + 2 * axis, 2048));
    let error = read_as("volume.nii.gz", &gzip(&large.bytes)).unwrap_err();
    assert!(error.contains(&format!("at least {}", ((1_u64 << 33) + 352).div_ceil(1032))), "{error}");
}

#[test]
fn samples_are_read_in_both_byte_orders_and_compressed() {
    for big in [false, true] {
        let mut file = File::new(big);
        file.bytes[DESCRIPTION..DESCRIPTION + 4].copy_from_slice(b"test");
        let volume = file.read().unwrap();
        assert_eq!((volume.dimensions(), volume.content.as_deref()), ([2, 3, 4], Some("test")));
        assert_eq!(*volume.samples(), Samples::Uint8((0..24).collect()));
        assert_eq!(volume.space.as_deref(), Some("right-anterior-superior"));
        file.short(TYPE, 512);
        file.short(DIM + 6, 2);
        let value = if big { 0x0203 } else { 0x0302 };
        let plain = file.read().unwrap();
        assert_eq!(plain.value([1, 0, 0]), Some(f64::from(value)));
        assert_eq!(read_as("a.NII.GZ", &gzip(&file.bytes)).unwrap().samples(), plain.samples());
        assert_eq!(read_as("without extension", &file.bytes).unwrap().samples(), plain.samples());
    }
}

#[test]
fn numbers_have_the_meaning_that_the_header_says() {
    let mut file = File::new(false);
    let values = |file: &File| file.read().unwrap().samples().clone();
    file.floats(SLOPE, &[0.0, 7.0]);
    assert!(matches!(values(&file), Samples::Uint8(_)));
    file.floats(SLOPE, &[1.0, -10.0]);
    assert_eq!(values(&file), Samples::Int16((-10..14).collect()));
    file.floats(SLOPE, &[0.5, 1.0]);
    assert_eq!(values(&file), Samples::Float32((0..24).map(|it| it as f32 * 0.5 + 1.0).collect()));
}

#[test]
fn space_is_what_the_header_says() {
    let mut file = File::new(true);
    file.floats(PIXDIM, &[-1.0, 0.5, 2.0, 3.0]);
    let geometry = |file: &File| *file.read().unwrap().geometry();
    assert_eq!(geometry(&file), Geometry::from_spacing([0.5, 2.0, 3.0]));
    // A quarter turn about z, the third axis mirrored.
    file.short(QFORM, 1);
    file.floats(QUATERNION, &[0.0, 0.0, 0.5_f32.sqrt(), 10.0, 20.0, 30.0]);
    let turned = geometry(&file);
    assert_eq!(turned.origin, DVec3::new(10.0, 20.0, 30.0));
    let wanted = DMat3::from_cols(DVec3::Y * 0.5, DVec3::X * -2.0, DVec3::Z * -3.0);
    assert!(turned.directions.abs_diff_eq(wanted, 1e-6), "{turned:?}");
    file.short(SFORM, 1);
    file.floats(ROWS, &[1.0, 0.0, 0.0, 4.0, 0.0, 0.0, 2.0, 5.0, 0.0, 3.0, 0.0, 6.0]);
    file.bytes[UNITS] = 1;
    let metres = geometry(&file);
    assert_eq!(metres.origin, DVec3::new(4.0, 5.0, 6.0) * 1e3);
    assert_eq!(metres.directions, DMat3::from_cols(DVec3::X, DVec3::Z * 3.0, DVec3::Y * 2.0) * 1e3);
}

proptest! {
    #[test]
    fn mutated_files_never_panic(
        changes in prop::collection::vec((0_usize..376, any::<u8>()), 0..12),
        cut in 300_usize..400,
        compressed in any::<bool>(),
    ) {
        let mut bytes = File::new(false).bytes;
        for (place, byte) in changes {
            bytes[place] = byte;
        }
        bytes.truncate(cut);
        let bytes = if compressed { gzip(&bytes) } else { bytes };
        if let Ok(volume) = read_as("volume.nii.gz", &bytes) {
            prop_assert_eq!(volume.dimensions().iter().product::<usize>(), volume.samples().len());
        }
    }
}
