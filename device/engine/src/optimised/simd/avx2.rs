//! 64 lanes with AVX2, in four registers: operations on one do not wait for those on the others. There are no byte
//! permutations over whole tables, so tables are looked up word by word.

use super::small::small_numbers_are_words;
use super::{HALF, Simd, Square, Work, each};
use crate::optimised::tables::{Classification, ReflectanceMap};
use crate::stage::reflectance::HALF_FACE;
use core::arch::x86_64::*;
use vg500_regs::VoxelFormat;

/// Proof that the processor has AVX2.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

impl Avx2 {
    /// The proof, if the processor has it.
    #[must_use]
    pub fn detect() -> Option<Self> {
        is_x86_feature_detected!("avx2").then_some(Self(()))
    }
}

/// The lanes of a vector.
type Words = [__m256i; 4];

/// Calls intrinsics of AVX2.
macro_rules! avx2 {
    ($call:expr) => {
        // SAFETY: a value of `Avx2` exists only where the processor has these instructions.
        unsafe { $call }
    };
}

/// An intrinsic on each register of vectors.
macro_rules! registers {
    ($intrinsic:ident$(::<$bits:ident>)?($($words:ident),+)) => {
        each!([0, 1, 2, 3], |register| avx2!($intrinsic$(::<$bits>)?($($words[register]),+)))
    };
}

/// An operation on the low and on the high half of the lanes of each register, widened to floats of 32 bits.
macro_rules! by_floats {
    ($words:expr, |$half:ident| $result:expr) => {
        each!([0, 1, 2, 3], |register| avx2!({
            let zero = _mm256_setzero_si256();
            let halves = [
                _mm256_unpacklo_epi16($words[register], zero),
                _mm256_unpackhi_epi16($words[register], zero),
            ];
            let [low, high] = each!([halves[0], halves[1]], |half| {
                let $half = _mm256_cvtepi32_ps(half);
                $result
            });
            _mm256_packus_epi32(low, high)
        }))
    };
}

mod look_ups;
mod transpose;
use look_ups::{Cells, Factors, between, blend_entries, classify, quarters};
pub(super) use look_ups::{alpha_of_two, join, two_entries};
use transpose::transpose;

/// Voxels in one register.
///
/// # Safety
///
/// 16 voxels can be read there.
#[inline(always)]
unsafe fn load_16_voxels(format: VoxelFormat, from: *const u8) -> __m256i {
    // SAFETY: the caller's promise; an 8-bit format has half as many bytes.
    unsafe {
        match format {
            VoxelFormat::Uint8 => _mm256_slli_epi16::<7>(_mm256_cvtepu8_epi16(_mm_loadu_si128(from.cast()))),
            VoxelFormat::Uint12Lower => {
                _mm256_srli_epi16::<1>(_mm256_slli_epi16::<4>(_mm256_loadu_si256(from.cast())))
            }
            VoxelFormat::Uint12Upper => {
                let words = _mm256_srli_epi16::<1>(_mm256_loadu_si256(from.cast()));
                _mm256_and_si256(words, _mm256_set1_epi16(0x7ff8))
            }
        }
    }
}

impl Simd for Avx2 {
    type Words = Words;
    type Constant = __m256i;
    type Mask = Words;
    type Small = Words;
    type SmallMask = Words;
    type Map = Cells;
    type Factors = Factors;

    #[inline(always)]
    fn run<W: Work>(self, work: W) -> W::Output {
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        // Apart from other work: the compiler does worse with functions of hundreds of kilobytes.
        #[inline(never)]
        fn with_avx2<W: Work>(simd: Avx2, work: W) -> W::Output {
            work.run(simd)
        }
        avx2!(with_avx2(self, work))
    }

    #[inline(always)]
    fn constant(self, value: i16) -> __m256i {
        avx2!(_mm256_set1_epi16(value))
    }

    #[inline(always)]
    fn spread(self, constant: __m256i) -> Words {
        [constant; 4]
    }

