//! Every operation at every level of this processor, lane by lane against its definition.

mod look_ups;
mod memory;

use super::{HALF, LANES, Level, Simd, Work};
use crate::stage::interpolate;

/// Where signs, carries and tables begin and end.
const EDGES: [u16; 24] = [
    0, 1, 2, 3, 63, 64, 127, 128, 255, 256, 4095, 4096, 0x3fff, 0x4000, 0x7fff, 0x8000, 0x8001, 0xbfff,
    0xc000, 0xff00, 0xff80, 0xffc0, 0xfffe, 0xffff,
];

/// Random words, the same ones for the same seed.
fn random(seed: u64) -> impl Iterator<Item = u16> {
    (1..).map(move |place: u64| {
        let mixed = (seed << 32 | place).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (mixed >> 40) as u16
    })
}

fn singles() -> Vec<[u16; 1]> {
    (0..=u16::MAX).map(|a| [a]).collect()
}

/// Every pair of edges, and every word with random ones on either side.
fn pairs() -> Vec<[u16; 2]> {
    let edges = EDGES.into_iter().flat_map(|a| EDGES.map(|b| [a, b]));
    let words = (0..=u16::MAX).zip(random(1)).flat_map(|(a, b)| [[a, b], [b, a]]);
    edges.chain(words).collect()
}

/// An operation and what it makes of a lane.
trait Operation<const N: usize> {
    fn vectors<S: Simd>(&self, simd: S, words: [S::Words; N]) -> S::Words;
    fn lane(&self, words: [u16; N]) -> u16;
}

/// Compares an operation with its definition.
struct Comparison<'a, const N: usize, O> {
    operation: &'a O,
    inputs: &'a [[u16; N]],
}

impl<const N: usize, O: Operation<N>> Work for Comparison<'_, N, O> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for inputs in self.inputs.chunks(LANES) {
            // Lanes behind the last input repeat the first.
            let mut lanes = inputs[0].map(|word| [word; LANES]);
            for (lane, input) in inputs.iter().enumerate() {
                for (words, word) in lanes.iter_mut().zip(input) {
                    words[lane] = *word;
                }
            }
            let mut words = [simd.splat(0); N];
            for (words, lanes) in words.iter_mut().zip(&lanes) {
                *words = load(simd, lanes);
            }
            let found = self::lanes(simd, self.operation.vectors(simd, words));
            for (lane, &input) in inputs.iter().enumerate() {
                assert_eq!(found[lane], self.operation.lane(input), "lane {lane}: {input:?}");
            }
        }
    }
}

/// Work at every level.
fn at_every_level<W: Work<Output = ()>>(work: impl Fn() -> W) {
    for level in Level::all() {
        println!("{}", level.name());
        level.run(work());
    }
}

fn compare<const N: usize>(inputs: &[[u16; N]], operation: &impl Operation<N>) {
    at_every_level(|| Comparison { operation, inputs });
}

/// Tests of operations: on which inputs, on vectors, and on a lane.
macro_rules! tests {
    ($($test:ident: $number:literal, $inputs:expr,
        |$simd:ident, $words:pat_param| $vectors:expr, |$word:pat_param| $lane:expr;)*) => {
        $(#[test]
        fn $test() {
            struct Tested;
            impl Operation<$number> for Tested {
                #[inline(always)]
                fn vectors<S: Simd>(&self, $simd: S, $words: [S::Words; $number]) -> S::Words {
                    $vectors
                }
                fn lane(&self, $word: [u16; $number]) -> u16 {
                    $lane
                }
            }
            compare(&$inputs, &Tested);
        })*
    };
}

fn signed(word: u16) -> i32 {
    i32::from(word.cast_signed())
}

fn wide(word: u16) -> u32 {
    u32::from(word)
}

