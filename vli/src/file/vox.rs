//! Vox1999a files (.vox), the VLI's own format.
//!
//! Two sections of text, each ended by the line `##` and a form feed, describe the file and its first volume, whose
//! samples follow. Of several volumes the first is read. `VolumeScale` and `VolumePosition` are taken for millimetres,
//! because the format fixes no unit.

use super::layout::{Layout, Meaning};
use super::source::open_regular;
use super::{ByteOrder, FileError, FileFault, Geometry, ScalarType};
use crate::text::shorten;
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// What every file begins with.
pub(super) const MAGIC: &[u8] = b"Vox1999a";

/// Longest header in bytes.
const MAXIMUM_HEADER: u64 = 1 << 20;

/// The line that ends a section.
const END: &[u8] = b"##\x0c\n";

const SIZE: &str = "VolumeSize";
const BITS: &str = "VoxelSize";
const ORDER: &str = "Endian";
const SCALE: &str = "VolumeScale";
const POSITION: &str = "VolumePosition";
const FIELD: &str = "Field0";

/// Reads the sections of text in front of a volume.
pub(super) fn layout(path: &Path) -> Result<Layout, FileError> {
    let (file, _) = open_regular(path)?;
    read(&mut BufReader::new(file)).map_err(|fault| fault.of(path))
}

fn read(reader: &mut dyn BufRead) -> Result<Layout, FileFault> {
    let mut reader = reader.take(MAXIMUM_HEADER);
    let mut magic = Vec::new();
    reader.read_until(b'\n', &mut magic)?;
    if magic.trim_ascii_end() != MAGIC {
        let what = format!("'{}' is not Vox1999a", shorten(&String::from_utf8_lossy(&magic), 40));
        return Err(FileFault::Line { line: 1, what });
    }
    section(&mut reader)?;
    let keys = section(&mut reader)?;
    interpret(&keys, MAXIMUM_HEADER - reader.limit())
}

/// The keys of a section, with the words behind them.
fn section(reader: &mut dyn BufRead) -> Result<BTreeMap<String, String>, FileFault> {
    let mut keys = BTreeMap::new();
    let mut line = Vec::new();
    loop {
        line.clear();
        if reader.read_until(b'\n', &mut line)? == 0 {
            let what = "no line of ## and a form feed ends the header";
            return Err(FileFault::field("header", what));
        }
        if line == END {
            return Ok(keys);
        }
        let text = String::from_utf8_lossy(&line);
        let text = text.trim();
        // `Field 0 (...)` and `Field0 (...)` are the same.
        let end = text.find(|character: char| character.is_whitespace() || character == '(');
        let (key, value) = text.split_at(end.unwrap_or(text.len()));
        let (key, value) = match value.trim_start().strip_prefix('0') {
            Some(rest) if key == "Field" => (FIELD, rest),
            _ => (key, value),
        };
        keys.entry(key.to_owned()).or_insert_with(|| value.trim().to_owned());
    }
}

fn interpret(keys: &BTreeMap<String, String>, offset: u64) -> Result<Layout, FileFault> {
    let require = |name: &'static str| {
        keys.get(name).map(String::as_str).ok_or_else(|| FileFault::field(name, "is missing"))
    };
    let stored = match require(BITS)? {
        "8" => ScalarType::Uint8,
        "16" => ScalarType::Uint16,
        bits => return Err(FileFault::field(BITS, format!("{bits} bits, 8 and 16 are understood"))),
    };
    let order = match require(ORDER) {
        Ok("L") => ByteOrder::Little,
        Ok("B") => ByteOrder::Big,
        Ok(other) => return Err(FileFault::field(ORDER, format!("'{other}' is neither L nor B"))),
        Err(_) if stored == ScalarType::Uint8 => ByteOrder::Little,
        Err(missing) => return Err(missing),
    };
    let dimensions = numbers(SIZE, require(SIZE)?)?;
    let layout = Layout::attached(dimensions, stored, order, offset, SIZE)?;
    let vector = |name: &'static str, default: f64| match keys.get(name) {
        Some(text) => numbers(name, text).map(DVec3::from_array),
        None => Ok(DVec3::splat(default)),
    };
    let geometry =
        Geometry { origin: vector(POSITION, 0.0)?, directions: DMat3::from_diagonal(vector(SCALE, 1.0)?) };
    geometry.check(SCALE, POSITION)?;
    let meaning = keys.get(FIELD).map_or(Ok(Meaning::itself(stored)), |text| meaning(stored, text))?;
    Ok(Layout { geometry, meaning, ..layout })
}

fn numbers<T: std::str::FromStr>(name: &'static str, text: &str) -> Result<[T; 3], FileFault> {
    let numbers: Option<Vec<T>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| numbers.try_into().ok());
    numbers
        .ok_or_else(|| FileFault::field(name, format!("'{}' is not three such numbers", shorten(text, 40))))
}

