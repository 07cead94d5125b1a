//! 16 lanes with AVX2. There are no byte permutations over whole tables, so tables are looked up word by word.

use super::{Simd, Work, each, opaque};
use crate::fixed::FULL;
use crate::optimised::tables::{Classification, ReflectanceMap};
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

/// Cells of the six faces, 8 x 8 with the last row and column replicated: each a 2 x 2 neighbourhood of vertices,
/// (v, u), (v, u + 1), (v + 1, u), (v + 1, u + 1).
#[derive(Debug)]
pub struct Cells([[u8; 4]; 6 * 64]);

/// Factors widened to U0.15.
#[derive(Debug)]
pub struct Factors([u16; 256]);

/// A vector in memory.
#[repr(align(32))]
struct Words([u16; 16]);

/// Calls intrinsics of AVX2.
macro_rules! avx2 {
    ($call:expr) => {
        // SAFETY: a value of `Avx2` exists only where the processor has these instructions.
        unsafe { $call }
    };
}

/// An operation on the low and on the high half of all lanes, widened to floats of 32 bits.
macro_rules! by_floats {
    ($words:expr, |$half:ident| $result:expr) => {
        avx2!({
            let zero = _mm256_setzero_si256();
            let halves = [_mm256_unpacklo_epi16($words, zero), _mm256_unpackhi_epi16($words, zero)];
            let [low, high] = each!([halves[0], halves[1]], |half| {
                let $half = _mm256_cvtepi32_ps(half);
                $result
            });
            _mm256_packus_epi32(low, high)
        })
    };
}

impl Simd for Avx2 {
    const LANES: usize = 16;
    type Words = __m256i;
    type Mask = __m256i;
    type Map = Cells;
    type Factors = Factors;

    #[inline(always)]
    fn run<W: Work>(self, work: W) -> W::Output {
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        fn with_avx2<W: Work>(simd: Avx2, work: W) -> W::Output {
            work.run(simd)
        }
        avx2!(with_avx2(self, work))
    }

    #[inline(always)]
    fn splat(self, value: i16) -> __m256i {
        avx2!(_mm256_set1_epi16(value))
    }

    #[inline(always)]
    fn count(self) -> __m256i {
        avx2!(_mm256_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
    }

    #[inline(always)]
    unsafe fn load(self, from: *const u16) -> __m256i {
        // SAFETY: the caller's promise.
        unsafe { _mm256_loadu_si256(from.cast()) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u16, words: __m256i) {
        // SAFETY: the caller's promise.
        unsafe { _mm256_storeu_si256(to.cast(), words) }
    }

    #[inline(always)]
    unsafe fn load_voxels(self, format: VoxelFormat, from: *const u8) -> __m256i {
        // SAFETY: the caller's promise; an 8-bit format has half as many bytes.
        unsafe {
            match format {
                VoxelFormat::Uint8 => {
                    _mm256_slli_epi16::<7>(_mm256_cvtepu8_epi16(_mm_loadu_si128(from.cast())))
                }
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

    #[inline(always)]
    unsafe fn add_to_sums(self, sums: *mut u32, words: __m256i) {
        // SAFETY: the caller's promise.
        unsafe {
            let halves = [_mm256_castsi256_si128(words), _mm256_extracti128_si256::<1>(words)];
            for (half, words) in halves.into_iter().enumerate() {
                let place = sums.add(8 * half).cast();
                let sum = _mm256_add_epi32(_mm256_loadu_si256(place), _mm256_cvtepu16_epi32(words));
                _mm256_storeu_si256(place, sum);
            }
        }
    }

    #[inline(always)]
    fn prefetch(self, address: *const u8) {
        avx2!(_mm_prefetch::<_MM_HINT_T0>(address.cast()));
    }

    #[inline(always)]
    fn add(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_add_epi16(a, b))
    }

    #[inline(always)]
    fn subtract(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_sub_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_low(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_mullo_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_high(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(high_half(a, b))
    }

    #[inline(always)]
    fn multiply_high_signed(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_mulhi_epi16(a, b))
    }

    #[inline(always)]
    fn multiply_round(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_mulhrs_epi16(a, b))
    }

    #[inline(always)]
    fn average(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_avg_epu16(a, b))
    }

    #[inline(always)]
    fn min(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_min_epi16(a, b))
    }

    #[inline(always)]
    fn max(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_max_epi16(a, b))
    }

    #[inline(always)]
    fn absolute(self, a: __m256i) -> __m256i {
        avx2!(_mm256_abs_epi16(a))
    }

    #[inline(always)]
    fn with_sign(self, magnitude: __m256i, sign: __m256i) -> __m256i {
        avx2!(_mm256_sign_epi16(magnitude, sign))
    }

    #[inline(always)]
    fn shift_left<const BITS: i32>(self, a: __m256i) -> __m256i {
        avx2!(_mm256_slli_epi16::<BITS>(a))
    }

    #[inline(always)]
    fn shift_right<const BITS: i32>(self, a: __m256i) -> __m256i {
        avx2!(_mm256_srli_epi16::<BITS>(a))
    }

    #[inline(always)]
    fn shift_right_signed<const BITS: i32>(self, a: __m256i) -> __m256i {
        avx2!(_mm256_srai_epi16::<BITS>(a))
    }

    #[inline(always)]
    fn and(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_and_si256(a, b))
    }