tests! {
    add: 2, pairs(), |simd, [a, b]| simd.add(a, b), |[a, b]| a.wrapping_add(b);
    subtract: 2, pairs(), |simd, [a, b]| simd.subtract(a, b), |[a, b]| a.wrapping_sub(b);
    multiply_low: 2, pairs(), |simd, [a, b]| simd.multiply_low(a, b), |[a, b]| (wide(a) * wide(b)) as u16;
    multiply_high: 2, pairs(),
        |simd, [a, b]| simd.multiply_high(a, b), |[a, b]| ((wide(a) * wide(b)) >> 16) as u16;
    multiply_high_shifted: 2, pairs(),
        |simd, [a, b]| simd.multiply_high(simd.shift_left::<3>(a), simd.shift_left::<10>(b)),
        |[a, b]| ((wide(a << 3) * wide(b << 10)) >> 16) as u16;
    multiply_high_signed: 2, pairs(),
        |simd, [a, b]| simd.multiply_high_signed(a, b), |[a, b]| ((signed(a) * signed(b)) >> 16) as u16;
    multiply_round: 2, pairs().into_iter().filter(|pair| *pair != [0x8000; 2]).collect::<Vec<_>>(),
        |simd, [a, b]| simd.multiply_round(a, b), |[a, b]| ((signed(a) * signed(b) + (1 << 14)) >> 15) as u16;
    average: 2, pairs(), |simd, [a, b]| simd.average(a, b), |[a, b]| ((wide(a) + wide(b) + 1) >> 1) as u16;
    min: 2, pairs(), |simd, [a, b]| simd.min(a, b), |[a, b]| signed(a).min(signed(b)) as u16;
    max: 2, pairs(), |simd, [a, b]| simd.max(a, b), |[a, b]| signed(a).max(signed(b)) as u16;
    and: 2, pairs(), |simd, [a, b]| simd.and(a, b), |[a, b]| a & b;
    absolute: 1, singles(), |simd, [a]| simd.absolute(a), |[a]| signed(a).unsigned_abs() as u16;
    with_sign: 2, signs(),
        |simd, [a, b]| simd.with_sign(a, b), |[a, b]| (signed(a) * signed(b).signum()) as u16;
    greater: 2, pairs(),
        |simd, [a, b]| simd.select(simd.greater(a, b), a, b), |[a, b]| if signed(a) > signed(b) { a } else { b };
    equal: 2, pairs(),
        |simd, [a, b]| simd.select(simd.equal(a, b), simd.splat(-1), simd.splat(7)),
        |[a, b]| if a == b { 0xffff } else { 7 };
    both: 2, pairs(),
        |simd, [a, b]| {
            let masks = [simd.greater(a, simd.splat(-5)), simd.greater(simd.splat(1000), b)];
            simd.select(simd.both(masks[0], masks[1]), a, b)
        },
        |[a, b]| if signed(a) > -5 && signed(b) < 1000 { a } else { b };
    lerp: 3, interpolations(),
        |simd, [a, b, weight]| simd.lerp(a, b, weight),
        |[a, b, weight]| interpolate::lerp(a.into(), b.into(), i32::from(weight) / 128) as u16;
    square_root: 1, singles(), |simd, [a]| simd.square_root(a), |[a]| f64::from(a).sqrt().round() as u16;
    narrow: 1, smalls(), |simd, [a]| widen(simd, simd.narrow(a)), |[a]| a;
    narrow_keeps_signs: 1, singles(),
        |simd, [a]| widen(simd, simd.with_sign_small(sign(simd, a), simd.narrow(a))), |[a]| signed(a).signum() as u16;
    widen_high: 1, smalls(), |simd, [a]| simd.widen_high(simd.narrow(a)), |[a]| a << 8;
    add_small: 2, small_pairs(|sum| (-128..128).contains(&sum)),
        |simd, [a, b]| widen(simd, simd.add_small(simd.narrow(a), simd.narrow(b))), |[a, b]| a.wrapping_add(b);
    min_small: 2, small_pairs(|_| true),
        |simd, [a, b]| widen(simd, simd.min_small(simd.narrow(a), simd.narrow(b))),
        |[a, b]| signed(a).min(signed(b)) as u16;
    max_small: 2, small_pairs(|_| true),
        |simd, [a, b]| widen(simd, simd.max_small(simd.narrow(a), simd.narrow(b))),
        |[a, b]| signed(a).max(signed(b)) as u16;
    absolute_small: 1, smalls().split_off(1),
        |simd, [a]| widen(simd, simd.absolute_small(simd.narrow(a))), |[a]| signed(a).unsigned_abs() as u16;
    with_sign_small: 2,
        signs().into_iter().filter(|[magnitude, _]| *magnitude < 128).collect::<Vec<_>>(),
        |simd, [a, b]| widen(simd, simd.with_sign_small(simd.narrow(a), simd.narrow(b))),
        |[a, b]| (signed(a) * signed(b).signum()) as u16;
    greater_small: 2, small_pairs(|_| true),
        |simd, [a, b]| {
            let [a, b] = [simd.narrow(a), simd.narrow(b)];
            widen(simd, simd.select_small(simd.greater_small(a, b), a, b))
        },
        |[a, b]| signed(a).max(signed(b)) as u16;
    both_small: 2, small_pairs(|_| true),
        |simd, [a, b]| {
            let [a, b] = [simd.narrow(a), simd.narrow(b)];
            let [low, high] = [simd.splat_small(-5), simd.splat_small(100)];
            let masks = [simd.greater_small(a, low), simd.greater_small(high, b)];
            widen(simd, simd.select_small(simd.both_small(masks[0], masks[1]), a, b))
        },
        |[a, b]| if signed(a) > -5 && signed(b) < 100 { a } else { b };
    with_signs: 3, signs().into_iter().flat_map(|[a, b]| [3, 0xfff0].map(|c| [a, b, c])).collect::<Vec<_>>(),
        |simd, [a, b, c]| simd.with_signs(a, [b, c]),
        |[a, b, c]| (signed(a) * signed(b).signum() * signed(c).signum()) as u16;
    reciprocal_of_gradient: 1, (1..=127).map(|a| [a]).collect::<Vec<_>>(),
        |simd, [a]| simd.reciprocal_of_gradient(simd.narrow(a)), |[a]| (14336.0 / f64::from(a)).round() as u16;
    reciprocal_seed: 1, (3584..=18943).map(|a| [a]).collect::<Vec<_>>(),
        |simd, [a]| simd.reciprocal_seed(a), |[a]| (134_217_728.0 / f64::from(a & 0xff00 | 0x80)).round() as u16;
}

