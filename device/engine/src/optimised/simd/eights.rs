//! Transposition of squares of 8 words, the same network for registers of any length.

/// A function `transpose_eights`, which transposes the 8 rows of 8 words in each 128 bits of registers: from a level's
/// instructions that interleave words, pairs of words and fours of words of the lower and upper halves of 128 bits.
macro_rules! transpose_eights {
    ($features:literal, $register:ty, [$words:ident, $words_high:ident], [$pairs:ident, $pairs_high:ident], [$fours:ident, $fours_high:ident]) => {
        #[inline]
        #[target_feature(enable = $features)]
        fn transpose_eights(rows: [$register; 8]) -> [$register; 8] {
            let [a, b, c, d, e, f, g, h] = rows;
            // Words of two rows, then pairs of words of four, then fours of words of all eight.
            let two = |a, b| [$words(a, b), $words_high(a, b)];
            let four = |a, b| [$pairs(a, b), $pairs_high(a, b)];
            let eight = |a, b| [$fours(a, b), $fours_high(a, b)];
            let [[ab, ab_high], [cd, cd_high]] = [two(a, b), two(c, d)];
            let [[ef, ef_high], [gh, gh_high]] = [two(e, f), two(g, h)];
            let [[first, second], [third, fourth]] = [four(ab, cd), four(ab_high, cd_high)];
            let [[first_below, second_below], [third_below, fourth_below]] =
                [four(ef, gh), four(ef_high, gh_high)];
            let [[a, b], [c, d]] = [eight(first, first_below), eight(second, second_below)];
            let [[e, f], [g, h]] = [eight(third, third_below), eight(fourth, fourth_below)];
            [a, b, c, d, e, f, g, h]
        }
    };
}
pub(super) use transpose_eights;
