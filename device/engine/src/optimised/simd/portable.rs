//! 64 lanes in portable Rust.

use super::small::small_numbers_are_words;
use super::{DARK, HALF, LANES, Simd, Square, Work};
use crate::fixed::{FULL, product, unity};
use crate::optimised::reciprocal::GRADIENT;
use crate::optimised::tables::{Classification, ReflectanceMap};
use crate::stage::reflectance::HALF_FACE;
use core::array::from_fn;
use vg500_regs::VoxelFormat;

/// Needs nothing of the processor.
#[derive(Clone, Copy, Debug)]
pub struct Portable;

type Words = [u16; LANES];

#[inline(always)]
fn each(a: Words, operation: impl Fn(u16) -> u16) -> Words {
    from_fn(|lane| operation(a[lane]))
}

#[inline(always)]
fn pairs(a: Words, b: Words, operation: impl Fn(u16, u16) -> u16) -> Words {
    from_fn(|lane| operation(a[lane], b[lane]))
}

#[inline(always)]
fn signed(a: Words, b: Words, operation: impl Fn(i32, i32) -> i32) -> Words {
    pairs(a, b, |a, b| operation(i32::from(a.cast_signed()), i32::from(b.cast_signed())) as u16)
}

impl Simd for Portable {
    type Words = Words;
    type Constant = u16;
    type Mask = [bool; LANES];
    type Small = Words;
    type SmallMask = [bool; LANES];
    type Map = ReflectanceMap;
    type Factors = [u16; 256];

    #[inline(always)]
    fn run<W: Work>(self, work: W) -> W::Output {
        work.run(self)
    }

    #[inline(always)]
    fn constant(self, value: i16) -> u16 {
        value.cast_unsigned()
    }

    #[inline(always)]
    fn spread(self, constant: u16) -> Words {
        [constant; LANES]
    }

    #[inline(always)]
    fn count(self) -> Words {
        from_fn(|lane| lane as u16)
    }

    #[inline(always)]
    fn halves(self, [a, b]: [i16; 2]) -> Words {
        from_fn(|lane| if lane < HALF { a.cast_unsigned() } else { b.cast_unsigned() })
    }

    #[inline(always)]
    unsafe fn load(self, from: [*const u16; 2]) -> Words {
        let mut words = [0; LANES];
        for (half, from) in words.as_chunks_mut::<HALF>().0.iter_mut().zip(from) {
            // SAFETY: the caller's promise.
            *half = unsafe { from.cast::<[u16; HALF]>().read_unaligned() };
        }
        words
    }

    #[inline(always)]
    unsafe fn store(self, to: [*mut u16; 2], words: Words) {
        for (half, to) in words.as_chunks::<HALF>().0.iter().zip(to) {
            // SAFETY: the caller's promise.
            unsafe { to.cast::<[u16; HALF]>().write_unaligned(*half) };
        }
    }

    #[inline(always)]
    unsafe fn load_voxels(self, format: VoxelFormat, from: *const u8) -> Words {
        // SAFETY: the caller's promise.
        from_fn(|voxel| unsafe { load_voxel(format, from.add(voxel * format.bytes())) })
    }

    #[inline(always)]
    unsafe fn add_to_sums(self, sums: [*mut u32; 2], words: Words) {
        for (lane, word) in words.into_iter().enumerate() {
            // SAFETY: the caller's promise.
            unsafe { *sums[lane / HALF].add(lane % HALF) += u32::from(word) }
        }
    }

    #[inline(always)]
    fn prefetch(self, _address: *const u8) {}

    #[inline(always)]
    fn prefetch_into_second(self, _address: *const u8) {}

    #[inline(always)]
    fn add(self, a: Words, b: Words) -> Words {
        pairs(a, b, u16::wrapping_add)
    }

    #[inline(always)]
    fn subtract(self, a: Words, b: Words) -> Words {
        pairs(a, b, u16::wrapping_sub)
    }

