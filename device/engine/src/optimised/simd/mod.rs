//! Vectors of 16-bit lanes: the one set of operations that the kernels are written in, for each kind of processor.
//!
//! A value of a type that implements [`Simd`] is proof that the processor has its instructions: [`Level::detect`]
//! and [`Level::named`] are the only places where one is made. It is passed down by value; nothing is global.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "x86_64")]
mod eights;
mod level;
mod portable;
mod small;
#[cfg(test)]
mod tests;

pub use level::{Level, LevelError};
pub use portable::Portable;

use super::tables::{Classification, ReflectanceMap};
use vg500_regs::VoxelFormat;

/// An expression for each of some values, as an array: `each!([a, b], |it| ...)`.
///
/// Kernels use it instead of closures: those are functions without the level's instructions until they are inlined,
/// and the compiler does not inline long ones.
macro_rules! each {
    ([$($value:expr),* $(,)?], |$it:ident| $result:expr) => {
        [$({
            let $it = $value;
            $result
        }),*]
    };
}
pub(crate) use each;

/// Lanes of a vector: two halves, which need not lie next to each other in memory.
pub const LANES: usize = 64;
/// Lanes of half a vector.
pub const HALF: usize = LANES / 2;

/// Rows of half a vector, as many as each has words.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct Square {
    /// The rows.
    pub rows: [[u16; HALF]; HALF],
    /// Else the same row of many squares would fall into the same few places of the cache.
    space: [u16; HALF],
}

impl Square {
    /// Of zeros.
    pub const ZERO: Self = Self { rows: [[0; HALF]; HALF], space: [0; HALF] };
}

/// The face behind those of a reflectance map.
pub const DARK: i8 = 6;

/// Work that runs with the instructions of some level. Implementations of `run` are `#[inline(always)]`, so that
/// the compiler makes them, and all that they call, of those instructions.
pub trait Work {
    /// What it comes to.
    type Output;

    /// Does it.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// Operations on vectors of 16-bit lanes. Lanes are without sign unless an operation says so.
///
/// Everything is `#[inline(always)]`: kernels become straight code of the level's instructions.
pub trait Simd: Copy + Send + Sync + 'static {
    /// A vector.
    type Words: Copy + core::fmt::Debug;
    /// The same word for each lane.
    type Constant: Copy + core::fmt::Debug;
    /// A truth value for each lane.
    type Mask: Copy + core::fmt::Debug;
    /// A signed number of 8 bits for each lane, in a form of the level's own.
    type Small: Copy + core::fmt::Debug;
    /// A truth value for each of these.
    type SmallMask: Copy + core::fmt::Debug;
    /// A reflectance map in the form that [`Self::reflectance`] looks up, with a dark face behind its six.
    type Map;
    /// A table of 256 factors in the form that [`Self::factor`] looks up.
    type Factors;

    /// Runs `work` with these instructions.
    fn run<W: Work>(self, work: W) -> W::Output;

    /// A value for each lane, to be kept: it takes less room than a vector.
    fn constant(self, value: i16) -> Self::Constant;
    /// It in each lane.
    fn spread(self, constant: Self::Constant) -> Self::Words;
    /// The same value in each lane.
    #[inline(always)]
    fn splat(self, value: i16) -> Self::Words {
        self.spread(self.constant(value))
    }
    /// 0, 1, 2, ...
    fn count(self) -> Self::Words;
    /// A value for each lane of a half.
    fn halves(self, values: [i16; 2]) -> Self::Words;
    /// Reads the halves of a vector.
    ///
    /// # Safety
    ///
    /// [`HALF`] words can be read at each place, and nobody writes them meanwhile.
    unsafe fn load(self, from: [*const u16; 2]) -> Self::Words;
    /// Writes the halves of a vector, the second one last.
    ///
    /// # Safety
    ///
    /// [`HALF`] words can be written at each place, and nobody else uses them meanwhile.
    unsafe fn store(self, to: [*mut u16; 2], words: Self::Words);
    /// Reads as many voxels next to each other as there are lanes, with the three guard bits of interpolation.
    ///
    /// # Safety
    ///
    /// They can be read at `from`. Others may write there meanwhile: what is read then is any 12-bit value.
    unsafe fn load_voxels(self, format: VoxelFormat, from: *const u8) -> Self::Words;

    /// Adds each lane to one of as many 32-bit sums, half by half.
    ///
    /// # Safety
    ///
    /// The sums can be read and written, and nobody else uses them meanwhile.
    unsafe fn add_to_sums(self, sums: [*mut u32; 2], words: Self::Words);
    /// Asks for the cache line at an address, which need not be one of anything.
    fn prefetch(self, address: *const u8);
    /// As [`Self::prefetch`], but no nearer than into the second cache: it has room for more lines in each place.
    fn prefetch_into_second(self, address: *const u8);

