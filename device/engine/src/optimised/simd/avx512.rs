//! 32 lanes with AVX-512. Permutations of bytes look whole tables up in registers.

use super::avx2::{Avx2, alpha_of_two, join, two_entries};
use super::{Simd, Work, each, opaque};
use crate::fixed::FULL;
use crate::optimised::reciprocal::{GRADIENT, SEED};
use crate::optimised::tables::{Classification, ReflectanceMap};
use core::arch::x86_64::*;
use core::array::from_fn;
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

/// 128 bytes, a table for one permutation.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Bytes([u8; 128]);

/// A reflectance map by the parity of v and u: of any 2 x 2 vertices each lies in another of the four tables, at
/// 16 face + 4 (v / 2) + u / 2.
#[derive(Debug)]
pub struct Parities([[Bytes; 2]; 2]);

/// Factors as they are: 0..=127 and 128..=255.
#[derive(Debug)]
pub struct Factors([Bytes; 2]);

/// Words of a table for one permutation.
#[repr(C, align(64))]
struct Words([u16; 64]);

static SEEDS: Words = Words(SEED);
static GRADIENTS: [Words; 2] = {
    let mut halves = [Words([0; 64]), Words([0; 64])];
    let mut at = 0;
    while at < 64 {
        halves[0].0[at] = GRADIENT[at];
        halves[1].0[at] = GRADIENT[64 + at];
        at += 1;
    }
    halves
};

/// Calls intrinsics of AVX-512.
macro_rules! avx512 {
    ($call:expr) => {
        // SAFETY: a value of `Avx512` exists only where the processor has these instructions.
        unsafe { $call }
    };
}

/// The lower bytes of words, as a mask of bytes.
const LOWER: u64 = 0x5555_5555_5555_5555;

/// The vertices along u: for the even one in the lower byte of each lane, for the odd one in the upper byte.
struct Across {
    /// u / 2.
    index: __m512i,
    weights: __m512i,
}

impl Avx512 {
    /// A value in the lower byte of each lane and one in the upper.
    #[inline(always)]
    fn bytes(self, lower: __m512i, upper: __m512i) -> __m512i {
        self.add(lower, self.shift_left::<8>(upper))
    }

    /// The row of vertices from `first` on, interpolated along u and multiplied with its weight along v.
    #[inline(always)]
    fn row(self, tables: &[Bytes; 2], first: __m512i, weight: __m512i, across: &Across) -> __m512i {
        let index = self.add(self.bytes(first, first), across.index);
        let even = bytes_at(&tables[0], LOWER, index);
        let odd = bytes_at(&tables[1], !LOWER, index);
        let row = avx512!(_mm512_maddubs_epi16(_mm512_or_si512(even, odd), across.weights));
        // A row of at most 8160 times 8 and a weight times 2^10: the high half is row times weight / 8.
        self.multiply_high(self.shift_left::<3>(row), self.shift_left::<10>(weight))
    }
}

/// The entries of a table at the two lowest indices of each of four words.
///
/// # Safety
///
/// The table has these entries.
#[inline(always)]
unsafe fn four_pairs(table: *const u64, indices: [u64; 4]) -> __m512i {
    // SAFETY: the caller's promise.
    unsafe {
        let [a, b, c, d] = each!([0, 1, 2, 3], |at| two_entries(table, indices[at]));
        _mm512_inserti64x4::<1>(_mm512_castsi256_si512(join(a, b)), join(c, d))
    }
}

/// The lanes of a vector, four to a word, two words for each quarter.
#[inline(always)]
fn quarters(words: __m512i) -> [[u64; 2]; 4] {
    avx512!({
        let quarters = [
            _mm512_castsi512_si128(words),
            _mm512_extracti64x2_epi64::<1>(words),
            _mm512_extracti64x2_epi64::<2>(words),
            _mm512_extracti64x2_epi64::<3>(words),
        ];
        each!([0, 1, 2, 3], |at| [
            opaque(_mm_cvtsi128_si64(quarters[at])),
            opaque(_mm_extract_epi64::<1>(quarters[at])),
        ])
    })
}