    #[inline(always)]
    fn multiply_low(self, a: Words, b: Words) -> Words {
        pairs(a, b, u16::wrapping_mul)
    }

    #[inline(always)]
    fn multiply_high(self, a: Words, b: Words) -> Words {
        pairs(a, b, |a, b| ((u32::from(a) * u32::from(b)) >> 16) as u16)
    }

    #[inline(always)]
    fn multiply_high_signed(self, a: Words, b: Words) -> Words {
        signed(a, b, |a, b| (a * b) >> 16)
    }

    #[inline(always)]
    fn multiply_round(self, a: Words, b: Words) -> Words {
        signed(a, b, |a, b| (a * b + (1 << 14)) >> 15)
    }

    #[inline(always)]
    fn average(self, a: Words, b: Words) -> Words {
        pairs(a, b, |a, b| ((u32::from(a) + u32::from(b) + 1) >> 1) as u16)
    }

    #[inline(always)]
    fn min(self, a: Words, b: Words) -> Words {
        signed(a, b, i32::min)
    }

    #[inline(always)]
    fn max(self, a: Words, b: Words) -> Words {
        signed(a, b, i32::max)
    }

    #[inline(always)]
    fn absolute(self, a: Words) -> Words {
        each(a, |a| a.cast_signed().unsigned_abs())
    }

    #[inline(always)]
    fn with_sign(self, magnitude: Words, sign: Words) -> Words {
        signed(magnitude, sign, |magnitude, sign| magnitude * sign.signum())
    }

    #[inline(always)]
    fn with_signs(self, magnitude: Words, signs: [Words; 2]) -> Words {
        self.with_sign(self.with_sign(magnitude, signs[0]), signs[1])
    }

    #[inline(always)]
    fn shift_left<const BITS: i32>(self, a: Words) -> Words {
        each(a, |a| a << BITS)
    }

    #[inline(always)]
    fn shift_right<const BITS: i32>(self, a: Words) -> Words {
        each(a, |a| a >> BITS)
    }

    #[inline(always)]
    fn shift_right_signed<const BITS: i32>(self, a: Words) -> Words {
        each(a, |a| (a.cast_signed() >> BITS).cast_unsigned())
    }

    #[inline(always)]
    fn and(self, a: Words, b: Words) -> Words {
        pairs(a, b, |a, b| a & b)
    }

    #[inline(always)]
    fn greater(self, a: Words, b: Words) -> [bool; LANES] {
        from_fn(|lane| a[lane].cast_signed() > b[lane].cast_signed())
    }

    #[inline(always)]
    fn equal(self, a: Words, b: Words) -> [bool; LANES] {
        from_fn(|lane| a[lane] == b[lane])
    }

    #[inline(always)]
    fn both(self, a: [bool; LANES], b: [bool; LANES]) -> [bool; LANES] {
        from_fn(|lane| a[lane] & b[lane])
    }

    #[inline(always)]
    fn select(self, mask: [bool; LANES], yes: Words, no: Words) -> Words {
        from_fn(|lane| if mask[lane] { yes[lane] } else { no[lane] })
    }

    #[inline(always)]
    fn any(self, mask: [bool; LANES]) -> bool {
        mask.contains(&true)
    }

    #[inline(always)]
    fn bits(self, mask: [bool; LANES]) -> u64 {
        (0..LANES).fold(0, |bits, lane| bits | u64::from(mask[lane]) << lane)
    }

    small_numbers_are_words!();

    #[inline(always)]
    fn square_root(self, a: Words) -> Words {
        // The floor, and one more where a > floor^2 + floor: there the root is nearer to the next.
        each(a, |a| {
            let floor = u32::from(a).isqrt();
            (floor + u32::from(u32::from(a) > floor * floor + floor)) as u16
        })
    }

    #[inline(always)]
    fn reciprocal_of_gradient(self, a: Words) -> Words {
        each(a, |a| GRADIENT[usize::from(a & 127)])
    }