/// Small numbers as words.
#[inline(always)]
fn widen<S: Simd>(simd: S, small: S::Small) -> S::Words {
    simd.shift_right_signed::<8>(simd.widen_high(small))
}

/// 1 where a word has a sign that can be given to something, 0 for 0.
#[inline(always)]
fn sign<S: Simd>(simd: S, words: S::Words) -> S::Small {
    let zero = simd.equal(words, simd.splat(0));
    simd.narrow(simd.select(zero, simd.splat(0), simd.splat(1)))
}

/// All small numbers.
fn smalls() -> Vec<[u16; 1]> {
    (-128..128).map(|number: i16| [number.cast_unsigned()]).collect()
}

/// All pairs of small numbers with such a sum.
fn small_pairs(wanted: impl Fn(i32) -> bool) -> Vec<[u16; 2]> {
    let all = smalls().into_iter().flat_map(|[a]| smalls().into_iter().map(move |[b]| [a, b]));
    all.filter(|[a, b]| wanted(signed(*a) + signed(*b))).collect()
}

/// Every magnitude, with signs that it may be given.
fn signs() -> Vec<[u16; 2]> {
    let all = (0..=u16::MAX).flat_map(|magnitude| EDGES.map(|sign| [magnitude, sign]));
    all.filter(|[magnitude, sign]| *magnitude == 0 || *sign != 0).collect()
}