/// Words of a table of 64, by the lower six bits of each lane.
#[inline(always)]
fn words_at(table: &Words, index: __m512i) -> __m512i {
    avx512!({
        let [low, high] = each!([0, 32], |at| _mm512_load_si512(table.0.as_ptr().add(at).cast()));
        _mm512_permutex2var_epi16(low, index, high)
    })
}

/// Bytes of a table, by the lower seven bits of those bytes of `index` that `mask` tells; the others are 0.
#[inline(always)]
fn bytes_at(table: &Bytes, mask: u64, index: __m512i) -> __m512i {
    avx512!({
        let [low, high] = each!([0, 64], |at| _mm512_load_si512(table.0.as_ptr().add(at).cast()));
        _mm512_maskz_permutex2var_epi8(mask, low, index, high)
    })
}

/// Where two vertices along an axis lie, of which one is even and one odd, and their weights.
struct Vertices {
    even: __m512i,
    odd: __m512i,
    even_weight: __m512i,
}

impl Vertices {
    /// Those around a coordinate of 0..=224.
    #[inline(always)]
    fn around(simd: Avx512, coordinate: __m512i) -> Self {
        let half = simd.splat(32);
        let within = simd.and(coordinate, simd.splat(63));
        Self {
            even: simd.shift_right::<6>(simd.add(coordinate, half)),
            odd: simd.shift_right::<6>(coordinate),
            even_weight: simd.absolute(simd.subtract(within, half)),
        }
    }
}

impl Simd for Avx512 {
    const LANES: usize = 32;
    type Words = __m512i;
    type Mask = __mmask32;
    type Map = Parities;
    type Factors = Factors;

    #[inline(always)]
    fn run<W: Work>(self, work: W) -> W::Output {
        #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vbmi")]
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        fn with_avx512<W: Work>(simd: Avx512, work: W) -> W::Output {
            work.run(simd)
        }
        avx512!(with_avx512(self, work))
    }

    #[inline(always)]
    fn splat(self, value: i16) -> __m512i {
        avx512!(_mm512_set1_epi16(value))
    }

    #[inline(always)]
    fn count(self) -> __m512i {
        avx512!(_mm512_cvtepi8_epi16(_mm256_setr_epi8(
            0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26,
            27, 28, 29, 30, 31
        )))
    }

