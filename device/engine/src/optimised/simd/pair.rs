//! Two vectors as one of twice as many lanes.
//!
//! A block of samples goes through a long chain of operations, each of which waits for the one before. With two
//! vectors the processor always has a second chain to work on.

use super::{Simd, Work};
use crate::optimised::tables::{Classification, ReflectanceMap};
use vg500_regs::VoxelFormat;

/// The operations of a level on pairs of its vectors.
#[derive(Clone, Copy, Debug)]
pub struct Pair<S: Simd>(pub S);

impl<S: Simd> Simd for Pair<S> {
    const LANES: usize = 2 * S::LANES;
    type Words = [S::Words; 2];
    type Mask = [S::Mask; 2];
    type Map = S::Map;
    type Factors = S::Factors;

    #[inline(always)]
    fn run<W: Work>(self, work: W) -> W::Output {
        struct Paired<W>(W);
        impl<W: Work> Work for Paired<W> {
            type Output = W::Output;

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) -> W::Output {
                self.0.run(Pair(simd))
            }
        }
        self.0.run(Paired(work))
    }

    #[inline(always)]
    fn splat(self, value: i16) -> Self::Words {
        [self.0.splat(value); 2]
    }

    #[inline(always)]
    fn count(self) -> Self::Words {
        let first = self.0.count();
        [first, self.0.add(first, self.0.splat(S::LANES as i16))]
    }

    #[inline(always)]
    unsafe fn load(self, from: *const u16) -> Self::Words {
        // SAFETY: the caller's promise.
        unsafe { [self.0.load(from), self.0.load(from.add(S::LANES))] }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u16, words: Self::Words) {
        // SAFETY: the caller's promise.
        unsafe {
            self.0.store(to, words[0]);
            self.0.store(to.add(S::LANES), words[1]);
        }
    }

    #[inline(always)]
    unsafe fn load_voxels(self, format: VoxelFormat, from: *const u8) -> Self::Words {
        // SAFETY: the caller's promise.
        unsafe {
            let behind = from.add(S::LANES * format.bytes());
            [self.0.load_voxels(format, from), self.0.load_voxels(format, behind)]
        }
    }

    #[inline(always)]
    unsafe fn add_to_sums(self, sums: *mut u32, words: Self::Words) {
        // SAFETY: the caller's promise.
        unsafe {
            self.0.add_to_sums(sums, words[0]);
            self.0.add_to_sums(sums.add(S::LANES), words[1]);
        }
    }

    #[inline(always)]
    fn prefetch(self, address: *const u8) {
        self.0.prefetch(address);
    }

    #[inline(always)]
    fn add(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.add(a[0], b[0]), self.0.add(a[1], b[1])]
    }

    #[inline(always)]
    fn subtract(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.subtract(a[0], b[0]), self.0.subtract(a[1], b[1])]
    }

    #[inline(always)]
    fn multiply_low(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.multiply_low(a[0], b[0]), self.0.multiply_low(a[1], b[1])]
    }

    #[inline(always)]
    fn multiply_high(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.multiply_high(a[0], b[0]), self.0.multiply_high(a[1], b[1])]
    }

    #[inline(always)]
    fn multiply_high_signed(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.multiply_high_signed(a[0], b[0]), self.0.multiply_high_signed(a[1], b[1])]
    }

    #[inline(always)]
    fn multiply_round(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.multiply_round(a[0], b[0]), self.0.multiply_round(a[1], b[1])]
    }

    #[inline(always)]
    fn average(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.average(a[0], b[0]), self.0.average(a[1], b[1])]
    }

    #[inline(always)]
    fn min(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.min(a[0], b[0]), self.0.min(a[1], b[1])]
    }

    #[inline(always)]
    fn max(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.max(a[0], b[0]), self.0.max(a[1], b[1])]
    }

    #[inline(always)]
    fn with_sign(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.with_sign(a[0], b[0]), self.0.with_sign(a[1], b[1])]
    }

    #[inline(always)]
    fn and(self, a: Self::Words, b: Self::Words) -> Self::Words {
        [self.0.and(a[0], b[0]), self.0.and(a[1], b[1])]
    }

    #[inline(always)]
    fn absolute(self, a: Self::Words) -> Self::Words {
        [self.0.absolute(a[0]), self.0.absolute(a[1])]
    }

    #[inline(always)]
    fn square_root(self, a: Self::Words) -> Self::Words {
        [self.0.square_root(a[0]), self.0.square_root(a[1])]
    }

    #[inline(always)]
    fn reciprocal_of_gradient(self, a: Self::Words) -> Self::Words {
        [self.0.reciprocal_of_gradient(a[0]), self.0.reciprocal_of_gradient(a[1])]
    }

    #[inline(always)]
    fn reciprocal_seed(self, a: Self::Words) -> Self::Words {
        [self.0.reciprocal_seed(a[0]), self.0.reciprocal_seed(a[1])]
    }

    #[inline(always)]
    fn shift_left<const BITS: i32>(self, a: Self::Words) -> Self::Words {
        [self.0.shift_left::<BITS>(a[0]), self.0.shift_left::<BITS>(a[1])]
    }

    #[inline(always)]
    fn shift_right<const BITS: i32>(self, a: Self::Words) -> Self::Words {
        [self.0.shift_right::<BITS>(a[0]), self.0.shift_right::<BITS>(a[1])]
    }

    #[inline(always)]
    fn shift_right_signed<const BITS: i32>(self, a: Self::Words) -> Self::Words {
        [self.0.shift_right_signed::<BITS>(a[0]), self.0.shift_right_signed::<BITS>(a[1])]
    }

    #[inline(always)]
    fn greater(self, a: Self::Words, b: Self::Words) -> Self::Mask {
        [self.0.greater(a[0], b[0]), self.0.greater(a[1], b[1])]
    }

    #[inline(always)]
    fn equal(self, a: Self::Words, b: Self::Words) -> Self::Mask {
        [self.0.equal(a[0], b[0]), self.0.equal(a[1], b[1])]
    }

    #[inline(always)]
    fn both(self, a: Self::Mask, b: Self::Mask) -> Self::Mask {
        [self.0.both(a[0], b[0]), self.0.both(a[1], b[1])]
    }

    #[inline(always)]
    fn select(self, mask: Self::Mask, yes: Self::Words, no: Self::Words) -> Self::Words {
        [self.0.select(mask[0], yes[0], no[0]), self.0.select(mask[1], yes[1], no[1])]
    }

    #[inline(always)]
    fn any(self, mask: Self::Mask) -> bool {
        self.0.any(mask[0]) | self.0.any(mask[1])
    }

    #[inline(always)]
    fn bits(self, mask: Self::Mask) -> u64 {
        self.0.bits(mask[0]) | self.0.bits(mask[1]) << S::LANES
    }

    #[inline(always)]
    unsafe fn classify(self, table: &Classification, values: Self::Words) -> [Self::Words; 4] {
        // SAFETY: the caller's promise.
        let [first, second] =
            unsafe { [self.0.classify(table, values[0]), self.0.classify(table, values[1])] };
        [[first[0], second[0]], [first[1], second[1]], [first[2], second[2]], [first[3], second[3]]]
    }

    #[inline(always)]
    unsafe fn blend_entries(self, table: &Classification, values: Self::Words, rays: *mut u16) {
        // SAFETY: the caller's promise.
        unsafe {
            self.0.blend_entries(table, values[0], rays);
            self.0.blend_entries(table, values[1], rays.add(4 * S::LANES));
        }
    }

    fn map(self, map: &ReflectanceMap) -> S::Map {
        self.0.map(map)
    }

    #[inline(always)]
    unsafe fn reflectance(
        self,
        map: &S::Map,
        face: Self::Words,
        u: Self::Words,
        v: Self::Words,
    ) -> Self::Words {
        // SAFETY: the caller's promise.
        unsafe {
            [self.0.reflectance(map, face[0], u[0], v[0]), self.0.reflectance(map, face[1], u[1], v[1])]
        }
    }

    fn factors(self, table: &[u8; 256]) -> S::Factors {
        self.0.factors(table)
    }

    #[inline(always)]
    unsafe fn factor(self, table: &S::Factors, index: Self::Words) -> Self::Words {
        // SAFETY: the caller's promise.
        unsafe { [self.0.factor(table, index[0]), self.0.factor(table, index[1])] }
    }

    #[inline(always)]
    unsafe fn load_transposed(self, format: VoxelFormat, from: *const u8, pitch: isize) -> [[u16; 16]; 16] {
        // SAFETY: the caller's promise.
        unsafe { self.0.load_transposed(format, from, pitch) }
    }
}