    #[inline(always)]
    fn reciprocal_seed(self, a: Words) -> Words {
        each(a, |a| {
            let middle = u32::from(a & 0xff00 | 0x80);
            (((1 << 28) + middle) / (2 * middle)) as u16
        })
    }

    #[inline(always)]
    unsafe fn classify(self, table: &Classification, values: Words) -> [Words; 4] {
        // SAFETY: the caller promises that no value lies behind the table's last entry.
        let entries: [u64; LANES] =
            from_fn(|lane| unsafe { *table.entries().add(usize::from(values[lane])) });
        from_fn(|channel| from_fn(|lane| (entries[lane] >> (16 * channel)) as u16))
    }

    #[inline(always)]
    unsafe fn blend_entries(self, table: &Classification, values: Words, rays: [*mut u16; 2]) {
        for (lane, value) in values.into_iter().enumerate() {
            // SAFETY: the caller's promise.
            let (entry, ray) = unsafe {
                (
                    *table.entries().add(usize::from(value)),
                    &mut *rays[lane / HALF].add(4 * (lane % HALF)).cast::<[u16; 4]>(),
                )
            };
            let transparency = FULL - ray[3];
            for (channel, accumulated) in ray.iter_mut().enumerate() {
                *accumulated += product((entry >> (16 * channel)) as u16, transparency);
            }
        }
    }

    fn map(self, map: &ReflectanceMap) -> ReflectanceMap {
        map.clone()
    }

    #[inline(always)]
    unsafe fn reflectance(self, map: &ReflectanceMap, face: Words, u: Words, v: Words) -> Words {
        from_fn(|lane| {
            if face[lane] == u16::from(DARK.cast_unsigned()) {
                return 0;
            }
            let from_edge = |coordinate: Words| usize::from(coordinate[lane].wrapping_add(HALF_FACE as u16));
            let [face, u, v] = [usize::from(face[lane]), from_edge(u), from_edge(v)];
            let vertex = |row, column| u32::from(map.at(face, v / 32 + row, u / 32 + column));
            let weight = |coordinate: usize| (coordinate % 32) as u32;
            let row = |row| vertex(row, 0) * (32 - weight(u)) + vertex(row, 1) * weight(u);
            let intensity = row(0) * (32 - weight(v)) / 8 + row(1) * weight(v) / 8;
            (intensity + (intensity >> 8)) as u16
        })
    }

    fn factors(self, table: &[u8; 256]) -> [u16; 256] {
        table.map(unity)
    }

    #[inline(always)]
    unsafe fn factor(self, table: &[u16; 256], index: Words) -> Words {
        each(index, |index| table[usize::from(index & 0xff)])
    }

    #[inline(always)]
    unsafe fn load_half_of_voxels(self, format: VoxelFormat, from: *const u8, to: &mut [u16; HALF]) {
        for (voxel, word) in to.iter_mut().enumerate() {
            // SAFETY: the caller's promise.
            *word = unsafe { load_voxel(format, from.add(voxel * format.bytes())) };
        }
    }

    #[inline(always)]
    fn transpose(self, square: &mut Square) {
        let rows = square.rows;
        square.rows = from_fn(|row| from_fn(|column| rows[column][row]));
    }
}

/// A voxel, as it enters interpolation.
///
/// # Safety
///
/// It can be read there.
#[inline(always)]
unsafe fn load_voxel(format: VoxelFormat, from: *const u8) -> u16 {
    // SAFETY: the caller's promise, and others may write; bytes are always valid.
    let byte = |at: usize| u16::from(unsafe { from.add(at).read_volatile() });
    let stored = match format {
        VoxelFormat::Uint8 => byte(0),
        VoxelFormat::Uint12Lower | VoxelFormat::Uint12Upper => byte(0) | byte(1) << 8,
    };
    crate::stage::interpolate::guard(format.value(stored)) as u16
}
