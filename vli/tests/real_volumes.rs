//! Real scans, where there are any: read from `$VOLUMEPRO_DATA`, else from `../shared/data` beside the workspace.
//! What they test is tested with phantoms too, which are always there.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::PathBuf;
use vli::file::{ScalarType, ScalarVolume, nrrd, open};
use vli::phantom::Phantom;
use vli::transfer::Preset;
use vli::values::{Histogram, ValueMapping};

/// What is known about a volume.
struct Known {
    file: &'static str,
    dimensions: [usize; 3],
    scalar: ScalarType,
    range: [f64; 2],
    spacing: [f64; 3],
    preset: Preset,
}

const fn known(
    file: &'static str,
    dimensions: [usize; 3],
    scalar: ScalarType,
    range: [f64; 2],
    spacing: [f64; 3],
    preset: Preset,
) -> Known {
    Known { file, dimensions, scalar, range, spacing, preset }
}

use Preset::{CtSoftTissue, Industrial, MrHead, Smooth};
use ScalarType::{Int16, Uint8, Uint16};

const KNOWN: [Known; 7] = [
    known("engine.nrrd", [256, 256, 110], Uint8, [0.0, 255.0], [1.0; 3], Industrial),
    known("bonsai.nrrd", [256, 256, 256], Uint8, [0.0, 255.0], [1.0; 3], Industrial),
    known("ct_head.nrrd", [256, 256, 113], Int16, [0.0, 3272.0], [1.0, 1.0, 2.0], CtSoftTissue),
    known("mri_head.nrrd", [256, 256, 256], Uint8, [0.0, 242.0], [1.0; 3], MrHead),
    known("iron_protein.nrrd", [68, 68, 68], Uint8, [0.0, 255.0], [1.0; 3], Smooth),
    known("mr_brain_small.nrrd", [128, 128, 84], Uint8, [0.0, 202.0], [1.0; 3], MrHead),
    known("ct_thorax.nrrd", [448, 320, 96], Uint16, [0.0, 2766.0], [0.78125, 0.78125, 1.0], CtSoftTissue),
];

/// A real volume; `None`, said aloud, if it is not there.
fn real(file: &str) -> Option<ScalarVolume> {
    let folder = std::env::var_os("VOLUMEPRO_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    let path = folder.join(file);
    if path.exists() {
        return Some(open(&path, &mut |_, _| {}).unwrap());
    }
    eprintln!("skipped: {file} is not in $VOLUMEPRO_DATA or ../shared/data");
    None
}

#[test]
fn real_volumes_are_what_they_are_known_to_be() {
    for known in &KNOWN {
        let Some(volume) = real(known.file) else { continue };
        let mapping = ValueMapping::new(&volume, None).unwrap();
        assert_eq!(volume.dimensions(), known.dimensions, "{}", known.file);
        assert_eq!(volume.samples().scalar_type(), known.scalar, "{}", known.file);
        assert_eq!(mapping.data_range(), known.range, "{}", known.file);
        assert_eq!(volume.geometry().spacing(), known.spacing, "{}", known.file);
        assert!(mapping.to_string().contains("are kept as"), "{}: {mapping}", known.file);
        let histogram = Histogram::new(&mapping.voxels(&volume));
        assert_eq!(Preset::automatic(&mapping, &histogram), known.preset, "{}", known.file);
        assert!(volume.remarks.is_empty(), "{}: {:?}", known.file, volume.remarks);
    }
}

#[test]
fn space_directions_place_a_real_volume() {
    let Some(volume) = real("ct_thorax.nrrd") else { return };
    assert_eq!(volume.space.as_deref(), Some("left-posterior-superior"));
    assert_eq!(volume.geometry().origin.to_array(), [-172.875, 47.25, -559.800_049]);
}

#[test]
fn phantoms_survive_the_way_through_a_file() {
    let folder = tempfile::tempdir().unwrap();
    for phantom in Phantom::ALL {
        let volume = phantom.volume([48, 40, 24]).unwrap();
        for compression in [nrrd::Compression::None, nrrd::Compression::Gzip] {
            let path = folder.path().join("volume.nrrd");
            nrrd::write(&path, &volume, compression).unwrap();
            let read = open(&path, &mut |_, _| {}).unwrap();
            assert_eq!(read.dimensions(), [48, 40, 24]);
            assert_eq!(read.samples(), volume.samples(), "{phantom}");
            assert_eq!(read.geometry(), volume.geometry(), "{phantom}");
            assert_eq!(read.content, volume.content, "{phantom}");
            assert_eq!(ValueMapping::new(&read, None), ValueMapping::new(&volume, None), "{phantom}");
        }
    }
}

#[test]
fn phantoms_have_kinds_too() {
    for (name, preset) in [("engine-block", Industrial), ("sphere-flake", Smooth)] {
        let volume = name.parse::<Phantom>().unwrap().volume([96; 3]).unwrap();
        let mapping = ValueMapping::new(&volume, None).unwrap();
        let histogram = Histogram::new(&mapping.voxels(&volume));
        assert_eq!(Preset::automatic(&mapping, &histogram), preset, "{name}");
    }
}
