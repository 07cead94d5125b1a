//! An access of any width and alignment, cut into the words of the register window.

use std::ops::Range;

/// What an access has to do with one word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Part {
    /// Byte offset of the word.
    pub(super) word: u32,
    /// Bytes of the word that the access touches.
    pub(super) bytes: Range<usize>,
    /// The same bytes in the access.
    pub(super) data: Range<usize>,
}

impl Part {
    /// Whether the access touches the whole word.
    pub(super) fn is_whole(&self) -> bool {
        self.bytes == (0..4)
    }
}

/// The words of an access of `length` bytes at byte `offset`, in increasing order.
pub(super) fn parts(offset: u32, length: usize) -> impl Iterator<Item = Part> {
    let mut done = 0;
    std::iter::from_fn(move || {
        let at = offset.checked_add(u32::try_from(done).ok()?)?;
        let first = (at % 4) as usize;
        let count = (4 - first).min(length - done);
        let part = Part { word: at - at % 4, bytes: first..first + count, data: done..done + count };
        done += count;
        (count > 0).then_some(part)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_of_every_access_is_met_once() {
        for offset in 0..9 {
            for length in 0..20usize {
                let mut met = Vec::new();
                for part in parts(offset, length) {
                    assert_eq!(part.bytes.len(), part.data.len());
                    assert!(part.word.is_multiple_of(4) && part.bytes.end <= 4 && !part.bytes.is_empty());
                    assert_eq!(part.is_whole(), part.bytes.len() == 4);
                    met.extend(
                        part.bytes.zip(part.data).map(|(byte, data)| (part.word as usize + byte, data)),
                    );
                }
                let expected: Vec<_> = (0..length).map(|data| (offset as usize + data, data)).collect();
                assert_eq!(met, expected);
            }
        }
    }

    #[test]
    fn an_access_past_the_address_space_ends() {
        assert_eq!(parts(u32::MAX, 100).count(), 1);
    }
}
