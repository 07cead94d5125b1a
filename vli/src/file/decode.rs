//! Samples from data files in any encoding.

use super::layout::{ByteSkip, Data, Encoding, Layout, Piece};
use super::source::{Reading, fill, open_regular};
use super::{FileError, FileFault, Progress, ScalarVolume};
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Most bytes that one byte of compressed data can stand for: a match of 258 bytes takes at least two bits.
const MAXIMUM_RATIO: u64 = 1032;

/// Bytes of a file that are buffered.
const BUFFER: usize = 1 << 17;

/// Longest number in text.
const MAXIMUM_WORD: usize = 1024;

/// Reads all samples of the volume that a header, read from `path`, describes.
pub fn read_samples(
    path: &Path,
    layout: &Layout,
    progress: &mut Progress<'_>,
) -> Result<ScalarVolume, FileError> {
    // Every file is opened and measured before memory is taken for any.
    for piece in layout.pieces(path) {
        open(&piece, layout)?;
    }
    let mut reading = Reading::new(layout, progress).map_err(|fault| fault.of(path))?;
    let mut remarks = layout.remarks.clone();
    for piece in layout.pieces(path) {
        let mut reader = open(&piece, layout)?;
        let surplus =
            decode(&mut reader, layout, &piece, &mut reading).map_err(|fault| fault.of(&piece.path))?;
        // Files of slices may have more than samples.
        if surplus && !matches!(layout.data, Data::Slices(_)) {
            let what = "data goes on behind the last sample; ignored";
            let detached = piece.path != path;
            remarks.push(if detached { format!("{}: {what}", piece.path.display()) } else { what.into() });
        }
    }
    let found = reading.samples.len() as u64;
    let volume = ScalarVolume::new(layout.dimensions, reading.samples, layout.geometry);
    let mut volume =
        volume.ok_or_else(|| FileFault::Short { wanted: layout.count() as u64, found }.of(path))?;
    volume.content.clone_from(&layout.content);
    volume.space.clone_from(&layout.space);
    volume.remarks = remarks;
    Ok(volume)
}

/// Opens a file at the first byte of its samples, or of its compressed data. A file that cannot hold as many samples
/// is refused.
fn open(piece: &Piece, layout: &Layout) -> Result<BufReader<File>, FileError> {
    let (file, length) = open_regular(&piece.path)?;
    let mut reader = BufReader::with_capacity(BUFFER, file);
    let mut start = || {
        reader.seek(SeekFrom::Start(piece.offset))?;
        let lines = skip_lines(&mut reader, layout.line_skip)?;
        let bytes = piece.samples as u64 * layout.stored.bytes() as u64;
        let skip = match layout.byte_skip {
            ByteSkip::Bytes(skip) => skip,
            ByteSkip::ToSamplesAtEnd => 0,
        };
        let wanted = match layout.encoding {
            Encoding::Raw => skip.saturating_add(bytes),
            Encoding::Gzip | Encoding::Zlib => skip.saturating_add(bytes).div_ceil(MAXIMUM_RATIO),
            Encoding::Hex => skip.saturating_add(2 * bytes),
            // A digit each, and something between them.
            Encoding::Text => skip.saturating_add(2 * piece.samples as u64 - 1),
        };
        let found = length.saturating_sub(piece.offset.saturating_add(lines));
        if found < wanted {
            return Err(FileFault::Short { wanted, found });
        }
        match layout.byte_skip {
            // Skipped in the decompressed data.
            ByteSkip::Bytes(_) if layout.encoding.is_compressed() => {}
            ByteSkip::Bytes(skip) => {
                reader.seek(SeekFrom::Start(piece.offset + lines + skip))?;
            }
            ByteSkip::ToSamplesAtEnd => {
                reader.seek(SeekFrom::Start(length - bytes))?;
            }
        }
        Ok(())
    };
    start().map_err(|fault: FileFault| fault.of(&piece.path))?;
    Ok(reader)
}

/// Skips lines; tells how many bytes they had.
fn skip_lines(reader: &mut dyn BufRead, lines: u64) -> Result<u64, FileFault> {
    let mut bytes = 0;
    for line in 0..lines {
        match reader.skip_until(b'\n')? {
            0 => return Err(FileFault::field("line skip", format!("{lines}, but there are {line} lines"))),
            skipped => bytes += skipped as u64,
        }
    }
    Ok(bytes)
}

