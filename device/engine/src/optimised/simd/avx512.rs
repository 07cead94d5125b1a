//! 64 lanes with AVX-512, in two registers: operations on one do not wait for those on the other. Permutations of
//! bytes look whole tables up in registers, for all lanes at once.

use super::avx2::Avx2;
use super::{HALF, Simd, Square, Work, each};
use crate::optimised::tables::{Classification, ReflectanceMap};
use crate::stage::reflectance::HALF_FACE;
use core::arch::x86_64::*;
use vg500_regs::VoxelFormat;

/// Proof that the processor has AVX-512 F, BW, DQ, VL and VBMI.
#[derive(Clone, Copy, Debug)]
pub struct Avx512(Avx2);

impl Avx512 {
    /// The proof, if the processor has it.
    #[must_use]
    pub fn detect() -> Option<Self> {
        let has = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512vbmi");
        Avx2::detect().filter(|_| has).map(Self)
    }
}

/// The lanes of a vector.
type Words = [__m512i; 2];

/// Calls intrinsics of AVX-512.
macro_rules! avx512 {
    ($call:expr) => {
        // SAFETY: a value of `Avx512` exists only where the processor has these instructions.
        unsafe { $call }
    };
}

/// An intrinsic on each register of vectors.
macro_rules! registers {
    ($intrinsic:ident($($words:ident),+)) => {
        each!([0, 1], |register| avx512!($intrinsic($($words[register]),+)))
    };
}

mod look_ups;
mod transpose;
use look_ups::{
    Factors, GRADIENTS, Parities, Vertices, blend_entries, bytes_at, classify, interleave, seeds,
};
use transpose::transpose;

impl Simd for Avx512 {
    type Words = Words;
    type Constant = __m512i;
    type Mask = [__mmask32; 2];
    type Small = __m512i;
    type SmallMask = __mmask64;
    type Map = Parities;
    type Factors = Factors;

    #[inline(always)]
    fn run<W: Work>(self, work: W) -> W::Output {
        #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vbmi")]
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        // Apart from other work: the compiler does worse with functions of hundreds of kilobytes.
        #[inline(never)]
        fn with_avx512<W: Work>(simd: Avx512, work: W) -> W::Output {
            work.run(simd)
        }
        avx512!(with_avx512(self, work))
    }

    #[inline(always)]
    fn constant(self, value: i16) -> __m512i {
        avx512!(_mm512_set1_epi16(value))
    }

    #[inline(always)]
    fn spread(self, constant: __m512i) -> Words {
        [constant; 2]
    }

    #[inline(always)]
    fn count(self) -> Words {
        let first = avx512!(_mm512_cvtepi8_epi16(_mm256_setr_epi8(
            0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26,
            27, 28, 29, 30, 31
        )));
        [first, avx512!(_mm512_add_epi16(first, _mm512_set1_epi16(32)))]
    }

    #[inline(always)]
    fn halves(self, [a, b]: [i16; 2]) -> Words {
        avx512!([_mm512_set1_epi16(a), _mm512_set1_epi16(b)])
    }

    #[inline(always)]
    unsafe fn load(self, from: [*const u16; 2]) -> Words {
        // SAFETY: the caller's promise.
        unsafe { each!([from[0], from[1]], |from| _mm512_loadu_si512(from.cast())) }
    }

    #[inline(always)]
    unsafe fn store(self, to: [*mut u16; 2], words: Words) {
        // SAFETY: the caller's promise.
        unsafe {
            _mm512_storeu_si512(to[0].cast(), words[0]);
            _mm512_storeu_si512(to[1].cast(), words[1]);
        }
    }

    #[inline(always)]
    unsafe fn load_voxels(self, format: VoxelFormat, from: *const u8) -> Words {
        // SAFETY: the caller's promise.
        unsafe { each!([0, 32], |voxel| load_32_voxels(format, from.add(voxel * format.bytes()))) }
    }

