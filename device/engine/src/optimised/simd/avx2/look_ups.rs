//! Tables of a frame in the forms that AVX2 looks up, word by word.

use super::high_half;
use crate::fixed::FULL;
use crate::optimised::simd::{DARK, each, opaque};
use crate::optimised::tables::ReflectanceMap;
use core::arch::x86_64::*;

/// Cells of the six faces, 8 x 8 with the last row and column replicated, and of the dark one: each a 2 x 2
/// neighbourhood of vertices, (v, u), (v, u + 1), (v + 1, u), (v + 1, u + 1).
#[derive(Debug)]
pub struct Cells([[u8; 4]; 7 * 64]);

/// Factors widened to U0.15.
#[derive(Debug)]
pub struct Factors(pub [u16; 256]);

impl Cells {
    /// For a map.
    pub fn new(map: &ReflectanceMap) -> Self {
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
        Self(cells)
    }
}

/// R, G, B and opacity of sample values.
///
/// # Safety
///
/// The table has entries for all values.
#[inline(always)]
pub unsafe fn classify(table: *const u64, values: __m256i) -> [__m256i; 4] {
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
pub unsafe fn blend_entries(table: *const u64, values: __m256i, rays: *mut u16) {
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
pub fn quarters(words: __m256i) -> [u64; 4] {
    avx2!([
        opaque(_mm256_extract_epi64::<0>(words)),
        opaque(_mm256_extract_epi64::<1>(words)),
        opaque(_mm256_extract_epi64::<2>(words)),
        opaque(_mm256_extract_epi64::<3>(words)),
    ])
}

/// Where, in two rays of R, G, B and opacity, the bytes of each one's opacity lie, for all of its channels.
#[inline(always)]
pub fn alpha_of_two() -> __m128i {
    avx2!(_mm_setr_epi8(6, 7, 6, 7, 6, 7, 6, 7, 14, 15, 14, 15, 14, 15, 14, 15))
}

/// A vector of two halves.
#[inline(always)]
pub fn join(low: __m128i, high: __m128i) -> __m256i {
    avx2!(_mm256_inserti128_si256::<1>(_mm256_castsi128_si256(low), high))
}

/// The entries of a table at the two lowest of four indices.
///
/// # Safety
///
/// The table has these entries.
#[inline(always)]
pub unsafe fn two_entries(table: *const u64, indices: u64) -> __m128i {
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
pub unsafe fn between(map: &Cells, cells: __m256i, u: __m256i, v: __m256i) -> __m256i {
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
