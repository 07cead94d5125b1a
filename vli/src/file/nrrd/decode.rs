//! Samples from data files in any encoding.

use super::super::source::{Reading, fill, open_regular};
use super::super::{FileError, FileFault, Progress, ScalarVolume};
use super::header::{ByteSkip, Data, Encoding, Header};
use flate2::bufread::MultiGzDecoder;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Most bytes that one byte of gzip data can stand for: a match of 258 bytes takes at least two bits.
const MAXIMUM_GZIP_RATIO: u64 = 1032;

/// Bytes of a file that are buffered.
const BUFFER: usize = 1 << 17;

/// Longest number in text.
const MAXIMUM_WORD: usize = 1024;

/// Reads all samples of the volume that `header`, read from `path`, describes.
pub fn read_samples(
    path: &Path,
    header: &Header,
    progress: &mut Progress<'_>,
) -> Result<ScalarVolume, FileError> {
    let (offset, samples) = match header.data {
        Data::Attached(offset) => (offset, header.count),
        Data::Detached(_, samples) => (0, samples),
    };
    // Every file is opened and measured before memory is taken for any.
    for file in files(path, header) {
        open(&file, header, offset, samples)?;
    }
    let mut reading = Reading::new(header.scalar, header.count, progress).map_err(|fault| fault.of(path))?;
    let mut remarks = header.remarks.clone();
    for file in files(path, header) {
        let mut reader = open(&file, header, offset, samples)?;
        let surplus = decode(&mut reader, header, samples, &mut reading).map_err(|fault| fault.of(&file))?;
        if surplus {
            remarks.push(format!("{}: data goes on behind the last sample; ignored", file.display()));
        }
    }
    let found = reading.samples.len() as u64;
    let volume = ScalarVolume::new(header.axes.dimensions, reading.samples, header.axes.geometry);
    let mut volume =
        volume.ok_or_else(|| FileFault::Short { wanted: header.count as u64, found }.of(path))?;
    volume.content.clone_from(&header.content);
    volume.space.clone_from(&header.space);
    volume.remarks = remarks;
    Ok(volume)
}

/// The files that hold samples.
fn files<'a>(path: &'a Path, header: &'a Header) -> Box<dyn Iterator<Item = PathBuf> + 'a> {
    match &header.data {
        Data::Attached(_) => Box::new(std::iter::once(path.to_owned())),
        Data::Detached(files, _) => {
            let folder = path.parent().unwrap_or(Path::new(""));
            Box::new(files.names().map(|name| folder.join(name)))
        }
    }
}

/// Opens a file at the first byte of its samples, or of its compressed data. A file that cannot hold as many samples
/// is refused.
fn open(path: &Path, header: &Header, offset: u64, samples: usize) -> Result<BufReader<File>, FileError> {
    let (file, length) = open_regular(path)?;
    let mut reader = BufReader::with_capacity(BUFFER, file);
    let mut start = || {
        reader.seek(SeekFrom::Start(offset))?;
        let lines = skip_lines(&mut reader, header.line_skip)?;
        let bytes = samples as u64 * header.scalar.bytes() as u64;
        let skip = match header.byte_skip {
            ByteSkip::Bytes(skip) => skip,
            ByteSkip::ToSamplesAtEnd => 0,
        };
        let wanted = match header.encoding {
            Encoding::Raw => skip.saturating_add(bytes),
            Encoding::Gzip => skip.saturating_add(bytes).div_ceil(MAXIMUM_GZIP_RATIO),
            Encoding::Hex => skip.saturating_add(2 * bytes),
            // A digit each, and something between them.
            Encoding::Text => skip.saturating_add(2 * samples as u64 - 1),
        };
        let found = length.saturating_sub(offset + lines);
        if found < wanted {
            return Err(FileFault::Short { wanted, found });
        }
        match (header.byte_skip, header.encoding) {
            // Skipped in the decompressed data.
            (ByteSkip::Bytes(_), Encoding::Gzip) => {}
            (ByteSkip::Bytes(skip), _) => {
                reader.seek(SeekFrom::Start(offset + lines + skip))?;
            }
            (ByteSkip::ToSamplesAtEnd, _) => {
                reader.seek(SeekFrom::Start(length - bytes))?;
            }
        }
        Ok(())
    };
    start().map_err(|fault: FileFault| fault.of(path))?;
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
    header: &Header,
    samples: usize,
    reading: &mut Reading<'_, '_>,
) -> Result<bool, FileFault> {
    match header.encoding {
        Encoding::Raw => decode_bytes(reader, header, samples, reading),
        Encoding::Hex => decode_bytes(&mut HexReader(reader), header, samples, reading),
        Encoding::Gzip => {
            let mut reader = MultiGzDecoder::new(reader);
            if let ByteSkip::Bytes(skip) = header.byte_skip {
                io::copy(&mut reader.by_ref().take(skip), &mut io::sink())
                    .map_err(|error| data_fault(header.encoding, error))?;
            }
            decode_bytes(&mut reader, header, samples, reading)
        }
        Encoding::Text => decode_text(reader, samples, reading),
    }
}

fn decode_bytes(
    reader: &mut dyn Read,
    header: &Header,
    samples: usize,
    reading: &mut Reading<'_, '_>,
) -> Result<bool, FileFault> {
    let mut decode = || match reading.read(reader, samples, header.order)? {
        // Reading on also verifies the checksum at the end of compressed data.
        0 => Ok(fill(reader, &mut [0])? > 0),
        missing => Err(io::Error::new(
            io::ErrorKind::UnexpectedEof,
            format!("it ends {missing} bytes before the last sample"),
        )),
    };
    decode().map_err(|error| data_fault(header.encoding, error))
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