    #[inline(always)]
    fn greater(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_cmpgt_epi16(a, b))
    }

    #[inline(always)]
    fn equal(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_cmpeq_epi16(a, b))
    }

    #[inline(always)]
    fn both(self, a: __m256i, b: __m256i) -> __m256i {
        self.and(a, b)
    }

    #[inline(always)]
    fn select(self, mask: __m256i, yes: __m256i, no: __m256i) -> __m256i {
        avx2!(_mm256_blendv_epi8(no, yes, mask))
    }

    #[inline(always)]
    fn any(self, mask: __m256i) -> bool {
        avx2!(_mm256_testz_si256(mask, mask)) == 0
    }

    #[inline(always)]
    fn bits(self, mask: __m256i) -> u64 {
        let bytes = avx2!(_mm256_packs_epi16(mask, _mm256_setzero_si256()));
        // 8 lanes in the lower bytes of each half.
        let bits = u64::from(avx2!(_mm256_movemask_epi8(bytes)).cast_unsigned());
        (bits | bits >> 8) & 0xffff
    }

    #[inline(always)]
    fn square_root(self, a: __m256i) -> __m256i {
        by_floats!(a, |a| _mm256_cvtps_epi32(_mm256_sqrt_ps(a)))
    }

    #[inline(always)]
    fn reciprocal_of_gradient(self, a: __m256i) -> __m256i {
        // 14336 / a and its sum with 1/2 are off by less than 2^-9, and a floor that is not meant is at least
        // 1 / (2 * 127) away.
        by_floats!(a, |a| {
            let quotient = _mm256_div_ps(_mm256_set1_ps(14336.0), a);
            _mm256_cvttps_epi32(_mm256_add_ps(quotient, _mm256_set1_ps(0.5)))
        })
    }

    #[inline(always)]
    fn reciprocal_seed(self, a: __m256i) -> __m256i {
        // With middle = 128 odd: 2^27 / middle = 2^20 / odd. Its sum with 1/2 is off by less than 2^-8, and a
        // floor that is not meant is at least 1 / (2 * 147) away; the tests look at all of them.
        let odd =
            avx2!(_mm256_or_si256(_mm256_slli_epi16::<1>(_mm256_srli_epi16::<8>(a)), _mm256_set1_epi16(1)));
        by_floats!(odd, |odd| {
            let quotient = _mm256_div_ps(_mm256_set1_ps(1_048_576.0), odd);
            _mm256_cvttps_epi32(_mm256_add_ps(quotient, _mm256_set1_ps(0.5)))
        })
    }

    #[inline(always)]
    unsafe fn classify(self, table: &Classification, values: __m256i) -> [__m256i; 4] {
        let [a, b, c, d] = quarters(values);
        let table = table.entries();
        // Samples 2 i and 2 i + 1 in the lower half, those eight behind them in the upper one.
        // SAFETY: the caller promises that no value lies behind the table's last entry.
        unsafe {
            let [a, b, c, d] = [
                join(two_entries(table, a), two_entries(table, c)),
                join(two_entries(table, a >> 32), two_entries(table, c >> 32)),
                join(two_entries(table, b), two_entries(table, d)),
                join(two_entries(table, b >> 32), two_entries(table, d >> 32)),
            ];
            let [even, odd] = [_mm256_unpacklo_epi16(a, b), _mm256_unpackhi_epi16(a, b)];
            let [rg, ba] = [_mm256_unpacklo_epi16(even, odd), _mm256_unpackhi_epi16(even, odd)];
            let [even, odd] = [_mm256_unpacklo_epi16(c, d), _mm256_unpackhi_epi16(c, d)];
            let [rg_behind, ba_behind] = [_mm256_unpacklo_epi16(even, odd), _mm256_unpackhi_epi16(even, odd)];
            [
                _mm256_unpacklo_epi64(rg, rg_behind),
                _mm256_unpackhi_epi64(rg, rg_behind),
                _mm256_unpacklo_epi64(ba, ba_behind),
                _mm256_unpackhi_epi64(ba, ba_behind),
            ]
        }
    }

    #[inline(always)]
    unsafe fn blend_entries(self, table: &Classification, values: __m256i, rays: *mut u16) {
        let table = table.entries();
        let [a, b, c, d] = quarters(values);
        let full = self.splat(FULL as i16);
        for (quarter, indices) in [a, b, c, d].into_iter().enumerate() {
            // SAFETY: the caller's promise.
            unsafe {
                let samples = join(two_entries(table, indices), two_entries(table, indices >> 32));
                let place = rays.add(16 * quarter).cast();
                let accumulated = _mm256_loadu_si256(place);
                let alpha = _mm256_shuffle_epi8(accumulated, _mm256_broadcastsi128_si256(alpha_of_two()));
                let transparency = _mm256_slli_epi16::<3>(_mm256_sub_epi16(full, alpha));
                let more = _mm256_mulhrs_epi16(samples, transparency);
                _mm256_storeu_si256(place, _mm256_add_epi16(accumulated, more));
            }
        }
    }

    fn map(self, map: &ReflectanceMap) -> Cells {
        let mut cells = [[0; 4]; 6 * 64];
        for (index, cell) in cells.iter_mut().enumerate() {
            let [face, v, u] = [index / 64, index / 8 % 8, index % 8];
            *cell = [
                map.at(face, v, u),
                map.at(face, v, u + 1),
                map.at(face, v + 1, u),
                map.at(face, v + 1, u + 1),
            ];
        }
        Cells(cells)
    }

    #[inline(always)]
    unsafe fn reflectance(self, map: &Cells, face: __m256i, u: __m256i, v: __m256i) -> __m256i {
        let [u_cell, v_cell] = [self.shift_right::<5>(u), self.shift_right::<5>(v)];
        let row = self.add(self.shift_left::<6>(face), self.shift_left::<3>(v_cell));
        let [a, b, c, d] = quarters(self.add(row, u_cell));
        // SAFETY: faces are 0..=5 and cells 0..=7, by the caller's promise.
        let [first, second] = unsafe {
            [join(four_cells(map, a), four_cells(map, c)), join(four_cells(map, b), four_cells(map, d))]
        };
        let within = self.splat(31);
        let [u, v] = [self.and(u, within), self.and(v, within)];
        avx2!({
            // Bytes 32 - u and u, for both vertices of a row at once.
            let u = _mm256_add_epi16(_mm256_set1_epi16(32), _mm256_sub_epi16(_mm256_slli_epi16::<8>(u), u));
            let rows = [
                _mm256_maddubs_epi16(first, _mm256_unpacklo_epi16(u, u)),
                _mm256_maddubs_epi16(second, _mm256_unpackhi_epi16(u, u)),
            ];
            // A row of at most 8160 times 8 and a weight times 2^10: the high half is row times weight / 8.
            let behind = _mm256_slli_epi16::<10>(v);
            let here = _mm256_sub_epi16(_mm256_set1_epi16(i16::MIN), behind);
            let weights = [_mm256_unpacklo_epi16(here, behind), _mm256_unpackhi_epi16(here, behind)];
            let [first, second] = each!([0, 1], |half| {
                let products = self.multiply_high(self.shift_left::<3>(rows[half]), weights[half]);
                _mm256_madd_epi16(products, _mm256_set1_epi16(1))
            });
            let intensity = _mm256_packus_epi32(first, second);
            _mm256_add_epi16(intensity, _mm256_srli_epi16::<8>(intensity))
        })
    }

    fn factors(self, table: &[u8; 256]) -> Factors {
        Factors(table.map(crate::fixed::unity))
    }

    #[inline(always)]
    unsafe fn factor(self, table: &Factors, index: __m256i) -> __m256i {
        let mut found = Words([0; 16]);
        let quarters = quarters(index);
        for lane in 0..16 {
            let index = (quarters[lane / 4] >> (16 * (lane % 4))) as usize & 0xffff;
            // SAFETY: the caller promises that no index is greater than 255.
            found.0[lane] = unsafe { *table.0.get_unchecked(index) };
        }
        // SAFETY: the array is as long as a vector.
        unsafe { self.load(found.0.as_ptr()) }
    }

    #[inline(always)]
    unsafe fn load_transposed(self, format: VoxelFormat, from: *const u8, pitch: isize) -> [[u16; 16]; 16] {
        let mut rows = [self.splat(0); 16];
        for (row, words) in rows.iter_mut().enumerate() {
            // SAFETY: the caller's promise.
            *words = unsafe { self.load_voxels(format, from.offset(row.cast_signed() * pitch)) };
        }
        let rows = avx2!(transpose(rows));
        let mut square = [[0; 16]; 16];
        for (row, words) in square.iter_mut().zip(rows) {
            // SAFETY: a row is as long as a vector.
            unsafe { self.store(row.as_mut_ptr(), words) };
        }
        square
    }
}

