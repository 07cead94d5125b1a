//! Transposition of voxels.

use crate::optimised::simd::Square;
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