    #[inline(always)]
    unsafe fn add_to_sums(self, sums: [*mut u32; 2], words: Words) {
        for (sums, words) in sums.into_iter().zip(words) {
            // SAFETY: the caller's promise.
            unsafe {
                let halves = [_mm512_castsi512_si256(words), _mm512_extracti64x4_epi64::<1>(words)];
                for (half, words) in halves.into_iter().enumerate() {
                    let place = sums.add(16 * half).cast();
                    let sum = _mm512_add_epi32(_mm512_loadu_si512(place), _mm512_cvtepu16_epi32(words));
                    _mm512_storeu_si512(place.cast(), sum);
                }
            }
        }
    }

    #[inline(always)]
    fn prefetch(self, address: *const u8) {
        avx512!(_mm_prefetch::<_MM_HINT_T0>(address.cast()));
    }

    #[inline(always)]
    fn prefetch_into_second(self, address: *const u8) {
        avx512!(_mm_prefetch::<_MM_HINT_T1>(address.cast()));
    }

    #[inline(always)]
    fn add(self, a: Words, b: Words) -> Words {
        registers!(_mm512_add_epi16(a, b))
    }

    #[inline(always)]
    fn subtract(self, a: Words, b: Words) -> Words {
        registers!(_mm512_sub_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_low(self, a: Words, b: Words) -> Words {
        registers!(_mm512_mullo_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_high(self, a: Words, b: Words) -> Words {
        registers!(high_half(a, b))
    }

    #[inline(always)]
    fn multiply_high_signed(self, a: Words, b: Words) -> Words {
        registers!(_mm512_mulhi_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_round(self, a: Words, b: Words) -> Words {
        registers!(_mm512_mulhrs_epi16(a, b))
    }

    #[inline(always)]
    fn average(self, a: Words, b: Words) -> Words {
        registers!(_mm512_avg_epu16(a, b))
    }

    #[inline(always)]
    fn min(self, a: Words, b: Words) -> Words {
        registers!(_mm512_min_epi16(a, b))
    }

    #[inline(always)]
    fn max(self, a: Words, b: Words) -> Words {
        registers!(_mm512_max_epi16(a, b))
    }

    #[inline(always)]
    fn absolute(self, a: Words) -> Words {
        registers!(_mm512_abs_epi16(a))
    }

    #[inline(always)]
    fn with_sign(self, magnitude: Words, sign: Words) -> Words {
        let negative = registers!(_mm512_movepi16_mask(sign));
        registers!(negated(negative, magnitude))
    }

    #[inline(always)]
    fn with_signs(self, magnitude: Words, signs: [Words; 2]) -> Words {
        let [a, b] = each!([signs[0], signs[1]], |sign| registers!(_mm512_movepi16_mask(sign)));
        let negative = registers!(_kxor_mask32(a, b));
        registers!(negated(negative, magnitude))
    }

    #[inline(always)]
    fn shift_left<const BITS: i32>(self, a: Words) -> Words {
        each!([a[0], a[1]], |a| avx512!(_mm512_sll_epi16(a, _mm_cvtsi32_si128(BITS))))
    }

    #[inline(always)]
    fn shift_right<const BITS: i32>(self, a: Words) -> Words {
        each!([a[0], a[1]], |a| avx512!(_mm512_srl_epi16(a, _mm_cvtsi32_si128(BITS))))
    }

    #[inline(always)]
    fn shift_right_signed<const BITS: i32>(self, a: Words) -> Words {
        each!([a[0], a[1]], |a| avx512!(_mm512_sra_epi16(a, _mm_cvtsi32_si128(BITS))))
    }

    #[inline(always)]
    fn and(self, a: Words, b: Words) -> Words {
        registers!(_mm512_and_si512(a, b))
    }

    #[inline(always)]
    fn greater(self, a: Words, b: Words) -> [__mmask32; 2] {
        registers!(_mm512_cmpgt_epi16_mask(a, b))
    }

    #[inline(always)]
    fn equal(self, a: Words, b: Words) -> [__mmask32; 2] {
        registers!(_mm512_cmpeq_epi16_mask(a, b))
    }

    #[inline(always)]
    fn both(self, a: [__mmask32; 2], b: [__mmask32; 2]) -> [__mmask32; 2] {
        [a[0] & b[0], a[1] & b[1]]
    }

    #[inline(always)]
    fn select(self, mask: [__mmask32; 2], yes: Words, no: Words) -> Words {
        registers!(_mm512_mask_blend_epi16(mask, no, yes))
    }

    #[inline(always)]
    fn any(self, mask: [__mmask32; 2]) -> bool {
        mask[0] | mask[1] != 0
    }

    #[inline(always)]
    fn bits(self, mask: [__mmask32; 2]) -> u64 {
        u64::from(mask[0]) | u64::from(mask[1]) << 32
    }

    #[inline(always)]
    fn narrow(self, a: Words) -> __m512i {
        avx512!(_mm512_packs_epi16(a[0], a[1]))
    }

    #[inline(always)]
    fn widen_high(self, a: __m512i) -> Words {
        interleave(self.splat_small(0), a)
    }

    #[inline(always)]
    fn splat_small(self, value: i8) -> __m512i {
        avx512!(_mm512_set1_epi8(value))
    }

    #[inline(always)]
    fn add_small(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_add_epi8(a, b))
    }

    #[inline(always)]
    fn min_small(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_min_epi8(a, b))
    }

    #[inline(always)]
    fn max_small(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_max_epi8(a, b))
    }

    #[inline(always)]
    fn absolute_small(self, a: __m512i) -> __m512i {
        avx512!(_mm512_abs_epi8(a))
    }

    #[inline(always)]
    fn with_sign_small(self, magnitude: __m512i, sign: __m512i) -> __m512i {
        avx512!({
            let negative = _mm512_movepi8_mask(sign);
            _mm512_mask_sub_epi8(magnitude, negative, _mm512_setzero_si512(), magnitude)
        })
    }

    #[inline(always)]
    fn greater_small(self, a: __m512i, b: __m512i) -> __mmask64 {
        avx512!(_mm512_cmpgt_epi8_mask(a, b))
    }

    #[inline(always)]
    fn both_small(self, a: __mmask64, b: __mmask64) -> __mmask64 {
        a & b
    }

    #[inline(always)]
    fn select_small(self, mask: __mmask64, yes: __m512i, no: __m512i) -> __m512i {
        avx512!(_mm512_mask_blend_epi8(mask, no, yes))
    }

    #[inline(always)]
    fn square_root(self, a: Words) -> Words {
        each!([a[0], a[1]], |a| avx512!({
            let zero = _mm512_setzero_si512();
            let halves = [_mm512_unpacklo_epi16(a, zero), _mm512_unpackhi_epi16(a, zero)];
            let [low, high] = each!([halves[0], halves[1]], |half| _mm512_cvtps_epi32(_mm512_sqrt_ps(
                _mm512_cvtepi32_ps(half)
            )));
            _mm512_packus_epi32(low, high)
        }))
    }

    #[inline(always)]
    fn reciprocal_of_gradient(self, a: __m512i) -> Words {
        interleave(bytes_at(&GRADIENTS[0], a), bytes_at(&GRADIENTS[1], a))
    }

    #[inline(always)]
    fn reciprocal_seed(self, a: Words) -> Words {
        let high = self.shift_right::<8>(a);
        each!([high[0], high[1]], |index| seeds(index))
    }

    #[inline(always)]
    unsafe fn classify(self, table: &Classification, values: Words) -> [Words; 4] {
        let [first, second] = each!([0, 1], |register| {
            // SAFETY: the caller's promise.
            unsafe { classify(table.entries(), values[register]) }
        });
        each!([0, 1, 2, 3], |channel| [first[channel], second[channel]])
    }

    #[inline(always)]
    unsafe fn blend_entries(self, table: &Classification, values: Words, rays: [*mut u16; 2]) {
        // SAFETY: the caller's promise.
        unsafe {
            blend_entries(table.entries(), values[0], rays[0]);
            blend_entries(table.entries(), values[1], rays[1]);
        }
    }

    fn map(self, map: &ReflectanceMap) -> Parities {
        Parities::new(map)
    }

    #[inline(always)]
    unsafe fn reflectance(self, map: &Parities, face: __m512i, u: __m512i, v: __m512i) -> Words {
        let half = self.splat_small(HALF_FACE as i8);
        let [u, v] = each!([u, v], |coordinate| Vertices::around(self.add_small(half, coordinate)));
        // Pairs of vertices lie 64 apart; a face has 16 entries of each parity, a pair of rows four.
        let columns = u.pairs::<6>(0b11);
        let face = avx512!(_mm512_slli_epi16::<4>(face));
        let rows = v.pairs::<4>(0b1100);
        let across = interleave(u.weights[0], u.weights[1]);
        let [even, odd] = each!([0, 1], |row| {
            let start = avx512!(_mm512_or_si512(face, rows[row]));
            let [even, odd] = each!([0, 1], |column| {
                bytes_at(&map.0[row][column], avx512!(_mm512_or_si512(start, columns[column])))
            });
            let vertices = interleave(even, odd);
            // A row of at most 8160 times 8 and a weight times 2^10: the high half is row times weight / 8.
            let row_of = registers!(_mm512_maddubs_epi16(vertices, across));
            let weight = self.shift_left::<2>(self.widen_high(v.weights[row]));
            self.multiply_high(self.shift_left::<3>(row_of), weight)
        });
        let intensity = self.add(even, odd);
        self.add(intensity, self.shift_right::<8>(intensity))
    }

    fn factors(self, table: &[u8; 256]) -> Factors {
        Factors::new(table)
    }

    #[inline(always)]
    unsafe fn factor(self, table: &Factors, index: Words) -> Words {
        avx512!({
            let index = _mm512_packus_epi16(index[0], index[1]);
            let [low, high] = [bytes_at(&table.0[0], index), bytes_at(&table.0[1], index)];
            let factor = _mm512_mask_blend_epi8(_mm512_movepi8_mask(index), low, high);
            // f * 257 / 2 is f << 7 | f >> 1.
            self.shift_right::<1>(interleave(factor, factor))
        })
    }

    #[inline(always)]
    unsafe fn load_half_of_voxels(self, format: VoxelFormat, from: *const u8, to: &mut [u16; HALF]) {
        // SAFETY: the caller's promise; a register is half a vector.
        unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), load_32_voxels(format, from)) };
    }

