//! 64 lanes with AVX2, in four registers: operations on one do not wait for those on the others. There are no byte
//! permutations over whole tables, so tables are looked up word by word.

use super::{DARK, HALF, Simd, Work, each, opaque, small_numbers_are_words};
use crate::fixed::FULL;
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

/// Cells of the six faces, 8 x 8 with the last row and column replicated, and of the dark one: each a 2 x 2
/// neighbourhood of vertices, (v, u), (v, u + 1), (v + 1, u), (v + 1, u + 1).
#[derive(Debug)]
pub struct Cells([[u8; 4]; 7 * 64]);

/// Factors widened to U0.15.
#[derive(Debug)]
pub struct Factors([u16; 256]);

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
        let mut cells = [[0; 4]; 7 * 64];
        for (index, cell) in cells.iter_mut().enumerate().take(DARK as usize * 64) {
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
    unsafe fn load_transposed(self, format: VoxelFormat, from: *const u8, pitch: isize) -> [[u16; 16]; 32] {
        let mut halves = [[avx2!(_mm256_setzero_si256()); 16]; 2];
        let [low, high] = &mut halves;
        for (row, (low, high)) in low.iter_mut().zip(high).enumerate() {
            // SAFETY: the caller's promise.
            unsafe {
                let from = from.offset(row.cast_signed() * pitch);
                *low = load_16_voxels(format, from);
                *high = load_16_voxels(format, from.add(16 * format.bytes()));
            }
        }
        let mut rows = [[0_u16; 16]; 32];
        let [low, high] = halves;
        let transposed = avx2!([transpose(low), transpose(high)]);
        for (row, words) in rows.iter_mut().zip(transposed.as_flattened()) {
            // SAFETY: a row is as long as a register.
            unsafe { _mm256_storeu_si256(row.as_mut_ptr().cast(), *words) };
        }
        rows
    }
}

/// R, G, B and opacity of sample values.
///
/// # Safety
///
/// The table has entries for all values.
#[inline(always)]
unsafe fn classify(table: *const u64, values: __m256i) -> [__m256i; 4] {
    let [a, b, c, d] = quarters(values);
    // Samples 2 i and 2 i + 1 in the lower half, those eight behind them in the upper one.
    // SAFETY: the caller's promise.
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

/// Blends samples into as many rays of four words.
///
/// # Safety
///
/// The table has entries for all values, and the rays can be read and written.
#[inline(always)]
unsafe fn blend_entries(table: *const u64, values: __m256i, rays: *mut u16) {
    for (quarter, indices) in quarters(values).into_iter().enumerate() {
        // SAFETY: the caller's promise.
        unsafe {
            let full = _mm256_set1_epi16(FULL as i16);
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

/// The lanes of a register, four to a word.
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

/// The intensities at places within cells, 0..=31 along u and v.
///
/// # Safety
///
/// There are such cells.
#[inline(always)]
unsafe fn between(map: &Cells, cells: __m256i, u: __m256i, v: __m256i) -> __m256i {
    let [a, b, c, d] = quarters(cells);
    // SAFETY: the caller's promise.
    let [first, second] = unsafe {
        [join(four_cells(map, a), four_cells(map, c)), join(four_cells(map, b), four_cells(map, d))]
    };
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
            let products = high_half(_mm256_slli_epi16::<3>(rows[half]), weights[half]);
            _mm256_madd_epi16(products, _mm256_set1_epi16(1))
        });
        let intensity = _mm256_packus_epi32(first, second);
        _mm256_add_epi16(intensity, _mm256_srli_epi16::<8>(intensity))
    })
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