    #[inline(always)]
    fn count(self) -> Words {
        let first = avx2!(_mm256_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
        each!([0, 16, 32, 48], |lane| avx2!(_mm256_add_epi16(first, _mm256_set1_epi16(lane))))
    }

    #[inline(always)]
    fn halves(self, [a, b]: [i16; 2]) -> Words {
        each!([a, a, b, b], |value| avx2!(_mm256_set1_epi16(value)))
    }

    #[inline(always)]
    unsafe fn load(self, [a, b]: [*const u16; 2]) -> Words {
        // SAFETY: the caller's promise.
        unsafe { each!([a, a.add(16), b, b.add(16)], |from| _mm256_loadu_si256(from.cast())) }
    }

    #[inline(always)]
    unsafe fn store(self, to: [*mut u16; 2], words: Words) {
        let halves = words.as_chunks::<2>().0;
        for (to, [first, second]) in to.into_iter().zip(halves) {
            // SAFETY: the caller's promise.
            unsafe {
                _mm256_storeu_si256(to.cast(), *first);
                _mm256_storeu_si256(to.add(16).cast(), *second);
            }
        }
    }

    #[inline(always)]
    unsafe fn load_voxels(self, format: VoxelFormat, from: *const u8) -> Words {
        // SAFETY: the caller's promise.
        unsafe { each!([0, 16, 32, 48], |voxel| load_16_voxels(format, from.add(voxel * format.bytes()))) }
    }

    #[inline(always)]
    unsafe fn add_to_sums(self, sums: [*mut u32; 2], words: Words) {
        for (register, words) in words.into_iter().enumerate() {
            // SAFETY: the caller's promise.
            unsafe {
                let sums = sums[register / 2].add(16 * (register % 2));
                let halves = [_mm256_castsi256_si128(words), _mm256_extracti128_si256::<1>(words)];
                for (half, words) in halves.into_iter().enumerate() {
                    let place = sums.add(8 * half).cast();
                    let sum = _mm256_add_epi32(_mm256_loadu_si256(place), _mm256_cvtepu16_epi32(words));
                    _mm256_storeu_si256(place, sum);
                }
            }
        }
    }

    #[inline(always)]
    fn prefetch(self, address: *const u8) {
        avx2!(_mm_prefetch::<_MM_HINT_T0>(address.cast()));
    }

    #[inline(always)]
    fn prefetch_into_second(self, address: *const u8) {
        avx2!(_mm_prefetch::<_MM_HINT_T1>(address.cast()));
    }

    #[inline(always)]
    fn add(self, a: Words, b: Words) -> Words {
        registers!(_mm256_add_epi16(a, b))
    }

    #[inline(always)]
    fn subtract(self, a: Words, b: Words) -> Words {
        registers!(_mm256_sub_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_low(self, a: Words, b: Words) -> Words {
        registers!(_mm256_mullo_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_high(self, a: Words, b: Words) -> Words {
        registers!(high_half(a, b))
    }

    #[inline(always)]
    fn multiply_high_signed(self, a: Words, b: Words) -> Words {
        registers!(_mm256_mulhi_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_round(self, a: Words, b: Words) -> Words {
        registers!(_mm256_mulhrs_epi16(a, b))
    }

    #[inline(always)]
    fn average(self, a: Words, b: Words) -> Words {
        registers!(_mm256_avg_epu16(a, b))
    }

    #[inline(always)]
    fn min(self, a: Words, b: Words) -> Words {
        registers!(_mm256_min_epi16(a, b))
    }

    #[inline(always)]
    fn max(self, a: Words, b: Words) -> Words {
        registers!(_mm256_max_epi16(a, b))
    }

    #[inline(always)]
    fn absolute(self, a: Words) -> Words {
        registers!(_mm256_abs_epi16(a))
    }

    #[inline(always)]
    fn with_sign(self, magnitude: Words, sign: Words) -> Words {
        registers!(_mm256_sign_epi16(magnitude, sign))
    }

    #[inline(always)]
    fn with_signs(self, magnitude: Words, signs: [Words; 2]) -> Words {
        self.with_sign(self.with_sign(magnitude, signs[0]), signs[1])
    }

    #[inline(always)]
    fn shift_left<const BITS: i32>(self, a: Words) -> Words {
        registers!(_mm256_slli_epi16::<BITS>(a))
    }

    #[inline(always)]
    fn shift_right<const BITS: i32>(self, a: Words) -> Words {
        registers!(_mm256_srli_epi16::<BITS>(a))
    }

    #[inline(always)]
    fn shift_right_signed<const BITS: i32>(self, a: Words) -> Words {
        registers!(_mm256_srai_epi16::<BITS>(a))
    }

    #[inline(always)]
    fn and(self, a: Words, b: Words) -> Words {
        registers!(_mm256_and_si256(a, b))
    }

    #[inline(always)]
    fn greater(self, a: Words, b: Words) -> Words {
        registers!(_mm256_cmpgt_epi16(a, b))
    }

    #[inline(always)]
    fn equal(self, a: Words, b: Words) -> Words {
        registers!(_mm256_cmpeq_epi16(a, b))
    }

    #[inline(always)]
    fn both(self, a: Words, b: Words) -> Words {
        self.and(a, b)
    }

    #[inline(always)]
    fn select(self, mask: Words, yes: Words, no: Words) -> Words {
        registers!(_mm256_blendv_epi8(no, yes, mask))
    }

    #[inline(always)]
    fn any(self, mask: Words) -> bool {
        let [a, b, c, d] = mask;
        let any = avx2!(_mm256_or_si256(_mm256_or_si256(a, b), _mm256_or_si256(c, d)));
        avx2!(_mm256_testz_si256(any, any)) == 0
    }

    #[inline(always)]
    fn bits(self, mask: Words) -> u64 {
        // 8 lanes of each register in turn; the quarters into the order of the lanes.
        let [low, high] = each!([[mask[0], mask[1]], [mask[2], mask[3]]], |two| {
            let bytes = avx2!(_mm256_permute4x64_epi64::<0b11_01_10_00>(_mm256_packs_epi16(two[0], two[1])));
            u64::from(avx2!(_mm256_movemask_epi8(bytes)).cast_unsigned())
        });
        low | high << 32
    }

    small_numbers_are_words!();

    #[inline(always)]
    fn square_root(self, a: Words) -> Words {
        by_floats!(a, |a| _mm256_cvtps_epi32(_mm256_sqrt_ps(a)))
    }

    #[inline(always)]
    fn reciprocal_of_gradient(self, a: Words) -> Words {
        // 14336 / a and its sum with 1/2 are off by less than 2^-9, and a floor that is not meant is at least
        // 1 / (2 * 127) away.
        by_floats!(a, |a| {
            let quotient = _mm256_div_ps(_mm256_set1_ps(14336.0), a);
            _mm256_cvttps_epi32(_mm256_add_ps(quotient, _mm256_set1_ps(0.5)))
        })
    }

    #[inline(always)]
    fn reciprocal_seed(self, a: Words) -> Words {
        // With middle = 128 odd: 2^27 / middle = 2^20 / odd. Its sum with 1/2 is off by less than 2^-8, and a
        // floor that is not meant is at least 1 / (2 * 147) away; the tests look at all of them.
        let odd = self.add(self.shift_left::<1>(self.shift_right::<8>(a)), self.splat(1));
        by_floats!(odd, |odd| {
            let quotient = _mm256_div_ps(_mm256_set1_ps(1_048_576.0), odd);
            _mm256_cvttps_epi32(_mm256_add_ps(quotient, _mm256_set1_ps(0.5)))
        })
    }

    #[inline(always)]
    unsafe fn classify(self, table: &Classification, values: Words) -> [Words; 4] {
        let [a, b, c, d] = each!([0, 1, 2, 3], |register| {
            // SAFETY: the caller's promise.
            unsafe { classify(table.entries(), values[register]) }
        });
        each!([0, 1, 2, 3], |channel| [a[channel], b[channel], c[channel], d[channel]])
    }

    #[inline(always)]
    unsafe fn blend_entries(self, table: &Classification, values: Words, rays: [*mut u16; 2]) {
        for (register, values) in values.into_iter().enumerate() {
            // SAFETY: the caller's promise.
            unsafe {
                let rays = rays[register / 2].add(4 * 16 * (register % 2));
                blend_entries(table.entries(), values, rays);
            }
        }
    }

    fn map(self, map: &ReflectanceMap) -> Cells {
        Cells::new(map)
    }

    #[inline(always)]
    unsafe fn reflectance(self, map: &Cells, face: Words, u: Words, v: Words) -> Words {
        let half = self.splat(HALF_FACE as i16);
        let [u, v] = [self.add(half, u), self.add(half, v)];
        let [u_cell, v_cell] = [self.shift_right::<5>(u), self.shift_right::<5>(v)];
        let row = self.add(self.shift_left::<6>(face), self.shift_left::<3>(v_cell));
        let cells = self.add(row, u_cell);
        let within = self.splat(31);
        let [u, v] = [self.and(u, within), self.and(v, within)];
        // SAFETY: the caller's promise.
        each!([0, 1, 2, 3], |register| unsafe { between(map, cells[register], u[register], v[register]) })
    }

    fn factors(self, table: &[u8; 256]) -> Factors {
        Factors(table.map(crate::fixed::unity))
    }

    #[inline(always)]
    unsafe fn factor(self, table: &Factors, index: Words) -> Words {
        let mut found = [0; 64];
        let sixteens = found.as_chunks_mut::<16>().0;
        for (found, index) in sixteens.iter_mut().zip(index) {
            let quarters = quarters(index);
            for (lane, found) in found.iter_mut().enumerate() {
                let index = (quarters[lane / 4] >> (16 * (lane % 4))) as usize & 0xffff;
                // SAFETY: the caller promises that no index is greater than 255.
                *found = unsafe { *table.0.get_unchecked(index) };
            }
        }
        // SAFETY: the array is as long as a vector.
        unsafe { self.load([found.as_ptr(), found.as_ptr().add(HALF)]) }
    }

    #[inline(always)]
    unsafe fn load_half_of_voxels(self, format: VoxelFormat, from: *const u8, to: &mut [u16; HALF]) {
        for half in [0, 16] {
            // SAFETY: the caller's promise; two registers are half a vector.
            unsafe {
                let voxels = load_16_voxels(format, from.add(half * format.bytes()));
                _mm256_storeu_si256(to.as_mut_ptr().add(half).cast(), voxels);
            }
        }
    }

    #[inline(always)]
    fn transpose(self, square: &mut Square) {
        avx2!(transpose(square));
    }
}

/// High half of a b, without sign. The instruction is written out because LLVM turns the intrinsic into
/// multiplications of 32 bits where an operand was shifted.
#[inline]
#[target_feature(enable = "avx2")]
fn high_half(a: __m256i, b: __m256i) -> __m256i {
    let high;
    // SAFETY: the instruction touches registers only.
    unsafe {
        core::arch::asm!(
            "vpmulhuw {high}, {a}, {b}",
            high = lateout(ymm_reg) high,
            a = in(ymm_reg) a,
            b = in(ymm_reg) b,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    high
}