    #[inline(always)]
    fn transpose(self, square: &mut Square) {
        avx512!(transpose(square));
    }
}

/// Reads 32 voxels with guard bits.
///
/// # Safety
///
/// They can be read there.
#[inline(always)]
unsafe fn load_32_voxels(format: VoxelFormat, from: *const u8) -> __m512i {
    // SAFETY: the caller's promise; an 8-bit format has half as many bytes.
    unsafe {
        match format {
            VoxelFormat::Uint8 => {
                _mm512_slli_epi16::<7>(_mm512_cvtepu8_epi16(_mm256_loadu_si256(from.cast())))
            }
            VoxelFormat::Uint12Lower => {
                _mm512_srli_epi16::<1>(_mm512_slli_epi16::<4>(_mm512_loadu_si512(from.cast())))
            }
            VoxelFormat::Uint12Upper => {
                let words = _mm512_srli_epi16::<1>(_mm512_loadu_si512(from.cast()));
                _mm512_and_si512(words, _mm512_set1_epi16(0x7ff8))
            }
        }
    }
}

/// -a where the mask is set.
#[inline]
#[target_feature(enable = "avx512bw")]
fn negated(mask: __mmask32, a: __m512i) -> __m512i {
    _mm512_mask_sub_epi16(a, mask, _mm512_setzero_si512(), a)
}

/// High half of a b, without sign. The instruction is written out because LLVM turns the intrinsic into
/// multiplications of 32 bits where an operand was shifted.
#[inline]
#[target_feature(enable = "avx512bw")]
fn high_half(a: __m512i, b: __m512i) -> __m512i {
    let high;
    // SAFETY: the instruction touches registers only.
    unsafe {
        core::arch::asm!(
            "vpmulhuw {high}, {a}, {b}",
            high = lateout(zmm_reg) high,
            a = in(zmm_reg) a,
            b = in(zmm_reg) b,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    high
}