/// Random values with guard bits, and every weight, in the vector's format.
fn interpolations() -> Vec<[u16; 3]> {
    let words: Vec<_> = random(2).map(|word| word % 32761).take(1 << 17).collect();
    let inside = words.as_chunks::<2>().0.iter().zip((0..=255).cycle());
    let edges = [[0, 32760], [32760, 0], [32759, 32760]]
        .into_iter()
        .flat_map(|ends| (0..=255).map(move |w| (ends, w)));
    inside.map(|(&ends, w)| (ends, w)).chain(edges).map(|([a, b], w)| [a, b, w * 128]).collect()
}

/// Shifts of the three kinds.
struct Shift<const BITS: i32>(usize);

impl<const BITS: i32> Operation<1> for Shift<BITS> {
    #[inline(always)]
    fn vectors<S: Simd>(&self, simd: S, [a]: [S::Words; 1]) -> S::Words {
        match self.0 {
            0 => simd.shift_left::<BITS>(a),
            1 => simd.shift_right::<BITS>(a),
            _ => simd.shift_right_signed::<BITS>(a),
        }
    }

    fn lane(&self, [a]: [u16; 1]) -> u16 {
        match self.0 {
            0 => a << BITS,
            1 => a >> BITS,
            _ => (a.cast_signed() >> BITS).cast_unsigned(),
        }
    }
}

#[test]
fn shifts() {
    fn by<const BITS: i32>() {
        (0..3).for_each(|kind| compare(&singles(), &Shift::<BITS>(kind)));
    }
    let all: [fn(); 15] = [
        by::<1>, by::<2>, by::<3>, by::<4>, by::<5>, by::<6>, by::<7>, by::<8>, by::<9>, by::<10>, by::<11>,
        by::<12>, by::<13>, by::<14>, by::<15>,
    ];
    all.iter().for_each(|shift| shift());
}

/// Work that is one function of the level's operations.
macro_rules! work {
    ($test:ident, |$simd:ident| $body:expr) => {
        #[test]
        fn $test() {
            struct Tested;
            impl Work for Tested {
                type Output = ();

                #[inline(always)]
                fn run<S: Simd>(self, $simd: S) {
                    $body
                }
            }
            at_every_level(|| Tested);
        }
    };
}
use work;

/// A vector of lanes.
#[inline(always)]
fn load<S: Simd>(simd: S, lanes: &[u16; LANES]) -> S::Words {
    // SAFETY: as many as in a vector.
    unsafe { simd.load([lanes.as_ptr(), lanes.as_ptr().add(HALF)]) }
}

/// The lanes of a vector.
#[inline(always)]
fn lanes<S: Simd>(simd: S, words: S::Words) -> [u16; LANES] {
    let mut lanes = [0; LANES];
    let start = lanes.as_mut_ptr();
    // SAFETY: as many as in a vector.
    unsafe { simd.store([start, start.add(HALF)], words) };
    lanes
}

work!(constants, |simd| {
    simd.prefetch(core::ptr::null());
    let halves = lanes(simd, simd.halves([-3, 7]));
    assert!(halves[..HALF].iter().all(|lane| lane.cast_signed() == -3));
    assert!(halves[HALF..].iter().all(|lane| *lane == 7));
    assert_eq!(lanes(simd, simd.count()), core::array::from_fn(|lane| lane as u16));
    for edge in EDGES {
        assert_eq!(lanes(simd, simd.splat(edge.cast_signed())), [edge; LANES]);
    }
});

work!(any_lane_counts, |simd| {
    assert!(!simd.any(simd.greater(simd.splat(0), simd.splat(0))));
    for lane in 0..LANES {
        let mask = simd.equal(simd.count(), simd.splat(lane as i16));
        assert!(simd.any(mask), "{lane}");
        assert_eq!(simd.bits(mask), 1 << lane);
        let expected = core::array::from_fn(|place| u16::from(place == lane));
        assert_eq!(lanes(simd, simd.select(mask, simd.splat(1), simd.splat(0))), expected);
    }
});