    /// a + b, modulo 2^16.
    fn add(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// a - b, modulo 2^16.
    fn subtract(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// Low half of a b.
    fn multiply_low(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// High half of a b, both without sign.
    fn multiply_high(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// High half of a b, both signed.
    fn multiply_high_signed(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// (a b + 2^14) >> 15, all signed. Not for a = b = -2^15.
    fn multiply_round(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// `a + (b - a) w`, rounded half up; the weight has 8 fraction bits and is given times 2^7
    /// ([`crate::stage::interpolate::lerp`]).
    #[inline(always)]
    fn lerp(self, a: Self::Words, b: Self::Words, weight: Self::Words) -> Self::Words {
        self.add(a, self.multiply_round(self.subtract(b, a), weight))
    }
    /// (a + b + 1) >> 1 without overflow.
    fn average(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// The lesser, signed.
    fn min(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// The greater, signed.
    fn max(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// The absolute value.
    fn absolute(self, a: Self::Words) -> Self::Words;
    /// `magnitude` with the sign of `sign`, for magnitudes that are 0 wherever `sign` is.
    fn with_sign(self, magnitude: Self::Words, sign: Self::Words) -> Self::Words;
    /// As [`Self::with_sign`], with the sign of the product of two.
    fn with_signs(self, magnitude: Self::Words, signs: [Self::Words; 2]) -> Self::Words;
    /// a << BITS.
    fn shift_left<const BITS: i32>(self, a: Self::Words) -> Self::Words;
    /// a >> BITS.
    fn shift_right<const BITS: i32>(self, a: Self::Words) -> Self::Words;
    /// a >> BITS, signed.
    fn shift_right_signed<const BITS: i32>(self, a: Self::Words) -> Self::Words;
    /// Bitwise and.
    fn and(self, a: Self::Words, b: Self::Words) -> Self::Words;

    /// a > b, signed.
    fn greater(self, a: Self::Words, b: Self::Words) -> Self::Mask;
    /// a = b.
    fn equal(self, a: Self::Words, b: Self::Words) -> Self::Mask;
    /// Both.
    fn both(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// `yes` where the mask is set, `no` elsewhere.
    fn select(self, mask: Self::Mask, yes: Self::Words, no: Self::Words) -> Self::Words;
    /// Whether the mask is set in any lane.
    fn any(self, mask: Self::Mask) -> bool;
    /// The lanes in which the mask is set, the first one as the lowest bit.
    fn bits(self, mask: Self::Mask) -> u64;

    /// Small numbers, of words; of those beyond -128..=127 only the sign is kept.
    fn narrow(self, a: Self::Words) -> Self::Small;
    /// Small numbers times 2^8.
    fn widen_high(self, a: Self::Small) -> Self::Words;
    /// The same small number in each lane.
    fn splat_small(self, value: i8) -> Self::Small;
    /// a + b, where that is a small number.
    fn add_small(self, a: Self::Small, b: Self::Small) -> Self::Small;
    /// The lesser.
    fn min_small(self, a: Self::Small, b: Self::Small) -> Self::Small;
    /// The greater.
    fn max_small(self, a: Self::Small, b: Self::Small) -> Self::Small;
    /// The absolute value of any but -128.
    fn absolute_small(self, a: Self::Small) -> Self::Small;
    /// As [`Self::with_sign`].
    fn with_sign_small(self, magnitude: Self::Small, sign: Self::Small) -> Self::Small;
    /// a > b.
    fn greater_small(self, a: Self::Small, b: Self::Small) -> Self::SmallMask;
    /// Both.
    fn both_small(self, a: Self::SmallMask, b: Self::SmallMask) -> Self::SmallMask;
    /// `yes` where the mask is set, `no` elsewhere.
    fn select_small(self, mask: Self::SmallMask, yes: Self::Small, no: Self::Small) -> Self::Small;

    /// round(sqrt(a)) for a up to 2^16 - 1.
    fn square_root(self, a: Self::Words) -> Self::Words;
    /// round(14336 / a), half up, for a in 1..=127; 0 or any other value for 0.
    fn reciprocal_of_gradient(self, a: Self::Small) -> Self::Words;
    /// round(2^27 / (a with its low byte replaced by 128)), half up, for a in 3584..=18943; any other value
    /// elsewhere.
    fn reciprocal_seed(self, a: Self::Words) -> Self::Words;

    /// R, G, B and opacity of sample values.
    ///
    /// # Safety
    ///
    /// No lane is greater than [`Classification::TRANSPARENT`].
    unsafe fn classify(self, table: &Classification, values: Self::Words) -> [Self::Words; 4];

    /// Blends samples front to back into as many rays: R, G, B and opacity of a ray follow each other, and the
    /// entries of the table are premultiplied. C += (1 - A) a c, A += (1 - A) a.
    ///
    /// # Safety
    ///
    /// No lane is greater than [`Classification::TRANSPARENT`]; four words for each lane of a half can be read and
    /// written at each place of `rays`, and nobody else uses them meanwhile.
    unsafe fn blend_entries(self, table: &Classification, values: Self::Words, rays: [*mut u16; 2]);

    /// Prepares a map.
    fn map(self, map: &ReflectanceMap) -> Self::Map;
    /// Looks directions up: the face in 0..=5, and u and v on it in -112..=112, as
    /// [`crate::stage::reflectance::look_up`] does. On face [`DARK`] nothing is reflected.
    ///
    /// # Safety
    ///
    /// All lanes are in these ranges.
    unsafe fn reflectance(
        self,
        map: &Self::Map,
        face: Self::Small,
        u: Self::Small,
        v: Self::Small,
    ) -> Self::Words;

    /// Prepares a table of factors.
    fn factors(self, table: &[u8; 256]) -> Self::Factors;
    /// Looks factors up, as U0.15.
    ///
    /// # Safety
    ///
    /// All lanes are in 0..=255.
    unsafe fn factor(self, table: &Self::Factors, index: Self::Words) -> Self::Words;

    /// Reads half a vector of voxels as [`Self::load_voxels`] does.
    ///
    /// # Safety
    ///
    /// As for [`Self::load_voxels`].
    unsafe fn load_half_of_voxels(self, format: VoxelFormat, from: *const u8, to: &mut [u16; HALF]);
    /// Transposes a square.
    fn transpose(self, square: &mut Square);
}

/// A value of which the compiler knows nothing: it would make the slower gather instructions of look-ups.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn opaque(value: i64) -> u64 {
    let mut value = value.cast_unsigned();
    // SAFETY: nothing is executed.
    unsafe {
        core::arch::asm!("/* {0} */", inout(reg) value, options(pure, nomem, nostack, preserves_flags));
    }
    value
}
