//! Rays that no sample can change any more.
//!
//! A sample adds (x (4095 - A) + 2048) >> 12 to a channel, x at most its opacity: nothing as soon as
//! (4095 - A) a < 2048 for the greatest opacity a that is still to come.

use super::accumulators::Accumulators;
use super::cells::CELL;
use super::simd::Simd;
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

/// Which rays of a row are finished: a bit each.
#[derive(Clone, Debug)]
struct Row {
    bits: [u64; WORDS],
    /// Whether any ray is.
    any: bool,
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
        let mut bits = [u64::MAX; WORDS];
        (MARGIN..MARGIN + columns).for_each(|at| bits[at / 64] &= !(1 << (at % 64)));
        self.rows.clear();
        self.rows.resize(rows, Row { bits, any: false });
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
            for column in (0..self.columns).step_by(S::LANES) {
                let alive = accumulators.less_opaque(simd, place, column, self.limit);
                let at = MARGIN + column;
                let (word, shift) = (at / 64, at % 64);
                let lanes = u64::MAX >> (64 - S::LANES);
                let finished = !(alive << shift) & lanes << shift;
                more |= finished & !row.bits[word] != 0;
                row.bits[word] |= finished;
            }
            row.any |= more;
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

    /// Whether all rays of a cell are finished, of which the first is ray `column` of a row.
    #[inline(always)]
    #[must_use]
    pub fn all_of(&self, row: usize, column: i32) -> bool {
        let at = (column + MARGIN as i32).clamp(0, (64 * (WORDS - 1) - 1) as i32) as usize;
        let bits = &self.rows[row].bits;
        let (word, shift) = (at / 64, at % 64);
        let rays = bits[word] >> shift | bits[word + 1] << 1 << (63 - shift);
        rays as u32 == u32::MAX
    }

    /// How many rays are known to be finished.
    #[must_use]
    pub fn count(&self) -> u64 {
        let beside = 64 * WORDS - self.columns;
        let in_row =
            |row: &Row| row.bits.iter().map(|word| word.count_ones() as usize).sum::<usize>() - beside;
        self.rows.iter().map(in_row).sum::<usize>() as u64
    }
}

const _: () = assert!(CELL == 32, "a cell's rays are read as 32 bits");