/// Reads the samples of a file; tells whether data goes on behind the last one.
fn decode(
    reader: &mut BufReader<File>,
    layout: &Layout,
    piece: &Piece,
    reading: &mut Reading<'_, '_>,
) -> Result<bool, FileFault> {
    let reader: &mut dyn Read = match layout.encoding {
        Encoding::Raw => reader,
        Encoding::Hex => &mut HexReader(reader),
        Encoding::Gzip => &mut MultiGzDecoder::new(reader),
        Encoding::Zlib => &mut ZlibDecoder::new(reader),
        Encoding::Text => return decode_text(reader, piece.samples, reading),
    };
    let mut decode = || {
        if let (ByteSkip::Bytes(skip), true) = (layout.byte_skip, layout.encoding.is_compressed()) {
            io::copy(&mut reader.take(skip), &mut io::sink())?;
        }
        match reading.read(reader, piece, layout)? {
            // Reading on also verifies the checksum at the end of compressed data.
            0 => Ok(fill(reader, &mut [0])? > 0),
            missing => Err(io::Error::new(
                io::ErrorKind::UnexpectedEof,
                format!("it ends {missing} bytes before the last sample"),
            )),
        }
    };
    decode().map_err(|error| data_fault(layout.encoding, error))
}

/// Errors of a decoder are those of its data, all others the operating system's.
fn data_fault(encoding: Encoding, error: io::Error) -> FileFault {
    match error.raw_os_error() {
        Some(_) => error.into(),
        None => FileFault::Data { encoding: encoding.name(), what: error.to_string() },
    }
}

/// Bytes written as two hexadecimal digits each, with any white space.
struct HexReader<'a>(&'a mut dyn BufRead);

impl HexReader<'_> {
    /// Value of the next digit, if there is one.
    fn digit(&mut self) -> io::Result<Option<u8>> {
        loop {
            let Some(&character) = self.0.fill_buf()?.first() else { return Ok(None) };
            self.0.consume(1);
            if character.is_ascii_whitespace() {
                continue;
            }
            let character = char::from(character);
            return match character.to_digit(16) {
                Some(digit) => Ok(Some(digit as u8)),
                None => Err(io::Error::new(
                    io::ErrorKind::InvalidData,
                    format!("'{}' is not a hexadecimal digit", character.escape_default()),
                )),
            };
        }
    }
}

impl Read for HexReader<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        for (index, byte) in bytes.iter_mut().enumerate() {
            match (self.digit()?, self.digit()?) {
                (Some(high), Some(low)) => *byte = high << 4 | low,
                _ => return Ok(index),
            }
        }
        Ok(bytes.len())
    }
}

/// Reads numbers between white space.
fn decode_text(
    reader: &mut dyn BufRead,
    samples: usize,
    reading: &mut Reading<'_, '_>,
) -> Result<bool, FileFault> {
    /// Samples between two reports of progress.
    const REPORT: usize = 1 << 16;
    let fault = |what| FileFault::Data { encoding: Encoding::Text.name(), what };
    let scalar = reading.samples.scalar_type();
    let mut word = Vec::new();
    for sample in 0..samples {
        if !next_word(reader, &mut word)? {
            return Err(fault(format!("it ends after {sample} of {samples} numbers")));
        }
        let text = String::from_utf8_lossy(&word);
        if !reading.samples.append_text(&text) {
            let text: String = text.chars().flat_map(char::escape_default).take(40).collect();
            return Err(fault(format!("number {}, '{text}', is not of type {scalar}", sample + 1)));
        }
        if sample.is_multiple_of(REPORT) {
            reading.report();
        }
    }
    reading.report();
    Ok(next_word(reader, &mut word)?)
}

/// Reads the next word, cut off where it is too long to be a number; tells whether there is one.
fn next_word(reader: &mut dyn BufRead, word: &mut Vec<u8>) -> io::Result<bool> {
    word.clear();
    while let Some(&character) = reader.fill_buf()?.first() {
        let ends = character.is_ascii_whitespace() && !word.is_empty();
        if ends || word.len() == MAXIMUM_WORD {
            break;
        }
        reader.consume(1);
        if !character.is_ascii_whitespace() {
            word.push(character);
        }
    }
    Ok(!word.is_empty())
}