/// The lanes of a vector, four to a word.
#[inline(always)]
fn quarters(words: __m256i) -> [u64; 4] {
    avx2!([
        opaque(_mm256_extract_epi64::<0>(words)),
        opaque(_mm256_extract_epi64::<1>(words)),
        opaque(_mm256_extract_epi64::<2>(words)),
        opaque(_mm256_extract_epi64::<3>(words)),
    ])
}

/// Where, in two rays of R, G, B and opacity, the bytes of each one's opacity lie, for all of its channels.
#[inline(always)]
pub(super) fn alpha_of_two() -> __m128i {
    avx2!(_mm_setr_epi8(6, 7, 6, 7, 6, 7, 6, 7, 14, 15, 14, 15, 14, 15, 14, 15))
}

/// A vector of two halves.
#[inline(always)]
pub(super) fn join(low: __m128i, high: __m128i) -> __m256i {
    avx2!(_mm256_inserti128_si256::<1>(_mm256_castsi128_si256(low), high))
}

/// The entries of a table at the two lowest of four indices.
///
/// # Safety
///
/// The table has these entries.
#[inline(always)]
pub(super) unsafe fn two_entries(table: *const u64, indices: u64) -> __m128i {
    // SAFETY: the caller's promise.
    unsafe {
        let [first, second] =
            [table.add(indices as usize & 0xffff), table.add((indices >> 16) as usize & 0xffff)];
        let first = _mm_castsi128_pd(_mm_loadl_epi64(first.cast()));
        _mm_castpd_si128(_mm_loadh_pd(first, second.cast()))
    }
}