    #[inline(always)]
    unsafe fn load(self, from: *const u16) -> __m512i {
        // SAFETY: the caller's promise.
        unsafe { _mm512_loadu_si512(from.cast()) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u16, words: __m512i) {
        // SAFETY: the caller's promise.
        unsafe { _mm512_storeu_si512(to.cast(), words) }
    }

    #[inline(always)]
    unsafe fn load_voxels(self, format: VoxelFormat, from: *const u8) -> __m512i {
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

    #[inline(always)]
    unsafe fn add_to_sums(self, sums: *mut u32, words: __m512i) {
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

    #[inline(always)]
    fn prefetch(self, address: *const u8) {
        avx512!(_mm_prefetch::<_MM_HINT_T0>(address.cast()));
    }

    #[inline(always)]
    fn add(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_add_epi16(a, b))
    }

    #[inline(always)]
    fn subtract(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_sub_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_low(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_mullo_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_high(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(high_half(a, b))
    }

    #[inline(always)]
    fn multiply_high_signed(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_mulhi_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_round(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_mulhrs_epi16(a, b))
    }

    #[inline(always)]
    fn average(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_avg_epu16(a, b))
    }

    #[inline(always)]
    fn min(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_min_epi16(a, b))
    }

    #[inline(always)]
    fn max(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_max_epi16(a, b))
    }

    #[inline(always)]
    fn absolute(self, a: __m512i) -> __m512i {
        avx512!(_mm512_abs_epi16(a))
    }

    #[inline(always)]
    fn with_sign(self, magnitude: __m512i, sign: __m512i) -> __m512i {
        avx512!({
            let negative = _mm512_movepi16_mask(sign);
            _mm512_mask_sub_epi16(magnitude, negative, _mm512_setzero_si512(), magnitude)
        })
    }

    #[inline(always)]
    fn shift_left<const BITS: i32>(self, a: __m512i) -> __m512i {
        avx512!(_mm512_sll_epi16(a, _mm_cvtsi32_si128(BITS)))
    }

    #[inline(always)]
    fn shift_right<const BITS: i32>(self, a: __m512i) -> __m512i {
        avx512!(_mm512_srl_epi16(a, _mm_cvtsi32_si128(BITS)))
    }

    #[inline(always)]
    fn shift_right_signed<const BITS: i32>(self, a: __m512i) -> __m512i {
        avx512!(_mm512_sra_epi16(a, _mm_cvtsi32_si128(BITS)))
    }

    #[inline(always)]
    fn and(self, a: __m512i, b: __m512i) -> __m512i {
        avx512!(_mm512_and_si512(a, b))
    }

    #[inline(always)]
    fn greater(self, a: __m512i, b: __m512i) -> __mmask32 {
        avx512!(_mm512_cmpgt_epi16_mask(a, b))
    }

    #[inline(always)]
    fn equal(self, a: __m512i, b: __m512i) -> __mmask32 {
        avx512!(_mm512_cmpeq_epi16_mask(a, b))
    }

    #[inline(always)]
    fn both(self, a: __mmask32, b: __mmask32) -> __mmask32 {
        a & b
    }

    #[inline(always)]
    fn select(self, mask: __mmask32, yes: __m512i, no: __m512i) -> __m512i {
        avx512!(_mm512_mask_blend_epi16(mask, no, yes))
    }

    #[inline(always)]
    fn any(self, mask: __mmask32) -> bool {
        mask != 0
    }

    #[inline(always)]
    fn bits(self, mask: __mmask32) -> u64 {
        mask.into()
    }

    #[inline(always)]
    fn square_root(self, a: __m512i) -> __m512i {
        avx512!({
            let zero = _mm512_setzero_si512();
            let halves = [_mm512_unpacklo_epi16(a, zero), _mm512_unpackhi_epi16(a, zero)];
            let [low, high] = each!([halves[0], halves[1]], |half| _mm512_cvtps_epi32(_mm512_sqrt_ps(
                _mm512_cvtepi32_ps(half)
            )));
            _mm512_packus_epi32(low, high)
        })
    }

    #[inline(always)]
    fn reciprocal_of_gradient(self, a: __m512i) -> __m512i {
        let [low, high] = [words_at(&GRADIENTS[0], a), words_at(&GRADIENTS[1], a)];
        self.select(self.greater(a, self.splat(63)), high, low)
    }

    #[inline(always)]
    fn reciprocal_seed(self, a: __m512i) -> __m512i {
        words_at(&SEEDS, self.shift_right::<8>(a))
    }

    #[inline(always)]
    unsafe fn classify(self, table: &Classification, values: __m512i) -> [__m512i; 4] {
        let table = table.entries();
        let quarters = quarters(values);
        // Samples 2 i and 2 i + 1 in the first quarter, those 8, 16 and 24 behind them in the others.
        // SAFETY: the caller promises that no value lies behind the table's last entry.
        unsafe {
            let low = each!([0, 1, 2, 3], |at| quarters[at][0]);
            let high = each!([0, 1, 2, 3], |at| quarters[at][1]);
            let [a, b, c, d] = [
                four_pairs(table, low),
                four_pairs(table, each!([0, 1, 2, 3], |at| low[at] >> 32)),
                four_pairs(table, high),
                four_pairs(table, each!([0, 1, 2, 3], |at| high[at] >> 32)),
            ];
            let [even, odd] = [_mm512_unpacklo_epi16(a, b), _mm512_unpackhi_epi16(a, b)];
            let [rg, ba] = [_mm512_unpacklo_epi16(even, odd), _mm512_unpackhi_epi16(even, odd)];
            let [even, odd] = [_mm512_unpacklo_epi16(c, d), _mm512_unpackhi_epi16(c, d)];
            let [rg_behind, ba_behind] = [_mm512_unpacklo_epi16(even, odd), _mm512_unpackhi_epi16(even, odd)];
            [
                _mm512_unpacklo_epi64(rg, rg_behind),
                _mm512_unpackhi_epi64(rg, rg_behind),
                _mm512_unpacklo_epi64(ba, ba_behind),
                _mm512_unpackhi_epi64(ba, ba_behind),
            ]
        }
    }

    #[inline(always)]
    unsafe fn blend_entries(self, table: &Classification, values: __m512i, rays: *mut u16) {
        let table = table.entries();
        let [a, b, c, d] = quarters(values);
        let full = self.splat(FULL as i16);
        for (quarter, [low, high]) in [a, b, c, d].into_iter().enumerate() {
            // SAFETY: the caller's promise.
            unsafe {
                let first = join(two_entries(table, low), two_entries(table, low >> 32));
                let second = join(two_entries(table, high), two_entries(table, high >> 32));
                let samples = _mm512_inserti64x4::<1>(_mm512_castsi256_si512(first), second);
                let place = rays.add(32 * quarter).cast::<__m512i>();
                let accumulated = _mm512_loadu_si512(place);
                let alpha = _mm512_shuffle_epi8(accumulated, _mm512_broadcast_i32x4(alpha_of_two()));
                let transparency = _mm512_slli_epi16::<3>(_mm512_sub_epi16(full, alpha));
                let more = _mm512_mulhrs_epi16(samples, transparency);
                _mm512_storeu_si512(place, _mm512_add_epi16(accumulated, more));
            }
        }
    }

    // Once for a tile: not worth unrolling for each specialisation.
    #[inline(never)]
    fn map(self, map: &ReflectanceMap) -> Parities {
        let table = |v_parity: usize, u_parity: usize| {
            let mut bytes = [0; 128];
            for (index, byte) in bytes.iter_mut().enumerate().take(96) {
                let [face, v, u] = [index / 16, index / 4 % 4, index % 4];
                *byte = map.at(face, 2 * v + v_parity, 2 * u + u_parity);
            }
            Bytes(bytes)
        };
        Parities([[table(0, 0), table(0, 1)], [table(1, 0), table(1, 1)]])
    }

    #[inline(always)]
    unsafe fn reflectance(self, map: &Parities, face: __m512i, u: __m512i, v: __m512i) -> __m512i {
        let [u, v] = [Vertices::around(self, u), Vertices::around(self, v)];
        let face = self.shift_left::<4>(face);
        let whole = self.splat(32);
        let [u_even, u_odd] = [u.even_weight, self.subtract(whole, u.even_weight)];
        let across = Across { index: self.bytes(u.even, u.odd), weights: self.bytes(u_even, u_odd) };
        let [v_even, v_odd] = [v.even_weight, self.subtract(whole, v.even_weight)];
        let even = self.row(&map.0[0], self.add(face, self.shift_left::<2>(v.even)), v_even, &across);
        let odd = self.row(&map.0[1], self.add(face, self.shift_left::<2>(v.odd)), v_odd, &across);
        let intensity = self.add(even, odd);
        self.add(intensity, self.shift_right::<8>(intensity))
    }

    fn factors(self, table: &[u8; 256]) -> Factors {
        let [low, high] = [0, 128].map(|at| Bytes(from_fn(|byte| table[at + byte])));
        Factors([low, high])
    }

    #[inline(always)]
    unsafe fn factor(self, table: &Factors, index: __m512i) -> __m512i {
        let [low, high] = [bytes_at(&table.0[0], LOWER, index), bytes_at(&table.0[1], LOWER, index)];
        let factor = self.select(self.greater(index, self.splat(127)), high, low);
        avx512!(_mm512_or_si512(_mm512_slli_epi16::<7>(factor), _mm512_srli_epi16::<1>(factor)))
    }

    #[inline(always)]
    unsafe fn load_transposed(self, format: VoxelFormat, from: *const u8, pitch: isize) -> [[u16; 16]; 16] {
        // SAFETY: the caller's promise.
        unsafe { self.0.load_transposed(format, from, pitch) }
    }
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
