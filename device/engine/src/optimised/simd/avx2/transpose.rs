//! Transposition of voxels.

use crate::optimised::simd::Square;
use crate::optimised::simd::eights::transpose_eights;
use core::arch::x86_64::*;

/// Transposes a square: the quarters beside the diagonal change places, then each is transposed.
#[inline]
#[target_feature(enable = "avx2")]
pub fn transpose(square: &mut Square) {
    for (row, column) in [(0, 0), (16, 16)] {
        let quarter = transpose_16(load_16(square, row, column));
        store_16(square, row, column, quarter);
    }
    let [right, left] = [load_16(square, 0, 16), load_16(square, 16, 0)];
    store_16(square, 16, 0, transpose_16(right));
    store_16(square, 0, 16, transpose_16(left));
}

/// 16 words of each of 16 rows of a square; both start at multiples of 16.
#[inline]
#[target_feature(enable = "avx2")]
fn load_16(square: &Square, row: usize, column: usize) -> [__m256i; 16] {
    let mut rows = [_mm256_setzero_si256(); 16];
    for (register, words) in rows.iter_mut().zip(&square.rows[row..row + 16]) {
        // SAFETY: 16 words from there lie in the row, at a multiple of their length.
        *register = unsafe { _mm256_load_si256(words[column..column + 16].as_ptr().cast()) };
    }
    rows
}

/// Writes 16 words to each of 16 rows of a square.
#[inline]
#[target_feature(enable = "avx2")]
fn store_16(square: &mut Square, row: usize, column: usize, rows: [__m256i; 16]) {
    for (register, words) in rows.into_iter().zip(&mut square.rows[row..row + 16]) {
        // SAFETY: as in `load_16`.
        unsafe { _mm256_store_si256(words[column..column + 16].as_mut_ptr().cast(), register) };
    }
}

/// Transposes 16 rows of 16 words: the quarters change places, then each is transposed.
#[inline]
#[target_feature(enable = "avx2")]
fn transpose_16(rows: [__m256i; 16]) -> [__m256i; 16] {
    let left = core::array::from_fn(|row| _mm256_permute2x128_si256::<0x20>(rows[row], rows[row + 8]));
    let right = core::array::from_fn(|row| _mm256_permute2x128_si256::<0x31>(rows[row], rows[row + 8]));
    let [left, right] = [transpose_eights(left), transpose_eights(right)];
    core::array::from_fn(|row| if row < 8 { left[row] } else { right[row - 8] })
}

transpose_eights!(
    "avx2",
    __m256i,
    [_mm256_unpacklo_epi16, _mm256_unpackhi_epi16],
    [_mm256_unpacklo_epi32, _mm256_unpackhi_epi32],
    [_mm256_unpacklo_epi64, _mm256_unpackhi_epi64]
);