/// The cells at four indices.
///
/// # Safety
///
/// There are such cells.
#[inline(always)]
unsafe fn four_cells(map: &Cells, indices: u64) -> __m128i {
    // SAFETY: the caller's promise; a cell is as long as an `i32`.
    unsafe {
        let cells = map.0.as_ptr();
        let [a, b, c, d] = each!([0, 16, 32, 48], |shift| {
            cells.add((indices >> shift) as usize & 0xffff).cast::<i32>().read_unaligned()
        });
        _mm_setr_epi32(a, b, c, d)
    }
}

/// Transposes 16 rows of 16 words: the quarters change places, then each is transposed.
#[inline]
#[target_feature(enable = "avx2")]
fn transpose(rows: [__m256i; 16]) -> [__m256i; 16] {
    let left = core::array::from_fn(|row| _mm256_permute2x128_si256::<0x20>(rows[row], rows[row + 8]));
    let right = core::array::from_fn(|row| _mm256_permute2x128_si256::<0x31>(rows[row], rows[row + 8]));
    let [left, right] = [transpose_quarters(left), transpose_quarters(right)];
    core::array::from_fn(|row| if row < 8 { left[row] } else { right[row - 8] })
}

/// Transposes the 8 rows of 8 words in each half of the vectors.
#[inline]
#[target_feature(enable = "avx2")]
fn transpose_quarters(rows: [__m256i; 8]) -> [__m256i; 8] {
    let [a, b, c, d, e, f, g, h] = rows;
    // Words of two rows, then pairs of words of four, then fours of words of all eight.
    let two = |a, b| [_mm256_unpacklo_epi16(a, b), _mm256_unpackhi_epi16(a, b)];
    let four = |a, b| [_mm256_unpacklo_epi32(a, b), _mm256_unpackhi_epi32(a, b)];
    let eight = |a, b| [_mm256_unpacklo_epi64(a, b), _mm256_unpackhi_epi64(a, b)];
    let [[ab, ab_high], [cd, cd_high]] = [two(a, b), two(c, d)];
    let [[ef, ef_high], [gh, gh_high]] = [two(e, f), two(g, h)];
    let [[first, second], [third, fourth]] = [four(ab, cd), four(ab_high, cd_high)];
    let [[first_below, second_below], [third_below, fourth_below]] = [four(ef, gh), four(ef_high, gh_high)];
    let [[a, b], [c, d]] = [eight(first, first_below), eight(second, second_below)];
    let [[e, f], [g, h]] = [eight(third, third_below), eight(fourth, fourth_below)];
    [a, b, c, d, e, f, g, h]
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
