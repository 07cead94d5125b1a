//! Transposition of voxels.

use crate::optimised::simd::eights::transpose_eights;
use crate::optimised::simd::{Square, each};
use core::arch::x86_64::*;

/// Transposes a square: 8 words of 8 rows each, then these squares of eight.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
pub fn transpose(square: &mut Square) {
    for eight in 0..4 {
        let rows = each!([0, 1, 2, 3, 4, 5, 6, 7], |row| load(square, 8 * eight + row));
        let columns = transpose_eights(rows);
        for (row, words) in columns.into_iter().enumerate() {
            store(square, 8 * eight + row, words);
        }
    }
    // Row 8 i + j has column 8 k + j of rows 8 i..8 i + 8 as its k-th eight.
    for row in 0..8 {
        let rows = each!([0, 8, 16, 24], |eight| load(square, eight + row));
        for (eight, words) in transpose_quarters(rows).into_iter().enumerate() {
            store(square, 8 * eight + row, words);
        }
    }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn load(square: &Square, row: usize) -> __m512i {
    // SAFETY: a row is as long as a register, and lies at a multiple of that length.
    unsafe { _mm512_load_si512(square.rows[row].as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn store(square: &mut Square, row: usize, words: __m512i) {
    // SAFETY: as in `load`.
    unsafe { _mm512_store_si512(square.rows[row].as_mut_ptr().cast(), words) };
}

transpose_eights!(
    "avx512f,avx512bw",
    __m512i,
    [_mm512_unpacklo_epi16, _mm512_unpackhi_epi16],
    [_mm512_unpacklo_epi32, _mm512_unpackhi_epi32],
    [_mm512_unpacklo_epi64, _mm512_unpackhi_epi64]
);

/// Transposes 4 rows of quarters.
#[inline]
#[target_feature(enable = "avx512f")]
fn transpose_quarters([a, b, c, d]: [__m512i; 4]) -> [__m512i; 4] {
    let halves = |a, b| [_mm512_shuffle_i64x2::<0x44>(a, b), _mm512_shuffle_i64x2::<0xee>(a, b)];
    let columns = |a, b| [_mm512_shuffle_i64x2::<0x88>(a, b), _mm512_shuffle_i64x2::<0xdd>(a, b)];
    let [[ab, ab_high], [cd, cd_high]] = [halves(a, b), halves(c, d)];
    let [[first, second], [third, fourth]] = [columns(ab, cd), columns(ab_high, cd_high)];
    [first, second, third, fourth]
}
