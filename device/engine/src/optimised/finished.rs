//! Rays that no sample can change any more.
//!
//! A sample adds (x (4095 - A) + 2048) >> 12 to a channel, x at most its opacity: nothing as soon as
//! (4095 - A) a < 2048 for the greatest opacity a that is still to come.

use super::accumulators::Accumulators;
use super::cells::{CELL, Cells};
use super::simd::{LANES, Simd};
use crate::fixed::FULL;
use vg500_regs::limit::BASE_PLANE_SIZE;

/// Bits before the first ray and behind the last one: cells may begin and end beside the base plane.
const MARGIN: usize = 64;
const WORDS: usize = (MARGIN + BASE_PLANE_SIZE as usize + MARGIN) / 64;

/// The opacity at which a ray is finished, if none of its samples is more opaque than `most`.
#[must_use]
pub const fn finishing_opacity(most: u16) -> u16 {
    match 2047u16.checked_div(most) {
        Some(transparency) if transparency < FULL => FULL - transparency,
        _ => 0,
    }
}

/// Whether a ray that begins empty can be finished by `samples` samples of an opacity of at most `most`.
#[must_use]
pub fn can_finish(most: u16, samples: usize) -> bool {
    let limit = finishing_opacity(most);
    let mut opacity = 0;
    for _ in 0..samples {
        let more = crate::fixed::product(most, FULL - opacity);
        opacity += more;
        if opacity >= limit || more == 0 {
            break;
        }
    }
    opacity >= limit
}

/// Which rays of a row are finished.
#[derive(Clone, Debug)]
struct Row {
    /// A bit for each ray.
    rays: [u64; WORDS],
    /// Whether any ray of the row is.
    any: bool,
    /// A bit for every eighth ray: whether it and those behind it are, as many as a cell has.
    cells: u128,
    /// Likewise with the eight behind these.
    longer_cells: u128,
}

impl Row {
    /// Gathers what is asked for slice by slice.
    fn gather(&mut self) {
        let mut eights = 0u128;
        for (place, word) in self.rays.iter().enumerate() {
            eights |= u128::from(full_bytes(*word)) << (8 * place);
        }
        self.cells = eights & eights >> 1 & eights >> 2 & eights >> 3;
        self.longer_cells = self.cells & eights >> 4;
    }
}

