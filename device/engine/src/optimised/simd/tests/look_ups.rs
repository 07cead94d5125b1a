//! Operations that look tables up.

use super::{Operation, at_every_level, compare, load, random, work};
use crate::fixed::{FULL, product, unity};
use crate::optimised::simd::{DARK, HALF, LANES, Simd, Work};
use crate::optimised::tables::{Classification, ReflectanceMap};
use crate::stage::reflectance::{HALF_FACE, look_up};
use crate::tables::Tables;
use core::array::from_fn;
use vg500_regs::limit::REFLECTANCE_ENTRIES;
use vg500_regs::reflectance::FACE;

/// Random tables, and the classification of which colours are multiplied by opacities or not.
fn tables(premultiplied: bool) -> (Tables, Box<Classification>) {
    let mut tables = Tables::empty();
    let mut words = random(6).map(|word| if word & 0x7000 == 0 { FULL } else { word & FULL });
    for (color, alpha) in tables.color.iter_mut().zip(&mut tables.opacity) {
        *color = from_fn(|_| words.next().unwrap());
        *alpha = words.next().unwrap();
    }
    if premultiplied {
        for (color, alpha) in tables.color.iter_mut().zip(&tables.opacity) {
            *color = color.map(|channel| product(channel, *alpha));
        }
    }
    let classification = Classification::new(&tables, |color, _| color);
    (tables, classification)
}

/// The entry of a sample value.
fn entry(tables: &Tables, value: u16) -> [u16; 4] {
    let place = usize::from(value);
    match (tables.color.get(place), tables.opacity.get(place)) {
        (Some(&[r, g, b]), Some(&alpha)) => [r, g, b, alpha],
        _ => [0; 4],
    }
}

/// Every value in order, and random ones.
fn values() -> impl Iterator<Item = u16> {
    let last = Classification::TRANSPARENT;
    (0..=last).chain(random(7).map(move |word| word % (last + 1)).take(20_000))
}

struct Classify<'a> {
    tables: &'a (Tables, Box<Classification>),
    channel: usize,
}

impl Operation<1> for Classify<'_> {
    #[inline(always)]
    fn vectors<S: Simd>(&self, simd: S, [values]: [S::Words; 1]) -> S::Words {
        // SAFETY: `values` are none but these.
        unsafe { simd.classify(&self.tables.1, values)[self.channel] }
    }

    fn lane(&self, [value]: [u16; 1]) -> u16 {
        entry(&self.tables.0, value)[self.channel]
    }
}

#[test]
fn classification() {
    let tables = tables(false);
    let values: Vec<_> = values().map(|value| [value]).collect();
    (0..4).for_each(|channel| compare(&values, &Classify { tables: &tables, channel }));
}

work!(blending_of_entries, |simd| {
    let (tables, classification) = tables(true);
    let values: Vec<_> = values().collect();
    let mut words = random(8);
    for values in values.as_chunks::<LANES>().0 {
        // Accumulated colours are not greater than opacities.
        let before: Vec<[u16; 4]> = values
            .iter()
            .map(|_| {
                let alpha = words.next().unwrap() % 4097;
                let alpha = alpha.min(FULL);
                [product(words.next().unwrap() & FULL, alpha), alpha, product(FULL, alpha), alpha]
            })
            .collect();
        let mut rays = before.clone();
        // SAFETY: there are as many values and rays as lanes.
        unsafe {
            let first = rays.as_mut_ptr().cast::<u16>();
            simd.blend_entries(&classification, load(simd, values), [first, first.add(4 * HALF)]);
        }
        for (lane, ray) in rays.into_iter().enumerate() {
            let [entry, before] = [entry(&tables, values[lane]), before[lane]];
            let expected = from_fn(|at| before[at] + product(entry[at], FULL - before[3]));
            assert_eq!(ray, expected, "{lane}: {before:?} {entry:?}");
        }
    }
});

struct Reflectance(ReflectanceMap);

impl Operation<3> for Reflectance {
    #[inline(always)]
    fn vectors<S: Simd>(&self, simd: S, [face, u, v]: [S::Words; 3]) -> S::Words {
        let map = simd.map(&self.0);
        let half = simd.splat(HALF_FACE as i16);
        let [u, v] = [simd.narrow(simd.subtract(u, half)), simd.narrow(simd.subtract(v, half))];
        // SAFETY: the inputs are none but the allowed ones.
        unsafe { simd.reflectance(&map, simd.narrow(face), u, v) }
    }

    /// Looks the face up as face +z, to which all of its edges belong.
    fn lane(&self, [face, u, v]: [u16; 3]) -> u16 {
        if face == DARK as u16 {
            return 0;
        }
        let mut map = [0; REFLECTANCE_ENTRIES];
        let place = usize::from(face) * FACE;
        map[4 * FACE..5 * FACE].copy_from_slice(&self.0.0[place..place + FACE]);
        look_up(&map, [i32::from(u) - HALF_FACE, i32::from(v) - HALF_FACE, HALF_FACE])
    }
}

#[test]
fn reflectance_in_all_directions() {
    let directions = || {
        (0..=DARK as u16).flat_map(|face| (0..=224).flat_map(move |v| (0..=224).map(move |u| [face, u, v])))
    };
    let inputs: Vec<_> = directions().collect();
    let bytes: Vec<_> = random(9).map(|word| word as u8).take(REFLECTANCE_ENTRIES).collect();
    compare(&inputs, &Reflectance(ReflectanceMap(bytes.try_into().unwrap())));
    compare(&inputs, &Reflectance(ReflectanceMap([255; REFLECTANCE_ENTRIES])));
    // Lanes look different faces up.
    let mut words = random(10);
    let mixed = directions().map(|[_, u, v]| [words.next().unwrap() % 7, u, v]);
    let bytes = from_fn(|entry| if entry % 3 == 0 { 255 } else { entry as u8 });
    compare(&mixed.collect::<Vec<_>>(), &Reflectance(ReflectanceMap(bytes)));
}

struct Factors([u8; 256]);

impl Operation<1> for Factors {
    #[inline(always)]
    fn vectors<S: Simd>(&self, simd: S, [index]: [S::Words; 1]) -> S::Words {
        let table = simd.factors(&self.0);
        // SAFETY: the inputs are none but the allowed ones.
        unsafe { simd.factor(&table, index) }
    }

    fn lane(&self, [index]: [u16; 1]) -> u16 {
        unity(self.0[usize::from(index)])
    }
}

#[test]
fn factors() {
    let ordered = (0..256).map(|index| [index]);
    let inputs: Vec<_> = ordered.chain(random(11).map(|word| [word % 256]).take(4096)).collect();
    compare(&inputs, &Factors(from_fn(|index| index as u8)));
    compare(&inputs, &Factors(from_fn(|index| 255 - (index * 7) as u8)));
}