/// Which bits of a voxel are its value: `(Position p Size s ...)`.
fn meaning(stored: ScalarType, text: &str) -> Result<Meaning, FileFault> {
    let words: Vec<&str> =
        text.split(|character: char| character.is_whitespace() || "()".contains(character)).collect();
    let words: Vec<&str> = words.into_iter().filter(|word| !word.is_empty()).collect();
    let whole = 8 * stored.bytes() as u32;
    let number = |name: &str, default: u32| {
        let place = words.iter().position(|word| *word == name);
        let word = place.and_then(|place| words.get(place + 1));
        place.map_or(Some(default), |_| word.and_then(|word| word.parse().ok()))
    };
    let (position, size) = (number("Position", 0), number("Size", whole));
    match (position, size) {
        (Some(position), Some(size @ 1..)) if position.saturating_add(size) <= whole => {
            // What lies below the value becomes a fraction, which integers do not keep.
            Ok(Meaning { bits: position + size, slope: 0.5_f64.powi(position as i32), intercept: 0.0 })
        }
        _ => Err(FileFault::field(FIELD, format!("'{}' is no part of {whole} bits", shorten(text, 60)))),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Samples, ScalarVolume, open};
    use super::*;
    use proptest::prelude::*;

    const KEYS: &str = "VolumeSize 2 3 2\nVoxelSize 16\nEndian L\n";

    fn read_bytes(bytes: &[u8]) -> Result<ScalarVolume, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("volume.vox");
        std::fs::write(&path, bytes).unwrap();
        open(&path, &mut |_, _| {}).map_err(|error| error.to_string())
    }

    fn file(keys: &str) -> Vec<u8> {
        let text = format!("Vox1999a\nVolumeCount 1\n// free\n##\x0c\n##\n{keys}// more\n##\x0c\n");
        [text.into_bytes(), (0..24).collect()].concat()
    }

    #[test]
    fn wrong_keys_are_refused_by_name() {
        for (key, message) in [
            ("VolumeSize", "VolumeSize: is missing"),
            ("VolumeSize 2 3", "VolumeSize: '2 3' is not three"),
            ("VolumeSize 2 -3 2", "VolumeSize: '2 -3 2'"),
            ("VolumeSize 0 3 2", "VolumeSize: 0 x 3 x 2 holds no samples"),
            ("VolumeSize 2 3 3", "holds 24 bytes where sizes, type and encoding want at least 36"),
            ("VolumeSize 18446744073709551615 2 2", "more than 8 GiB"),
            ("VoxelSize", "VoxelSize: is missing"),
            ("VoxelSize 32", "VoxelSize: 32 bits"),
            ("Endian", "Endian: is missing"),
            ("Endian M", "Endian: 'M' is neither"),
            ("VolumeScale 1 0 1", "VolumeScale: an axis"),
            ("VolumeScale 1 1", "VolumeScale: '1 1'"),
            ("VolumePosition nan 0 0", "VolumePosition: a coordinate"),
            ("Field0 (Position 5 Size 12)", "Field0: '(Position 5 Size 12)' is no part of 16 bits"),
            ("Field0 (Position 0 Size 0)", "Field0: "),
            ("Field 0 (Position Size)", "Field0: "),
        ] {
            let name = key.split(' ').next().unwrap();
            let mut keys: String =
                KEYS.lines().filter(|line| !line.starts_with(name)).map(|line| format!("{line}\n")).collect();
            if key != name {
                keys += &format!("{key}\n");
            }
            let error = read_bytes(&file(&keys)).expect_err(key);
            assert!(error.contains(message), "{key}: {error}");
        }
        for (bytes, message) in [
            (b"Vox1998\n".to_vec(), "line 1: 'Vox1998"),
            (b"Vox1999a\n##\x0c\nVolumeSize 1 1 1\n".to_vec(), "ends the header"),
            ([b"Vox1999a\n".to_vec(), vec![b' '; 2 << 20]].concat(), "ends the header"),
        ] {
            let error = read_bytes(&bytes).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }

    #[test]
    fn voxels_are_read() {
        let volume =
            read_bytes(&file(&format!("{KEYS}VolumeScale 1 0.5 2\nVolumePosition 7 8 9\n"))).unwrap();
        assert_eq!(volume.dimensions(), [2, 3, 2]);
        assert_eq!(volume.value([1, 0, 0]), Some(f64::from(0x0302)));
        assert_eq!(volume.geometry().spacing(), [1.0, 0.5, 2.0]);
        assert_eq!(volume.geometry().origin, DVec3::new(7.0, 8.0, 9.0));
        let bytes = read_bytes(&file("VolumeSize 2 3 4\nVoxelSize 8\n")).unwrap();
        assert_eq!(*bytes.samples(), Samples::Uint8((0..24).collect()));
        assert!(bytes.remarks.is_empty());
    }

    #[test]
    fn fields_are_parts_of_voxels() {
        let value = |field: &str| {
            let keys = format!("{}{field}\n", KEYS.replace("Endian L", "Endian B"));
            // The fourth voxel is 0x0607.
            read_bytes(&file(&keys)).unwrap().value([1, 1, 0]).unwrap()
        };
        assert_eq!(value("Field0 (Position 0 Size 8 Name \"low\")"), f64::from(0x07));
        assert_eq!(value("Field 0 ( Position 4  Size 12 Format ui )"), f64::from(0x060));
        assert_eq!(value("Field0 (Size 16)"), f64::from(0x0607));
        assert_eq!(value("Field1 (Position 8 Size 8)"), f64::from(0x0607));
    }

    proptest! {
        #[test]
        fn mutated_files_never_panic(place in 0_usize..200, byte in any::<u8>(), cut in 0_usize..300) {
            let mut bytes = file(&format!("{KEYS}VolumeScale 1 1 1\nField0 (Position 0 Size 12)\n"));
            let place = place % bytes.len();
            bytes[place] = byte;
            bytes.truncate(cut);
            let _ = read_bytes(&bytes);
        }
    }
}
