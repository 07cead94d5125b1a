//! Files as a source of samples: length known beforehand, read block by block.

use super::layout::{Layout, Meaning, Piece};
use super::{FileError, FileFault, MAXIMUM_BYTES, Progress, Samples, ScalarType};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Bytes that are read at a time; a multiple of every sample's size.
const BLOCK: usize = 1 << 20;

/// Opens a regular file; also tells its length in bytes.
pub(crate) fn open_regular(path: &Path) -> Result<(File, u64), FileError> {
    let system = |error: io::Error| FileFault::from(error).of(path);
    // Before opening, which would wait for the other end of a pipe.
    let kind = path.metadata().map_err(system)?;
    if kind.is_dir() {
        return Err(FileFault::Folder.of(path));
    }
    if !kind.is_file() {
        return Err(FileFault::NotRegular.of(path));
    }
    let file = File::open(path).map_err(system)?;
    let length = file.metadata().map_err(system)?.len();
    Ok((file, length))
}

/// Reads the first bytes of a file; tells how many there were.
pub(super) fn read_beginning(path: &Path, bytes: &mut [u8]) -> Result<usize, FileError> {
    let (mut file, _) = open_regular(path)?;
    fill(&mut file, bytes).map_err(|error| FileFault::from(error).of(path))
}

/// Number of samples of a volume, which has some, and whose samples fit below [`MAXIMUM_BYTES`]. `field` is what
/// holds the dimensions.
pub(super) fn check_size(
    dimensions: &[usize],
    scalar: ScalarType,
    field: &'static str,
) -> Result<usize, FileFault> {
    let text = || dimensions.iter().map(usize::to_string).collect::<Vec<_>>().join(" x ");
    if dimensions.contains(&0) {
        return Err(FileFault::field(field, format!("{} holds no samples", text())));
    }
    let count = dimensions.iter().try_fold(1_usize, |count, &size| count.checked_mul(size));
    let bytes = count.and_then(|count| count.checked_mul(scalar.bytes()));
    match (count, bytes) {
        (Some(count), Some(bytes)) if bytes as u64 <= MAXIMUM_BYTES => Ok(count),
        _ => Err(FileFault::field(
            field,
            format!("{} samples of {scalar} are more than {} GiB", text(), MAXIMUM_BYTES >> 30),
        )),
    }
}

/// Samples being read.
pub(super) struct Reading<'a, 'b> {
    /// Samples so far.
    pub samples: Samples,
    /// Samples that there will be.
    pub count: usize,
    /// Told about the samples so far.
    pub progress: &'a mut Progress<'b>,
}

impl<'a, 'b> Reading<'a, 'b> {
    /// Nothing read yet, with memory for all samples.
    pub fn new(layout: &Layout, progress: &'a mut Progress<'b>) -> Result<Self, FileFault> {
        let count = layout.count();
        let bytes = count as u64 * layout.scalar.bytes() as u64;
        let samples = Samples::with_capacity(layout.scalar, count).map_err(|_| FileFault::Memory(bytes))?;
        progress(0, bytes);
        Ok(Self { samples, count, progress })
    }

    /// Tells the progress.
    pub fn report(&mut self) {
        let size = self.samples.scalar_type().bytes() as u64;
        (self.progress)(self.samples.len() as u64 * size, self.count as u64 * size);
    }

    /// Reads the samples of a piece; tells how many bytes were missing.
    pub fn read(&mut self, reader: &mut dyn Read, piece: &Piece, layout: &Layout) -> io::Result<usize> {
        let Layout { stored, scalar, order, .. } = *layout;
        let plain = scalar == stored && piece.meaning == Meaning::itself(stored);
        let mut missing = piece.samples * stored.bytes();
        let mut block = vec![0; missing.min(BLOCK)];
        while missing > 0 {
            let wanted = missing.min(BLOCK);
            let read = fill(reader, &mut block[..wanted])?;
            if plain {
                self.samples.append(&block[..read], order);
            } else {
                let mut numbers = Samples::with_capacity(stored, read / stored.bytes())?;
                numbers.append(&block[..read], order);
                self.samples.append_meanings(&numbers, &piece.meaning);
            }
            missing -= read;
            self.report();
            if read < wanted {
                break;
            }
        }
        Ok(missing)
    }
}

/// Reads until `bytes` is full or there is no more; tells how many bytes there were.
pub(super) fn fill(reader: &mut dyn Read, bytes: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < bytes.len() {
        match reader.read(&mut bytes[filled..]) {
            Ok(0) => break,
            Ok(read) => filled += read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}
