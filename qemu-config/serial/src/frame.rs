//! The frames on the line.

use std::io::{self, Read, Write};

/// What a frame holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A piece of the command's standard output.
    Output,
    /// A piece of the command's standard error.
    Errors,
    /// The whole of the file that the command was to write.
    File,
    /// The command's exit code, one byte. Nothing comes after it.
    Exit,
}

impl Kind {
    const ALL: [Self; 4] = [Self::Output, Self::Errors, Self::File, Self::Exit];

    fn letter(self) -> u8 {
        match self {
            Self::Output => b'o',
            Self::Errors => b'e',
            Self::File => b'f',
            Self::Exit => b'x',
        }
    }
}

/// Why a frame cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The line ends before the exit code.
    #[error("the line ended before the command did")]
    Ended,
    /// The bytes are no frame, or its checksum is wrong.
    #[error("byte {offset} of the line: a damaged frame")]
    Damaged {
        /// Where the frame begins.
        offset: u64,
    },
    /// The line cannot be used.
    #[error("the line: {0}")]
    Line(#[from] io::Error),
}

/// A frame begins with this, its kind, the length of its data (u32, little-endian) and the CRC-32 of kind, length and
/// data.
const MAGIC: [u8; 3] = *b"vp:";

fn checksum(kind: u8, length: u32, data: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&[kind]);
    crc.update(&length.to_le_bytes());
    crc.update(data);
    crc.finalize()
}

/// Writes one frame in one piece.
///
/// # Errors
/// The line cannot be written, or 4 GiB are too much for a frame.
pub fn write(mut line: impl Write, kind: Kind, data: &[u8]) -> io::Result<()> {
    let length = u32::try_from(data.len()).map_err(io::Error::other)?;
    let mut frame = MAGIC.to_vec();
    frame.push(kind.letter());
    frame.extend(length.to_le_bytes());
    frame.extend(checksum(kind.letter(), length, data).to_le_bytes());
    frame.extend(data);
    line.write_all(&frame)?;
    line.flush()
}

/// Reads frames from a line.
pub struct Frames<R> {
    line: R,
    offset: u64,
}

impl<R: Read> Frames<R> {
    /// Frames from here on.
    pub fn new(line: R) -> Self {
        Self { line, offset: 0 }
    }

    /// The next frame. Memory grows with what arrives, not with what a frame claims.
    ///
    /// # Errors
    /// [`Error`].
    pub fn read(&mut self) -> Result<(Kind, Vec<u8>), Error> {
        let damaged = Error::Damaged { offset: self.offset };
        let ([m0, m1, m2, letter], length, crc) = (self.word()?, self.word()?, self.word()?);
        let Some(kind) = Kind::ALL.into_iter().find(|kind| kind.letter() == letter) else {
            return Err(damaged);
        };
        let length = u32::from_le_bytes(length);
        if [m0, m1, m2] != MAGIC {
            return Err(damaged);
        }
        let mut data = Vec::new();
        (&mut self.line).take(length.into()).read_to_end(&mut data)?;
        self.offset += data.len() as u64;
        if data.len() as u64 != u64::from(length) {
            return Err(Error::Ended);
        }
        if checksum(letter, length, &data) != u32::from_le_bytes(crc) {
            return Err(damaged);
        }
        Ok((kind, data))
    }

    fn word(&mut self) -> Result<[u8; 4], Error> {
        let mut word = [0; 4];
        self.line.read_exact(&mut word).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => Error::Ended,
            _ => Error::Line(error),
        })?;
        self.offset += 4;
        Ok(word)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frame(kind: Kind, data: &[u8]) -> Vec<u8> {
        let mut line = Vec::new();
        write(&mut line, kind, data).unwrap();
        line
    }

    #[test]
    fn a_line_that_ends_early_says_so() {
        let line = frame(Kind::File, b"picture");
        for length in 0..line.len() {
            assert!(matches!(Frames::new(&line[..length]).read(), Err(Error::Ended)), "{length}");
        }
    }

    #[test]
    fn every_changed_byte_is_noticed() {
        let mut line = frame(Kind::Output, b"first");
        let second = line.len();
        line.extend(frame(Kind::File, b"second"));
        for position in second..line.len() {
            for change in [1, 0x20, 0x80] {
                let mut line = line.clone();
                line[position] ^= change;
                let mut frames = Frames::new(line.as_slice());
                frames.read().unwrap();
                match frames.read().unwrap_err() {
                    Error::Damaged { offset } => assert_eq!(offset, second as u64),
                    Error::Ended => assert!((4..8).contains(&(position - second)), "a longer length"),
                    Error::Line(error) => panic!("{error}"),
                }
            }
        }
    }

    #[test]
    fn a_claimed_length_takes_no_memory() {
        let mut line = frame(Kind::File, b"");
        line[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(matches!(Frames::new(line.as_slice()).read(), Err(Error::Ended)));
    }

    proptest! {
        #[test]
        fn frames_come_out_as_they_went_in(pieces in prop::collection::vec((0_usize..4, any::<Vec<u8>>()), 0..6)) {
            let line: Vec<u8> =
                pieces.iter().flat_map(|(kind, data)| frame(Kind::ALL[*kind], data)).collect();
            let mut frames = Frames::new(line.as_slice());
            for (kind, data) in pieces {
                prop_assert_eq!(frames.read().unwrap(), (Kind::ALL[kind], data));
            }
            prop_assert!(matches!(frames.read(), Err(Error::Ended)));
        }
    }
}
