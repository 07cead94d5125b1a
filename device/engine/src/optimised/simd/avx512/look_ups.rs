//! Tables of a frame in the forms that AVX-512 looks up.

use super::Words;
use crate::fixed::FULL;
use crate::optimised::reciprocal::{GRADIENT, SEED};
use crate::optimised::simd::avx2::{alpha_of_two, join, two_entries};
use crate::optimised::simd::{DARK, each, opaque};
use crate::optimised::tables::ReflectanceMap;
use core::arch::x86_64::*;
use core::array::from_fn;

/// 128 bytes, a table for one permutation.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Bytes([u8; 128]);

/// A reflectance map by the parity of v and u: of any 2 x 2 vertices each lies in another of the four tables, at
/// 16 face + 4 (v / 2) + u / 2. The dark face is 0.
#[derive(Debug)]
pub struct Parities(pub [[Bytes; 2]; 2]);

/// Factors as they are: 0..=127 and 128..=255.
#[derive(Debug)]
pub struct Factors(pub [Bytes; 2]);

/// Words of a table for one permutation.
#[repr(C, align(64))]
struct Words64([u16; 64]);

static SEEDS: Words64 = Words64(SEED);

/// The lower bytes of reciprocals, and the upper ones.
pub static GRADIENTS: [Bytes; 2] = {
    let mut bytes = [Bytes([0; 128]), Bytes([0; 128])];
    let mut at = 0;
    while at < 128 {
        [bytes[0].0[at], bytes[1].0[at]] = GRADIENT[at].to_le_bytes();
        at += 1;
    }
    bytes
};

impl Parities {
    /// For a map.
    // Once for a tile: not worth unrolling for each specialisation.
    #[inline(never)]
    pub fn new(map: &ReflectanceMap) -> Self {
        let table = |v_parity: usize, u_parity: usize| {
            let mut bytes = [0; 128];
            for (index, byte) in bytes.iter_mut().enumerate().take(DARK as usize * 16) {
                let [face, v, u] = [index / 16, index / 4 % 4, index % 4];
                *byte = map.at(face, 2 * v + v_parity, 2 * u + u_parity);
            }
            Bytes(bytes)
        };
        Self([[table(0, 0), table(0, 1)], [table(1, 0), table(1, 1)]])
    }
}

impl Factors {
    /// For a table.
    pub fn new(table: &[u8; 256]) -> Self {
        Self([0, 128].map(|at| Bytes(from_fn(|byte| table[at + byte]))))
    }
}

/// A reciprocal's seed for each word, by its lower six bits.
#[inline(always)]
pub fn seeds(index: __m512i) -> __m512i {
    avx512!({
        let [low, high] = each!([0, 32], |at| _mm512_load_si512(SEEDS.0.as_ptr().add(at).cast()));
        _mm512_permutex2var_epi16(low, index, high)
    })
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

/// R, G, B and opacity of sample values.
///
/// # Safety
///
/// The table has entries for all values.
#[inline(always)]
pub unsafe fn classify(table: *const u64, values: __m512i) -> [__m512i; 4] {
    let quarters = quarters(values);
    // Samples 2 i and 2 i + 1 in the first quarter, those 8, 16 and 24 behind them in the others.
    // SAFETY: the caller's promise.
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

/// Blends samples into as many rays of four words.
///
/// # Safety
///
/// The table has entries for all values, and the rays can be read and written.
#[inline(always)]
pub unsafe fn blend_entries(table: *const u64, values: __m512i, rays: *mut u16) {
    for (quarter, [low, high]) in quarters(values).into_iter().enumerate() {
        // SAFETY: the caller's promise.
        unsafe {
            let full = _mm512_set1_epi16(FULL as i16);
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

/// The lanes of a register, four to a word, two words for each quarter.
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

/// Bytes of a table, by the lower seven bits of each byte.
#[inline(always)]
pub fn bytes_at(table: &Bytes, index: __m512i) -> __m512i {
    avx512!({
        let [low, high] = each!([0, 64], |at| _mm512_load_si512(table.0.as_ptr().add(at).cast()));
        _mm512_permutex2var_epi8(low, index, high)
    })
}

/// The bytes of two vectors in turn, as the words that they were narrowed from.
#[inline(always)]
pub fn interleave(lower: __m512i, upper: __m512i) -> Words {
    avx512!([_mm512_unpacklo_epi8(lower, upper), _mm512_unpackhi_epi8(lower, upper)])
}

/// Two vertices along an axis, an even and an odd one.
pub struct Vertices {
    /// Coordinates, of which a pair of vertices spans 64.
    places: [__m512i; 2],
    /// Their weights, of 32 in all.
    pub weights: [__m512i; 2],
}

impl Vertices {
    /// Those around a coordinate of 0..=224 without sign, the even one first.
    #[inline(always)]
    pub fn around(coordinate: __m512i) -> Self {
        avx512!({
            let half = _mm512_set1_epi8(32);
            let within = _mm512_and_si512(coordinate, _mm512_set1_epi8(63));
            let even = _mm512_abs_epi8(_mm512_sub_epi8(within, half));
            Self {
                places: [_mm512_add_epi8(coordinate, half), coordinate],
                weights: [even, _mm512_sub_epi8(half, even)],
            }
        })
    }

    /// The pair that each vertex belongs to, in `bits` of each byte.
    #[inline(always)]
    pub fn pairs<const RIGHT: u32>(&self, bits: i8) -> [__m512i; 2] {
        each!([self.places[0], self.places[1]], |place| avx512!(_mm512_and_si512(
            _mm512_srli_epi16::<RIGHT>(place),
            _mm512_set1_epi8(bits)
        )))
    }
}
