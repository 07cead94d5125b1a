//! Memory that another process may change at any time.
//!
//! Mapped memories of the card are shared between client, device and engine. A Rust reference to such bytes
//! would promise what nobody can keep, so they are only copied in and out.

use core::marker::PhantomData;
use core::ptr::NonNull;

/// An access that does not lie inside the memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfRange {
    /// First byte of the access.
    pub offset: usize,
    /// Bytes of the access.
    pub length: usize,
    /// Bytes of the memory.
    pub size: usize,
}

impl core::fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "{} bytes at {:#x} lie outside of a memory of {:#x} bytes",
            self.length, self.offset, self.size
        )
    }
}

impl core::error::Error for OutOfRange {}

/// A window on shared memory that copies in and out, and never lends a reference.
#[derive(Clone, Copy, Debug)]
pub struct SharedView<'a> {
    start: NonNull<u8>,
    size: usize,
    memory: PhantomData<&'a ()>,
}

// SAFETY: a view only copies bytes by volatile accesses; concurrent writers can make the bytes it copies
// inconsistent, never the view itself.
unsafe impl Send for SharedView<'_> {}
// SAFETY: as for `Send`; no method hands out a reference to the memory.
unsafe impl Sync for SharedView<'_> {}

impl<'a> SharedView<'a> {
    /// A view of `size` bytes at `start`.
    ///
    /// # Safety
    ///
    /// The bytes stay mapped, readable and writable for `'a`, and no Rust reference to them exists meanwhile.
    #[must_use]
    pub const unsafe fn new(start: NonNull<u8>, size: usize) -> Self {
        Self { start, size, memory: PhantomData }
    }

    /// A view of bytes that this process alone owns (tests, private copies).
    #[must_use]
    pub fn of(bytes: &'a mut [u8]) -> Self {
        let size = bytes.len();
        // SAFETY: the exclusive borrow lasts for 'a, so no other reference exists while the view does. A slice
        // is never null.
        unsafe { Self::new(NonNull::new_unchecked(bytes.as_mut_ptr()), size) }
    }

    /// Bytes in the memory.
    #[must_use]
    pub const fn size(&self) -> usize {
        self.size
    }

    /// Address of the first byte, for kernels that copy by their own means.
    #[must_use]
    pub const fn start(&self) -> NonNull<u8> {
        self.start
    }

    fn check(&self, offset: usize, length: usize) -> Result<(), OutOfRange> {
        match offset.checked_add(length) {
            Some(end) if end <= self.size => Ok(()),
            _ => Err(OutOfRange { offset, length, size: self.size }),
        }
    }

    /// Copies `bytes.len()` bytes at `offset` out of the memory.
    pub fn read(&self, offset: usize, bytes: &mut [u8]) -> Result<(), OutOfRange> {
        self.check(offset, bytes.len())?;
        // SAFETY: `bytes.len()` bytes at offset lie inside the memory, by the check above.
        let source = unsafe { self.start.as_ptr().add(offset) };
        let head = source.align_offset(align_of::<u64>()).min(bytes.len());
        // SAFETY: each step reads what the ones before left over, inside the checked range. The head ends at a
        // multiple of eight, which blocks and words keep.
        unsafe {
            let mut at = read_units::<u8>(source, &mut bytes[..head]);
            at += read_units::<Block>(source.add(at), &mut bytes[at..]);
            at += read_units::<u64>(source.add(at), &mut bytes[at..]);
            read_units::<u8>(source.add(at), &mut bytes[at..]);
        }
        Ok(())
    }

    /// Copies `bytes` into the memory at `offset`.
    pub fn write(&self, offset: usize, bytes: &[u8]) -> Result<(), OutOfRange> {
        self.check(offset, bytes.len())?;
        // SAFETY: `bytes.len()` bytes at offset lie inside the memory, by the check above.
        let target = unsafe { self.start.as_ptr().add(offset) };
        let head = target.align_offset(align_of::<u64>()).min(bytes.len());
        // SAFETY: each step writes what the ones before left over, inside the checked range. The head ends at a
        // multiple of eight, which blocks and words keep.
        unsafe {
            let mut at = write_units::<u8>(target, &bytes[..head]);
            at += write_units::<Block>(target.add(at), &bytes[at..]);
            at += write_units::<u64>(target.add(at), &bytes[at..]);
            write_units::<u8>(target.add(at), &bytes[at..]);
        }
        Ok(())
    }

    /// Sets `length` bytes at `offset` to zero.
    pub fn clear(&self, offset: usize, length: usize) -> Result<(), OutOfRange> {
        self.check(offset, length)?;
        let zeros = [0u8; 4096];
        let mut at = 0;
        while at < length {
            let part = (length - at).min(zeros.len());
            self.write(offset + at, &zeros[..part])?;
            at += part;
        }
        Ok(())
    }

    /// Reads little-endian 16-bit words.
    pub fn read_u16(&self, offset: usize, words: &mut [u16]) -> Result<(), OutOfRange> {
        self.check(offset, words.len().saturating_mul(2))?;
        let mut bytes = [0u8; 512];
        for (index, part) in words.chunks_mut(bytes.len() / 2).enumerate() {
            let bytes = &mut bytes[..part.len() * 2];
            self.read(offset + index * 512, bytes)?;
            for (word, pair) in part.iter_mut().zip(bytes.as_chunks::<2>().0) {
                *word = u16::from_le_bytes(*pair);
            }
        }
        Ok(())
    }