/// A bit for each byte of a word: whether all bits of it are set.
#[inline(always)]
const fn full_bytes(word: u64) -> u8 {
    let fours = word & word >> 4;
    let pairs = fours & fours >> 2;
    let full = pairs & pairs >> 1 & 0x0101_0101_0101_0101;
    // The lowest bit of byte n goes to bit 56 + n: no two of the products are of one bit, so nothing carries.
    (full.wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8
}

/// Which rays of a tile are finished.
#[derive(Clone, Debug, Default)]
pub struct Finished {
    rows: Vec<Row>,
    columns: usize,
    limit: u16,
    /// Slices until rays are looked at again.
    wait: u32,
    /// Slices between looks: more while no ray finishes.
    interval: u32,
    /// The least of these.
    shortest: u32,
}

/// The most slices between looks at the rays.
const LONGEST: u32 = 32;

impl Finished {
    /// No ray is known to be finished of `rows` rows of `columns` rays, which are when their opacity is `limit`. At
    /// least every `shortest` slices, while rays finish, they are looked at.
    pub fn begin(&mut self, rows: usize, columns: usize, limit: u16, shortest: u32) {
        // What lies beside the base plane is nothing to wait for.
        let mut rays = [u64::MAX; WORDS];
        (MARGIN..MARGIN + columns).for_each(|at| rays[at / 64] &= !(1 << (at % 64)));
        self.rows.clear();
        let mut row = Row { rays, any: false, cells: 0, longer_cells: 0 };
        row.gather();
        self.rows.resize(rows, row);
        (self.columns, self.limit, self.shortest) = (columns, limit, shortest);
        (self.wait, self.interval) = (0, shortest);
    }

    /// Looks for rays that are finished, if it is time to.
    #[inline(always)]
    pub fn look<S: Simd>(&mut self, simd: S, accumulators: &Accumulators) {
        if self.wait > 0 {
            self.wait -= 1;
            return;
        }
        let mut any_more = false;
        for (place, row) in self.rows.iter_mut().enumerate() {
            let mut more = false;
            for column in (0..self.columns).step_by(LANES) {
                let alive = accumulators.less_opaque(simd, place, column, self.limit);
                let known = &mut row.rays[(MARGIN + column) / LANES];
                more |= !alive & !*known != 0;
                *known |= !alive;
            }
            if more {
                row.any = true;
                row.gather();
            }
            any_more |= more;
        }
        self.interval = if any_more { self.shortest } else { (2 * self.interval).min(LONGEST) };
        self.wait = self.interval - 1;
    }

    /// Whether any ray of a row is known to be finished.
    #[inline(always)]
    #[must_use]
    pub fn any(&self, row: usize) -> bool {
        self.rows[row].any
    }

    /// The cells of which all rays are known to be finished, of a row in which the ray in column 0 has its sample
    /// above voxel `first`. Where cells begin between every eighth ray, those behind have to be finished, too.
    #[inline(always)]
    #[must_use]
    pub fn cells(&self, row: usize, first: i32) -> Cells {
        let Row { cells, longer_cells, .. } = self.rows[row];
        let from = MARGIN as i32 - first;
        let eights = if from % 8 == 0 { cells } else { longer_cells };
        let at = from.div_euclid(8);
        let here = if at < 0 { eights << at.unsigned_abs().min(127) } else { eights >> at.min(127) };
        // Every fourth bit.
        let apart = here as u32 & 0x1111_1111;
        let pairs = (apart | apart >> 3) & 0x0303_0303;
        let fours = (pairs | pairs >> 6) & 0x000f_000f;
        Cells::from_bits((fours | fours >> 12) as u8)
    }

    /// How many rays are known to be finished.
    #[must_use]
    pub fn count(&self) -> u64 {
        let beside = 64 * WORDS - self.columns;
        let in_row =
            |row: &Row| row.rays.iter().map(|word| word.count_ones() as usize).sum::<usize>() - beside;
        self.rows.iter().map(in_row).sum::<usize>() as u64
    }
}

const _: () = assert!(LANES == 64 && MARGIN.is_multiple_of(LANES), "a vector of rays is a word");
const _: () = assert!(CELL == 32 && WORDS <= 16, "a cell is four times eight rays, a row 128 times");

#[cfg(test)]
mod tests {
    use super::*;
    use core::ops::Range;

    #[test]
    fn opacity_at_which_nothing_more_is_added() {
        for most in 0..=FULL {
            let limit = finishing_opacity(most);
            assert_eq!(crate::fixed::product(most, FULL - limit), 0, "{most}");
            assert!(limit == 0 || crate::fixed::product(most, FULL - limit + 1) > 0, "{most}");
        }
        assert_eq!(finishing_opacity(FULL), FULL);
        assert_eq!(finishing_opacity(40), 4044);
    }

    #[test]
    fn full_bytes_are_those_of_which_all_bits_are_set() {
        for pattern in 0..=u8::MAX {
            for almost in [0, 0x7f, 0xfe, 0xef] {
                let bytes: [u8; 8] =
                    core::array::from_fn(|byte| if pattern >> byte & 1 != 0 { u8::MAX } else { almost });
                assert_eq!(full_bytes(u64::from_le_bytes(bytes)), pattern);
            }
        }
    }

    #[test]
    fn cells_are_finished_when_their_rays_are() {
        let mut finished = Finished::default();
        finished.begin(1, 300, FULL, 1);
        let alive = [70, 71, 160, 299];
        let row = &mut finished.rows[0];
        row.rays = [u64::MAX; WORDS];
        alive.iter().for_each(|ray| row.rays[(MARGIN + ray) / 64] &= !(1 << ((MARGIN + ray) % 64)));
        row.gather();
        for first in -330..300 {
            for cell in 0..8 {
                let bit = Cells::covering(&(cell * CELL..cell * CELL + CELL));
                let found = !finished.cells(0, first).and(bit).is_empty();
                let column = (cell * CELL) as i32 - first;
                // As far as rays go, to the next eight.
                let end = (column + CELL as i32 + 7) / 8 * 8;
                let start = column.div_euclid(8) * 8;
                let any_alive =
                    |mut range: Range<i32>| range.any(|at| alive.contains(&(at as usize)) && at >= 0);
                if any_alive(column..column + CELL as i32) {
                    assert!(!found, "{first} {cell}");
                } else if !any_alive(start..end) && (-64..512).contains(&start) && end < 512 + 64 {
                    assert!(found, "{first} {cell}");
                }
            }
        }
    }
}