    /// Writes little-endian 16-bit words.
    pub fn write_u16(&self, offset: usize, words: &[u16]) -> Result<(), OutOfRange> {
        self.check(offset, words.len().saturating_mul(2))?;
        let mut bytes = [0u8; 512];
        for (index, part) in words.chunks(bytes.len() / 2).enumerate() {
            let bytes = &mut bytes[..part.len() * 2];
            for (pair, word) in bytes.as_chunks_mut::<2>().0.iter_mut().zip(part) {
                *pair = word.to_le_bytes();
            }
            self.write(offset + index * 512, bytes)?;
        }
        Ok(())
    }

    /// Reads one little-endian 32-bit word in a single access where it is aligned.
    pub fn read_u32(&self, offset: usize) -> Result<u32, OutOfRange> {
        let mut bytes = [0; 4];
        self.check(offset, 4)?;
        // SAFETY: four bytes at offset lie inside the memory, by the check above.
        let source = unsafe { self.start.as_ptr().add(offset) };
        if source.addr() % 4 == 0 {
            // SAFETY: as above, and aligned.
            return Ok(u32::from_le(unsafe { source.cast::<u32>().read_volatile() }));
        }
        self.read(offset, &mut bytes)?;
        Ok(u32::from_le_bytes(bytes))
    }

    /// Writes one little-endian 32-bit word in a single access where it is aligned.
    pub fn write_u32(&self, offset: usize, word: u32) -> Result<(), OutOfRange> {
        self.check(offset, 4)?;
        // SAFETY: four bytes at offset lie inside the memory, by the check above.
        let target = unsafe { self.start.as_ptr().add(offset) };
        if target.addr() % 4 == 0 {
            // SAFETY: as above, and aligned.
            unsafe { target.cast::<u32>().write_volatile(word.to_le()) };
            return Ok(());
        }
        self.write(offset, &word.to_le_bytes())
    }
}

/// What one volatile access copies at most: the compiler makes vector accesses of it.
type Block = [u64; 8];

/// Copies as many whole units as `bytes` holds, and returns how many bytes that were.
///
/// # Safety
///
/// `source` is aligned for `T` and `bytes.len()` bytes can be read there; any bytes are a valid `T`.
unsafe fn read_units<T: Copy>(source: *const u8, bytes: &mut [u8]) -> usize {
    let units = bytes.chunks_exact_mut(size_of::<T>());
    let copied = units.len() * size_of::<T>();
    for (index, unit) in units.enumerate() {
        // SAFETY: the unit lies among the readable bytes, and `unit` is as long as a `T`.
        unsafe {
            let value = source.cast::<T>().add(index).read_volatile();
            unit.as_mut_ptr().cast::<T>().write_unaligned(value);
        }
    }
    copied
}

/// Copies as many whole units as `bytes` holds, and returns how many bytes that were.
///
/// # Safety
///
/// `target` is aligned for `T` and `bytes.len()` bytes can be written there; any bytes are a valid `T`.
unsafe fn write_units<T: Copy>(target: *mut u8, bytes: &[u8]) -> usize {
    let units = bytes.chunks_exact(size_of::<T>());
    let copied = units.len() * size_of::<T>();
    for (index, unit) in units.enumerate() {
        // SAFETY: `unit` is as long as a `T`, and the unit lies among the writable bytes.
        unsafe {
            let value = unit.as_ptr().cast::<T>().read_unaligned();
            target.cast::<T>().add(index).write_volatile(value);
        }
    }
    copied
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accesses_outside_are_refused_whole() {
        let mut bytes = [7u8; 16];
        let view = SharedView::of(&mut bytes);
        assert!(view.write(9, &[0; 8]).is_err());
        assert!(view.write(usize::MAX, &[0; 8]).is_err());
        assert!(view.read(16, &mut [0]).is_err());
        assert!(view.read_u32(13).is_err());
        assert!(view.read_u16(15, &mut [0]).is_err());
        assert!(view.write_u16(15, &[0]).is_err());
        assert!(view.clear(0, 17).is_err());
        assert!(view.read(16, &mut []).is_ok());
        assert_eq!(bytes, [7; 16]);
    }

    #[test]
    fn every_offset_and_length_copies_exactly_its_bytes() {
        let original: Vec<u8> = (0..200).collect();
        for offset in 0..18 {
            for length in 0..180 {
                let mut bytes = original.clone();
                let view = SharedView::of(&mut bytes);
                let mut copy = vec![0; length];
                view.read(offset, &mut copy).unwrap();
                assert_eq!(copy, original[offset..offset + length]);
                copy.reverse();
                view.write(offset, &copy).unwrap();
                let mut expected = original.clone();
                expected[offset..offset + length].reverse();
                assert_eq!(bytes, expected);
            }
        }
    }

    #[test]
    fn words_are_little_endian() {
        let mut bytes: Vec<u8> = (0..=255).cycle().take(1500).collect();
        let view = SharedView::of(&mut bytes);
        let mut words = vec![0; 700];
        view.read_u16(3, &mut words).unwrap();
        assert_eq!(words[0], 0x0403);
        assert_eq!(words[300], u16::from_le_bytes([((603) % 256) as u8, (604 % 256) as u8]));
        let swapped: Vec<u16> = words.iter().map(|word| word.swap_bytes()).collect();
        view.write_u16(3, &swapped).unwrap();
        view.read_u16(3, &mut words).unwrap();
        assert_eq!(words, swapped);
        assert_eq!(view.read_u32(0).unwrap(), 0x0402_0100);
        view.write_u32(1, 0x0102_0304).unwrap();
        assert_eq!(view.read_u32(1).unwrap(), 0x0102_0304);
        assert_eq!(view.read_u32(0).unwrap() >> 8, 0x02_0304);
    }
}
